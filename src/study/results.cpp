#include "brash_ice_rig/study/results.h"

#include <algorithm>
#include <cassert>

#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/study/run_directory.h"

namespace brash_ice_rig {
namespace {

/// Keys of summary.json that are no result (status is a column of its own), or differ from computer to computer.
constexpr const char* kLeftOut[] = {"wall_s", "real_time_factor", "ns_per_particle_step", "threads", "status"};

/// A cell of a CSV file (RFC 4180).
std::string cell(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + '"';
}

std::string line(const std::vector<std::string>& cells) {
  std::string text;
  for (const std::string& one : cells) text += (text.empty() ? "" : ",") + cell(one);
  return text + '\n';
}

/// The keys in which any two runs differ: their places in keyValues().
std::vector<std::size_t> differingKeys(const std::vector<Table>& scenarios) {
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < scenarios.front().size(); ++i) {
    const auto differs = [&](const Table& other) { return other[i].second != scenarios.front()[i].second; };
    if (scenarios.front()[i].first == "field.seed") continue;
    if (std::any_of(scenarios.begin(), scenarios.end(), differs)) places.push_back(i);
  }
  return places;
}

/// Figures of a finished run.
Table figuresOf(const Table& summary, const std::string& directory) {
  Table figures;
  for (const auto& entry : summary) {
    if (std::find(std::begin(kLeftOut), std::end(kLeftOut), entry.first) == std::end(kLeftOut)) {
      figures.push_back(entry);
    }
  }
  for (auto& entry : readLastPlug(directory)) figures.push_back(std::move(entry));
  return figures;
}

}  // namespace

std::string resultsCsv(const Study& study, const std::string& directory, const std::vector<RunStatus>& statuses) {
  assert(statuses.size() == study.runs.size() && !study.runs.empty());
  std::vector<Table> scenarios, figures;
  std::vector<std::string> words;  // of the column status
  std::vector<std::string> figure_names;
  for (std::size_t i = 0; i < study.runs.size(); ++i) {
    scenarios.push_back(keyValues(study.runs[i].scenario));
    figures.emplace_back();
    words.push_back("failed: " + statuses[i].note);
    if (statuses[i].state != RunState::kDone) continue;
    const std::string run = directory + "/" + runDirectory(study, study.runs[i]);
    const Table summary = readSummary(run);
    words.back() = valueOf(summary, "status");
    figures.back() = figuresOf(summary, run);
    if (!figure_names.empty()) continue;
    for (const auto& [name, value] : figures.back()) figure_names.push_back(name);
  }
  const std::vector<std::size_t> keys = differingKeys(scenarios);

  std::vector<std::string> header = {"case", "seed", "status"};
  for (const std::size_t key : keys) header.push_back(scenarios.front()[key].first);
  header.insert(header.end(), figure_names.begin(), figure_names.end());
  std::string csv = line(header);
  for (std::size_t i = 0; i < study.runs.size(); ++i) {
    const StudyRun& run = study.runs[i];
    std::vector<std::string> row = {study.cases[run.case_index].name, std::to_string(run.seed), words[i]};
    for (const std::size_t key : keys) row.push_back(scenarios[i][key].second);
    for (const std::string& name : figure_names) row.push_back(valueOf(figures[i], name));
    csv += line(row);
  }
  return csv;
}

}  // namespace brash_ice_rig
