#include "brash_ice_rig/rviz/rig_panel.h"

#include <algorithm>
#include <cmath>

#include <std_srvs/Trigger.h>
#include <QDoubleSpinBox>
#include <QGridLayout>
#include <QGroupBox>
#include <QHBoxLayout>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QTextBrowser>
#include <QTimer>
#include <QVBoxLayout>
#include <pluginlib/class_list_macros.hpp>

#include "brash_ice_rig/Step.h"
#include "brash_ice_rig/node/topic_names.h"
#include "brash_ice_rig/rviz/force_plot.h"
#include "brash_ice_rig/rviz/spring_slider.h"

namespace brash_ice_rig {
namespace {

constexpr double kHistoryS = 180.0;
/// Period of velocity commands, wall time. The crane's watchdog waits 0.25 s of simulated time: enough for a rig at
/// seven times real time.
constexpr std::chrono::milliseconds kCommandPeriod{33};
/// A GUI that stands still for so long cannot tell whether a slider is still held. A frame takes a second at worst on a
/// busy computer without a graphics card.
constexpr std::chrono::seconds kGuiTimeout{2};
constexpr int kRefreshPeriodMs = 150;
constexpr std::chrono::seconds kStatusTimeout{2};
/// Flags are raised for a fifth of a second at a time: keep each on the screen long enough to read it.
constexpr std::chrono::seconds kFlagStays{4};
constexpr double kAnswerTimeoutS = 10.0;
constexpr double kStepAnswerTimeoutS = 600.0;

constexpr std::array<const char*, 6> kStages = {"settle", "lower", "unfold", "lift", "hold", "done"};

/// Place in kStages, or its size for a stage of another kind ("manual").
std::size_t stageIndex(const std::string& stage) {
  return static_cast<std::size_t>(std::find(kStages.begin(), kStages.end(), stage) - kStages.begin());
}

QString number(double value, int decimals) {
  return std::isfinite(value) ? QString::number(value, 'f', decimals) : QString("–");
}

QString kilonewton(double force_n) {
  return number(1.0e-3 * force_n, 1) + " kN";
}

QDoubleSpinBox* makeSpinBox(double low, double high, double step, double value, const char* unit, const char* name) {
  auto* box = new QDoubleSpinBox;
  box->setRange(low, high);
  box->setDecimals(2);
  box->setSingleStep(step);
  box->setValue(value);
  box->setSuffix(unit);
  box->setObjectName(name);
  return box;
}

}  // namespace

RigPanel::RigPanel(QWidget* parent) : rviz::Panel(parent), history_(kHistoryS) {
  head_ = new QLabel;
  head_->setObjectName("head");
  head_->setWordWrap(true);
  force_ = new QLabel;
  force_->setObjectName("force");
  plot_ = new ForcePlot;
  plot_->setMinimumHeight(130);
  flag_list_ = new QTextBrowser;
  flag_list_->setObjectName("flags");
  flag_list_->setFixedHeight(92);
  answer_ = new QLabel;
  answer_->setObjectName("answer");
  answer_->setWordWrap(true);
  answer_->setTextFormat(Qt::PlainText);
  // Its line stays free without an answer, lest the controls move away under the mouse.
  answer_->setText("|");
  answer_->setMinimumHeight(answer_->sizeHint().height());
  answer_->clear();

  auto* layout = new QVBoxLayout(this);
  layout->setContentsMargins(6, 4, 6, 4);
  layout->setSpacing(4);
  layout->addWidget(head_);
  layout->addWidget(makeStageRow());
  layout->addWidget(force_);
  layout->addWidget(plot_, 1);
  layout->addWidget(makeCraneBox());
  layout->addWidget(makeCollectorBox());
  layout->addWidget(makeRunRow());
  layout->addWidget(answer_);
  layout->addWidget(flag_list_);
  layout->addWidget(makeNamespaceRow());
  setMinimumWidth(330);

  auto* refresh_timer = new QTimer(this);
  connect(refresh_timer, &QTimer::timeout, this, [this] { refresh(); });
  refresh_timer->start(kRefreshPeriodMs);

  connectToRig();
  repeater_ = std::thread([this] { repeatVelocity(); });
}

RigPanel::~RigPanel() {
  {
    const std::lock_guard<std::mutex> lock(drive_mutex_);
    drive_.releaseAll();
    sendVelocity();
    ending_ = true;
  }
  ending_now_.notify_all();
  repeater_.join();
}

// -------------------------------------------------------------------------------------------------------------- layout

QPushButton* RigPanel::makeButton(const char* text, const char* name, const char* tip) {
  auto* button = new QPushButton(text);
  button->setObjectName(name);
  button->setToolTip(tip);
  button->setFocusPolicy(Qt::NoFocus);  // a blank typed into rviz must not press it
  button->setMinimumWidth(20);
  return button;
}

SpringSlider* RigPanel::makeSlider(HandDrive::Axis axis, Qt::Orientation orientation, const char* name) {
  auto* slider = new SpringSlider(orientation);
  slider->setObjectName(name);
  slider->setToolTip("Drives while held, stops when let go");
  const auto deflection = [](int value) { return static_cast<double>(value) / SpringSlider::kEnd; };
  connect(slider, &QSlider::sliderPressed, this, [this, slider, axis, deflection] {
    const std::lock_guard<std::mutex> lock(drive_mutex_);
    gui_seen_ = WallClock::now();
    drive_.hold(axis, deflection(slider->value()));
  });
  connect(slider, &QSlider::valueChanged, this, [this, slider, axis, deflection](int value) {
    if (!slider->isSliderDown()) return;
    const std::lock_guard<std::mutex> lock(drive_mutex_);
    drive_.hold(axis, deflection(value));
  });
  connect(slider, &QSlider::sliderReleased, this, [this, axis] {
    const std::lock_guard<std::mutex> lock(drive_mutex_);
    drive_.release(axis);
    sendVelocity();  // the crane's stop does not wait for the next tick
  });
  sliders_[axis] = slider;
  return slider;
}

QWidget* RigPanel::makeStageRow() {
  auto* row = new QWidget;
  auto* layout = new QHBoxLayout(row);
  layout->setContentsMargins(0, 0, 0, 0);
  layout->setSpacing(2);
  for (std::size_t i = 0; i < kStages.size(); ++i) {
    stages_[i] = makeButton(kStages[i], (std::string("stage_") + kStages[i]).c_str(),
                            "Lets the script run to the beginning of this stage and pauses there");
    stages_[i]->setCheckable(false);
    connect(stages_[i], &QPushButton::clicked, this, [this, i] { runTo(i); });
    layout->addWidget(stages_[i]);
  }
  return row;
}

QWidget* RigPanel::makeCraneBox() {
  crane_box_ = new QGroupBox("Crane");
  auto* hoist = makeSlider(HandDrive::kHoist, Qt::Vertical, "hoist");
  hoist->setMinimumHeight(100);
  full_speed_ = makeSpinBox(0.01, 2.0, 0.01, 0.1, " m/s", "full_speed");
  full_speed_->setToolTip("Speed with a slider at its end; the node cuts it to crane.max_speed_mps");
  drive_.setFullSpeed(full_speed_->value());
  connect(full_speed_, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this, [this](double value) {
    {
      const std::lock_guard<std::mutex> lock(drive_mutex_);
      drive_.setFullSpeed(value);
    }
    Q_EMIT configChanged();
  });
  crane_state_ = new QLabel;
  crane_state_->setObjectName("crane_state");
  crane_state_->setToolTip("Height of the collector's hub over the still waterline, and its speed");

  auto* layout = new QGridLayout(crane_box_);
  layout->setContentsMargins(8, 4, 8, 4);
  layout->setVerticalSpacing(2);
  layout->addWidget(new QLabel("up"), 0, 0, Qt::AlignHCenter);
  layout->addWidget(hoist, 1, 0, 2, 1, Qt::AlignHCenter);
  layout->addWidget(new QLabel("down"), 3, 0, Qt::AlignHCenter);
  layout->addWidget(crane_state_, 0, 1, 1, 2);
  layout->addWidget(new QLabel("boom x"), 1, 1);
  layout->addWidget(makeSlider(HandDrive::kBoomX, Qt::Horizontal, "boom_x"), 1, 2);
  layout->addWidget(new QLabel("boom y"), 2, 1);
  layout->addWidget(makeSlider(HandDrive::kBoomY, Qt::Horizontal, "boom_y"), 2, 2);
  layout->addWidget(new QLabel("full speed"), 3, 1);
  layout->addWidget(full_speed_, 3, 2);
  layout->setColumnStretch(2, 1);
  return crane_box_;
}

QWidget* RigPanel::makeCollectorBox() {
  auto* box = new QGroupBox("Collector");
  auto* layout = new QHBoxLayout(box);
  layout->setContentsMargins(8, 4, 8, 4);
  auto* fold = makeButton("Fold", "fold", "Arms up, for the way down through the ice");
  auto* unfold = makeButton("Unfold", "unfold", "Arms out, to lift");
  connect(fold, &QPushButton::clicked, this, [this] { sendFold(0.0); });
  connect(unfold, &QPushButton::clicked, this, [this] { sendFold(1.0); });
  collector_state_ = new QLabel;
  collector_state_->setObjectName("collector_state");
  layout->addWidget(fold);
  layout->addWidget(unfold);
  layout->addWidget(collector_state_, 1);
  return box;
}

QWidget* RigPanel::makeRunRow() {
  pause_ = makeButton("Pause", "pause", "Stops and continues the simulation");
  step_ = makeButton("Step", "step", "While paused: runs on for the time beside it");
  reset_ = makeButton("Reset", "reset", "Back to the start of the scenario");
  tare_ = makeButton("Tare", "tare", "Makes the present reading zero; the plot begins anew");
  step_duration_ = makeSpinBox(0.01, 60.0, 0.1, 1.0, " s", "step_duration");
  connect(pause_, &QPushButton::clicked, this, [this] { pauseOrResume(); });
  connect(step_, &QPushButton::clicked, this, [this] { step(); });
  connect(reset_, &QPushButton::clicked, this, [this] { reset(); });
  connect(tare_, &QPushButton::clicked, this, [this] { trigger(services::kTare); });
  connect(step_duration_, QOverload<double>::of(&QDoubleSpinBox::valueChanged), this,
          [this](double) { Q_EMIT configChanged(); });

  auto* row = new QWidget;
  auto* layout = new QHBoxLayout(row);
  layout->setContentsMargins(0, 0, 0, 0);
  layout->setSpacing(2);
  for (QWidget* widget :
       {static_cast<QWidget*>(pause_), static_cast<QWidget*>(step_), static_cast<QWidget*>(step_duration_),
        static_cast<QWidget*>(reset_), static_cast<QWidget*>(tare_)}) {
    layout->addWidget(widget);
  }
  return row;
}

QWidget* RigPanel::makeNamespaceRow() {
  namespace_ = new QLineEdit;
  namespace_->setObjectName("namespace");
  namespace_->setPlaceholderText(QString::fromStdString(ros::this_node::getNamespace()));
  namespace_->setToolTip("Namespace of the rig; empty: that of rviz");
  connect(namespace_, &QLineEdit::editingFinished, this, [this] {
    if (!namespace_->isModified()) return;
    namespace_->setModified(false);
    connectToRig();
    Q_EMIT configChanged();
  });
  auto* row = new QWidget;
  auto* layout = new QHBoxLayout(row);
  layout->setContentsMargins(0, 0, 0, 0);
  layout->addWidget(new QLabel("Namespace"));
  layout->addWidget(namespace_, 1);
  return row;
}

void RigPanel::load(const rviz::Config& config) {
  rviz::Panel::load(config);
  QString name;
  if (config.mapGetString("Namespace", &name)) namespace_->setText(name);
  float value = 0.0F;
  if (config.mapGetFloat("Full Speed", &value)) full_speed_->setValue(static_cast<double>(value));
  if (config.mapGetFloat("Step", &value)) step_duration_->setValue(static_cast<double>(value));
  connectToRig();
}

void RigPanel::save(rviz::Config config) const {
  rviz::Panel::save(config);
  config.mapSetValue("Namespace", namespace_->text());
  config.mapSetValue("Full Speed", full_speed_->value());
  config.mapSetValue("Step", step_duration_->value());
}

// ----------------------------------------------------------------------------------------------------------------- ROS

void RigPanel::connectToRig() {
  const std::lock_guard<std::mutex> lock(drive_mutex_);
  drive_.releaseAll();
  sendVelocity();  // to the rig that we leave
  subscribers_ = {};
  commands_ = CommandPublisher();
  history_ = ForceHistory(kHistoryS);
  status_.reset();
  crane_.reset();
  flags_.clear();
  run_to_.reset();

  const std::string name = namespace_->text().trimmed().toStdString();
  std::string error;
  if (!ros::names::validate(name, error)) {
    say("Namespace: " + error, true);
    return;
  }
  node_ = ros::NodeHandle(name);
  using geometry_msgs::WrenchStamped;
  // Samples of seconds fit in, for rviz serves callbacks once per frame.
  subscribers_[0] = node_.subscribe<WrenchStamped>(
      topics::kWrench, 2000,
      boost::function<void(const WrenchStamped::ConstPtr&)>([this](const auto& wrench) { onWrench(*wrench); }));
  subscribers_[1] = node_.subscribe<SimStatus>(
      topics::kSimStatus, 10,
      boost::function<void(const SimStatus::ConstPtr&)>([this](const auto& status) { onStatus(*status); }));
  subscribers_[2] = node_.subscribe<CraneState>(
      topics::kCraneState, 10,
      boost::function<void(const CraneState::ConstPtr&)>([this](const auto& crane) { onCrane(*crane); }));
  commands_ = CommandPublisher(node_);
  say("", false);
}

void RigPanel::onWrench(const geometry_msgs::WrenchStamped& wrench) {
  history_.add(wrench.header.stamp.toSec(), wrench.wrench.force.z);
}

void RigPanel::onStatus(const SimStatus& status) {
  history_.setClock(status.header.stamp.toSec(), status.time_s);
  status_ = status;
  status_seen_ = WallClock::now();
  for (std::size_t i = 0; i < std::min(status.flag_names.size(), status.remedies.size()); ++i) {
    flags_[status.flag_names[i]] = {status.remedies[i], status_seen_};
  }
  // A stage that the scenario does not have is passed by with the next one.
  const std::size_t stage = stageIndex(status.stage);
  if (run_to_ && stage < kStages.size() && stage >= *run_to_ && !caller_.busy()) {
    run_to_.reset();
    if (!status.paused) trigger("rig_node/pause");
  }
}

void RigPanel::onCrane(const CraneState& crane) {
  crane_ = crane;
}

void RigPanel::sendVelocity() {
  if (const auto mps = drive_.next()) commands_.send({Eigen::Vector3d(mps->data()), std::nullopt});
}

void RigPanel::repeatVelocity() {
  std::unique_lock<std::mutex> lock(drive_mutex_);
  while (!ending_now_.wait_for(lock, kCommandPeriod, [this] { return ending_; })) {
    if (WallClock::now() - gui_seen_ > kGuiTimeout) drive_.releaseAll();
    sendVelocity();
  }
}

void RigPanel::showThatGuiRuns() {
  bool stood = false;
  {
    const std::lock_guard<std::mutex> lock(drive_mutex_);
    stood = WallClock::now() - gui_seen_ > kGuiTimeout;
    gui_seen_ = WallClock::now();
  }
  if (!stood) return;
  for (SpringSlider* slider : sliders_) {
    if (!slider->isSliderDown()) continue;
    slider->letGo();
    say("rviz stood still for " + std::to_string(kGuiTimeout.count()) + " s, so the slider was let go", true);
  }
}

void RigPanel::sendFold(double ratio) {
  const std::lock_guard<std::mutex> lock(drive_mutex_);
  commands_.send({std::nullopt, ratio});
}

void RigPanel::trigger(const char* service) {
  caller_.call(node_.resolveName(service), std_srvs::Trigger(), kAnswerTimeoutS);
  refresh();
}

void RigPanel::pauseOrResume() {
  run_to_.reset();
  trigger(status_ && status_->paused ? "rig_node/resume" : "rig_node/pause");
}

void RigPanel::step() {
  Step step;
  step.request.duration_s = step_duration_->value();
  caller_.call(node_.resolveName("rig_node/step"), step, kStepAnswerTimeoutS);
  refresh();
}

void RigPanel::reset() {
  run_to_.reset();
  trigger("rig_node/reset");
}

void RigPanel::runTo(std::size_t stage) {
  if (!status_) return;
  run_to_ = stage;
  if (status_->paused) trigger("rig_node/resume");
}

void RigPanel::say(const std::string& text, bool trouble) {
  answer_->setText(QString::fromStdString(text));
  answer_->setStyleSheet(trouble ? "color: #b02020" : "color: #404040");
}

// -------------------------------------------------------------------------------------------------------------- screen

bool RigPanel::alive() const {
  return status_ && WallClock::now() - status_seen_ < kStatusTimeout;
}

void RigPanel::refresh() {
  showThatGuiRuns();
  if (const auto answer = caller_.poll()) {
    const std::string name = answer->service.substr(answer->service.rfind('/') + 1);
    say(name + ": " + answer->message, !answer->success);
    // Readings before and after do not compare.
    if (answer->success && answer->service == node_.resolveName(services::kTare)) history_.clear();
    if (!answer->success) run_to_.reset();
  }
  // While it steps, the node has no time for its status.
  const bool there = alive() || (status_ && caller_.busy());
  showState(there);
  showForce();
  showFlags();
}

void RigPanel::showState(bool there) {
  const bool free = there && !caller_.busy();
  pause_->setText(status_ && status_->paused ? "Resume" : "Pause");
  pause_->setEnabled(free);
  step_->setEnabled(free && status_->paused);
  reset_->setEnabled(free);
  tare_->setEnabled(free);

  const std::size_t stage = there ? stageIndex(status_->stage) : kStages.size();
  for (std::size_t i = 0; i < kStages.size(); ++i) {
    stages_[i]->setEnabled(free && stage < kStages.size() && i > stage && !status_->frozen);
    const bool goal = run_to_ && *run_to_ == i;
    stages_[i]->setStyleSheet(i == stage ? "font-weight: bold; color: white; background: #1c4a8c"
                              : goal     ? "font-weight: bold; color: #1c4a8c"
                                         : "");
  }
  if (!there) {
    head_->setText(QString("<span style='color:#b02020'>No rig in %1: no sim/status for 2 s.</span>")
                       .arg(QString::fromStdString(node_.getNamespace()).toHtmlEscaped()));
    crane_state_->clear();
    collector_state_->clear();
    return;
  }
  QString speed = "real-time factor " + number(status_->real_time_factor, 2);
  if (status_->paused) speed = "paused";
  if (status_->frozen) speed = "<span style='color:#b02020'>frozen</span>";
  head_->setText(QString("<b>%1</b> &nbsp; t = %2 s &nbsp; %3")
                     .arg(QString::fromStdString(status_->stage).toHtmlEscaped(), number(status_->time_s, 1), speed));
  crane_box_->setTitle(status_->stage == "manual" ? "Crane" : "Crane (the script drives)");
  if (!crane_) return;
  crane_state_->setText(
      QString("hub %1 m, %2 m/s").arg(number(crane_->hoist_position_m, 2), number(crane_->velocity_mps.z, 3)));
  const double ratio = crane_->fold_ratio;
  const char* fold = ratio <= 0.0 ? "folded" : ratio < 1.0 ? "moving" : ratio > 1.0 ? "drooping" : "unfolded";
  collector_state_->setText(
      QString("%1 %, %2%3").arg(number(100.0 * ratio, 0), fold, crane_->locked ? ", locked" : ""));
}

void RigPanel::showForce() {
  plot_->show(history_);
  const auto level = history_.level();
  const auto peak = history_.peak();
  QString text = "Force (kN)";
  if (level) text += QString(" &nbsp; <span style='color:#14823c'>now %1</span>").arg(kilonewton(level->force_n));
  if (peak) {
    text += QString(" &nbsp; <span style='color:#c81e1e'>peak %1 at %2 s</span>")
                .arg(kilonewton(peak->force_n), number(peak->time_s, 1));
  }
  force_->setText(text);
}

void RigPanel::showFlags() {
  const auto now = WallClock::now();
  QString text;
  for (auto flag = flags_.begin(); flag != flags_.end();) {
    if (now - flag->second.seen > kFlagStays) {
      flag = flags_.erase(flag);
      continue;
    }
    text += QString("<p style='margin:0 0 4px 0'><b>%1</b> %2</p>")
                .arg(QString::fromStdString(flag->first).toHtmlEscaped(),
                     QString::fromStdString(flag->second.remedy).toHtmlEscaped());
    ++flag;
  }
  if (text.isEmpty()) text = "<span style='color:#707070'>No flags.</span>";
  // Setting it scrolls to the top: only when it is new.
  if (flag_list_->property("shown").toString() == text) return;
  flag_list_->setProperty("shown", text);
  flag_list_->setHtml(text);
}

}  // namespace brash_ice_rig

PLUGINLIB_EXPORT_CLASS(brash_ice_rig::RigPanel, rviz::Panel)
