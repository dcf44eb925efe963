#include "brash_ice_rig/study/run_directory.h"

#include <yaml-cpp/yaml.h>

#include <cinttypes>
#include <cstdio>
#include <filesystem>
#include <sstream>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/simulation/status.h"
#include "brash_ice_rig/version.h"

namespace brash_ice_rig {
namespace {

/// Whether a scenario file gives the same run. The number of threads does not change results.
bool isSameScenario(const std::string& path, const Scenario& scenario) {
  if (textOfFileIfThere(path) == toYaml(scenario)) return true;
  ScenarioSources sources;
  sources.file = path;
  try {
    Scenario earlier = loadScenario(sources);
    earlier.solver.threads = scenario.solver.threads;
    return keyValues(earlier) == keyValues(scenario);
  } catch (const ConfigError&) {
    return false;  // written by hand, or by another version
  }
}

/// Whether a status, as statusText() writes it, names the flag.
bool statusHas(const std::string& status, StatusFlag flag) {
  return ("; " + status).find("; " + std::string(statusName(flag)) + ": ") != std::string::npos;
}

std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> parts;
  std::istringstream stream(line);
  for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
  return parts;
}

}  // namespace

bool isFrozen(const std::string& status) {
  return statusHas(status, StatusFlag::kNonFinite);
}

EarlierRun findEarlierRun(const std::string& directory, const Scenario& scenario, const std::string& stamp) {
  namespace fs = std::filesystem;
  using State = EarlierRun::State;
  if (!fs::exists(directory + "/scenario.yaml")) return {};
  if (!fs::exists(directory + "/summary.json")) return {State::kNone, "it did not get to its end"};
  if (!isSameScenario(directory + "/scenario.yaml", scenario)) return {State::kNone, "the scenario has changed"};
  if (textOfFileIfThere(directory + "/program.txt") != stamp) return {State::kNone, "the program has changed"};
  for (const char* name : {"force.csv", "plug.csv"}) {
    if (!fs::exists(directory + "/" + name)) return {State::kNone, std::string(name) + " is missing"};
  }
  try {
    const std::string status = valueOf(readSummary(directory), "status");
    if (status.rfind("interrupted", 0) == 0) return {State::kNone, "it was interrupted"};
    if (isFrozen(status)) return {State::kNotFinite, status};
    return {State::kDone, ""};
  } catch (const OutputError&) {
    return {State::kNone, "its summary.json is damaged"};
  }
}

void prepareRun(const std::string& directory, const std::string& scenario_yaml, const std::string& stamp) {
  makeDirectory(directory);
  // First: with a summary the new scenario would count as done.
  removeFile(directory + "/summary.json");
  removeFile(directory + "/failure.txt");
  const auto put = [&directory](const char* name, const std::string& text) {
    OutputFile file(directory + "/" + name, OutputFile::Mode::kReplace);
    file.write(text);
    file.close();
  };
  put("scenario.yaml", scenario_yaml);
  put("program.txt", stamp);
}

std::uint64_t fnv1a(const std::string& bytes) {
  std::uint64_t hash = 14695981039346656037ull;
  for (const char byte : bytes) hash = (hash ^ static_cast<unsigned char>(byte)) * 1099511628211ull;
  return hash;
}

std::string hashText(const std::string& bytes) {
  char text[17];
  std::snprintf(text, sizeof text, "%016" PRIx64, fnv1a(bytes));
  return text;
}

std::string programStamp(const std::string& program) {
  return std::string("brash_ice ") + kVersion + ", FNV-1a " + hashText(textOfFile(program)) + "\n";
}

Table readSummary(const std::string& directory) {
  const std::string path = directory + "/summary.json";
  const std::string text = textOfFile(path);
  try {
    // JSON as RunSummary writes it is YAML, too.
    Table table;
    for (const auto& pair : YAML::Load(text)) {
      table.emplace_back(pair.first.Scalar(), pair.second.IsNull() ? "" : pair.second.Scalar());
    }
    if (!valueOf(table, "status").empty()) return table;
  } catch (const YAML::Exception&) {
  }
  throw OutputError(path, "is not the summary of a run");
}

std::string valueOf(const Table& table, const std::string& key) {
  for (const auto& [name, value] : table) {
    if (name == key) return value;
  }
  return "";
}

Table readLastPlug(const std::string& directory) {
  std::istringstream stream(textOfFile(directory + "/plug.csv"));
  std::string header, row, last;
  std::getline(stream, header);
  while (std::getline(stream, row)) last = row;
  const std::vector<std::string> names = cells(header), values = cells(last);
  Table table;
  for (std::size_t i = 0; i < names.size(); ++i) table.emplace_back(names[i], i < values.size() ? values[i] : "");
  return table;
}

std::string lastLogLine(const std::string& directory) {
  std::istringstream stream(textOfFileIfThere(directory + "/log.txt"));
  std::string last;
  for (std::string line; std::getline(stream, line);) {
    if (line.find_first_not_of(" \t\r") != std::string::npos) last = line;
  }
  return last;
}

}  // namespace brash_ice_rig
