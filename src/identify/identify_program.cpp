#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <thread>

#include <nlohmann/json.hpp>

#include "brash_ice_rig/identify/identification.h"
#include "brash_ice_rig/output/directory_lock.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/study/claims.h"
#include "brash_ice_rig/study/run_directory.h"
#include "brash_ice_rig/system/child_process.h"
#include "brash_ice_rig/system/launcher.h"
#include "brash_ice_rig/version.h"

namespace brash_ice_rig {
namespace {

using Json = nlohmann::ordered_json;

/// What is not finite becomes null by itself.
Json toJson(const Eigen::VectorXd& values) {
  Json array = Json::array();
  for (const double value : values) array.push_back(std::round(value * 1000.0) / 1000.0);
  return array;
}

Json toJson(const CurveError& e) {
  return {{"rmse_n", e.rmse_n},
          {"nrmse_ratio", e.nrmse_ratio},
          {"peak_error_n", e.peak_error_n},
          {"peak_time_error_s", e.peak_time_error_s},
          {"residual_level_error_n", e.residual_level_error_n},
          {"max_abs_n", e.max_abs_n},
          {"ljung_box_p", e.ljung_box_p}};
}

Json recordJson(const RecordCurves& c) {
  Json findings = Json::array();
  for (const Finding& f : c.report.findings) {
    findings.push_back(
        {{"severity", severityName(f.severity)}, {"code", f.code}, {"text", f.text}, {"remedy", f.remedy}});
  }
  return {{"path", c.path},
          {"title", c.record.title},
          {"source", sourceName(c.record.source)},
          {"position", c.record.position == PositionOrigin::kMeasured ? "measured" : "commanded"},
          {"duration_s", c.report.duration_s},
          {"peak_force_n", c.report.peak_force_n},
          {"peak_time_s", c.report.peak_time_s},
          {"noise_sigma_n", c.report.noise_sigma_n},
          {"findings", findings},
          {"assumptions", c.record.assumptions}};
}

Json seriesJson(const RecordCurves& c) {
  const Observation& o = c.observation;
  Json series = {{"time_s", toJson(o.time_s)},         {"way_m", toJson(o.way_m)},
                 {"measured_n", toJson(o.force_n)},    {"baseline_n", toJson(c.baseline_n)},
                 {"refitted_n", toJson(c.refitted_n)}, {"with_effect_n", nullptr}};
  if (c.with_effect_n.size() > 0) series["with_effect_n"] = toJson(c.with_effect_n);
  const double noise = std::hypot(o.noise.white_n, o.noise.slow_n);
  series["noise_sigma_n"] = toJson(Eigen::VectorXd::Constant(o.time_s.size(), noise));
  series["total_sigma_n"] = toJson(c.total_sigma_n);
  return series;
}

Json errorsJson(const RecordCurves& c) {
  Json errors = {{"before", toJson(c.before)}, {"baseline_refitted", toJson(c.refitted)}, {"after", nullptr}};
  if (c.with_effect_n.size() > 0) errors["after"] = toJson(c.after);
  return errors;
}

Json rankingJson(const Identification& id) {
  Json ranking = Json::array();
  for (const Explanation& e : id.ranking) {
    Json parameters = Json::array(), changes = Json::array();
    for (const ParameterEstimate& p : e.parameters) {
      parameters.push_back({{"key", p.key},
                            {"unit", p.unit},
                            {"value", p.value},
                            {"low", p.low},
                            {"high", p.high},
                            {"prior_low", p.prior_low},
                            {"prior_high", p.prior_high}});
    }
    for (std::size_t k = 0; k < e.baseline.size() && k < id.baseline.size(); ++k) {
      const BaselineParameter& p = id.baseline[k];
      changes.push_back({{"key", p.key}, {"unit", p.unit}, {"from", p.fitted}, {"to", e.baseline[k]}});
    }
    std::string name;
    for (const std::string& effect : e.effects) name += (name.empty() ? "" : " + ") + effect;
    ranking.push_back({{"effects", e.effects},
                       {"name", name},
                       {"shape", e.shape},
                       {"log_bayes_factor", e.log_bayes_factor},
                       {"threshold", e.threshold},
                       {"explained_ratio", e.explained_ratio},
                       {"chi2_per_bin", e.chi2_per_bin},
                       {"portmanteau_p", e.portmanteau_p},
                       {"detectability", e.detectability},
                       {"confirmed", e.confirmed},
                       {"rmse_n", e.rmse_n},
                       {"error_ratio", e.error_ratio},
                       {"holdout_rmse_n", e.holdout_rmse_n},
                       {"holdout_ratio", e.holdout_ratio},
                       {"holdout_log_ratio", e.holdout_log_ratio},
                       {"holdout_way_log_ratio", e.holdout_way_log_ratio},
                       {"evidence_of_both", e.evidence_of_both},
                       {"parameters", parameters},
                       {"baseline_change", changes},
                       {"note", e.note}});
  }
  return ranking;
}

}  // namespace

std::string toJson(const Identification& id, const Thresholds& t) {
  const Discrepancy& d = id.discrepancy;
  Json further = Json::array();
  for (std::size_t i = 1; i < id.records.size(); ++i) further.push_back(recordJson(id.records[i]));
  Json baseline = Json::array(), detectable = Json::array(), confusable = Json::array(), next = Json::array();
  for (const BaselineParameter& p : id.baseline) {
    baseline.push_back({{"key", p.key},
                        {"unit", p.unit},
                        {"prior", p.prior},
                        {"prior_sigma", p.prior_sigma},
                        {"fitted", p.fitted},
                        {"sigma", p.sigma}});
  }
  for (const DetectableMagnitude& m : id.minimum_detectable) {
    detectable.push_back({{"name", m.effect},
                          {"key", m.key},
                          {"unit", m.unit},
                          {"value", m.value},
                          {"expected_detectability", m.expected_detectability}});
  }
  for (const ConfusableSet& s : id.confusable) {
    confusable.push_back({{"names", s.effects}, {"correlation", s.correlation}, {"how_to_tell", s.how_to_tell}});
  }
  for (const NextExperiment& n : id.next_experiment) next.push_back({{"text", n.text}, {"separates", n.separates}});
  const RecordCurves& first = id.records.front();
  Json lags = Json::array();
  for (std::size_t k = 0; k < id.autocorrelation_before.size(); ++k) lags.push_back(kBinS * static_cast<double>(k));
  const double band = 1.96 / std::sqrt(static_cast<double>(std::max<std::size_t>(id.bins, 1)));
  Json json = {{"program", std::string("brash_ice ") + kVersion},
               {"record", recordJson(first)},
               {"further_records", further},
               {"holdout_record", nullptr},
               {"verdict", verdictName(id.verdict)},
               {"effects", id.effects},
               {"summary", id.summary},
               {"significance",
                {{"chi2_per_bin", id.chi2_per_bin},
                 {"threshold_chi2_per_bin", t.chi2_per_bin},
                 {"portmanteau_p", id.portmanteau_p},
                 {"bins", id.bins},
                 {"significant", id.significant}}},
               {"ranking", rankingJson(id)},
               {"baseline", baseline}};
  json.update(errorsJson(first));
  json["holdout"] = nullptr;
  json["minimum_detectable"] = detectable;
  json["confusable"] = confusable;
  json["next_experiment"] = next;
  json["kappa"] = id.kappa;
  json["thresholds"] = {{"log_bayes_factor", t.log_bayes_factor},
                        {"chi2_per_bin", t.chi2_per_bin},
                        {"portmanteau_p", t.portmanteau_p},
                        {"explained_ratio", t.explained_ratio},
                        {"holdout_log_ratio", t.holdout_log_ratio},
                        {"error_ratio", t.error_ratio},
                        {"rival_nats", t.rival_nats},
                        {"rival_share", t.rival_share},
                        {"rival_correlation", t.rival_correlation},
                        {"second_effect", t.second_effect},
                        {"detectability", t.detectability},
                        {"null_records", t.null_records},
                        {"file", "src/identify/thresholds.cpp"}};
  for (const auto& [name, value] : t.own) json["thresholds"]["own." + name] = value;
  json["noise"] = {{"white_n", first.observation.noise.white_n}, {"slow_n", first.observation.noise.slow_n}};
  json["discrepancy"] = {{"from_references", d.fromReferences()},
                         {"references", d.ice.size()},
                         {"share", d.share},
                         {"share_of_peak", d.share_of_peak},
                         {"length_m", d.length_m},
                         {"rough_share", d.rough_share},
                         {"rough_length_m", d.rough_length_m},
                         {"turn_share", d.turn_share},
                         {"turn_length_m", d.turn_length_m},
                         {"form_share", d.form_share},
                         {"form_length_m", d.form_length_m},
                         {"timing_length_m", d.timing_length_m},
                         {"rest_share", d.rest_share},
                         {"rest_length_m", d.rest_length_m},
                         {"creep_mps", d.creep_mps},
                         {"ice_factor", id.ice_factor}};
  json["runs"] = {{"needed", id.runs_needed}, {"made", id.runs_made}, {"wall_s", id.wall_s}};
  json["series"] = seriesJson(first);
  json["holdout_series"] = nullptr;
  if (!id.holdout.empty()) {
    json["holdout_record"] = recordJson(id.holdout.front());
    json["holdout"] = errorsJson(id.holdout.front());
    json["holdout_series"] = seriesJson(id.holdout.front());
  }
  json["whitened_before"] = toJson(id.whitened_before);
  json["autocorrelation"] = {
      {"lag_s", lags}, {"before", id.autocorrelation_before}, {"after", nullptr}, {"band", band}};
  if (!id.autocorrelation_after.empty()) json["autocorrelation"]["after"] = id.autocorrelation_after;
  return json.dump(1) + "\n";
}

namespace {

/// What all processes that share an identification must have in common.
std::string workOf(const IdentifyOptions& options, const std::string& simulator) {
  std::string work = "identify";
  const auto add = [&work](const char* what, const NamedRecord& record) {
    work += std::string(" ") + what + std::filesystem::absolute(record.path).lexically_normal().string();
  };
  for (const NamedRecord& record : options.input.records) add("", record);
  for (const NamedRecord& record : options.input.references) add("reference ", record);
  if (options.input.holdout) add("holdout ", *options.input.holdout);
  if (options.input.screen_only) work += " screen";
  return work + ", " + programStamp("/proc/self/exe") + programStamp(simulator);
}

void writeResults(const IdentifyOptions& options, const std::string& directory, const Identification& result,
                  const Thresholds& thresholds, Claims& claims) {
  replaceFile(directory + "/overlay.yaml", "# Verdict: " + std::string(verdictName(result.verdict)) +
                                               ". What makes the model of this record out of the default scenario.\n" +
                                               (result.overlay.empty() ? "{}\n" : result.overlay));
  replaceFile(directory + "/report.json", toJson(result, thresholds));
  for (const std::string& sentence : result.summary) std::printf("%s\n", sentence.c_str());
  for (const NextExperiment& next : result.next_experiment) std::printf("Measure next: %s.\n", next.text.c_str());
  std::printf("%s/report.json\n%s/overlay.yaml\n", directory.c_str(), directory.c_str());
  std::fflush(stdout);
  const auto stop = [&] {
    claims.renew();
    return options.stop && options.stop();
  };
  if (options.report && makeReport("identify_report", directory, stop)) {
    std::printf("%s/report.html\n", directory.c_str());
  }
}

}  // namespace

bool runIdentify(const IdentifyOptions& options) {
  const LaunchedTogether together = launchedTogether();
  RunPoolOptions pool;
  pool.stop = options.stop;
  pool.shared = options.shared || together.size > 1;
  pool.lease_s = options.lease_s;
  pool.children = options.children;
  if (pool.children == 0) pool.children = together.size > 1 ? 1 : coreCount();
  if (!options.simulator.empty()) pool.program = std::filesystem::absolute(options.simulator).string();
  makeDirectory(options.directory);
  const std::string directory = std::filesystem::absolute(options.directory).lexically_normal().string();
  const auto tidyUp = [&] {
    // They belong to another record or program; without them, nobody takes them for those of this one.
    for (const char* name : {"/report.json", "/report.html", "/overlay.yaml"}) removeFile(directory + name);
  };
  std::optional<DirectoryLock> lock;
  if (pool.shared) {
    lock.emplace(directory, workOf(options, pool.program), tidyUp);
  } else {
    lock.emplace(directory);
    tidyUp();
  }
  Identification result;
  const Thresholds thresholds = identificationThresholds();
  try {
    RunLibrary runs(options.cache.empty() ? directory + "/runs" : options.cache, pool);
    result = identify(options.input, runs, thresholds, Discrepancy());
  } catch (const Interrupted&) {
    std::fprintf(stderr, "interrupted; the same command goes on where it was\n");
    return false;
  }
  // All have come to the same; one writes it. Should it die before its last file stands, the next one does.
  Claims claims(pool.lease_s);
  const auto stands = [&] { return pool.shared && std::filesystem::exists(directory + "/report.json"); };
  while (!stands() && claims.claim(directory) == Claims::Answer::kBusy) {
    if (options.stop && options.stop()) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  if (!stands()) writeResults(options, directory, result, thresholds, claims);
  return true;
}

}  // namespace brash_ice_rig
