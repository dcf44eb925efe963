#include "brash_ice_rig/study/study_file.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <sstream>

#include "brash_ice_rig/config/edit_distance.h"
#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/config/yaml_document.h"
#include "brash_ice_rig/math/repeatable.h"
#include "brash_ice_rig/version.h"

namespace brash_ice_rig {
namespace {

constexpr double kMaxRuns = 100000.0;
constexpr double kMaxSeed = 9007199254740992.0;  // as field.seed
constexpr std::size_t kMaxNameLength = 200;      // file systems allow 255

// ---- what stands in the file

/// A scenario key that the study sets.
struct Setting {
  std::string key, value, where;
};

/// A case as the file describes it.
struct CaseSource {
  StudyCase described;  ///< name and title
  std::vector<std::string> overlays;
  std::vector<Setting> settings;
  std::string where;
};

Setting settingOf(const std::string& key, const YamlItem& value, const std::string& written) {
  if (key == "field.seed") throw ConfigError(key, written, "is what `seeds` sets; give the values there", value.where);
  return {key, written, value.where};
}

std::vector<Setting> readSettings(const YamlItem& item) {
  if (!item.exists()) return {};
  std::vector<Setting> settings;
  for (const YamlItem& entry : item.map("must be a map of scenario keys, such as {ice.cohesion_pa: 50}")) {
    settings.push_back(settingOf(entry.name, entry, entry.text("must be a single value")));
  }
  return settings;
}

/// Paths relative to the study file.
std::vector<std::string> readOverlays(const YamlItem& item) {
  if (!item.exists()) return {};
  std::vector<std::string> paths;
  for (const YamlItem& entry : item.list("must be a list of files, such as [overlay.yaml]")) {
    const std::filesystem::path directory = std::filesystem::path(item.file).parent_path();
    paths.push_back((directory / entry.text("must be a file's name")).lexically_normal().string());
  }
  return paths;
}

// ---- cases

bool mayStandInName(char c) {
  const bool alphanumeric = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z');
  return alphanumeric || std::string("._-=,").find(c) != std::string::npos;
}

void checkName(const std::string& name, const std::string& where) {
  const auto refuse = [&](const std::string& rule) { throw ConfigError("name", name, rule, where); };
  if (!std::all_of(name.begin(), name.end(), mayStandInName)) {
    refuse("names a directory: only letters, digits and . _ - = , may stand in it");
  }
  if (name.front() == '.') refuse("names a directory: must not start with a dot");
  if (name.size() > kMaxNameLength) refuse("must have at most " + std::to_string(kMaxNameLength) + " letters");
}

std::vector<CaseSource> readCases(const YamlItem& cases) {
  std::vector<CaseSource> sources;
  for (const YamlItem& item : cases.list("must be a list of cases, such as [{name: A, settings: {...}}]")) {
    const YamlSection section(item, {"name", "title", "overlays", "settings"});
    CaseSource source;
    source.where = item.where;
    source.described.name = section["name"].text();
    const YamlItem title = section["title"];
    source.described.title = title.exists() ? title.text() : source.described.name;
    source.overlays = readOverlays(section["overlays"]);
    source.settings = readSettings(section["settings"]);
    sources.push_back(std::move(source));
  }
  return sources;
}

/// Last part of a scenario key.
std::string leafOf(const std::string& key) {
  return key.substr(key.rfind('.') + 1);
}

std::vector<CaseSource> readGrid(const YamlItem& grid) {
  const std::vector<YamlItem> axes = grid.map("must be a map of scenario keys, such as {ice.cohesion_pa: [50, 200]}");
  double case_count = 1.0;
  std::vector<std::vector<Setting>> values;
  for (const YamlItem& axis : axes) {
    values.emplace_back();
    for (const YamlItem& value : axis.list("must be a list of values")) {
      values.back().push_back(settingOf(axis.name, value, value.text("must be a single value")));
    }
    case_count *= static_cast<double>(values.back().size());
  }
  if (case_count > kMaxRuns) {
    throw ConfigError("grid", "", "makes " + formatNumber(case_count) + " cases, at most " + formatNumber(kMaxRuns),
                      grid.where);
  }
  std::vector<CaseSource> sources;
  std::vector<std::size_t> at(axes.size(), 0);
  for (std::size_t i = 0; i < static_cast<std::size_t>(case_count); ++i) {
    CaseSource source;
    source.where = grid.where;
    for (std::size_t axis = 0; axis < axes.size(); ++axis) {
      const Setting& setting = values[axis][at[axis]];
      source.settings.push_back(setting);
      source.described.name += (axis == 0 ? "" : ",") + leafOf(setting.key) + "=" + setting.value;
      source.described.title += (axis == 0 ? "" : ", ") + setting.key + " = " + setting.value;
    }
    std::string& name = source.described.name;
    name.erase(std::remove_if(name.begin(), name.end(), [](char c) { return !mayStandInName(c); }), name.end());
    sources.push_back(std::move(source));
    // The last key changes fastest.
    for (std::size_t axis = axes.size(); axis-- > 0;) {
      if (++at[axis] < values[axis].size()) break;
      at[axis] = 0;
    }
  }
  return sources;
}

/// Interval from which a sampled key is drawn.
struct SampledKey {
  YamlItem item;
  double min, max;
  bool log_scale;

  /// @param share  0 .. 1 of the way from min to max. To six digits.
  double at(double share) const {
    const double exact =
        log_scale ? repeatable::exp(repeatable::log(min) + share * (repeatable::log(max) - repeatable::log(min)))
                  : min + share * (max - min);
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text.precision(6);
    text << exact;
    return std::clamp(numberFromText(item.name, text.str()), min, max);
  }
};

std::vector<CaseSource> readSample(const YamlItem& sample) {
  const YamlSection section(sample, {"count", "seed", "keys"});
  const std::uint64_t count = section["count"].wholeNumber(Range{1.0, kMaxRuns});
  const YamlItem seed = section["seed"];
  std::vector<SampledKey> keys;
  for (const YamlItem& item : section["keys"].map("must be a map of scenario keys with their intervals")) {
    const YamlSection interval(item, {"min", "max", "scale"});
    const YamlItem scale = interval["scale"];
    SampledKey key{item, interval["min"].number(Range{}), interval["max"].number(Range{}),
                   scale.exists() && scale.word({"linear", "log"}) == "log"};
    if (!(key.min < key.max)) interval["max"].refuse("must be greater than min");
    if (key.log_scale && key.min <= 0.0) interval["min"].refuse("must be greater than 0 on a log scale");
    keys.push_back(std::move(key));
  }
  // Case by case, so that a larger count keeps the cases that there are.
  std::mt19937_64 generator(seed.exists() ? seed.wholeNumber(Range{0.0, kMaxSeed}) : 1);
  std::vector<CaseSource> sources;
  for (std::uint64_t i = 0; i < count; ++i) {
    CaseSource source;
    source.where = sample.where;
    std::string number = std::to_string(i + 1);
    number.insert(0, number.size() < 5 ? 5 - number.size() : 0, '0');
    source.described.name = "sample_" + number;
    for (const SampledKey& key : keys) {
      // Uniform in [0, 1), written out because the standard leaves its distributions to the library.
      const double share = static_cast<double>(generator() >> 11) * std::ldexp(1.0, -53);
      const Setting setting = settingOf(key.item.name, key.item, formatNumber(key.at(share)));
      source.settings.push_back(setting);
      std::string& title = source.described.title;
      title += (title.empty() ? "" : ", ") + setting.key + " = " + setting.value;
    }
    sources.push_back(std::move(source));
  }
  return sources;
}

std::vector<CaseSource> readCaseSources(const YamlSection& root, const std::string& path) {
  int given = 0;
  for (const char* key : {"cases", "grid", "sample"}) given += root[key].exists() ? 1 : 0;
  if (given != 1) throw ConfigError("", "", "must have exactly one of the keys cases, grid and sample", path);
  std::vector<CaseSource> sources;
  if (root["cases"].exists()) sources = readCases(root["cases"]);
  if (root["grid"].exists()) sources = readGrid(root["grid"]);
  if (root["sample"].exists()) sources = readSample(root["sample"]);
  std::set<std::string> names;
  for (const CaseSource& source : sources) {
    const std::string& name = source.described.name;
    checkName(name, source.where);
    if (!names.insert(name).second) throw ConfigError("name", name, "is the name of two cases", source.where);
  }
  return sources;
}

// ---- scenarios

/// Later settings of a key replace earlier ones.
std::vector<Setting> merged(const std::vector<Setting>& first, const std::vector<Setting>& second) {
  std::vector<Setting> all = first;
  for (const Setting& setting : second) {
    const auto same =
        std::find_if(all.begin(), all.end(), [&](const Setting& other) { return other.key == setting.key; });
    if (same == all.end()) {
      all.push_back(setting);
    } else {
      *same = setting;
    }
  }
  return all;
}

/// The effective scenario of a case, with the first of the seeds.
Scenario buildScenario(const std::string& file, const std::vector<std::string>& overlays, const CaseSource& source,
                       std::uint64_t seed) {
  ScenarioSources sources;
  sources.file = file;
  sources.overlays = overlays;
  sources.overlays.insert(sources.overlays.end(), source.overlays.begin(), source.overlays.end());
  for (const Setting& setting : source.settings) sources.settings.push_back(setting.key + "=" + setting.value);
  sources.settings.push_back("field.seed=" + std::to_string(seed));
  const std::string in_case = ": case " + source.described.name;
  try {
    Scenario scenario = loadScenario(sources);
    if (scenario.procedure.control == ControlMode::kManual) {
      throw ConfigError("procedure.control", "manual", "has no end; a study needs scripted", file);
    }
    return scenario;
  } catch (const ConfigError& error) {
    // For the reader of scenarios our settings are those of a command line.
    std::string where = source.where + in_case + ": " + error.where();
    for (const Setting& setting : source.settings) {
      if (error.where() == "--set" && error.key() == setting.key) where = setting.where + in_case;
    }
    throw ConfigError(error.key(), error.value(), error.rule(), where);
  }
}

std::vector<std::uint64_t> readSeeds(const YamlItem& item) {
  if (!item.exists()) return {1};
  std::vector<std::uint64_t> seeds;
  for (const YamlItem& entry : item.list("must be a list of whole numbers, such as [1, 2, 3]")) {
    const std::uint64_t seed = entry.wholeNumber(Range{0.0, kMaxSeed});
    if (std::find(seeds.begin(), seeds.end(), seed) != seeds.end()) entry.refuse("is given twice");
    seeds.push_back(seed);
  }
  return seeds;
}

/// Without jitter all seeds give the same run.
void checkSeedsMatter(const Study& study, const YamlItem& seeds) {
  if (study.seeds.size() < 2) return;
  const auto jitters = [](const StudyRun& run) { return run.scenario.field.jitter_ratio > 0.0; };
  if (std::any_of(study.runs.begin(), study.runs.end(), jitters)) return;
  throw ConfigError("seeds", "", "seeds repeat the same run where field.jitter_ratio is 0; set it, or give one seed",
                    seeds.where);
}

// ---- figures

const std::map<std::string, std::string>& figureTitles() {
  static const std::map<std::string, std::string> titles = {{"hardening", "Hardening of the cap"},
                                                            {"force", "Force over time"},
                                                            {"bars", "Peak and residual force"},
                                                            {"snapshots", "Section through the ice"},
                                                            {"plug", "The raised ice"}};
  return titles;
}

std::vector<std::string> caseNames(const Study& study) {
  std::vector<std::string> names;
  for (const StudyCase& one : study.cases) names.push_back(one.name);
  return names;
}

std::string readCaseName(const YamlItem& item, const std::vector<std::string>& known) {
  std::string name = item.text("must be the name of a case");
  if (std::find(known.begin(), known.end(), name) == known.end()) {
    item.refuse("is not a case of this study; did you mean " + nearestWord(known, name) + "?");
  }
  return name;
}

/// The report shows what the run has left: only multiples of the interval are there.
void checkSnapshotTimes(const Study& study, const YamlItem& times, const StudyFigure& figure) {
  const auto shown = std::find_if(study.runs.begin(), study.runs.end(), [&](const StudyRun& run) {
    return study.cases[run.case_index].name == figure.cases.front();
  });
  const double interval_s = shown->scenario.output.vtk_interval_s;
  const std::string key = "output.vtk_interval_s of case " + figure.cases.front();
  if (interval_s == 0.0) times.refuse("cannot be shown, because " + key + " is 0; set it in the case");
  for (std::size_t i = 0; i < figure.times_s.size(); ++i) {
    const double multiple = figure.times_s[i] / interval_s;
    if (std::abs(multiple - std::round(multiple)) < 1.0e-6) continue;
    times.list("")[i].refuse("must be a multiple of " + key + " (" + formatNumber(interval_s) + ")");
  }
}

StudyFigure readFigure(const Study& study, const YamlItem& item) {
  const YamlSection section(item, {"kind", "title", "cases", "case", "times_s"});
  std::vector<std::string> kinds;
  for (const auto& [kind, title] : figureTitles()) kinds.push_back(kind);
  StudyFigure figure;
  figure.kind = section["kind"].word(kinds);
  const YamlItem title = section["title"];
  figure.title = title.exists() ? title.text() : figureTitles().at(figure.kind);
  const std::vector<std::string> known = caseNames(study);
  const bool snapshots = figure.kind == "snapshots";
  const auto refuseKey = [&](const char* key) {
    if (section[key].exists()) section[key].refuse("is not a key of kind " + figure.kind);
  };
  refuseKey(snapshots ? "cases" : "case");
  if (!snapshots) refuseKey("times_s");
  if (snapshots) {
    figure.cases = {readCaseName(section["case"], known)};
    const YamlItem times = section["times_s"];
    for (const YamlItem& time : times.list("must be a list of times, such as [5, 15]")) {
      figure.times_s.push_back(time.number(Range{}));
    }
    checkSnapshotTimes(study, times, figure);
    return figure;
  }
  if (!section["cases"].exists()) {
    figure.cases = known;
    return figure;
  }
  for (const YamlItem& name : section["cases"].list("must be a list of cases' names")) {
    figure.cases.push_back(readCaseName(name, known));
  }
  return figure;
}

std::vector<StudyFigure> readFigures(const Study& study, const YamlItem& item) {
  std::vector<StudyFigure> figures;
  if (!item.exists()) {
    for (const char* kind : {"force", "bars"}) {
      figures.push_back({kind, figureTitles().at(kind), caseNames(study), {}});
    }
    return figures;
  }
  for (const YamlItem& entry : item.list("must be a list of figures, such as [{kind: force}]")) {
    figures.push_back(readFigure(study, entry));
  }
  return figures;
}

}  // namespace

bool isStudyFile(const std::string& path) {
  try {
    const YAML::Node root = readYamlMap(path, "keys");
    return root["cases"].IsDefined() || root["grid"].IsDefined() || root["sample"].IsDefined();
  } catch (const ConfigError&) {
    return false;
  }
}

Study readStudy(const std::string& path) {
  const YamlItem file{"", "", readYamlMap(path, "keys, such as `title: text` and `scenario: file.yaml`"), path, path};
  const YamlSection root(
      file, {"title", "scenario", "overlays", "settings", "seeds", "cases", "grid", "sample", "figures", "findings"});
  Study study;
  study.title = root["title"].text();
  const std::filesystem::path scenario = root["scenario"].text("must be the name of a scenario file");
  study.scenario_file = scenario.filename().string();
  study.seeds = readSeeds(root["seeds"]);
  const std::string scenario_path = (std::filesystem::path(path).parent_path() / scenario).lexically_normal().string();
  const std::vector<std::string> overlays = readOverlays(root["overlays"]);
  // Runs side by side use the cores better than threads do.
  const std::vector<Setting> for_all = merged({{"solver.threads", "1", path}}, readSettings(root["settings"]));

  std::vector<CaseSource> sources = readCaseSources(root, path);
  if (static_cast<double>(sources.size()) * static_cast<double>(study.seeds.size()) > kMaxRuns) {
    throw ConfigError("", "", "makes more than " + formatNumber(kMaxRuns) + " runs", path);
  }
  for (CaseSource& source : sources) {
    source.settings = merged(for_all, source.settings);
    StudyRun run;
    run.case_index = study.cases.size();
    run.scenario = buildScenario(scenario_path, overlays, source, study.seeds.front());
    for (const std::uint64_t seed : study.seeds) {
      run.seed = run.scenario.field.seed = seed;
      study.runs.push_back(run);
    }
    for (const Setting& setting : source.settings) source.described.settings.emplace_back(setting.key, setting.value);
    study.cases.push_back(std::move(source.described));
  }
  checkSeedsMatter(study, root["seeds"]);
  study.figures = readFigures(study, root["figures"]);
  if (root["findings"].exists()) study.findings = root["findings"].word({"paper"});
  return study;
}

std::string runDirectory(const Study& study, const StudyRun& run) {
  return "runs/" + study.cases[run.case_index].name + "/seed_" + std::to_string(run.seed);
}

std::string toYaml(const Study& study) {
  YAML::Emitter out;
  // Text in quotes: a reader must not take a name such as 1e5 for a number.
  const auto text = [&out](const char* key, const std::string& value) {
    out << YAML::Key << key << YAML::Value << YAML::DoubleQuoted << value;
  };
  out << YAML::Comment(std::string("The study as brash_ice ") + kVersion + " ran it") << YAML::BeginMap;
  text("title", study.title);
  text("scenario", study.scenario_file);
  out << YAML::Key << "seeds" << YAML::Value << YAML::Flow << study.seeds;
  out << YAML::Key << "cases" << YAML::Value << YAML::BeginSeq;
  for (const StudyCase& one : study.cases) {
    out << YAML::BeginMap;
    text("name", one.name);
    text("title", one.title);
    out << YAML::Key << "settings" << YAML::Value << YAML::BeginMap;
    for (const auto& [key, value] : one.settings) out << YAML::Key << key << YAML::Value << value;
    out << YAML::EndMap << YAML::EndMap;
  }
  out << YAML::EndSeq << YAML::Key << "figures" << YAML::Value << YAML::BeginSeq;
  for (const StudyFigure& figure : study.figures) {
    out << YAML::BeginMap;
    text("kind", figure.kind);
    text("title", figure.title);
    if (figure.kind == "snapshots") {
      text("case", figure.cases.front());
      out << YAML::Key << "times_s" << YAML::Value << YAML::Flow << YAML::BeginSeq;
      for (const double time_s : figure.times_s) out << formatNumber(time_s);
      out << YAML::EndSeq;
    } else {
      out << YAML::Key << "cases" << YAML::Value << YAML::Flow << YAML::BeginSeq;
      for (const std::string& name : figure.cases) out << YAML::DoubleQuoted << name;
      out << YAML::EndSeq;
    }
    out << YAML::EndMap;
  }
  out << YAML::EndSeq;
  if (!study.findings.empty()) text("findings", study.findings);
  out << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

}  // namespace brash_ice_rig
