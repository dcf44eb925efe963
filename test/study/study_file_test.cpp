#include "brash_ice_rig/study/study_file.h"

#include <cmath>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "../config/config_files.h"
#include "study_directory.h"

namespace brash_ice_rig {
namespace {

class StudyFileTest : public ::testing::Test {
 protected:
  Study read(const std::string& rest) const { return readStudy(directory_.putStudy(rest)); }

  /// What the user gets to read, without the path of the study file in front; fails the test if nothing is refused.
  std::string refusal(const std::string& rest) const {
    const std::string path = directory_.putStudy(rest);
    try {
      readStudy(path);
    } catch (const ConfigError& error) {
      const std::string text = error.what();
      EXPECT_EQ(text.rfind(path, 0), 0u) << text;
      return text.substr(std::min(path.size(), text.size()));
    }
    ADD_FAILURE() << "accepted: " << rest;
    return "";
  }

  void expectRefused(const std::string& rest, const std::vector<std::string>& parts) const {
    const std::string text = refusal(rest);
    for (const std::string& part : parts) EXPECT_NE(text.find(part), std::string::npos) << part << " not in: " << text;
  }

  StudyDirectory directory_;
};

// ---- what is shipped

TEST(ShippedStudies, EachLoadsAndIsKnownAsAStudy) {
  const auto files = shippedFiles("config/studies");
  ASSERT_GE(files.size(), 3u);
  for (const std::string& file : files) {
    SCOPED_TRACE(file);
    EXPECT_TRUE(isStudyFile(file));
    EXPECT_NO_THROW(readStudy(file));
  }
  for (const std::string& file : shippedFiles("config/scenarios")) EXPECT_FALSE(isStudyFile(file)) << file;
  for (const std::string& file : shippedFiles("config/simulations")) EXPECT_FALSE(isStudyFile(file)) << file;
}

TEST(ShippedStudies, PaperHasTheTenSimulationsOfTable5) {
  const Study study = readStudy(sourceFile("config/studies/paper.yaml"));
  struct Row {
    const char* name;
    double void_fraction, cohesion_pa, friction_angle_deg;
  };
  const std::vector<Row> table5 = {{"A-1", 0.7, 200, 50}, {"A-2", 0.7, 50, 50},  {"A-3", 0.7, 1000, 50},
                                   {"B-1", 0.6, 200, 50}, {"B-2", 0.6, 50, 50},  {"B-3", 0.6, 1000, 50},
                                   {"B-4", 0.6, 200, 40}, {"B-5", 0.6, 200, 60}, {"C-1", 0.5, 200, 50},
                                   {"D-1", 0.36, 200, 50}};
  ASSERT_EQ(study.cases.size(), table5.size());
  ASSERT_EQ(study.runs.size(), 3 * table5.size());
  std::set<std::string> directories;
  for (std::size_t i = 0; i < study.runs.size(); ++i) {
    const StudyRun& run = study.runs[i];
    const Row& row = table5[i / 3];
    SCOPED_TRACE(row.name);
    EXPECT_EQ(study.cases[run.case_index].name, row.name);
    EXPECT_EQ(run.seed, i % 3 + 1);
    EXPECT_EQ(run.scenario.field.seed, run.seed);
    EXPECT_EQ(run.scenario.ice.void_fraction, row.void_fraction);
    EXPECT_EQ(run.scenario.ice.cohesion_pa, row.cohesion_pa);
    EXPECT_EQ(run.scenario.ice.friction_angle_deg, row.friction_angle_deg);
    EXPECT_EQ(run.scenario.field.jitter_ratio, 0.1);
    EXPECT_EQ(run.scenario.output.vtk_interval_s, std::string(row.name) == "B-1" ? 5.0 : 0.0);
    directories.insert(runDirectory(study, run));
  }
  EXPECT_EQ(directories.size(), study.runs.size());
  EXPECT_EQ(study.findings, "paper");
}

TEST_F(StudyFileTest, ExampleOfTheGuideLoads) {
  std::string guide = readFile(sourceFile("doc/studies.md"));
  const std::string fence = "```yaml\n";
  const auto start = guide.find(fence);
  ASSERT_NE(start, std::string::npos);
  std::string example = guide.substr(start + fence.size());
  example.erase(example.find("```"));
  const std::string scenario = "../scenarios/pull_up.yaml";
  ASSERT_NE(example.find(scenario), std::string::npos);
  example.replace(example.find(scenario), scenario.size(), sourceFile("config/scenarios/pull_up.yaml"));
  EXPECT_EQ(readStudy(directory_.put("guide.yaml", example)).runs.size(), 6u);
}

// ---- what a study is

TEST_F(StudyFileTest, IsRecognisedByItsCases) {
  EXPECT_TRUE(isStudyFile(directory_.putStudy("cases: [{name: a}]")));
  EXPECT_TRUE(isStudyFile(directory_.putStudy("grid: {ice.cohesion_pa: [1]}")));
  EXPECT_TRUE(isStudyFile(directory_.putStudy("sample: {}")));
  EXPECT_FALSE(isStudyFile(directory_.file("small.yaml")));
  EXPECT_FALSE(isStudyFile(directory_.file("missing.yaml")));
  EXPECT_FALSE(isStudyFile(directory_.put("broken.yaml", "cases: [")));
}

TEST_F(StudyFileTest, RunsAreEveryCaseWithEverySeedInOrder) {
  const Study study = read("seeds: [7, 3]\ncases: [{name: b, title: The other}, {name: a}]\n");
  std::string order;
  for (const StudyRun& run : study.runs) order += runDirectory(study, run) + " ";
  EXPECT_EQ(order, "runs/b/seed_7 runs/b/seed_3 runs/a/seed_7 runs/a/seed_3 ");
  EXPECT_EQ(study.cases[0].title, "The other");
  EXPECT_EQ(study.cases[1].title, "a") << "without a title, the name";
  EXPECT_EQ(study.scenario_file, "small.yaml");
  EXPECT_EQ(study.runs[1].scenario.field.seed, 3u);
  EXPECT_EQ(read("cases: [{name: a}]\n").seeds, std::vector<std::uint64_t>{1});
}

TEST_F(StudyFileTest, SettingsOfACaseWinOverThoseOfAllAndOverOverlays) {
  directory_.put("all.yaml", "ice: {cohesion_pa: 10}\nwater: {density_kgpm3: 1010}\n");
  directory_.put("case.yaml", "ice: {friction_angle_deg: 45}\n");
  const Study study = read(
      "overlays: [all.yaml]\n"
      "settings: {ice.cohesion_pa: 20, ice.void_fraction: 0.5}\n"
      "cases: [{name: a}, {name: b, overlays: [case.yaml], settings: {ice.cohesion_pa: 30}}]\n");
  const Scenario &a = study.runs[0].scenario, &b = study.runs[1].scenario;
  EXPECT_EQ(a.water.density_kgpm3, 1010.0);
  EXPECT_EQ(a.ice.cohesion_pa, 20.0);
  EXPECT_EQ(a.ice.friction_angle_deg, 50.0);
  EXPECT_EQ(b.ice.cohesion_pa, 30.0);
  EXPECT_EQ(b.ice.void_fraction, 0.5);
  EXPECT_EQ(b.ice.friction_angle_deg, 45.0);
  const std::vector<std::pair<std::string, std::string>> settings = {
      {"solver.threads", "1"}, {"ice.cohesion_pa", "30"}, {"ice.void_fraction", "0.5"}};
  EXPECT_EQ(study.cases[1].settings, settings);
}

TEST_F(StudyFileTest, RunsHaveOneThreadUnlessTheStudySaysOtherwise) {
  EXPECT_EQ(read("cases: [{name: a}]\n").runs[0].scenario.solver.threads, 1) << "the scenario file gives 2";
  EXPECT_EQ(read("settings: {solver.threads: 3}\ncases: [{name: a}]\n").runs[0].scenario.solver.threads, 3);
}

TEST_F(StudyFileTest, PathsStartAtTheStudyFile) {
  std::filesystem::create_directory(directory_.file("below"));
  directory_.put("over.yaml", "ice: {cohesion_pa: 77}\n");
  const std::string path = directory_.put(
      "below/study.yaml", "title: T\nscenario: ../small.yaml\noverlays: [../over.yaml]\ncases: [{name: a}]\n");
  EXPECT_EQ(readStudy(path).runs[0].scenario.ice.cohesion_pa, 77.0);
}

// ---- grid and sample

TEST_F(StudyFileTest, GridMakesAllCombinationsNamedByTheirValues) {
  const Study study = read("grid: {ice.cohesion_pa: [50, 1.0e+3], ice.flow_rule: [associated, non_associated]}\n");
  std::string names;
  for (const StudyCase& one : study.cases) names += one.name + " ";
  EXPECT_EQ(names,
            "cohesion_pa=50,flow_rule=associated cohesion_pa=50,flow_rule=non_associated "
            "cohesion_pa=1.0e3,flow_rule=associated cohesion_pa=1.0e3,flow_rule=non_associated ");
  EXPECT_EQ(study.cases[3].title, "ice.cohesion_pa = 1.0e+3, ice.flow_rule = non_associated");
  EXPECT_EQ(study.runs[3].scenario.ice.cohesion_pa, 1000.0);
  EXPECT_EQ(study.runs[3].scenario.ice.flow_rule, FlowRule::kNonAssociated);
}

TEST_F(StudyFileTest, SampleRepeatsAndGrowsWithoutChange) {
  const std::string keys =
      "keys: {ice.cohesion_pa: {min: 10, max: 1000, scale: log}, ice.void_fraction: {min: 0.5, max: 0.7}}";
  const auto settings = [&](const std::string& head) {
    std::vector<std::vector<std::pair<std::string, std::string>>> all;
    for (const StudyCase& one : read("sample: {" + head + ", " + keys + "}\n").cases) all.push_back(one.settings);
    return all;
  };
  const auto five = settings("count: 5, seed: 7");
  auto eight = settings("count: 8, seed: 7");
  EXPECT_NE(settings("count: 5, seed: 8"), five);
  eight.resize(5);
  EXPECT_EQ(eight, five);
}

TEST_F(StudyFileTest, SampleIsEvenOnItsScaleAndStaysWithinItsInterval) {
  const Study study = read(
      "sample: {count: 400, keys: {ice.cohesion_pa: {min: 10, max: 1000, scale: log}, "
      "ice.void_fraction: {min: 0.5, max: 0.7}}}\n");
  ASSERT_EQ(study.runs.size(), 400u);
  EXPECT_EQ(study.cases.front().name, "sample_00001");
  EXPECT_EQ(study.cases.back().name, "sample_00400");
  double log_sum = 0.0, linear_sum = 0.0, product_sum = 0.0;
  for (const StudyRun& run : study.runs) {
    const IceConfig& ice = run.scenario.ice;
    EXPECT_TRUE(ice.cohesion_pa >= 10.0 && ice.cohesion_pa <= 1000.0) << ice.cohesion_pa;
    EXPECT_TRUE(ice.void_fraction >= 0.5 && ice.void_fraction <= 0.7) << ice.void_fraction;
    const double x = std::log10(ice.cohesion_pa) - 2.0, y = (ice.void_fraction - 0.6) / 0.1;  // both in [-1, 1]
    log_sum += x;
    linear_sum += y;
    product_sum += x * y;
  }
  // A uniform variable on [-1, 1] has variance 1/3, the product of two independent ones 1/9; four standard errors.
  EXPECT_LT(std::abs(log_sum / 400.0), 4.0 * std::sqrt(1.0 / 3.0 / 400.0));
  EXPECT_LT(std::abs(linear_sum / 400.0), 4.0 * std::sqrt(1.0 / 3.0 / 400.0));
  EXPECT_LT(std::abs(product_sum / 400.0), 4.0 * std::sqrt(1.0 / 9.0 / 400.0));
}

// ---- figures and study.yaml

TEST_F(StudyFileTest, FiguresDefaultToForceAndBarsOfAllCases) {
  const Study study = read("cases: [{name: a}, {name: b}]\n");
  ASSERT_EQ(study.figures.size(), 2u);
  EXPECT_EQ(study.figures[0].kind, "force");
  EXPECT_EQ(study.figures[1].kind, "bars");
  const std::vector<std::string> all = {"a", "b"};
  EXPECT_EQ(study.figures[0].cases, all);
  EXPECT_EQ(read("cases: [{name: a}, {name: b}]\nfigures: [{kind: plug}]\n").figures[0].cases, all);
}

TEST_F(StudyFileTest, StudyYamlHoldsTheStudyAsItWasRun) {
  const Study study = read(
      "seeds: [1, 2]\n"
      "cases:\n"
      "- {name: 1e5, title: 'a: \"b\", c', settings: {ice.cohesion_pa: 1.0e+2, output.vtk_interval_s: 0.5}}\n"
      "- {name: b}\n"
      "figures: [{kind: snapshots, case: 1e5, times_s: [0.5, 1]}, {kind: hardening, title: H, cases: [b]}]\n"
      "findings: paper\n");
  const YAML::Node yaml = YAML::Load(toYaml(study));
  EXPECT_EQ(yaml["title"].Scalar(), "Small study");
  EXPECT_EQ(yaml["scenario"].Scalar(), "small.yaml");
  EXPECT_EQ(yaml["seeds"].as<std::vector<int>>(), (std::vector<int>{1, 2}));
  ASSERT_EQ(yaml["cases"].size(), 2u);
  EXPECT_EQ(yaml["cases"][0]["name"].Scalar(), "1e5");
  EXPECT_EQ(yaml["cases"][0]["name"].Tag(), "!") << "without quotes, a name such as 1e5 is a number to others";
  EXPECT_EQ(yaml["cases"][0]["title"].Scalar(), "a: \"b\", c");
  EXPECT_EQ(yaml["cases"][0]["settings"]["ice.cohesion_pa"].as<double>(), 100.0);
  ASSERT_EQ(yaml["figures"].size(), 2u);
  EXPECT_EQ(yaml["figures"][0]["case"].Scalar(), "1e5");
  EXPECT_EQ(yaml["figures"][0]["times_s"].as<std::vector<double>>(), (std::vector<double>{0.5, 1.0}));
  EXPECT_EQ(yaml["figures"][0]["title"].Scalar(), "Section through the ice");
  EXPECT_EQ(yaml["figures"][1]["cases"].as<std::vector<std::string>>(), std::vector<std::string>{"b"});
  EXPECT_EQ(yaml["findings"].Scalar(), "paper");
}

// ---- what is refused

TEST_F(StudyFileTest, UnknownKeyNamesTheNearestOneAndItsLine) {
  expectRefused("seed: [1]\ncases: [{name: a}]\n", {":3: ", "unknown key seed", "did you mean seeds?"});
  expectRefused("cases:\n- name: a\n  setings: {}\n", {":5: ", "cases[0].setings", "did you mean settings?"});
  expectRefused("cases: [{name: a}]\nfigures: [{knid: force}]\n", {"figures[0].knid", "did you mean kind?"});
  expectRefused("sample: {count: 1, key: {}}\n", {"sample.key", "did you mean keys?"});
  expectRefused("sample: {count: 1, keys: {ice.cohesion_pa: {min: 1, mx: 2}}}\n", {"ice.cohesion_pa.mx", "max"});
  expectRefused("cases: [{name: a, settings: {ice.cohesionn_pa: 5}}]\n", {"case a", "did you mean ice.cohesion_pa?"});
  expectRefused("grid: {ice.cohesionn_pa: [5]}\n", {"did you mean ice.cohesion_pa?"});
}

TEST_F(StudyFileTest, BadValueOfACaseNamesLineCaseKeyValueAndRule) {
  expectRefused("cases:\n- name: good\n- name: bad\n  settings:\n    ice.void_fraction: 1.2\n",
                {":7: case bad: ", "ice.void_fraction = 1.2", "must lie in (0, 1)"});
  // A rule between keys, broken by a setting of all cases.
  expectRefused("settings:\n  collector.radius_m: 1.4\ncases: [{name: a}]\n",
                {":4: case a: ", "collector.radius_m = 1.4", "must be at most"});
  // The mistake is in another file.
  directory_.put("bad.yaml", "ice:\n  void_fraction: 2\n");
  expectRefused("cases: [{name: a, overlays: [bad.yaml]}]\n",
                {":3: case a: ", "bad.yaml:2: ", "ice.void_fraction = 2"});
  expectRefused("cases: [{name: a, overlays: [missing.yaml]}]\n", {"case a", "missing.yaml", "cannot be read"});
}

TEST_F(StudyFileTest, NamesThatAreNoSafeDirectoryAreRefused) {
  for (const std::string name : {"../a", ".a", "a/b", "a b", "'a\\b'", "'a;b'", "'a:b'", "ä", "'a\"b'", "'$a'", "a*"}) {
    expectRefused("cases: [{name: " + name + "}]\n", {"name", "directory"});
  }
  expectRefused("cases: [{name: " + std::string(201, 'a') + "}]\n", {"at most 200"});
  expectRefused("cases: [{name: ''}]\n", {"cases[0].name", "must be text"});
  expectRefused("cases: [{title: a}]\n", {"cases[0].name must be text"});
  expectRefused("cases: [{name: a}, {name: b}, {name: a}]\n", {"name = a", "two cases"});
  expectRefused("grid: {ice.cohesion_pa: [50, 50]}\n", {"cohesion_pa=50", "two cases"});
  EXPECT_NO_THROW(read("cases: [{name: 'B-1_x.2=3,4'}]\n"));
}

TEST_F(StudyFileTest, NeedsExactlyOneSourceOfCases) {
  const std::string rule = "exactly one of the keys cases, grid and sample";
  expectRefused("", {rule});
  expectRefused("cases: [{name: a}]\ngrid: {ice.cohesion_pa: [5]}\n", {rule});
  expectRefused("cases: []\n", {"cases = [...], must be a list of cases"});
  expectRefused("cases: {name: a}\n", {"must be a list of cases"});
  expectRefused("cases: [a]\n", {"cases[0] = a, must be a map with the keys name"});
  expectRefused("grid: {ice.cohesion_pa: 50}\n", {"grid.ice.cohesion_pa = 50, must be a list of values"});
  expectRefused("grid: {ice.cohesion_pa: [[1]]}\n", {"must be a single value"});
  expectRefused("cases: [{name: a, name: b}]\n", {"cases[0].name is given twice"});
  expectRefused("cases: [{name: a, settings: {ice.cohesion_pa: }}]\n", {"must be a single value"});
}

TEST_F(StudyFileTest, TooManyRunsAreRefusedBeforeTheyAreMade) {
  std::string hundred = "[0";
  for (int i = 1; i < 100; ++i) hundred += ", " + std::to_string(i);
  hundred += "]";
  expectRefused("grid: {load_cell.bias_n: " + hundred + ", load_cell.noise_n: " + hundred +
                    ", load_cell.lag_s: " + hundred + "}\n",
                {"1.0e+06 cases, at most 100000"});
}

TEST_F(StudyFileTest, SeedsAreDifferentWholeNumbersAndNeedJitter) {
  const std::string cases = "cases: [{name: a}]\n";
  expectRefused("seeds: 3\n" + cases, {"seeds = 3, must be a list of whole numbers"});
  expectRefused("seeds: []\n" + cases, {"must be a list"});
  expectRefused("seeds: [1.5]\n" + cases, {"seeds[0] = 1.5", "whole number"});
  expectRefused("seeds: [-1]\n" + cases, {"seeds[0] = -1", "must lie in [0, "});
  expectRefused("seeds: [one]\n" + cases, {"seeds[0] = one", "must be a number"});
  expectRefused("seeds: [4, 4]\n" + cases, {"seeds[1] = 4, is given twice"});
  expectRefused("seeds: [1, 2]\nsettings: {field.jitter_ratio: 0}\n" + cases, {"field.jitter_ratio is 0"});
  EXPECT_NO_THROW(read("seeds: [2]\nsettings: {field.jitter_ratio: 0}\n" + cases));
  expectRefused("settings: {field.seed: 4}\n" + cases, {"field.seed = 4", "`seeds`"});
  expectRefused("grid: {field.seed: [4]}\n", {"field.seed = 4", "`seeds`"});
}

TEST_F(StudyFileTest, SampleIntervalsAreChecked) {
  const auto sample = [](const std::string& head, const std::string& interval) {
    return "sample: {" + head + ", keys: {ice.cohesion_pa: {" + interval + "}}}\n";
  };
  expectRefused(sample("count: 0", "min: 1, max: 2"), {"sample.count = 0", "must lie in [1, 100000]"});
  expectRefused(sample("count: 2.5", "min: 1, max: 2"), {"sample.count = 2.5", "whole number"});
  expectRefused(sample("seed: 3", "min: 1, max: 2"), {"sample.count must be a number"});
  expectRefused(sample("count: 2, seed: -1", "min: 1, max: 2"), {"sample.seed = -1"});
  expectRefused(sample("count: 2", "min: 3, max: 3"), {"max = 3, must be greater than min"});
  expectRefused(sample("count: 2", "min: 0, max: 3, scale: log"), {"min = 0", "log scale"});
  expectRefused(sample("count: 2", "min: 1, max: .inf"), {"max = .inf", "finite"});
  expectRefused(sample("count: 2", "min: 1"), {"max must be a number"});
  expectRefused(sample("count: 2", "min: 1, max: 3, scale: square"), {"scale = square, must be linear or log"});
  expectRefused(sample("count: 1", "min: -9, max: -8"), {"case sample_00001", "ice.cohesion_pa"});
}

TEST_F(StudyFileTest, FiguresAreChecked) {
  const auto figure = [](const std::string& text) {
    return "settings: {output.vtk_interval_s: 0.5}\ncases: [{name: A-1}, {name: B-1}]\nfigures: [{" + text + "}]\n";
  };
  expectRefused(figure("kind: pie"), {"figures[0].kind = pie", "must be bars, force, hardening, plug or snapshots"});
  expectRefused(figure("title: T"), {"figures[0].kind", "must be"});
  expectRefused(figure("kind: force, cases: [B-2]"), {"cases[0] = B-2", "did you mean B-1?"});
  expectRefused(figure("kind: force, cases: []"), {"must be a list of cases' names"});
  expectRefused(figure("kind: force, case: A-1"), {"figures[0].case", "is not a key of kind force"});
  expectRefused(figure("kind: bars, times_s: [1]"), {"figures[0].times_s", "is not a key of kind bars"});
  expectRefused(figure("kind: snapshots, cases: [A-1], times_s: [1]"), {"is not a key of kind snapshots"});
  expectRefused(figure("kind: snapshots, case: A-1"), {"times_s must be a list of times"});
  expectRefused(figure("kind: snapshots, case: A-1, times_s: [1, x]"), {"times_s[1] = x", "must be a number"});
  expectRefused(figure("kind: snapshots, case: A-1, times_s: [1, 1.2]"), {"times_s[1] = 1.2", "multiple", "(0.5)"});
  EXPECT_NO_THROW(read(figure("kind: snapshots, case: A-1, times_s: [-0.5, 0, 1.5]")));
  expectRefused("cases: [{name: a}]\nfigures: [{kind: snapshots, case: a, times_s: [1]}]\n",
                {"output.vtk_interval_s of case a is 0"});
  expectRefused("cases: [{name: a}]\nfindings: mine\n", {"findings = mine, must be paper"});
}

TEST_F(StudyFileTest, ManualControlHasNoEndAndIsRefused) {
  expectRefused("cases: [{name: a, settings: {procedure.control: manual}}]\n",
                {"case a", "procedure.control = manual", "has no end"});
}

TEST_F(StudyFileTest, TitleAndScenarioAreNeeded) {
  const auto what = [&](const std::string& text) {
    try {
      readStudy(directory_.put("study.yaml", text));
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_NE(what("scenario: small.yaml\ncases: [{name: a}]\n").find("title must be text"), std::string::npos);
  EXPECT_NE(what("title: T\ncases: [{name: a}]\n").find("scenario must be the name"), std::string::npos);
  EXPECT_NE(what("title: T\nscenario: no.yaml\ncases: [{name: a}]\n").find("no.yaml: file cannot be read"),
            std::string::npos);
  EXPECT_NE(what("[1, 2]\n").find("must be a map of keys"), std::string::npos);
}

}  // namespace
}  // namespace brash_ice_rig
