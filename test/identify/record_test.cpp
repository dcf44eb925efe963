#include "brash_ice_rig/identify/record.h"

#include <algorithm>
#include <clocale>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "../output/shell.h"
#include "../output/temporary_directory.h"
#include "brash_ice_rig/config/csv.h"
#include "brash_ice_rig/identify/record_check.h"
#include "made_record.h"

namespace brash_ice_rig {
namespace {

class RecordFiles : public ::testing::Test {
 protected:
  static constexpr const char* kCsv = "time_s,force_n,hoist_position_m\n0,10,-1\n0.1,20,-0.9\n0.2,30,-0.8\n";

  /// What the user gets to read, without the directory; fails the test if nothing was refused.
  std::string refusal(const std::string& name = "test") const {
    try {
      readRecord(directory_.file(name));
    } catch (const ConfigError& error) {
      const std::string text = error.what();
      const std::string prefix = directory_.path() + "/";
      return text.rfind(prefix, 0) == 0 ? text.substr(prefix.size()) : text;
    }
    ADD_FAILURE() << "accepted";
    return "";
  }
  std::string refusalOfCsv(const std::string& text) const {
    directory_.put("test.yaml", "source: lab\n");
    directory_.put("test.csv", text);
    return refusal();
  }
  std::string refusalOfManifest(const std::string& text) const {
    directory_.put("test.csv", kCsv);
    directory_.put("test.yaml", text);
    return refusal();
  }
  Record recordOf(const std::string& csv, const std::string& manifest = "source: lab\n") const {
    directory_.put("test.csv", csv);
    directory_.put("test.yaml", manifest);
    return readRecord(directory_.file("test"));
  }
  static bool assumes(const Record& record, const std::string& text) {
    for (const std::string& assumption : record.assumptions) {
      if (contains(assumption, text)) return true;
    }
    return false;
  }

  TemporaryDirectory directory_;
};

using RecordCsv = RecordFiles;
using RecordManifest = RecordFiles;
using RecordMotionColumns = RecordFiles;

// ---- CSV

TEST_F(RecordCsv, ColumnsCountByNameInAnyOrderWithCommentsQuotesBlanksAndCrlf) {
  const Record record = recordOf(
      "\xEF\xBB\xBF# logger 7\r\n\r\n\"hoist_position_m\" , force_n,note,\"time_s\"\r\n"
      "  # units: SI\r\n-1.0, 1e3,\"a, \"\"b\"\"\",0\r\n-0.9,\"+2.5e+03\",,0.1\r\n");
  EXPECT_EQ(record.time_s, (std::vector<double>{0.0, 0.1}));
  EXPECT_EQ(record.force_n, (std::vector<double>{1000.0, 2500.0}));
  EXPECT_EQ(record.hoist_position_m, (std::vector<double>{-1.0, -0.9}));
  EXPECT_EQ(record.unused_columns, (std::vector<std::string>{"note"}));
  EXPECT_EQ(record.line, (std::vector<std::size_t>{5, 6}));
}

TEST_F(RecordCsv, WhatIsNoNumberIsMissingAndTold) {
  const Record record = recordOf(
      "time_s,force_n,hoist_position_m,force_x_n\n0,nan,-1,1\n0.1,OVL,-0.9,\n0.2,-inf,-0.8,0x10\n0.3,1e999,-0.7,2\n");
  EXPECT_TRUE(std::isnan(record.force_n[0]));
  EXPECT_TRUE(std::isnan(record.force_n[1]));
  EXPECT_EQ(record.force_n[2], -HUGE_VAL);
  EXPECT_EQ(record.force_n[3], HUGE_VAL);
  EXPECT_TRUE(std::isnan(record.force_x_n[1]));
  EXPECT_TRUE(std::isnan(record.force_x_n[2]));
  EXPECT_TRUE(assumes(record, "2 cells are no numbers and count as missing, first `OVL` for force_n in line 3"));
}

TEST_F(RecordCsv, LastLineMayBeCutOffAnyOtherNot) {
  const Record record = recordOf(std::string(kCsv) + "0.3,4");
  EXPECT_EQ(record.size(), 3u);
  EXPECT_TRUE(assumes(record, "the last line is cut off"));
  EXPECT_EQ(refusalOfCsv("time_s,force_n,hoist_position_m\n0,1,2\n0.1,2\n0.2,3,4\n"),
            "test.csv:3: 2 cells, where the header has 3");
}

TEST_F(RecordCsv, GarbageIsRefusedWithItsReason) {
  EXPECT_EQ(refusalOfCsv(""), "test.csv: file is empty");
  EXPECT_EQ(refusalOfCsv("# only\n\n# comments\n"), "test.csv: file is empty");
  EXPECT_EQ(refusalOfCsv("time_s,force_n,hoist_position_m\n"), "test.csv: has a header, but no rows");
  EXPECT_EQ(refusalOfCsv("0,1,2\n0.1,2,3\n"),
            "test.csv:1: no header: the first line must name the columns, such as time_s,force_n,hoist_position_m");
  EXPECT_EQ(refusalOfCsv("time_s;force_n;hoist_position_m\n0,1;2;3\n"),
            "test.csv:1: columns are separated by semicolons; a record has commas, and decimal points");
  EXPECT_EQ(refusalOfCsv("time_s\tforce_n\n0\t1\n"),
            "test.csv:1: columns are separated by tabs; a record has commas, and decimal points");
  EXPECT_EQ(refusalOfCsv("time_s,force_n,hoist_position_m\n0,1,5,2,3,0\n"),
            "test.csv:2: 6 cells, where the header has 3; decimals must be written with a point");
  EXPECT_EQ(refusalOfCsv("time_s,force_n,force_n\n0,1,2\n"), "test.csv:1: column `force_n` is given twice");
  EXPECT_EQ(refusalOfCsv("time_s,\"force_n\n0,1\n"), "test.csv:1: a quote is not closed within the line");
  EXPECT_EQ(refusalOfCsv("time_s,\"force_n\"x\n0,1\n"), "test.csv:1: text between a closing quote and the next comma");
  EXPECT_EQ(refusalOfCsv(std::string("time_s,force_n\n\x7F\x45\0\1", 19)),
            "test.csv:2: not text: byte 0; a record is plain text, UTF-8 or ASCII");
  EXPECT_EQ(refusalOfCsv("time_s,Kraft\n0,1\n"), "test.csv: no column force_n; the header is time_s,Kraft");
  EXPECT_EQ(refusalOfCsv("t,force_n\n0,1\n"), "test.csv: no column time_s; the header is t,force_n");
  EXPECT_EQ(refusalOfCsv("time_s,force_n\n0,1\n"),
            "test.csv: no column of the motion, hoist_position_m, hoist_speed_mps or hoist_command_mps; the header is "
            "time_s,force_n");
}

TEST_F(RecordCsv, SizeIsBounded) {
  EXPECT_EQ(refusalOfCsv("time_s,force_n\n" + std::string(kMaxCsvLineLength + 1, '1')),
            "test.csv:2: line longer than 10000 bytes");
  std::string text = kCsv;
  for (std::size_t i = 0; i < kMaxCsvLines; ++i) text += "#\n";
  EXPECT_EQ(refusalOfCsv(text), "test.csv: more than 1000000 lines; give fewer samples a second");
}

TEST_F(RecordCsv, WhatIsNoRegularFileIsRefused) {
  directory_.put("test.yaml", "source: lab\n");
  std::filesystem::create_symlink("/dev/zero", directory_.file("test.csv"));
  EXPECT_EQ(refusal(), "test.csv: is not a regular file");
}

TEST_F(RecordCsv, NumbersDoNotDependOnTheLocale) {
  const char* const before = std::setlocale(LC_ALL, "de_DE.UTF-8");
  const Record record = recordOf("time_s,force_n,hoist_position_m\n0,1.5,-1\n0.1,2.5,-1\n");
  if (before != nullptr) std::setlocale(LC_ALL, "C");
  EXPECT_EQ(record.force_n[0], 1.5);
}

// ---- files

TEST_F(RecordFiles, AreFoundFromEitherTheBaseOrTheirDirectory) {
  directory_.put("test.csv", kCsv);
  directory_.put("test.yaml", "source: field\n");
  directory_.put("other.csv", kCsv);
  for (const std::string path :
       {directory_.file("test.csv"), directory_.file("test.yaml"), directory_.file("test"), directory_.path()}) {
    EXPECT_EQ(readRecord(path).size(), 3u) << path;
    EXPECT_TRUE(isRecord(path)) << path;
  }
}

TEST_F(RecordFiles, DirectoryMustHoldOnePair) {
  EXPECT_TRUE(contains(refusal(""), "holds no record, which is a pair NAME.csv and NAME.yaml"));
  for (const char* name : {"a", "b"}) {
    directory_.put(std::string(name) + ".csv", kCsv);
    directory_.put(std::string(name) + ".yaml", "source: field\n");
  }
  EXPECT_TRUE(contains(refusal(""), "holds more than one record; name one: "));
  EXPECT_TRUE(contains(refusal(""), "/b"));
}

TEST_F(RecordFiles, MissingManifestIsToldHowToWrite) {
  directory_.put("test.csv", kCsv);
  EXPECT_EQ(refusal(),
            "test.yaml: the manifest is missing; write this file with at least the line `source: field` (or lab, or "
            "synthetic)");
  EXPECT_TRUE(contains(refusal("nothing"), "nothing.csv: file cannot be read: No such file"));
}

TEST_F(RecordFiles, AreToldFromScenariosStudiesAndOtherFiles) {
  EXPECT_TRUE(isRecord(directory_.put("a.log", "# x\ntime_s;force_n\n")));
  EXPECT_TRUE(isRecord(directory_.put("a.csv", "anything")));
  EXPECT_TRUE(isRecord(directory_.put("a.yaml", "tare_n: 3\n")));
  EXPECT_TRUE(isRecord(directory_.file("a")));
  EXPECT_FALSE(isRecord(directory_.put("b.yaml", "title: x\nice: {cohesion_pa: 100}\n")));
  EXPECT_FALSE(isRecord(directory_.put("c.yaml", "cases: [{name: a}]\n")));
  EXPECT_FALSE(isRecord(directory_.put("d.yaml", "")));
  EXPECT_FALSE(isRecord(directory_.file("nowhere")));
}

// ---- manifest

TEST_F(RecordManifest, ExampleOfTheDocumentationIsRead) {
  const std::string doc = readFile(BRASH_ICE_SOURCE_DIR "/doc/records.md");
  const auto start = doc.find("```yaml\n") + 8;
  const Record record = recordOf(kCsv, doc.substr(start, doc.find("```", start) - start));
  EXPECT_EQ(record.title, "Pull-up test 10, first spot");
  EXPECT_EQ(record.source, RecordSource::kField);
  EXPECT_EQ(record.tare_n, 0.0);
  EXPECT_EQ(record.position, PositionOrigin::kMeasured);
  ASSERT_EQ(record.ice.size(), 4u);
  for (const KnownValue& known : record.ice) {
    if (known.key == "field.thickness_m") {
      EXPECT_FALSE(known.sigma.has_value());
    } else if (known.key == "ice.void_fraction") {
      EXPECT_EQ(known.value, 0.6);
      EXPECT_EQ(known.sigma, 0.06);
    }
  }
  EXPECT_EQ(record.scenario.collector.radius_m, 1.3);
  EXPECT_EQ(record.scenario.ice.cohesion_pa, 200.0);
  EXPECT_EQ(record.scenario.procedure.start, StartPose::kUnfoldedUnderIce);
}

TEST_F(RecordManifest, SourceAloneIsEnoughAndTheRestIsAssumedAloud) {
  const Record record = recordOf(kCsv);
  EXPECT_EQ(record.source, RecordSource::kLab);
  EXPECT_EQ(record.title, "test");
  for (const char* text : {"no tare_n: 0 assumed", "no `rig`", "no `position`: measured assumed",
                           "field.thickness_m = 1.2", "ice.void_fraction = 0.6", "no hoist_speed_mps"}) {
    EXPECT_TRUE(assumes(record, text)) << text;
  }
}

TEST_F(RecordManifest, UncertaintyMayBeWrittenThreeWays) {
  for (const char* written : {"0.55 ± 0.04", "0.55 +- 0.04", "0.55+/-0.04", "\"0.55±0.04\""}) {
    const Record record = recordOf(kCsv, std::string("source: lab\nice: {void_fraction: ") + written + "}\n");
    ASSERT_EQ(record.ice.size(), 1u) << written;
    EXPECT_EQ(record.ice[0].key, "ice.void_fraction");
    EXPECT_EQ(record.ice[0].value, 0.55);
    EXPECT_EQ(record.ice[0].sigma, 0.04);
    EXPECT_EQ(record.scenario.ice.void_fraction, 0.55);
    EXPECT_FALSE(assumes(record, "no ± for"));
  }
  EXPECT_TRUE(assumes(recordOf(kCsv, "source: lab\nice: {void_fraction: 0.5}\n"), "no ± for ice.void_fraction"));
}

TEST_F(RecordManifest, RigMayBeAFileOrKeysInline) {
  directory_.put("rig.yaml", "collector: {radius_m: 1.1}\n");
  EXPECT_EQ(recordOf(kCsv, "source: lab\nrig: rig.yaml\n").scenario.collector.radius_m, 1.1);
  const Record record = recordOf(
      kCsv, "source: lab\nrig: {collector: {radius_m: 0.9}, start: folded above the ice}\nice: {thickness_m: 1}\n");
  EXPECT_EQ(record.scenario.collector.radius_m, 0.9);
  EXPECT_EQ(record.scenario.procedure.start, StartPose::kFoldedAboveIce);
  EXPECT_EQ(record.scenario.field.thickness_m, 1.0);
}

TEST_F(RecordManifest, MistakesNameLineKeyValueAndRule) {
  const std::pair<const char*, const char*> cases[] = {
      {"title: x\n", "test.yaml: source must be field, lab or synthetic"},
      {"source: sea\n", "test.yaml:1: source = sea, must be field, lab or synthetic"},
      {"source: lab\ntara_n: 0\n", "test.yaml:2: unknown key tara_n; did you mean tare_n?"},
      {"source: lab\ntare_n: much\n", "test.yaml:2: tare_n = much, must be a number"},
      {"source: lab\ntare_n: .nan\n", "test.yaml:2: tare_n = .nan, must be a finite number"},
      {"source: lab\ntare_n: 1.0e8\n", "test.yaml:2: tare_n = 1.0e8, must lie in [-1.0e+07, 1.0e+07]"},
      {"source: lab\nposition: guessed\n", "test.yaml:2: position = guessed, must be measured or commanded"},
      {"source: lab\nsource: lab\n", "test.yaml:2: source is given twice"},
      {"source: lab\nice: {void_fracton: 0.5}\n",
       "test.yaml:2: unknown key ice.void_fracton; did you mean void_fraction?"},
      {"source: lab\nice:\n  void_fraction: 1.5\n", "test.yaml:3: ice.void_fraction = 1.5, must lie in (0, 1)"},
      {"source: lab\nice:\n  thickness_m: -1 ± 1\n", "test.yaml:3: ice.thickness_m = -1, must lie in (0, 20]"},
      {"source: lab\nice: {void_fraction: 0.5 ± 0}\n",
       "test.yaml:2: ice.void_fraction = 0.5 ± 0, must have a standard deviation greater than 0"},
      {"source: lab\nice: {void_fraction: 0.5 ± }\n", "test.yaml:2: ice.void_fraction = \"\", must be a number"},
      {"source: lab\nrig: {collector: {radios_m: 1}}\n",
       "test.yaml:2: unknown key collector.radios_m; did you mean collector.radius_m?"},
      {"source: lab\nrig: {collector: {radius_m: 99}}\n",
       "test.yaml:2: rig.collector.radius_m = 99, must lie in [0.1, 20]"},
      {"source: lab\nrig: {collector: {radius_m: 9}}\n", "test.yaml:2: rig.collector.radius_m = 9, "},
      {"source: lab\nrig: {start: somewhere}\n",
       "test.yaml:2: rig.start = somewhere, must be rim at the ice bottom or folded above the ice"},
      {"source: lab\nrig: {collector: {shape: square}}\n",
       "test.yaml:2: rig.collector.shape = square, must be octagon"},
      {"source: lab\nrig: nowhere.yaml\n", "nowhere.yaml: file cannot be read"},
      {"source: lab\nrig: [1]\n", "test.yaml:2: rig = [...], must be a file with scenario keys, or a map of them"},
      {"source: lab\nrig: &a {collector: *a}\n", "must be"},
      {"- 1\n", "test.yaml: must be a map of keys, such as `source: field`"},
  };
  for (const auto& [text, expected] : cases) EXPECT_TRUE(contains(refusalOfManifest(text), expected)) << refusal();
}

// ---- motion

TEST_F(RecordMotionColumns, PositionComesFromTheSpeedAndSpeedFromThePosition) {
  std::string speeds = "time_s,force_n,hoist_speed_mps\n";
  std::string positions = "time_s,force_n,hoist_position_m\n";
  for (int i = 0; i <= 100; ++i) {
    const double t = 0.1 * i;
    speeds += std::to_string(t) + ",0," + std::to_string(0.01 * t) + "\n";
    positions += std::to_string(t) + ",0," + std::to_string(0.005 * t * t) + "\n";
  }
  const Record from_speed = recordOf(speeds);
  EXPECT_FALSE(from_speed.position_given);
  EXPECT_TRUE(assumes(from_speed, "no hoist_position_m: hoist_speed_mps integrated"));
  // Starts where the default scenario's lift does, hub at -1.38 m, and has gone 0.5 m after 10 s.
  EXPECT_NEAR(from_speed.hoist_position_m.front(), -1.38, 1e-9);
  EXPECT_NEAR(from_speed.hoist_position_m.back(), -1.38 + 0.5, 1e-4);

  const Record from_position = recordOf(positions);
  EXPECT_TRUE(from_position.position_given);
  for (std::size_t i = 1; i < 100; ++i) EXPECT_NEAR(from_position.hoist_speed_mps[i], 0.001 * i, 1e-4) << i;
}

TEST_F(RecordMotionColumns, CommandIsTheLastResortAndSaysSo) {
  const std::string csv = "time_s,force_n,hoist_command_mps\n0,1,0.05\n10,2,0.05\n20,3,0.05\n";
  const Record record = recordOf(csv);
  EXPECT_EQ(record.position, PositionOrigin::kCommanded);
  EXPECT_TRUE(assumes(record, "no `position`: commanded assumed"));
  EXPECT_TRUE(assumes(record, "hoist_command_mps integrated"));
  EXPECT_NEAR(record.hoist_position_m.back() - record.hoist_position_m.front(), 1.0, 1e-12);
  directory_.put("test.yaml", "source: lab\nposition: measured\n");
  EXPECT_TRUE(contains(refusal(), "position = measured, contradicts the CSV file"));
}

TEST_F(RecordMotionColumns, SlowEncoderIsFilledBetweenItsSamplesButNotAtTheEnds) {
  const Record record =
      recordOf("time_s,force_n,hoist_position_m\n0,1,\n0.1,1,-1.0\n0.2,1,\n0.3,1,\n0.4,1,-0.7\n0.5,1,\n");
  EXPECT_TRUE(std::isnan(record.hoist_position_m[0]));
  EXPECT_NEAR(record.hoist_position_m[2], -0.9, 1e-12);
  EXPECT_NEAR(record.hoist_position_m[3], -0.8, 1e-12);
  EXPECT_TRUE(std::isnan(record.hoist_position_m[5]));
  EXPECT_TRUE(assumes(record, "2 of 6 cells of hoist_position_m are empty"));
}

TEST(SmoothSlope, IsExactOnAStraightLineWithUnevenTimes) {
  const std::vector<double> time_s = {0.0, 0.01, 0.05, 0.3, 1.0, 1.02};
  std::vector<double> y;
  for (const double t : time_s) y.push_back(3.0 - 2.0 * t);
  for (const double slope : computeSmoothSlope(time_s, y)) EXPECT_NEAR(slope, -2.0, 1e-9);
  EXPECT_TRUE(std::isnan(computeSmoothSlope({1.0, 1.0}, {0.0, 1.0})[0]));
}

// ---- whatever the file holds

std::string csvOf(const Record& record) {
  std::string text = "time_s,force_n,hoist_position_m,hoist_speed_mps\n";
  for (std::size_t i = 0; i < record.size(); ++i) {
    char row[128];
    std::snprintf(row, sizeof row, "%.3f,%.1f,%.4f,%.4f\n", record.time_s[i], record.force_n[i],
                  record.hoist_position_m[i], record.hoist_speed_mps[i]);
    text += row;
  }
  return text;
}

TEST_F(RecordFiles, MutatedRecordsAreReadOrRefusedButNeverCrash) {
  RecordRecipe recipe;
  recipe.rate_hz = 5.0;
  recipe.quiet_s = 6.0;
  recipe.stages_s = {9.0, 3.0, 9.0};
  const std::string csv = csvOf(makeRecord(recipe));
  const std::string manifest =
      "title: x\nsource: field\ntare_n: 10\nrig: {collector: {radius_m: 1.2}}\nice: {void_fraction: 0.6 ± 0.1}\n";
  std::mt19937_64 generator(7);
  const auto below = [&](std::size_t limit) { return static_cast<std::size_t>(generator() % limit); };
  const std::string pieces[] = {"\n",   ",",     "\"",     "nan",
                                "-inf", "1e308", "-1e308", "1e-320",
                                "#",    "\r",    ":",      "{",
                                "± ",   "0",     "-",      "9999999999999999999999",
                                "&a ",  "*a",    "\t",     std::string(1, '\0')};
  const auto mutated = [&](std::string text) {
    const std::size_t count = 1 + below(4);
    for (std::size_t k = 0; k < count && !text.empty(); ++k) {
      const std::size_t at = below(text.size());
      switch (below(5)) {
        case 0:
          text[at] = static_cast<char>(text[at] ^ (1 << below(8)));
          break;
        case 1:
          text[at] = static_cast<char>(below(256));
          break;
        case 2:
          text.insert(at, pieces[below(std::size(pieces))]);
          break;
        case 3:
          text.erase(at, 1 + below(60));
          break;
        default:
          text.insert(at, text.substr(below(text.size()), below(80)));
          break;
      }
    }
    return text;
  };
  int read = 0;
  int refused = 0;
  directory_.put("test.yaml", manifest);
  for (int i = 0; i < 3000; ++i) {
    // The table first, then the manifest beside a good table.
    if (i < 2000) {
      directory_.put("test.csv", mutated(csv));
    } else {
      if (i == 2000) directory_.put("test.csv", csv);
      directory_.put("test.yaml", mutated(manifest));
    }
    try {
      const Record record = readRecord(directory_.file("test"));
      const RecordReport report = checkRecord(record);
      EXPECT_FALSE(describe("test", record, report).empty());
      for (std::size_t k = 1; k < report.rows.size(); ++k) {
        ASSERT_LT(record.time_s[report.rows[k - 1]], record.time_s[report.rows[k]]);
      }
      ++read;
    } catch (const ConfigError& error) {
      EXPECT_GT(std::string(error.what()).size(), 10u);
      ++refused;
    }
  }
  EXPECT_GT(read, 500);
  EXPECT_GT(refused, 500);
}

TEST_F(RecordFiles, NoiseOfAnyKindIsReadOrRefusedButNeverCrashes) {
  std::mt19937_64 generator(11);
  directory_.put("test.yaml", "source: lab\n");
  for (int i = 0; i < 300; ++i) {
    std::string text = i % 2 == 0 ? "time_s,force_n,hoist_position_m\n" : "";
    const std::string letters = "0123456789+-.eE,,,\n\n naif\"#";
    const std::size_t size = generator() % 3000;
    for (std::size_t k = 0; k < size; ++k) {
      text += i % 4 < 2 ? letters[generator() % letters.size()] : static_cast<char>(generator() % 256);
    }
    directory_.put("test.csv", text);
    try {
      const Record record = readRecord(directory_.file("test"));
      describe("test", record, checkRecord(record));
    } catch (const ConfigError&) {
    }
  }
  // Every number that there is, in rows without order.
  for (int i = 0; i < 100; ++i) {
    Record record;
    for (auto* values : {&record.time_s, &record.force_n, &record.hoist_position_m, &record.hoist_speed_mps}) {
      for (int k = 0; k < 200; ++k) {
        const std::uint64_t bits = generator();
        double value = 0.0;
        static_assert(sizeof bits == sizeof value);
        std::memcpy(&value, &bits, sizeof value);
        values->push_back(k % 3 == 0 ? value : std::ldexp(static_cast<double>(bits), -60));
      }
    }
    for (std::size_t k = 0; k < record.size(); ++k) record.line.push_back(k + 2);
    if (i % 2 == 0) {
      std::sort(record.time_s.begin(),
                std::remove_if(record.time_s.begin(), record.time_s.end(), [](double t) { return std::isnan(t); }));
    }
    describe("test", record, checkRecord(record));
  }
}

}  // namespace
}  // namespace brash_ice_rig
