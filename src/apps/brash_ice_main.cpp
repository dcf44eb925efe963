// brash_ice: runs pull-up scenarios and studies, and checks them and measured records, without ROS.

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include <CLI/CLI.hpp>

#include "brash_ice_rig/config/input_file.h"
#include "brash_ice_rig/config/number_check.h"
#include "brash_ice_rig/config/scenario_reader.h"
#include "brash_ice_rig/identify/identification.h"
#include "brash_ice_rig/identify/record.h"
#include "brash_ice_rig/identify/record_check.h"
#include "brash_ice_rig/identify/replay.h"
#include "brash_ice_rig/node/split_list.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/output/progress_line.h"
#include "brash_ice_rig/output/record_writer.h"
#include "brash_ice_rig/output/run_files.h"
#include "brash_ice_rig/rig/crane_motion.h"
#include "brash_ice_rig/rig/rig_commands.h"
#include "brash_ice_rig/simulation/simulation.h"
#include "brash_ice_rig/simulation/waiting_threads.h"
#include "brash_ice_rig/study/study.h"
#include "brash_ice_rig/study/study_file.h"
#include "brash_ice_rig/system/child_process.h"
#include "brash_ice_rig/version.h"

namespace brash_ice_rig {
namespace {

// Scripts rely on these.
constexpr int kExitDone = 0;
constexpr int kExitRunFailed = 1;
constexpr int kExitBadInput = 2;

volatile std::sig_atomic_t stop_requested = 0;

void requestStop(int) {
  stop_requested = 1;
}

using WallClock = std::chrono::steady_clock;

double secondsSince(WallClock::time_point start) {
  return std::chrono::duration<double>(WallClock::now() - start).count();
}

/// Simulated time that the script will take, settling included, s. An estimate: it leaves out the crane's ramps.
double expectedDuration(const Scenario& scenario) {
  const ProcedureConfig& procedure = scenario.procedure;
  if (procedure.control == ControlMode::kManual) {
    return procedure.timeBeforeZero() + readCommands(procedure.commands_file).back().time_s;
  }
  const double lift_s =
      procedure.motion_file.empty() ? procedure.lift_duration_s : CraneMotion::read(procedure.motion_file).duration();
  double duration_s = procedure.timeBeforeZero() + lift_s + procedure.hold_duration_s;
  if (procedure.start == StartPose::kFoldedAboveIce) {
    const double way_m = startHubHeight(scenario) - lowestHubHeight(scenario);
    duration_s += way_m / procedure.lower_speed_mps;
    duration_s += scenario.collector.unfold_duration_s;
  }
  return duration_s;
}

/// Tells on stderr how far the run is: a bar on a terminal; otherwise a line every 2 s and at each change of stage.
class Progress {
 public:
  explicit Progress(const Scenario& scenario)
      : before_zero_s_(scenario.procedure.timeBeforeZero()), total_s_(expectedDuration(scenario)) {}

  void show(const Snapshot& snapshot) {
    const double wall_s = secondsSince(start_);
    if (snapshot.stage == shown_stage_ && wall_s - shown_wall_s_ < (line_.onTerminal() ? 0.1 : 2.0)) return;
    shown_wall_s_ = wall_s;
    shown_stage_ = snapshot.stage;
    char text[128];
    std::snprintf(text, sizeof text, "%-7s t %7.2f s   hub %+6.2f m   force %8.0f N", stageName(snapshot.stage),
                  snapshot.time_s, snapshot.rig.hoist_position_m, snapshot.force_n);
    line_.show(line_.onTerminal() ? text + ("   " + bar(snapshot.time_s, wall_s)) : text);
  }

  void end() { line_.end(); }

 private:
  std::string bar(double time_s, double wall_s) const {
    const double done = std::clamp((time_s + before_zero_s_) / total_s_, 0.0, 1.0);
    // The first moments say little about the rest.
    return progressBar(done, done < 0.01 ? -1.0 : wall_s * (1.0 - done) / done);
  }

  ProgressLine line_;
  double before_zero_s_, total_s_;
  WallClock::time_point start_ = WallClock::now();
  double shown_wall_s_ = -std::numeric_limits<double>::infinity();
  Stage shown_stage_ = Stage::kSettle;
};

/// Whether standard input is a pipe whose other end is closed.
bool stdinIsClosed() {
  pollfd input{STDIN_FILENO, 0, 0};
  return poll(&input, 1, 0) > 0 && (input.revents & (POLLHUP | POLLERR)) != 0;
}

void handleStopSignals() {
  std::signal(SIGINT, requestStop);
  std::signal(SIGTERM, requestStop);
}

struct RunOptions {
  ScenarioSources sources;
  std::string resumed;              ///< a checkpoint to go on from; empty: from the start of the scenario
  std::optional<int> threads;       ///< instead of those of the checkpoint
  std::string directory;            ///< for the results
  double checkpoint_every_s = 0.0;  ///< simulated time; 0: never
  bool stop_with_stdin = false;     ///< stop when it is closed
  std::string record;               ///< where the run is left as a record, too; empty: nowhere
};

/// @param observe  called with each sample
int run(
    const RunOptions& options, const std::function<void(const Snapshot&)>& observe = [](const Snapshot&) {}) {
  std::optional<CheckpointReader> resumed;
  if (!options.resumed.empty()) resumed.emplace(options.resumed);
  const Scenario scenario = resumed ? resumed->scenario() : loadScenario(options.sources);
  if (scenario.procedure.control == ControlMode::kManual && scenario.procedure.commands_file.empty()) {
    throw ConfigError("procedure.control", "manual",
                      "has no end; `brash_ice run` needs scripted, or procedure.commands_file",
                      resumed ? options.resumed : options.sources.file);
  }
  Simulation simulation = resumed ? Simulation::load(*resumed, options.threads) : Simulation(scenario);
  std::optional<RecordWriter> recorder;
  if (!options.record.empty()) recorder.emplace(simulation, options.record);
  RunFiles files(simulation, options.directory, resumed ? &*resumed : nullptr);
  handleStopSignals();
  Progress progress(scenario);
  double compute_s = 0.0;
  const auto saveCheckpoint = [&] {
    CheckpointWriter file(files.checkpointPath(), simulation.scenario());
    simulation.save(file);
    files.save(file, compute_s);
    file.commit();
  };
  const double half_sample_s = 0.5 * simulation.samplePeriod();
  const auto nextCheckpoint = [&] {
    return nextMultiple(options.checkpoint_every_s, simulation.snapshot().time_s + half_sample_s);
  };
  const bool saves = options.checkpoint_every_s > 0.0;
  double checkpoint_due_s = saves ? nextCheckpoint() : 0.0;
  const bool watch_stdin = options.stop_with_stdin;
  while (!simulation.finished() && stop_requested == 0 && !(watch_stdin && stdinIsClosed())) {
    const auto before = WallClock::now();
    const StepReport report = simulation.advance(simulation.samplePeriod());
    compute_s += secondsSince(before);
    const Snapshot snapshot = simulation.snapshot();
    files.write(simulation, snapshot, report.flags);
    if (recorder) recorder->write(snapshot, report);
    observe(snapshot);
    progress.show(snapshot);
    if (saves && !simulation.frozen() && snapshot.time_s > checkpoint_due_s - half_sample_s) {
      saveCheckpoint();
      checkpoint_due_s = nextCheckpoint();
    }
  }
  progress.end();
  const bool interrupted = !simulation.finished();
  if (saves && interrupted) saveCheckpoint();
  files.finish(simulation, compute_s, interrupted);
  if (recorder) {
    recorder->finish(simulation);
    std::printf("%s\n%s\n", recorder->csvPath().c_str(), recorder->manifestPath().c_str());
  }
  return interrupted || simulation.frozen() ? kExitRunFailed : kExitDone;
}

int study(StudyOptions options) {
  handleStopSignals();
  options.stop = [] { return stop_requested != 0; };
  return runStudy(options) ? kExitDone : kExitRunFailed;
}

bool isBag(const std::string& file) {
  return fileBeginsWith(file, "#ROSBAG V2.0");
}

/// A record with the files that it names.
struct OwnedRecord {
  Record record;
  std::shared_ptr<const std::string> directory;  ///< removed with the last copy; empty: the files are the user's
};

/// A bag becomes a record by the script bag_to_record, which lies beside this program: only that script knows ROS.
/// @throws ConfigError with what the script says
OwnedRecord readBag(const std::string& file) {
  std::string directory = (std::filesystem::temp_directory_path() / "brash_ice_XXXXXX").string();
  if (mkdtemp(directory.data()) == nullptr) throw std::runtime_error(directory + ": " + std::strerror(errno));
  const std::shared_ptr<const std::string> lifetime(new std::string(directory), [](const std::string* path) {
    std::error_code ignored;
    std::filesystem::remove_all(*path, ignored);
    delete path;
  });

  ChildSetup setup;
  setup.program = programBesideThis("bag_to_record");
  setup.log_file = directory + "/log";
  setup.arguments = {file, "--out", directory + "/" + std::filesystem::path(file).stem().string()};
  constexpr std::chrono::minutes kTimeout{10};
  std::string reason;
  try {
    const std::optional<ChildEnd> end = ChildProcess(setup).wait(kTimeout, [] { return stop_requested != 0; });
    if (end && end->success()) return {readRecord(directory), lifetime};
    reason = textOfFileIfThere(setup.log_file);
    while (!reason.empty() && reason.back() == '\n') reason.pop_back();
    if (reason.empty()) reason = setup.program + ": " + (end ? end->text() : "stopped before its end");
  } catch (const std::system_error& error) {
    reason = error.what();
  }
  throw ConfigError("", "", "this bag could not be made a record: " + reason, file);
}

/// @throws ConfigError
OwnedRecord readRecordOrBag(const std::string& file) {
  return isBag(file) ? readBag(file) : OwnedRecord{readRecord(file), nullptr};
}

struct ReplayOptions {
  std::string record;       ///< CSV, manifest, directory or bag
  ScenarioSources changes;  ///< over the record's scenario
  std::string directory;    ///< for the results
  bool prepare_only = false;
};

int replay(const ReplayOptions& options) {
  if (options.record.empty()) {
    throw ConfigError("", "",
                      "names no record: its CSV, manifest, directory or bag is needed (replay.launch record:=FILE)",
                      "replay");
  }
  const OwnedRecord owned = readRecordOrBag(options.record);
  const Replay replay = prepareReplay(owned.record, options.changes, options.directory);
  std::printf("%s: %s\n", options.record.c_str(),
              replay.exact ? "a run of this simulation: its commands are repeated"
                           : "the hoist follows the record's hoist_position_m");
  for (const std::string& remark : replay.remarks) std::printf("  %s\n", remark.c_str());
  std::printf("%s\n%s\n", replay.scenario_file.c_str(), replay.measured_file.c_str());
  std::fflush(stdout);
  if (options.prepare_only) return kExitDone;
  std::vector<double> time_s, force_n;
  RunOptions run_options;
  run_options.sources.file = replay.scenario_file;
  run_options.directory = options.directory;
  const int code = run(run_options, [&](const Snapshot& snapshot) {
    time_s.push_back(snapshot.time_s);
    force_n.push_back(snapshot.force_n);
  });
  const ReplayComparison comparison = compareForces(replay, time_s, force_n);
  std::printf("measured and simulated force: %zu samples, rms difference %.6g N, %zu identical to the last bit\n",
              comparison.samples, comparison.rms_n, comparison.identical);
  return code;
}

/// Reads a file and says on stdout what it is worth.
/// @return whether it can be used
/// @throws ConfigError
bool checkFile(const std::string& file) {
  if (isCheckpoint(file)) {
    const Simulation simulation = Simulation::load(file);
    std::printf("%s: ok, a checkpoint at %.2f s of \"%s\"\n", file.c_str(), simulation.snapshot().time_s,
                simulation.scenario().title.c_str());
    return true;
  }
  if (isBag(file) || isRecord(file)) {
    const OwnedRecord owned = readRecordOrBag(file);
    const Record& record = owned.record;
    const RecordReport report = checkRecord(record);
    std::printf("%s", describe(file, record, report).c_str());
    return report.usability() != Usability::kNo;
  }
  if (isStudyFile(file)) {
    readStudy(file);
  } else {
    ScenarioSources sources;
    sources.file = file;
    loadScenario(sources);
  }
  std::printf("%s: ok\n", file.c_str());
  return true;
}

int check(const std::vector<std::string>& files) {
  int code = kExitDone;
  for (const std::string& file : files) {
    try {
      if (!checkFile(file)) code = kExitBadInput;
    } catch (const ConfigError& error) {
      std::fprintf(stderr, "%s\n", error.what());
      code = kExitBadInput;
    }
  }
  return code;
}

int identify(IdentifyOptions options, const std::vector<std::string>& records, const std::string& holdout,
             const std::vector<std::string>& references) {
  std::vector<OwnedRecord> owned;  // what was unpacked from bags has to stay until the end
  const auto named = [&](const std::string& file) -> NamedRecord {
    owned.push_back(readRecordOrBag(file));
    return {file, owned.back().record};
  };
  for (const std::string& file : records) options.input.records.push_back(named(file));
  if (!holdout.empty()) options.input.holdout = named(holdout);
  for (const std::string& file : references) options.input.references.push_back(named(file));
  handleStopSignals();
  options.stop = [] { return stop_requested != 0; };
  return runIdentify(options) ? kExitDone : kExitRunFailed;
}

void addSharing(CLI::App& command, bool& shared, double& lease_s) {
  command.add_flag("--share", shared,
                   "Let the same command, started on other computers, take a share (under mpirun always; the "
                   "directory must be one that all see)");
  command
      .add_option("--lease", lease_s,
                  "A process of which nothing has been seen for so long is taken for dead, and others make its runs "
                  "again (default: 30)")
      ->check(CLI::Range(3.0, 3600.0))
      ->type_name("SECONDS");
}

int runProgram(int argc, char** argv) {
  CLI::App app("Brash-ice pull-up rig: simulates the test that a scenario describes, or a study of many.", "brash_ice");
  app.require_subcommand(1);
  app.add_flag_callback(
      "--version",
      [] {
        std::printf("brash_ice %s\n", kVersion);
        throw CLI::Success();
      },
      "Print the version and exit");
  app.footer("Exit codes: 0 done, 1 run failed or interrupted, 2 bad input.");

  RunOptions run_options;
  ScenarioSources& sources = run_options.sources;
  std::string& directory = run_options.directory;
  std::string threads, vtk_interval_s, checkpoint_every_s;
  CLI::App* run_command = app.add_subcommand("run", "Run a scenario; leave force.csv, scenario.yaml and summary.json");
  CLI::Option* scenario_option =
      run_command->add_option("scenario", sources.file, "Scenario YAML")->type_name("SCENARIO");
  CLI::Option* set_option =
      run_command->add_option("--set", sources.settings, "Change one key; may be given many times")
          ->allow_extra_args(false)  // one value per --set, so that SCENARIO may follow
          ->type_name("SECTION.KEY=VALUE");
  CLI::Option* overlay_option =
      run_command->add_option("--overlay", sources.overlays, "YAML with changed keys; may be given many times")
          ->allow_extra_args(false)
          ->type_name("FILE");
  run_command->add_option("--out", directory, "Directory for the results (default: name of the scenario + _run)")
      ->type_name("DIR");
  run_command->add_option("--threads", threads, "The same as --set solver.threads=N")->type_name("N");
  CLI::Option* vtk_option =
      run_command->add_option("--vtk", vtk_interval_s, "The same as --set output.vtk_interval_s=SECONDS")
          ->type_name("SECONDS");
  run_command
      ->add_option("--checkpoint-every", checkpoint_every_s,
                   "Save all that a later --resume needs as checkpoint.bin, each time that so much simulated time has "
                   "passed and when the run is interrupted")
      ->type_name("SECONDS");
  run_command
      ->add_option("--record", run_options.record,
                   "Leave the run as a record, too, which `brash_ice replay` repeats: its name, or a directory for it")
      ->type_name("NAME");
  run_command
      ->add_option("--resume", run_options.resumed,
                   "Go on from a checkpoint as if the run had never stopped (default of --out: where it lies)")
      ->excludes(scenario_option)
      ->excludes(set_option)
      ->excludes(overlay_option)
      ->excludes(vtk_option)
      ->excludes("--record")  // of which the beginning would lack
      ->type_name("CHECKPOINT");
  run_command->add_flag("--stop-when-stdin-closes", run_options.stop_with_stdin,
                        "Stop when standard input, a pipe, is closed: whoever started the run has ended");

  ReplayOptions replay_options;
  CLI::App* replay_command = app.add_subcommand(
      "replay", "Move the crane as a record tells, and compare the force; leave what `run` leaves, and measured.csv");
  replay_command->add_option("record", replay_options.record, "Record: its CSV, manifest, directory or bag")
      ->required()
      ->type_name("RECORD");
  replay_command->add_option("--set", replay_options.changes.settings, "Change one key of the record's scenario")
      ->allow_extra_args(false)
      ->type_name("SECTION.KEY=VALUE");
  replay_command->add_option("--overlay", replay_options.changes.overlays, "YAML with changed keys, e.g. an effect")
      ->allow_extra_args(false)
      ->type_name("FILE");
  replay_command
      ->add_option("--out", replay_options.directory,
                   "Directory for the results (default: name of the record + _replay)")
      ->type_name("DIR");
  std::string overlay_list, setting_list;
  replay_command->add_option("--overlays", overlay_list, "The same as --overlay, ; between several")->type_name("LIST");
  replay_command->add_option("--settings", setting_list, "The same as --set, ; between several")->type_name("LIST");
  replay_command->add_flag("--prepare-only", replay_options.prepare_only,
                           "Leave replay.yaml, a scenario, and measured.csv, and do not run it");

  StudyOptions study_options;
  CLI::App* study_command = app.add_subcommand(
      "study", "Make the many runs of a study, or those that are missing; leave results.csv and report.html");
  study_command->add_option("study", study_options.file, "Study YAML")->required()->type_name("STUDY");
  study_command
      ->add_option("--out", study_options.directory, "Directory for the results (default: name of the study + _study)")
      ->type_name("DIR");
  study_command
      ->add_option("--jobs", study_options.children,
                   "Runs at a time (default: as many as the cores carry; under mpirun one in each process)")
      ->check(CLI::Range(1, 1024))
      ->type_name("N");
  addSharing(*study_command, study_options.shared, study_options.lease_s);
  study_command->add_flag("!--no-report", study_options.report, "Leave out report.html");
  study_command->add_flag("--repeat-failed", study_options.repeat_failed,
                          "Repeat the runs that ended with a non-finite state, too");

  IdentifyOptions identify_options;
  std::vector<std::string> records, references;
  std::string holdout;
  CLI::App* identify_command = app.add_subcommand(
      "identify", "Find out what the model lacks from measured records; leave report.html, report.json, overlay.yaml");
  identify_command
      ->add_option("records", records,
                   "Measured records of the same ice, fitted together: CSV, manifest, directory or bag")
      ->required()
      ->type_name("RECORD");
  identify_command
      ->add_option("--holdout", holdout, "Another record, that is not fitted: whatever is found has to hold on it")
      ->type_name("RECORD");
  identify_command
      ->add_option(
          "--reference", references,
          "Lifts of this rig that lack nothing: they teach how far the simulator is off; may be given many times")
      ->allow_extra_args(false)
      ->type_name("RECORD");
  identify_command
      ->add_option("--out", identify_options.directory,
                   "Directory for the results (default: name of the record + _identify)")
      ->type_name("DIR");
  identify_command
      ->add_option("--cache", identify_options.cache,
                   "Directory for the simulations, may be shared by many records (default: DIR/runs)")
      ->type_name("DIR");
  identify_command
      ->add_option("--jobs", identify_options.children,
                   "Simulations at a time (default: one per core; under mpirun one in each process)")
      ->check(CLI::Range(1, 1024))
      ->type_name("N");
  identify_command
      ->add_option(
          "--simulator", identify_options.simulator,
          "The brash_ice that makes the simulations, such as the one that filled the cache (default: this one)")
      ->check(CLI::ExistingFile)
      ->type_name("PROGRAM");
  identify_command->add_flag("--screen", identify_options.input.screen_only,
                             "A quick look: rank by what each effect does to the baseline, confirm nothing");
  addSharing(*identify_command, identify_options.shared, identify_options.lease_s);
  identify_command->add_flag("!--no-report", identify_options.report, "Leave out report.html");

  std::vector<std::string> files;
  CLI::App* check_command = app.add_subcommand(
      "check", "Validate scenarios, overlays, studies, records and checkpoints without running them");
  check_command
      ->add_option("files", files,
                   "Scenario, overlay or study YAML; record: its CSV, manifest, directory or bag; checkpoint")
      ->required()
      ->type_name("FILE");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitDone : kExitBadInput;
  }
  if (check_command->parsed()) return check(files);
  const auto nameOf = [](const std::string& file) { return std::filesystem::path(file).stem().string(); };
  if (study_command->parsed()) {
    if (study_options.directory.empty()) study_options.directory = nameOf(study_options.file) + "_study";
    return study(study_options);
  }

  if (identify_command->parsed()) {
    if (identify_options.directory.empty()) {
      identify_options.directory = nameOf(records.front()) + "_identify";
    }
    return identify(identify_options, records, holdout, references);
  }
  if (replay_command->parsed()) {
    for (const std::string& file : splitList(overlay_list)) replay_options.changes.overlays.push_back(file);
    for (const std::string& setting : splitList(setting_list)) replay_options.changes.settings.push_back(setting);
    if (replay_options.directory.empty()) replay_options.directory = nameOf(replay_options.record) + "_replay";
    return replay(replay_options);
  }

  if (sources.file.empty() == run_options.resumed.empty()) {
    std::fprintf(stderr, "run: SCENARIO or --resume CHECKPOINT is required\n");
    return kExitBadInput;
  }
  if (!threads.empty()) sources.settings.push_back("solver.threads=" + threads);
  if (!checkpoint_every_s.empty()) {
    constexpr const char* kOption = "--checkpoint-every";
    run_options.checkpoint_every_s = numberFromText(kOption, checkpoint_every_s, "");
    checkRange(kOption, run_options.checkpoint_every_s, checkpoint_every_s, {0.01, 86400.0}, "");
  }
  if (!vtk_interval_s.empty()) sources.settings.push_back("output.vtk_interval_s=" + vtk_interval_s);
  if (!run_options.resumed.empty()) {
    // The same check as of the key.
    if (!threads.empty()) run_options.threads = loadScenario({"", {}, sources.settings}).solver.threads;
    if (directory.empty()) directory = std::filesystem::path(run_options.resumed).parent_path().string();
    if (directory.empty()) directory = ".";
  }
  if (directory.empty()) directory = nameOf(sources.file) + "_run";
  return run(run_options);
}

/// A file that is opened while a standard stream is closed takes its place, and progress lines end up in force.csv.
void occupyClosedStreams() {
  int descriptor = open("/dev/null", O_RDWR);
  while (descriptor >= 0 && descriptor <= STDERR_FILENO) descriptor = dup(descriptor);
  if (descriptor >= 0) close(descriptor);
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  using namespace brash_ice_rig;
  occupyClosedStreams();
  letWaitingThreadsSleep(argv);
  try {
    return runProgram(argc, argv);
  } catch (const ConfigError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return kExitBadInput;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "run failed: %s\n", error.what());
    return kExitRunFailed;
  }
}
