#include "brash_ice_rig/node/rig_node.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include <rosgraph_msgs/Clock.h>
#include <std_msgs/String.h>

#include "brash_ice_rig/node/rig_markers.h"
#include "brash_ice_rig/node/rig_urdf.h"
#include "brash_ice_rig/node/topic_names.h"
#include "brash_ice_rig/output/output_file.h"
#include "brash_ice_rig/system/child_process.h"
#include "brash_ice_rig/version.h"

namespace brash_ice_rig {
namespace {

constexpr double kFirstStampS = 1.0;    // ROS takes time 0 for "no clock yet"
constexpr double kIdleCreepS = 1.0e-6;  // see publishIdleFrame()
constexpr double kLongestStepS = 3600.0;
constexpr double kCommandLogIntervalS = 2.0;
constexpr std::chrono::seconds kOverloadLogInterval{30};
constexpr char kNodeSection[] = "node";              // of a checkpoint
constexpr std::chrono::seconds kCommanderMemory{1};  // wall time for which a sender of commands counts as active

bool isFinite(const geometry_msgs::Vector3& vector) {
  return std::isfinite(vector.x) && std::isfinite(vector.y) && std::isfinite(vector.z);
}

/// True for every n-th sample, where n makes the rate nearest to the one asked for.
bool isDue(std::uint64_t sample, double sample_period_s, double rate_hz) {
  const auto every = static_cast<std::uint64_t>(std::max(1.0, std::round(1.0 / (rate_hz * sample_period_s))));
  return sample % every == 0;
}

double secondsBetween(std::chrono::steady_clock::time_point from, std::chrono::steady_clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

/// Draws the force-time plot of a finished run with the program plot_force that lies beside this one and that prints
/// the picture's path on stdout. Takes seconds. A plot that fails is reported on stderr and does no harm.
void plotRun(const std::string& directory) {
  constexpr std::chrono::seconds kTimeout{60};
  ChildSetup setup;
  setup.program = programBesideThis("plot_force");
  setup.arguments = {directory + "/force.csv"};
  setup.own_group = true;  // a Ctrl-C for the node does not end the plot of what the node has left
  std::string reason;
  try {
    ChildProcess plot(setup);
    const std::optional<ChildEnd> end = plot.wait(kTimeout);
    if (end && end->success()) return;
    reason = setup.program + " " + setup.arguments[0] + ": " + (end ? end->text() : "not done within 60 s");
  } catch (const std::system_error& error) {
    reason = error.what();
  }
  std::fprintf(stderr, "no force plot: %s\n", reason.c_str());
}

}  // namespace

RigNode::RigNode(const NodeOptions& options, const ros::NodeHandle& node, const ros::NodeHandle& private_node)
    : options_(options),
      scenario_(loadScenario(options.sources)),
      simulation_(std::make_unique<Simulation>(scenario_)),
      pacer_(options.live.real_time_factor),
      paused_(options.start_paused),
      node_(node),
      private_node_(private_node) {
  adoptScenario();
  clock_offset_s_ = kFirstStampS - simulation_->snapshot().time_s;
  startRun();

  if (options_.publish_clock) clock_publisher_ = node_.advertise<rosgraph_msgs::Clock>(topics::kClock, 10);
  // 10 s of samples: at a high real-time factor a recorder that stalls for a moment still gets each of them.
  wrench_publisher_ = node_.advertise<geometry_msgs::WrenchStamped>(topics::kWrench, 1000);
  true_wrench_publisher_ = node_.advertise<geometry_msgs::WrenchStamped>(topics::kTrueWrench, 1000);
  components_publisher_ = node_.advertise<ForceComponents>(topics::kForceComponents, 1000);
  points_publisher_ = node_.advertise<sensor_msgs::PointCloud2>(topics::kIcePoints, 2);
  plug_publisher_ = node_.advertise<PlugState>(topics::kPlugState, 10);
  command_out_publisher_ = node_.advertise<geometry_msgs::TwistStamped>(topics::kCraneCommandOut, 50);
  crane_publisher_ = node_.advertise<CraneState>(topics::kCraneState, 10);
  status_publisher_ = node_.advertise<SimStatus>(topics::kSimStatus, 10);
  joints_publisher_ = node_.advertise<sensor_msgs::JointState>(topics::kJointStates, 50);
  markers_publisher_ = node_.advertise<visualization_msgs::MarkerArray>(topics::kMarkers, 2);
  scenario_publisher_ = node_.advertise<std_msgs::String>(topics::kScenario, 1, true);
  publishScenario();
  // Latched: whoever joins before anything was told learns where the run began.
  commands_publisher_ = node_.advertise<TakenCommand>(topics::kCommands, 1000, true);
  publishRunStart();

  crane_subscriber_ = node_.subscribe<geometry_msgs::TwistStamped>(
      topics::kCraneCommand, 1,
      boost::function<void(const ros::MessageEvent<geometry_msgs::TwistStamped const>&)>(
          [this](const ros::MessageEvent<geometry_msgs::TwistStamped const>& event) { onCraneCommand(event); }));
  fold_subscriber_ = node_.subscribe<std_msgs::Float64>(
      topics::kFoldCommand, 1,
      boost::function<void(const ros::MessageEvent<std_msgs::Float64 const>&)>(
          [this](const ros::MessageEvent<std_msgs::Float64 const>& event) { onFoldCommand(event); }));
  pull_up_.emplace(node_, scenario_, options_.live.joints_rate_hz, rigForPullUp());

  advertiseTrigger(private_node_, services::kPause, [this] { return ask([this] { return pause(); }); });
  advertiseTrigger(private_node_, services::kResume, [this] { return ask([this] { return resume(); }); });
  advertiseTrigger(private_node_, services::kReset, [this] { return askForWorld([this] { return reset(); }); });
  advertiseTrigger(node_, services::kTare, [this] { return tare(); });
  services_.push_back(private_node_.advertiseService<Step::Request, Step::Response>(
      services::kStep,
      boost::function<bool(Step::Request&, Step::Response&)>([this](Step::Request& request, Step::Response& response) {
        const double duration_s = request.duration_s;
        const Answer answer = ask([this, duration_s] { return step(duration_s); });
        response.success = answer.success;
        response.message = answer.message;
        return true;
      })));

  advertiseCheckpoint(services::kSaveCheckpoint, [this](const std::string& path) { return saveCheckpoint(path); });
  advertiseCheckpoint(services::kLoadCheckpoint, [this](const std::string& path) {
    return askForWorld([this, path] { return loadCheckpoint(path); });
  });
  advertiseLoadScenario();
  reconfigure_.emplace(private_node_, liveSettings(), rigForReconfigure());

  addDiagnostics();
  if (options_.publish_clock) warnAboutForeignClock();
  bool use_sim_time = false;
  if (!ros::param::get("/use_sim_time", use_sim_time) || !use_sim_time) {
    ROS_WARN(
        "/use_sim_time is not set, but all stamps are simulation time: set it before starting other nodes, as "
        "pull_up.launch does");
  }
}

RigNode::~RigNode() = default;

// ----------------------------------------------------------------------------------------------- callback threads

void RigNode::advertiseTrigger(ros::NodeHandle& node, const char* name, std::function<Answer()> work) {
  using std_srvs::Trigger;
  services_.push_back(node.advertiseService<Trigger::Request, Trigger::Response>(
      name, boost::function<bool(Trigger::Request&, Trigger::Response&)>(
                [work = std::move(work)](Trigger::Request&, Trigger::Response& response) {
                  const Answer answer = work();
                  response.success = answer.success;
                  response.message = answer.message;
                  return true;
                })));
}

void RigNode::advertiseCheckpoint(const char* name, std::function<Answer(const std::string&)> work) {
  using Service = ::brash_ice_rig::Checkpoint;
  services_.push_back(private_node_.advertiseService<Service::Request, Service::Response>(
      name, boost::function<bool(Service::Request&, Service::Response&)>(
                [this, work = std::move(work)](Service::Request& request, Service::Response& response) {
                  const Answer answer = onCheckpointFile(request.file, work);
                  response.success = answer.success;
                  response.message = answer.message;
                  return true;
                })));
}

void RigNode::advertiseLoadScenario() {
  using Service = ::brash_ice_rig::LoadScenario;
  services_.push_back(private_node_.advertiseService<Service::Request, Service::Response>(
      services::kLoadScenario, boost::function<bool(Service::Request&, Service::Response&)>(
                                   [this](Service::Request& request, Service::Response& response) {
                                     const Answer answer =
                                         askForWorld([this, &request] { return loadScenarioFor(request); });
                                     response.success = answer.success;
                                     response.message = answer.message;
                                     return true;
                                   })));
}

RigNode::Answer RigNode::askForWorld(std::function<Answer()> work) {
  const Answer answer = ask(std::move(work));
  reconfigure_->refresh();
  return answer;
}

ReconfigureServer::Rig RigNode::rigForReconfigure() {
  ReconfigureServer::Rig rig;
  rig.present = [this] {
    std::optional<LiveSettings> present;
    ask([&] {
      present = liveSettings();
      return Answer{true, ""};
    });
    return present;
  };
  rig.change = [this](const LiveSettings& wanted) {
    ask([&] {
      changeLiveSettings(wanted);
      return Answer{true, ""};
    });
  };
  return rig;
}

RigNode::Answer RigNode::onCheckpointFile(const std::string& name,
                                          const std::function<Answer(const std::string&)>& work) {
  if (options_.checkpoint_dir.empty()) return {false, "the parameter ~checkpoint_dir does not say where"};
  const std::string file = name.empty() ? options_.checkpoint_file : name;
  if (!isPlainFileName(file)) {
    return {false, "file must be the plain name of a file in " + options_.checkpoint_dir +
                       ": no slash, no dot at the beginning, at most 200 characters"};
  }
  const std::string path = options_.checkpoint_dir + "/" + file;
  std::error_code no_file_yet;
  if (std::filesystem::is_symlink(path, no_file_yet))
    return {false, path + ": is a link; files elsewhere are not touched"};
  try {
    return work(path);
  } catch (const std::exception& error) {
    ROS_ERROR("%s", error.what());
    return {false, error.what()};
  }
}

/// The simulation goes on while the file is on its way to the disk.
RigNode::Answer RigNode::saveCheckpoint(const std::string& path) {
  std::optional<CheckpointWriter> file;
  double time_s = 0.0;
  const Answer answer = ask([&]() -> Answer {
    file.emplace(makeCheckpoint(path));
    time_s = simulation_->snapshot().time_s;
    return {true, ""};
  });
  if (!answer.success) return answer;
  const std::lock_guard<std::mutex> lock(commit_mutex_);
  file->commit();
  char text[64];
  std::snprintf(text, sizeof text, "saved time %.6g s as ", time_s);
  return {true, text + path};
}

RigNode::Answer RigNode::ask(std::function<Answer()> work) {
  std::future<Answer> answer;
  {
    const std::lock_guard<std::mutex> lock(request_mutex_);
    if (closed_) return {false, "the node is shutting down"};
    requests_.push_back({std::move(work), {}});
    answer = requests_.back().answer.get_future();
  }
  request_arrived_.notify_one();
  return answer.get();
}

void RigNode::onCraneCommand(const ros::MessageEvent<geometry_msgs::TwistStamped const>& event) {
  const geometry_msgs::TwistStamped& command = *event.getConstMessage();
  Eigen::Vector3d velocity(command.twist.linear.x, command.twist.linear.y, command.twist.linear.z);
  const std::string& frame = command.header.frame_id;
  const bool known_frame = frame.empty() || frame == options_.frame_prefix + frames::kMap ||
                           frame == options_.frame_prefix + frames::kCraneTip;
  // Nobody can tell which of two drivers means it: the crane obeys neither and stops.
  if (countCommanders(event.getPublisherName()) > 1) {
    ROS_WARN_STREAM_THROTTLE(kCommandLogIntervalS, "more than one node commands " << topics::kCraneCommand
                                                                                  << "; refused a command from "
                                                                                  << event.getPublisherName());
    velocity.setZero();
  } else if (!known_frame || !isFinite(command.twist.angular)) {
    ROS_WARN_STREAM_THROTTLE(kCommandLogIntervalS, "refused a command on " << topics::kCraneCommand << " in frame \""
                                                                           << frame << "\"; must be in "
                                                                           << frames::kCraneTip << " or "
                                                                           << frames::kMap << " and finite");
    command_refused_ = true;
    velocity.setZero();
  }
  pull_up_->giveWayTo(event.getPublisherName());
  const std::lock_guard<std::mutex> lock(simulation_mutex_);
  simulation_->setCraneVelocity(velocity);
}

std::size_t RigNode::countCommanders(const std::string& speaker) {
  const auto now = WallClock::now();
  const std::lock_guard<std::mutex> lock(commanders_mutex_);
  if (!speaker.empty()) commanders_[speaker] = now;
  for (auto commander = commanders_.begin(); commander != commanders_.end();) {
    commander = now - commander->second > kCommanderMemory ? commanders_.erase(commander) : std::next(commander);
  }
  return commanders_.size();
}

void RigNode::onFoldCommand(const ros::MessageEvent<std_msgs::Float64 const>& event) {
  pull_up_->giveWayTo(event.getPublisherName());
  const std::lock_guard<std::mutex> lock(simulation_mutex_);
  simulation_->setFoldTarget(event.getConstMessage()->data);
}

PullUpServer::Rig RigNode::rigForPullUp() {
  PullUpServer::Rig rig;
  rig.between_samples = [this](const std::function<void(const Snapshot&, const std::string&)>& work) {
    ask([this, &work] {
      work(simulation_->snapshot(), reasonAgainstPullUp());
      return Answer{true, ""};
    });
  };
  rig.command = [this](double hoist_speed_mps, std::optional<double> fold_target) {
    const std::lock_guard<std::mutex> lock(simulation_mutex_);
    simulation_->setCraneVelocity({0.0, 0.0, hoist_speed_mps});
    if (fold_target) simulation_->setFoldTarget(*fold_target);
  };
  return rig;
}

RigNode::Answer RigNode::tare() {
  const std::lock_guard<std::mutex> lock(simulation_mutex_);
  simulation_->tare();
  return {true, "zero from the next sample on"};
}

// ---------------------------------------------------------------------------------------------- simulation thread

int RigNode::run() {
  try {
    simulateUntilEnd();
  } catch (...) {
    refuseRequests();  // or the callback threads wait for ever
    throw;
  }
  refuseRequests();
  pull_up_->abort("the node is shutting down");
  finishRun(hasEnd() && !script_done_);
  finishAutosave();
  if (plot_.valid()) plot_.wait();
  if (ros::ok()) {
    publishStatus(WallClock::now());
    // Publishing only queues: give the last messages the time to leave.
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
  return failed_ ? 1 : 0;
}

void RigNode::simulateUntilEnd() {
  last_diagnostics_ = WallClock::now();
  next_status_ = last_diagnostics_;
  pacer_.restart(last_diagnostics_);

  while (ros::ok()) {
    serveRequests();
    const auto now = WallClock::now();
    if (now >= next_status_) {
      publishStatus(now);
      if (idle()) publishIdleFrame();
      next_status_ = now + std::chrono::duration_cast<WallClock::duration>(
                               std::chrono::duration<double>(1.0 / options_.live.status_rate_hz));
    }
    if (!script_done_ && simulation_->finished()) {
      script_done_ = true;
      failed_ = failed_ || simulation_->frozen();
      finishRun(false);
      if (options_.exit_at_end) return;
      ROS_INFO("the test is done; the simulation goes on. Ctrl-C ends it, the service rig_node/reset repeats the test");
    }
    const bool running = !idle();
    if (running && now >= pacer_.due()) {
      advance(stepsToNextSample());
      continue;
    }
    std::unique_lock<std::mutex> lock(request_mutex_);
    request_arrived_.wait_until(lock, running ? std::min(pacer_.due(), next_status_) : next_status_,
                                [this] { return !requests_.empty(); });
  }
}

void RigNode::serveRequests() {
  for (;;) {
    std::unique_lock<std::mutex> lock(request_mutex_);
    if (requests_.empty()) return;
    Request request = std::move(requests_.front());
    requests_.pop_front();
    lock.unlock();
    try {
      request.answer.set_value(request.work());
    } catch (const std::exception& error) {  // no memory or no disk for another run: the rig goes on without
      ROS_ERROR("%s", error.what());
      request.answer.set_value({false, error.what()});
    }
  }
}

void RigNode::refuseRequests() {
  const std::lock_guard<std::mutex> lock(request_mutex_);
  closed_ = true;
  for (Request& request : requests_) request.answer.set_value({false, "the node is shutting down"});
  requests_.clear();
}

RigNode::Answer RigNode::pause() {
  if (paused_) return {false, "is paused already"};
  paused_ = true;
  next_status_ = WallClock::now();
  return {true, "paused"};
}

RigNode::Answer RigNode::resume() {
  if (simulation_->frozen()) return {false, "the world is frozen by a non-finite state; call ~reset"};
  if (!paused_) return {false, "is not paused"};
  paused_ = false;
  pacer_.restart(WallClock::now());
  next_status_ = WallClock::now();
  return {true, "resumed"};
}

RigNode::Answer RigNode::reset() {
  return replaceWorld(std::make_unique<Simulation>(scenario_), nullptr, "back at the start");
}

RigNode::Answer RigNode::loadCheckpoint(const std::string& path) {
  CheckpointReader file(path);
  // Frames, rates, limits and sim/scenario are out already, and hold for this scenario.
  const auto own = keyValues(scenario_), saved = keyValues(file.scenario());
  for (std::size_t i = 0; i < own.size(); ++i) {
    if (own[i] == saved[i] || own[i].first == "solver.threads") continue;
    return {false,
            path + ": is of another scenario: " + own[i].first + " = " + saved[i].second + ", here " + own[i].second};
  }
  auto world = std::make_unique<Simulation>(Simulation::load(file, scenario_.solver.threads));
  char text[64];
  std::snprintf(text, sizeof text, "goes on from time %.6g s", world->snapshot().time_s);
  return replaceWorld(std::move(world), &file, text);
}

void RigNode::adoptScenario() {
  scenario_ = simulation_->scenario();
  steps_per_sample_ =
      static_cast<std::uint64_t>(std::max(1L, std::lround(simulation_->samplePeriod() / simulation_->timeStep())));
}

RigNode::Answer RigNode::loadScenarioFor(const LoadScenarioRequest& request) {
  if (options_.scenario_dir.empty()) return {false, "the parameter ~scenario_dir does not say where"};
  std::string reason = reasonAgainstLoad(simulation_->snapshot());
  if (reason.empty() && pull_up_->busy()) reason = "a goal of the action pull_up is running; cancel it first";
  if (!reason.empty()) return {false, reason};
  const ScenarioSources sources = resolveScenarioRequest(request, options_.scenario_dir, options_.sources);
  const Scenario scenario = loadScenario(sources);
  auto world = std::make_unique<Simulation>(scenario);
  const std::string urdf = makeRigUrdf(scenario, options_.frame_prefix);
  const bool other_shape = urdf != makeRigUrdf(scenario_, options_.frame_prefix);
  std::string message = "loaded \"" + scenario.title + "\", ";
  message += scenario.procedure.control == ControlMode::kManual ? "manual control" : "the script drives";
  if (other_shape && ros::param::has("robot_description")) {
    ros::param::set("robot_description", urdf);
    message += "; robot_description is another: restart robot_state_publisher and rviz to see the rig as it is now";
  }
  const Answer answer = replaceWorld(std::move(world), nullptr, message);
  options_.sources = sources;
  ROS_INFO("%s", answer.message.c_str());
  return answer;
}

LiveSettings RigNode::liveSettings() const {
  return {options_.live, simulation_->loadCellNoise(), simulation_->loadCellResolution()};
}

/// Noise and resolution go through the simulation, which tells with which sample they began.
void RigNode::changeLiveSettings(const LiveSettings& wanted) {
  const LiveSettings before = liveSettings();
  if (wanted.load_cell_noise_n != before.load_cell_noise_n) simulation_->setLoadCellNoise(wanted.load_cell_noise_n);
  if (wanted.load_cell_resolution_n != before.load_cell_resolution_n) {
    simulation_->setLoadCellResolution(wanted.load_cell_resolution_n);
  }
  options_.live = wanted.options;
  if (wanted.options.real_time_factor != before.options.real_time_factor) {
    pacer_ = RealTimePacer(wanted.options.real_time_factor);
    pacer_.restart(WallClock::now());
  }
  next_status_ = WallClock::now();
}

void RigNode::publishScenario() {
  std_msgs::String text;
  text.data = std::string("# brash_ice_rig ") + kVersion + "\n" + toYaml(scenario_);
  scenario_publisher_.publish(text);
  motion_file_publisher_.shutdown();
  if (scenario_.procedure.motion_file.empty()) return;
  motion_file_publisher_ = node_.advertise<std_msgs::String>(topics::kMotionFile, 1, true);
  std_msgs::String motion;
  motion.data = textOfFileIfThere(scenario_.procedure.motion_file);
  motion_file_publisher_.publish(motion);
}

/// ROS time goes on by a sample, whatever time it is in the new world.
RigNode::Answer RigNode::replaceWorld(std::unique_ptr<Simulation> world, CheckpointReader* resumed,
                                      std::string message) {
  pull_up_->abort("the rig was reset, or went on from a checkpoint");
  const double last_stamp_s = clock_offset_s_ + simulation_->snapshot().time_s;
  finishRun(hasEnd() && !script_done_);
  {
    const std::lock_guard<std::mutex> lock(simulation_mutex_);
    simulation_ = std::move(world);
  }
  if (toYaml(simulation_->scenario()) != toYaml(scenario_)) {
    adoptScenario();
    pull_up_->useScenario(scenario_);
    publishScenario();
  }
  clock_offset_s_ = last_stamp_s + simulation_->samplePeriod() - simulation_->snapshot().time_s;
  publishRunStart();
  script_done_ = false;
  raised_ = raised_since_sample_ = StatusFlags();
  if (paused_) message += ", paused";
  try {
    startRun(resumed);
  } catch (const std::exception& error) {  // the new world is there all the same
    ROS_ERROR("%s; this run is not recorded", error.what());
    failed_ = true;
    message += std::string(", not recorded: ") + error.what();
  }
  pacer_.restart(WallClock::now());
  next_status_ = WallClock::now();
  return {true, message};
}

CheckpointWriter RigNode::makeCheckpoint(const std::string& path) {
  makeDirectory(options_.checkpoint_dir);
  CheckpointWriter file(path, scenario_);
  simulation_->save(file);
  if (files_) files_->save(file, compute_s_);
  file.add(kNodeSection, [this](StateVisitor& visitor) { statistics_->visitState(visitor); });
  return file;
}

void RigNode::scheduleAutosave() {
  if (options_.checkpoint_every_s == 0.0) return;
  autosave_due_s_ =
      nextMultiple(options_.checkpoint_every_s, simulation_->snapshot().time_s + 0.5 * simulation_->samplePeriod());
}

/// The loop only puts the file together; a disk that is slow to write it must not hold up the simulation.
void RigNode::autosave(const Snapshot& snapshot) {
  if (options_.checkpoint_every_s == 0.0) return;
  if (saving_.valid() && saving_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) finishAutosave();
  if (snapshot.time_s < autosave_due_s_ - 0.5 * simulation_->samplePeriod()) return;
  if (saving_.valid()) {
    if (options_.live.real_time_factor > 0.0) return;
    finishAutosave();  // nobody waits for a simulation that runs as fast as it can: the disk sets the pace
  }
  scheduleAutosave();
  try {
    CheckpointWriter file = makeCheckpoint(options_.checkpoint_dir + "/" + options_.checkpoint_file);
    saving_ = std::async(std::launch::async, [this, file = std::move(file)]() mutable {
      const std::lock_guard<std::mutex> lock(commit_mutex_);
      file.commit();
    });
  } catch (const std::exception& error) {
    reportAutosave(error);
  }
}

void RigNode::finishAutosave() {
  if (!saving_.valid()) return;
  try {
    saving_.get();
  } catch (const std::exception& error) {
    reportAutosave(error);
  }
}

void RigNode::reportAutosave(const std::exception& error) {
  ROS_ERROR("%s; the rig goes on without this checkpoint", error.what());
  failed_ = true;
}

RigNode::Answer RigNode::step(double duration_s) {
  char text[160];
  if (!paused_) return {false, "is running; call ~pause before ~step"};
  if (simulation_->frozen()) return {false, "the world is frozen by a non-finite state; call ~reset"};
  if (!(duration_s > 0.0 && duration_s <= kLongestStepS)) {
    std::snprintf(text, sizeof text, "duration_s = %g, must lie in (0, %g]", duration_s, kLongestStepS);
    return {false, text};
  }
  const auto wanted = static_cast<std::uint64_t>(std::max(1LL, std::llround(duration_s / simulation_->timeStep())));
  std::uint64_t done = 0;
  pacer_.restart(WallClock::now());
  while (done < wanted && ros::ok() && !simulation_->frozen()) {
    const std::uint64_t steps = std::min(wanted - done, stepsToNextSample());
    advance(steps);
    done += steps;
  }
  publishIdleFrame();
  next_status_ = WallClock::now();
  std::snprintf(text, sizeof text, "%llu steps, %g s; time is %.6g s", static_cast<unsigned long long>(done),
                static_cast<double>(done) * simulation_->timeStep(), simulation_->snapshot().time_s);
  return {done == wanted && !simulation_->frozen(), text};
}

std::string RigNode::reasonAgainstPullUp() const {
  if (scenario_.procedure.control != ControlMode::kManual) {
    return "procedure.control = scripted, must be manual (launch with teleop:=true): the script drives the crane";
  }
  if (simulation_->frozen()) return "the world is frozen by a non-finite state; call ~reset";
  if (paused_) return "the rig is paused; call ~resume first";
  return "";
}

void RigNode::startRun(CheckpointReader* resumed) {
  ++run_number_;
  compute_s_ = 0.0;
  printed_second_ = std::numeric_limits<std::int64_t>::min();
  statistics_.emplace(simulation_->samplePeriod());
  scheduleAutosave();
  if (resumed != nullptr && resumed->has(kNodeSection)) {
    resumed->read(kNodeSection, [this](StateVisitor& visitor) { statistics_->visitState(visitor); });
  }
  if (options_.output_dir.empty()) return;
  std::string directory = std::filesystem::absolute(options_.output_dir).lexically_normal().string();
  // A reset must not wipe what the run before it has left.
  if (run_number_ > 1) directory += "/run_" + std::to_string(run_number_);
  files_.emplace(*simulation_, directory, resumed);
}

void RigNode::finishRun(bool interrupted) {
  if (!files_) return;
  try {
    files_->finish(*simulation_, compute_s_, interrupted);
    // One plot after the other, and in the background: a reset must not wait for the plot of the run before.
    plot_ = std::async(std::launch::async, [before = std::move(plot_), directory = files_->directory()] {
      if (before.valid()) before.wait();
      plotRun(directory);
    });
  } catch (const OutputError& error) {
    // A shutdown closes ROS's log first, and a run ended by Ctrl-C would lose its files without a word.
    if (ros::ok()) {
      ROS_ERROR("%s", error.what());
    } else {
      std::fprintf(stderr, "%s\n", error.what());
    }
    failed_ = true;
  }
  files_.reset();
}

std::uint64_t RigNode::stepsToNextSample() const {
  return steps_per_sample_ - simulation_->stepCount() % steps_per_sample_;
}

void RigNode::advance(std::uint64_t steps) {
  const double duration_s = static_cast<double>(steps) * simulation_->timeStep();
  const auto before = WallClock::now();
  const StepReport report = simulation_->advance(duration_s);
  const auto after = WallClock::now();
  compute_s_ += secondsBetween(before, after);
  pacer_.book(duration_s, report.steps, after);
  raised_ |= report.flags;
  if (simulation_->frozen()) {
    pull_up_->abort(statusRemedy(StatusFlag::kNonFinite) + (" " + simulation_->breakdown()));
  }
  raised_since_sample_ |= report.flags;
  publishCommands(report.commands);
  if (simulation_->stepCount() % steps_per_sample_ != 0 || simulation_->frozen()) return;

  const Snapshot snapshot = simulation_->snapshot();
  publishSample(snapshot);
  pull_up_->update(snapshot, raised_since_sample_);
  raised_since_sample_ = StatusFlags();
  if (!script_done_) printProgress(snapshot);
  if (snapshot.time_s > -0.5 * simulation_->samplePeriod() && snapshot.stage != Stage::kDone) {
    statistics_->add(snapshot.time_s, snapshot.force_n);
  }
  if (files_) {
    try {
      files_->write(*simulation_, snapshot, report.flags);
    } catch (const OutputError& error) {
      ROS_ERROR("%s; this run is not recorded any further", error.what());
      files_.reset();
      failed_ = true;
    }
  }
  autosave(snapshot);
}

Stamp RigNode::stamp(double time_s) const {
  Stamp stamp;
  stamp.time.fromSec(clock_offset_s_ + time_s);
  stamp.frame_prefix = options_.frame_prefix;
  return stamp;
}

void RigNode::publishRunStart() {
  command_index_ = 0;
  RigCommand start;
  start.time_s = simulation_->snapshot().time_s;
  commands_publisher_.publish(toTakenCommand(stamp(start.time_s), start, command_index_));
}

void RigNode::publishCommands(const std::vector<RigCommand>& commands) {
  for (const RigCommand& command : commands) {
    commands_publisher_.publish(toTakenCommand(stamp(command.time_s), command, ++command_index_));
  }
}

void RigNode::publishSample(const Snapshot& snapshot) {
  const Stamp now = stamp(snapshot.time_s);
  const double period_s = simulation_->samplePeriod();
  ++sample_index_;
  ++samples_since_diagnostics_;
  publishClock(now);  // first: whoever gets the others finds its clock there already
  wrench_publisher_.publish(toWrench(now, snapshot.load_cell_force_n));
  true_wrench_publisher_.publish(toWrench(now, snapshot.support_n));
  components_publisher_.publish(toForceComponents(now, snapshot));
  if (isDue(sample_index_, period_s, options_.live.joints_rate_hz)) publishJoints(now, snapshot);
  if (isDue(sample_index_, period_s, options_.live.state_rate_hz)) publishStates(now, snapshot);
  if (isDue(sample_index_, period_s, options_.live.points_rate_hz)) publishPoints(now);
  if (isDue(sample_index_, period_s, options_.live.markers_rate_hz)) publishMarkers(now, snapshot);
}

void RigNode::publishIdleFrame() {
  // A node or rviz that joins a resting rig wants the clock and the transforms, but tf2 complains about a second
  // transform with the stamp of the first. So time creeps on by a microsecond; load-cell samples are not repeated.
  clock_offset_s_ += kIdleCreepS;
  const Snapshot snapshot = simulation_->snapshot();
  const Stamp now = stamp(snapshot.time_s);
  publishClock(now);
  publishJoints(now, snapshot);
  publishStates(now, snapshot);
  publishPoints(now);
  publishMarkers(now, snapshot);
}

void RigNode::publishClock(const Stamp& now) {
  if (!options_.publish_clock) return;
  rosgraph_msgs::Clock clock;
  clock.clock = now.time;
  clock_publisher_.publish(clock);
}

void RigNode::publishJoints(const Stamp& now, const Snapshot& snapshot) {
  joints_publisher_.publish(toJointState(now, snapshot));
  command_out_publisher_.publish(toCommandOut(now, snapshot.rig));
}

void RigNode::publishStates(const Stamp& now, const Snapshot& snapshot) {
  crane_publisher_.publish(toCraneState(now, snapshot));
  plug_publisher_.publish(toPlugState(now, snapshot.time_s, simulation_->plug()));
}

void RigNode::publishPoints(const Stamp& now) {
  if (points_publisher_.getNumSubscribers() == 0) return;
  points_publisher_.publish(
      boost::make_shared<sensor_msgs::PointCloud2>(toPointCloud(now, simulation_->particles(), options_.live)));
}

void RigNode::publishMarkers(const Stamp& now, const Snapshot& snapshot) {
  if (markers_publisher_.getNumSubscribers() == 0) return;
  markers_publisher_.publish(toMarkers(now, scenario_, snapshot, simulation_->plugOutline(),
                                       1.0e-3 * options_.live.markers_force_scale_m_per_kn));
}

void RigNode::publishStatus(WallClock::time_point now) {
  const Snapshot snapshot = simulation_->snapshot();
  StatusFlags flags = raised_;
  flags |= snapshot.flags;
  if (command_refused_.exchange(false)) flags.set(StatusFlag::kCommandRejected);
  if (countCommanders() > 1) flags.set(StatusFlag::kMultipleCommanders);
  if (!idle() && pacer_.overloaded(now)) flags.set(StatusFlag::kOverload);
  raised_ = StatusFlags();

  const std::uint32_t flags_before = status_.flags;
  status_.header = stamp(snapshot.time_s).header(frames::kMap);
  status_.stage = stageName(snapshot.stage);
  status_.time_s = snapshot.time_s;
  status_.real_time_factor = idle() ? 0.0 : pacer_.achievedFactor(now);
  status_.real_time_factor_target = pacer_.targetFactor();
  status_.step_rate_hz = idle() ? 0.0 : pacer_.stepRate(now);
  status_.time_step_s = simulation_->timeStep();
  status_.step_count = simulation_->stepCount();
  status_.particle_count = static_cast<std::uint32_t>(simulation_->particleCount());
  status_.kinetic_energy_j = snapshot.kinetic_energy_j;
  status_.peak_force_n = statistics_->empty() ? 0.0 : statistics_->peak();
  status_.peak_time_s = statistics_->empty() ? 0.0 : statistics_->peakTime();
  status_.paused = paused_;
  status_.finished = simulation_->finished();
  status_.frozen = simulation_->frozen();
  setFlags(flags, simulation_->breakdown(), status_);
  status_publisher_.publish(status_);
  pull_up_->publishStatus();

  StatusFlags news;
  for (const StatusFlag flag : activeFlags(flags)) {
    if ((flags_before & static_cast<std::uint32_t>(flag)) == 0) news.set(flag);
  }
  for (const StatusFlag flag : activeFlags(news)) {
    // A computer at its limit is overloaded on and off; the factor is in each line of progress anyway.
    if (flag == StatusFlag::kOverload && now < next_overload_log_) continue;
    if (flag == StatusFlag::kOverload) next_overload_log_ = now + kOverloadLogInterval;
    std::string remedy = statusRemedy(flag);
    if (flag == StatusFlag::kNonFinite) remedy += " " + simulation_->breakdown();
    ROS_WARN("%s: %s (t = %.2f s, real-time factor %.2f)", statusName(flag), remedy.c_str(), snapshot.time_s,
             status_.real_time_factor);
  }
  if (secondsBetween(last_diagnostics_, now) >= 1.0) publishDiagnostics(now);
}

void RigNode::printProgress(const Snapshot& snapshot) {
  const auto second = static_cast<std::int64_t>(std::floor(snapshot.time_s + 0.5 * simulation_->samplePeriod()));
  if (second == printed_second_) return;
  printed_second_ = second;
  std::printf("%-7s t %6.1f s   hub %+6.3f m   force %7.2f kN   real-time factor %.2f\n", stageName(snapshot.stage),
              snapshot.time_s, snapshot.rig.hoist_position_m, 1.0e-3 * snapshot.force_n,
              pacer_.achievedFactor(WallClock::now()));
  std::fflush(stdout);
}

// ----------------------------------------------------------------------------------------------------- diagnostics

void RigNode::publishDiagnostics(WallClock::time_point now) {
  sample_rate_hz_ = static_cast<double>(samples_since_diagnostics_) / secondsBetween(last_diagnostics_, now);
  samples_since_diagnostics_ = 0;
  last_diagnostics_ = now;
  // Not update(): that one waits on ROS time, which stands still in a pause.
  diagnostics_.force_update();
}

void RigNode::addDiagnostics() {
  using diagnostic_msgs::DiagnosticStatus;
  using diagnostic_updater::DiagnosticStatusWrapper;
  const auto has = [this](StatusFlag flag) { return (status_.flags & static_cast<std::uint32_t>(flag)) != 0; };
  diagnostics_.setHardwareID("brash_ice_rig " + std::string(kVersion));

  diagnostics_.add("Real time", [this, has](DiagnosticStatusWrapper& report) {
    if (has(StatusFlag::kOverload)) {
      report.summary(DiagnosticStatus::WARN, statusRemedy(StatusFlag::kOverload));
    } else {
      report.summary(DiagnosticStatus::OK, paused_ ? "paused" : "keeps up");
    }
    report.add("Real-time factor", status_.real_time_factor);
    report.add("Real-time factor asked for (0: as fast as it can)", status_.real_time_factor_target);
    report.add("Steps per second", status_.step_rate_hz);
    report.add("Time step (s)", status_.time_step_s);
  });
  diagnostics_.add("Numerics", [this, has](DiagnosticStatusWrapper& report) {
    if (has(StatusFlag::kNonFinite)) {
      report.summary(DiagnosticStatus::ERROR, statusRemedy(StatusFlag::kNonFinite) + (" " + simulation_->breakdown()));
    } else if (has(StatusFlag::kContactSaturated)) {
      report.summary(DiagnosticStatus::WARN, statusRemedy(StatusFlag::kContactSaturated));
    } else {
      report.summary(DiagnosticStatus::OK, "finite");
    }
    report.add("Kinetic energy of the ice (J)", status_.kinetic_energy_j);
    report.add("Particles", status_.particle_count);
    report.add("Steps", status_.step_count);
  });
  diagnostics_.add("Load cell", [this](DiagnosticStatusWrapper& report) {
    const double expected_hz = pacer_.targetFactor() / simulation_->samplePeriod();
    const bool slow = !idle() && sample_rate_hz_ < 0.95 * expected_hz;
    report.summary(slow ? DiagnosticStatus::WARN : DiagnosticStatus::OK,
                   slow ? "fewer samples per second of wall time than asked for" : "samples arrive");
    report.add("Samples per second of wall time", sample_rate_hz_);
    report.add("Samples per second of simulated time", 1.0 / simulation_->samplePeriod());
  });
  diagnostics_.add("Commands", [this, has](DiagnosticStatusWrapper& report) {
    report.summary(DiagnosticStatus::OK,
                   scenario_.procedure.control == ControlMode::kManual ? "manual control" : "script drives");
    for (const StatusFlag flag : {StatusFlag::kCommandTimeout, StatusFlag::kCommandRejected,
                                  StatusFlag::kCommandIgnored, StatusFlag::kMultipleCommanders}) {
      if (has(flag)) report.mergeSummary(DiagnosticStatus::WARN, statusRemedy(flag));
    }
    report.add("Publishers of crane/cmd_vel", crane_subscriber_.getNumPublishers());
    report.add("Timeout (simulated s)", scenario_.crane.command_timeout_s);
  });
}

void RigNode::warnAboutForeignClock() const {
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = ros::this_node::getName();
  if (!ros::master::execute("getSystemState", request, response, payload, false)) return;
  XmlRpc::XmlRpcValue& publications = payload[0];
  for (int i = 0; i < publications.size(); ++i) {
    if (static_cast<std::string>(publications[i][0]) != topics::kClock) continue;
    for (int j = 0; j < publications[i][1].size(); ++j) {
      const auto name = static_cast<std::string>(publications[i][1][j]);
      if (name == ros::this_node::getName()) continue;
      ROS_WARN(
          "%s publishes /clock too, so that time will jump: give one of the two ~publish_clock = false, or call "
          "`rosnode cleanup` if that node is gone",
          name.c_str());
    }
  }
}

}  // namespace brash_ice_rig
