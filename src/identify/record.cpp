#include "brash_ice_rig/identify/record.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <system_error>

#include "brash_ice_rig/config/csv.h"
#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/config/yaml_document.h"

namespace brash_ice_rig {
namespace {

namespace fs = std::filesystem;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr int kMaxDepth = 4;  // of maps in `rig`: YAML aliases can nest without end

const std::vector<std::string>& manifestKeys() {
  static const std::vector<std::string> kKeys = {"title", "source",   "tare_n", "position", "rig",
                                                 "ice",   "commands", "motion", "notes"};
  return kKeys;
}

// ---- which files

bool isFile(const std::string& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

/// NAME of the only pair NAME.csv, NAME.yaml in a directory.
std::string onlyPairIn(const std::string& directory) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator entry(directory, error), end; !error && entry != end; entry.increment(error)) {
    const fs::path base = entry->path().parent_path() / entry->path().stem();
    if (entry->path().extension() == ".csv" && isFile(base.string() + ".yaml")) names.push_back(base.string());
  }
  if (error) throw ConfigError("", "", "directory cannot be read: " + error.message(), directory);
  if (names.size() == 1) return names.front();
  std::sort(names.begin(), names.end());
  std::string rule = "holds no record, which is a pair NAME.csv and NAME.yaml";
  if (!names.empty()) {
    rule = "holds more than one record; name one:";
    for (const std::string& name : names) rule += " " + name;
  }
  throw ConfigError("", "", rule, directory);
}

std::string baseOf(const std::string& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return onlyPairIn(path);
  const fs::path file(path);
  if (file.extension() == ".csv" || file.extension() == ".yaml") return fs::path(file).replace_extension().string();
  return path;
}

// ---- manifest

/// `a ± b`, `a +- b` or `a`.
KnownValue knownValueOf(const YamlItem& item, const std::string& key) {
  const std::string written = item.text("must be a number, or `value ± standard deviation`");
  KnownValue known{key, 0.0, std::nullopt};
  std::string value = written;
  for (const std::string sign : {"±", "+-", "+/-"}) {
    const auto at = written.find(sign);
    if (at == std::string::npos) continue;
    const auto strip = [](std::string text) {
      text.erase(0, text.find_first_not_of(' '));
      return text.erase(text.find_last_not_of(' ') + 1);
    };
    value = strip(written.substr(0, at));
    const std::string sigma = strip(written.substr(at + sign.size()));
    known.sigma = numberFromText(item.key, sigma, item.where);
    if (!(*known.sigma > 0.0)) item.refuse("must have a standard deviation greater than 0");
    break;
  }
  known.value = numberFromText(item.key, value, item.where);
  return known;
}

/// Keys of the ice section of a scenario that are numbers.
class NumericKeys {
 public:
  NumericKeys() { IceConfig().visit(*this); }
  const std::vector<std::string>& names() const { return names_; }

  // What visit() calls.
  template <class Number>
  void operator()(const char* name, Number&, const Range&, const char*) {
    names_.push_back(name);
  }
  template <class Other>
  void operator()(const char*, Other&, const char*) {}
  template <class Enum>
  void operator()(const char*, Enum&, std::initializer_list<const char*>, const char*) {}

 private:
  std::vector<std::string> names_ = {"thickness_m"};
};

/// The manifest's `rig` and `ice` as a scenario.
class RigAndIce {
 public:
  explicit RigAndIce(Record& record) : record_(record) {}

  void readRig(const YamlItem& item) {
    if (!item.exists()) {
      assume("no `rig`: the collector of the default scenario is assumed");
      return;
    }
    if (item.value.IsMap()) {
      addSettings(item, "", 1);
      return;
    }
    const std::string file = item.text("must be a file with scenario keys, or a map of them");
    record_.sources.file = (fs::path(item.file).parent_path() / file).lexically_normal().string();
  }

  void readIce(const YamlItem& item) {
    if (item.exists()) {
      const std::vector<std::string> names = NumericKeys().names();
      const YamlSection section(item, names);
      for (const std::string& name : names) {
        const YamlItem entry = section[name];
        if (!entry.exists()) continue;
        const KnownValue known = knownValueOf(entry, name == "thickness_m" ? "field.thickness_m" : "ice." + name);
        add(known.key, formatNumber(known.value), entry);
        if (!known.sigma) assume("no ± for ice." + name + ": how well it is known is left open");
        record_.ice.push_back(known);
      }
    }
    compose();
    const Scenario& scenario = record_.scenario;
    const std::pair<const char*, double> main_values[] = {{"field.thickness_m", scenario.field.thickness_m},
                                                          {"ice.void_fraction", scenario.ice.void_fraction},
                                                          {"ice.cohesion_pa", scenario.ice.cohesion_pa},
                                                          {"ice.friction_angle_deg", scenario.ice.friction_angle_deg}};
    std::string missing;
    for (const auto& [key, value] : main_values) {
      const auto same = [name = key](const KnownValue& known) { return known.key == name; };
      if (std::any_of(record_.ice.begin(), record_.ice.end(), same)) continue;
      missing += (missing.empty() ? "" : ", ") + std::string(key) + " = " + formatNumber(value);
    }
    if (!missing.empty()) assume("not given under `ice`: " + missing + " assumed");
  }

 private:
  void assume(const std::string& text) { record_.assumptions.push_back(text); }

  void add(const std::string& key, const std::string& value, const YamlItem& item) {
    record_.sources.settings.push_back(key + "=" + value);
    origins_[key] = item;
  }

  /// Words for how the rig starts and what it looks like, and scenario keys.
  void addSettings(const YamlItem& map, const std::string& prefix, int depth) {
    for (const YamlItem& item : map.map("must be a map of scenario keys, such as {collector: {radius_m: 1.3}}")) {
      const std::string key = prefix + item.name;
      if (key == "start") {
        const bool unfolded = item.word({"rim at the ice bottom", "folded above the ice"}) == "rim at the ice bottom";
        add("procedure.start", unfolded ? "unfolded_under_ice" : "folded_above_ice", item);
      } else if (key == "collector.shape") {
        item.word({"octagon"});  // the only one that the model has
      } else if (item.value.IsMap() && depth < kMaxDepth) {
        addSettings(item, key + ".", depth + 1);
      } else {
        add(key, item.text("must be a single value"), item);
      }
    }
  }

  /// The scenario, with errors named by their place in the manifest.
  void compose() {
    try {
      record_.scenario = loadScenario(record_.sources);
    } catch (const ConfigError& error) {
      const auto origin = origins_.find(error.key());
      if (origin == origins_.end()) throw;
      const YamlItem& item = origin->second;
      throw ConfigError(error.value().empty() ? error.key() : item.key, error.value(), error.rule(), item.where);
    }
  }

  Record& record_;
  std::map<std::string, YamlItem> origins_;
};

void readManifest(Record& record) {
  const std::string& path = record.manifest_file;
  const YamlItem file{"", "", readYamlMap(path, "keys, such as `source: field`"), path, path};
  const YamlSection root(file, manifestKeys());
  const auto assume = [&](const std::string& text) { record.assumptions.push_back(text); };

  const std::string source = root["source"].word({"field", "lab", "synthetic"});
  record.source = source == "field" ? RecordSource::kField
                  : source == "lab" ? RecordSource::kLab
                                    : RecordSource::kSynthetic;
  const YamlItem title = root["title"];
  record.title = title.exists() ? title.text() : fs::path(path).stem().string();
  const YamlItem notes = root["notes"];
  if (notes.exists() && !notes.value.IsNull()) record.notes = notes.text();
  const YamlItem tare = root["tare_n"];
  if (tare.exists()) {
    record.tare_n = tare.number(Range{-1.0e7, 1.0e7});
  } else {
    assume("no tare_n: 0 assumed, a load cell zeroed with the empty rig hanging in the water");
  }
  const auto fileBeside = [&](const char* key, std::string& target) {
    const YamlItem item = root[key];
    if (!item.exists()) return;
    target = (fs::path(path).parent_path() / item.text("must name a CSV file")).lexically_normal().string();
    if (!isFile(target)) item.refuse("must name a file that exists; " + target + " does not");
  };
  fileBeside("commands", record.commands_file);
  fileBeside("motion", record.motion_file);
  RigAndIce rig_and_ice(record);
  rig_and_ice.readRig(root["rig"]);
  rig_and_ice.readIce(root["ice"]);

  // What the columns say comes with the columns.
  const YamlItem position = root["position"];
  const bool has_encoder = !record.hoist_position_m.empty() || !record.hoist_speed_mps.empty();
  if (position.exists()) {
    const bool measured = position.word({"measured", "commanded"}) == "measured";
    if (measured && !has_encoder) {
      position.refuse("contradicts the CSV file, which has no column hoist_position_m or hoist_speed_mps");
    }
    record.position = measured ? PositionOrigin::kMeasured : PositionOrigin::kCommanded;
  } else {
    record.position = has_encoder ? PositionOrigin::kMeasured : PositionOrigin::kCommanded;
    assume(std::string("no `position`: ") + (has_encoder ? "measured" : "commanded") + " assumed, from the columns");
  }
}

// ---- motion

/// Fills samples that are missing between others by straight lines over time. Nothing is made up at the ends.
/// @return how many were filled
std::size_t fillGaps(const std::vector<double>& time_s, std::vector<double>& values) {
  std::size_t filled = 0;
  std::size_t left = values.size();
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i]) || !std::isfinite(time_s[i])) continue;
    if (left < i && time_s[i] > time_s[left]) {
      for (std::size_t k = left + 1; k < i; ++k) {
        const double share = (time_s[k] - time_s[left]) / (time_s[i] - time_s[left]);
        if (!std::isnan(values[k]) || !(share >= 0.0 && share <= 1.0)) continue;
        values[k] = values[left] + share * (values[i] - values[left]);
        ++filled;
      }
    }
    left = i;
  }
  return filled;
}

/// Trapezoidal rule; what is not finite and steps back in time add nothing.
std::vector<double> integral(const std::vector<double>& time_s, const std::vector<double>& speed_mps) {
  std::vector<double> sum(speed_mps.size(), kNan);
  double total = 0.0;
  std::optional<std::size_t> left;
  for (std::size_t i = 0; i < speed_mps.size(); ++i) {
    if (!std::isfinite(speed_mps[i]) || !std::isfinite(time_s[i])) continue;
    if (left && time_s[i] > time_s[*left]) {
      total += 0.5 * (speed_mps[i] + speed_mps[*left]) * (time_s[i] - time_s[*left]);
    }
    sum[i] = total;
    left = i;
  }
  return sum;
}

/// Derives of position and speed what the file lacks.
void completeMotion(Record& record) {
  const auto assume = [&](const std::string& text) { record.assumptions.push_back(text); };
  const std::pair<const char*, std::vector<double>*> columns[] = {{"hoist_position_m", &record.hoist_position_m},
                                                                  {"hoist_speed_mps", &record.hoist_speed_mps},
                                                                  {"hoist_command_mps", &record.hoist_command_mps}};
  for (const auto& [name, values] : columns) {
    const std::size_t filled = fillGaps(record.time_s, *values);
    if (filled == 0) continue;
    assume(std::to_string(filled) + " of " + std::to_string(record.size()) + " cells of " + name +
           " are empty: filled by straight lines between the others");
  }
  if (record.hoist_position_m.empty()) {
    const bool from_speed = !record.hoist_speed_mps.empty();
    record.hoist_position_m = integral(record.time_s, from_speed ? record.hoist_speed_mps : record.hoist_command_mps);
    double lowest = std::numeric_limits<double>::infinity();
    for (const double height : record.hoist_position_m) lowest = std::fmin(lowest, height);
    const double start_m = lowestHubHeight(record.scenario);
    for (double& height : record.hoist_position_m) height += start_m - lowest;
    assume(std::string("no hoist_position_m: ") + (from_speed ? "hoist_speed_mps" : "hoist_command_mps") +
           " integrated; the lowest point is taken for the start of the lift, hub at " + formatNumber(start_m) + " m");
  }
  if (record.hoist_speed_mps.empty()) {
    record.hoist_speed_mps = computeSmoothSlope(record.time_s, record.hoist_position_m);
    assume("no hoist_speed_mps: slope of the position over 0.2 s");
  }
}

}  // namespace

std::vector<double> computeSmoothSlope(const std::vector<double>& time_s, const std::vector<double>& y) {
  constexpr double kHalfWindowS = 0.1;
  std::vector<std::size_t> finite;
  for (std::size_t i = 0; i < y.size(); ++i) {
    if (std::isfinite(time_s[i]) && std::isfinite(y[i])) finite.push_back(i);
  }
  std::vector<double> slope(y.size(), kNan);
  std::size_t first = 0;
  std::size_t last = 0;  // one past the end
  for (std::size_t k = 0; k < finite.size(); ++k) {
    const double t = time_s[finite[k]];
    while (first < k && time_s[finite[first]] < t - kHalfWindowS) ++first;
    while (last < finite.size() && time_s[finite[last]] <= t + kHalfWindowS) ++last;
    const std::size_t from = std::min(first, k > 0 ? k - 1 : 0);
    const std::size_t to = std::min(std::max(last, k + 2), finite.size());
    const double count = static_cast<double>(to - from);
    double t_mean = 0.0;
    double y_mean = 0.0;
    for (std::size_t j = from; j < to; ++j) {
      t_mean += (time_s[finite[j]] - t) / count;
      y_mean += y[finite[j]] / count;
    }
    double tt = 0.0;
    double ty = 0.0;
    for (std::size_t j = from; j < to; ++j) {
      const double dt = time_s[finite[j]] - t - t_mean;
      tt += dt * dt;
      ty += dt * (y[finite[j]] - y_mean);
    }
    if (tt > 0.0) slope[finite[k]] = ty / tt;
  }
  return slope;
}

bool isRecord(const std::string& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return true;
  if (!fs::exists(path, ignored)) return isFile(path + ".csv");
  if (fs::path(path).extension() == ".csv" || csvHasColumn(path, {"time_s", "force_n"})) return true;
  try {
    const YAML::Node root = readYamlMap(path, "keys");
    // `title` and `ice` are keys of scenarios, too.
    for (const char* key : {"source", "tare_n", "position", "rig", "notes"}) {
      if (root[key].IsDefined()) return true;
    }
  } catch (const ConfigError&) {
  }
  return false;
}

const char* sourceName(RecordSource source) {
  switch (source) {
    case RecordSource::kField:
      return "field";
    case RecordSource::kLab:
      return "lab";
    case RecordSource::kSynthetic:
      return "synthetic";
  }
  return "unknown";
}

Record readRecord(const std::string& path) {
  const std::string base = baseOf(path);
  Record record;
  record.csv_file = base + ".csv";
  record.manifest_file = base + ".yaml";
  if (!isFile(record.manifest_file) && isFile(record.csv_file)) {
    throw ConfigError("", "",
                      "the manifest is missing; write this file with at least the line `source: field` (or lab, "
                      "or synthetic)",
                      record.manifest_file);
  }
  const std::vector<std::string> names = {
      "time_s", "force_n", "hoist_position_m", "hoist_speed_mps", "hoist_command_mps", "force_x_n", "force_y_n"};
  std::vector<double>* const members[] = {&record.time_s,          &record.force_n,           &record.hoist_position_m,
                                          &record.hoist_speed_mps, &record.hoist_command_mps, &record.force_x_n,
                                          &record.force_y_n};
  CsvTable table = readCsv(record.csv_file, names);
  std::string header;
  for (const std::string& name : table.header) header += (header.empty() ? "" : ",") + name;
  if (header.size() > 200) header = header.substr(0, 200) + "...";
  const auto require = [&](bool present, const std::string& what) {
    if (!present) throw ConfigError("", "", "no column " + what + "; the header is " + header, record.csv_file);
  };
  require(table.columns[0].has_value(), "time_s");
  require(table.columns[1].has_value(), "force_n");
  require(table.columns[2] || table.columns[3] || table.columns[4],
          "of the motion, hoist_position_m, hoist_speed_mps or hoist_command_mps");
  record.line = std::move(table.line);
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (table.columns[i]) *members[i] = std::move(*table.columns[i]);
  }
  record.position_given = !record.hoist_position_m.empty();
  for (const std::string& name : table.header) {
    if (std::find(names.begin(), names.end(), name) == names.end()) record.unused_columns.push_back(name);
  }
  readManifest(record);
  if (table.bad_cells > 0) {
    const CsvTable::BadCell& bad = *table.first_bad_cell;
    record.assumptions.push_back(std::to_string(table.bad_cells) +
                                 " cells are no numbers and count as missing, first " + bad.text + " for " +
                                 bad.column + " in line " + std::to_string(record.line[bad.row]));
  }
  if (table.last_row_cut_off) record.assumptions.push_back("the last line is cut off: left out");
  completeMotion(record);
  return record;
}

}  // namespace brash_ice_rig
