#include <cmath>
#include <csignal>
#include <memory>
#include <string>

#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <geometry_msgs/TwistStamped.h>
#include <rviz/panel.h>
#include <std_msgs/Float64.h>
#include <QApplication>
#include <QDoubleSpinBox>
#include <QLabel>
#include <QLineEdit>
#include <QMouseEvent>
#include <QPushButton>
#include <QSlider>
#include <QTextBrowser>
#include <QtTest/QTest>
#include <pluginlib/class_loader.hpp>

#include "../ros/test_support.h"
#include "brash_ice_rig/CraneState.h"

// The panel as rviz loads it, without a screen, at a real node in the namespace /east.
namespace brash_ice_rig {
namespace {

/// As waitFor(), but keeps the GUI going, too.
bool waitInGui(const std::function<bool()>& condition, double timeout_s = 15.0) {
  return waitFor(
      [&] {
        QApplication::processEvents();
        return condition();
      },
      timeout_s);
}

/// The node in a process of its own, which ends with the test, however that ends.
class Node {
 public:
  explicit Node(const std::string& name_space) {
    const std::string remap = "__ns:=" + name_space;
    pid_ = fork();
    if (pid_ != 0) return;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    execl(RIG_NODE, RIG_NODE, remap.c_str(), nullptr);
    _exit(127);
  }
  ~Node() { end(SIGTERM); }

  void end(int signal) {
    if (pid_ <= 0) return;
    kill(pid_, signal);
    waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }

 private:
  pid_t pid_ = -1;
};

class PanelTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    node_ = std::make_unique<Node>("/east");
    loader_ = std::make_unique<pluginlib::ClassLoader<rviz::Panel>>("rviz", "rviz::Panel");
  }
  static void TearDownTestSuite() { node_.reset(); }

  void SetUp() override {
    panel_ = loader_->createUniqueInstance("brash_ice_rig/RigPanel");
    rviz::Config config;
    config.mapSetValue("Namespace", "/east");
    config.mapSetValue("Full Speed", 0.2);
    config.mapSetValue("Step", 0.5);
    panel_->load(config);
    panel_->resize(350, 700);
    panel_->show();
    ASSERT_TRUE(waitInGui([&] { return text("head").contains("manual") && button("reset")->isEnabled(); }, 30.0));
    button("reset")->click();
    ASSERT_TRUE(waitInGui([&] { return answer().startsWith("reset: back at the start"); })) << answer().toStdString();
    ASSERT_TRUE(waitInGui([&] {
      return !crane_.messages.empty() && !status_.messages.empty() && status_.last().stage == "manual" &&
             text("head").contains("manual");
    }));
  }

  template <class Widget>
  Widget* find(const char* name) {
    auto* widget = panel_->findChild<Widget*>(name);
    if (widget == nullptr) ADD_FAILURE() << "the panel has no " << name;
    return widget;
  }
  QPushButton* button(const char* name) { return find<QPushButton>(name); }
  QString text(const char* name) { return find<QLabel>(name)->text(); }
  QString answer() { return text("answer"); }
  double speed() { return crane_.last().velocity_mps.z; }

  /// Where a vertical slider stands for a share of its travel, -1 at the lower end.
  static QPoint pointOn(const QSlider* slider, double deflection) {
    return {slider->width() / 2, static_cast<int>(std::lround(0.5 * (1.0 - deflection) * slider->height()))};
  }

  /// QTest::mouseMove() would move the mouse without its button.
  static void drag(QWidget* widget, const QPoint& point) {
    QMouseEvent move(QEvent::MouseMove, point, widget->mapToGlobal(point), Qt::NoButton, Qt::LeftButton,
                     Qt::NoModifier);
    QApplication::sendEvent(widget, &move);
  }

  static std::unique_ptr<Node> node_;
  static std::unique_ptr<pluginlib::ClassLoader<rviz::Panel>> loader_;
  pluginlib::UniquePtr<rviz::Panel> panel_;
  Listener<CraneState> crane_{"/east/crane/state"};
  Listener<SimStatus> status_{"/east/sim/status"};
  Listener<geometry_msgs::TwistStamped> commands_{"/east/crane/cmd_vel"};
};

std::unique_ptr<Node> PanelTest::node_;
std::unique_ptr<pluginlib::ClassLoader<rviz::Panel>> PanelTest::loader_;

TEST_F(PanelTest, HeldSliderMovesTheHoistAndReleaseStopsItWithOneZero) {
  auto* hoist = find<QSlider>("hoist");
  const double start_m = crane_.last().position_m.z;
  QTest::mousePress(hoist, Qt::LeftButton, Qt::NoModifier, pointOn(hoist, 1.0));
  EXPECT_TRUE(waitInGui([&] { return std::abs(speed() - 0.2) < 1e-9; })) << speed();
  EXPECT_GT(crane_.last().position_m.z, start_m + 0.03);
  drag(hoist, pointOn(hoist, -1.0));
  EXPECT_TRUE(waitInGui([&] { return std::abs(speed() + 0.2) < 1e-9; })) << speed();
  QTest::mouseRelease(hoist, Qt::LeftButton, Qt::NoModifier, pointOn(hoist, -1.0));
  EXPECT_EQ(hoist->value(), 0) << "it springs back";
  EXPECT_TRUE(waitInGui([&] { return speed() == 0.0; }));

  ASSERT_TRUE(waitInGui([&] { return commands_.last().twist.linear.z == 0.0; }));
  const std::size_t sent = commands_.messages.size();
  EXPECT_NE(commands_.messages[sent - 2].twist.linear.z, 0.0) << "one zero";
  waitInGui([] { return false; }, 0.5);
  EXPECT_EQ(commands_.messages.size(), sent) << "then silence";
}

TEST_F(PanelTest, SliderThatIsHiddenWhileHeldStopsTheCrane) {
  auto* hoist = find<QSlider>("hoist");
  QTest::mousePress(hoist, Qt::LeftButton, Qt::NoModifier, pointOn(hoist, -0.8));
  ASSERT_TRUE(waitInGui([&] { return speed() < -0.1; }));
  panel_->hide();
  EXPECT_TRUE(waitInGui([&] { return speed() == 0.0; }));
  EXPECT_EQ(commands_.last().twist.linear.z, 0.0);
}

TEST_F(PanelTest, CraneMovesOnWhileRvizDrawsAFrameButNotWhenItHangs) {
  auto* hoist = find<QSlider>("hoist");
  QTest::mousePress(hoist, Qt::LeftButton, Qt::NoModifier, pointOn(hoist, 1.0));
  ASSERT_TRUE(waitInGui([&] { return speed() > 0.1; }));
  // waitFor() serves no events of the GUI.
  EXPECT_FALSE(waitFor([&] { return speed() < 0.1; }, 1.0)) << "the watchdog waits only 0.25 s";
  EXPECT_TRUE(waitFor([&] { return speed() == 0.0; }));
  EXPECT_EQ(commands_.last().twist.linear.z, 0.0) << "stopped by a zero";
  waitInGui([] { return false; }, 0.3);
  EXPECT_EQ(hoist->value(), 0) << "it has to be pressed anew";
  EXPECT_TRUE(answer().startsWith("rviz stood still for 2 s")) << answer().toStdString();
  const std::size_t sent = commands_.messages.size();
  drag(hoist, pointOn(hoist, 0.5));
  waitInGui([] { return false; }, 0.3);
  EXPECT_EQ(commands_.messages.size(), sent);
  QTest::mouseRelease(hoist, Qt::LeftButton, Qt::NoModifier, pointOn(hoist, 0.5));
}

TEST_F(PanelTest, AnswersDoNotMoveTheControlsUnderTheMouse) {
  const auto height = [&] { return find<QSlider>("hoist")->mapTo(panel_.get(), QPoint()).y(); };
  waitInGui([] { return false; }, 0.2);
  const int with_answer = height();
  EXPECT_FALSE(answer().isEmpty());
  find<QLabel>("answer")->clear();
  waitInGui([] { return false; }, 0.2);
  EXPECT_EQ(height(), with_answer);
}

TEST_F(PanelTest, WheelAndKeysDoNotDrive) {
  auto* boom = find<QSlider>("boom_x");
  QWheelEvent wheel(QPointF(5, 5), boom->mapToGlobal(QPoint(5, 5)), QPoint(), QPoint(0, 240), Qt::NoButton,
                    Qt::NoModifier, Qt::NoScrollPhase, false);
  QApplication::sendEvent(boom, &wheel);
  QTest::keyClick(boom, Qt::Key_PageUp);
  EXPECT_EQ(boom->value(), 0);
  waitInGui([] { return false; }, 0.3);
  EXPECT_TRUE(commands_.messages.empty());
}

TEST_F(PanelTest, FoldButtonsTurnTheArms) {
  button("fold")->click();
  EXPECT_TRUE(waitInGui([&] { return crane_.last().fold_target == 0.0; }));
  EXPECT_TRUE(waitInGui([&] { return text("collector_state").contains("moving"); }))
      << text("collector_state").toStdString();
  button("unfold")->click();
  EXPECT_TRUE(waitInGui([&] { return crane_.last().fold_target == 1.0; }));
}

TEST_F(PanelTest, PauseStepAndResumeCallTheNode) {
  EXPECT_FALSE(button("step")->isEnabled()) << "only while paused";
  button("pause")->click();
  ASSERT_TRUE(waitInGui([&] { return answer() == "pause: paused" && button("step")->isEnabled(); }));
  EXPECT_EQ(button("pause")->text(), "Resume");
  const double before_s = status_.last().time_s;
  button("step")->click();
  EXPECT_TRUE(waitInGui([&] { return answer().startsWith("step: "); }));
  EXPECT_TRUE(waitInGui([&] { return std::abs(status_.last().time_s - before_s - 0.5) < 1e-6; }));
  button("pause")->click();
  EXPECT_TRUE(waitInGui([&] { return answer() == "resume: resumed"; }));
  EXPECT_TRUE(waitInGui([&] { return !status_.last().paused; }));
}

TEST_F(PanelTest, StageButtonRunsTheScriptToThatStageAndPauses) {
  for (const char* stage : {"stage_lift", "stage_done"}) {
    EXPECT_FALSE(button(stage)->isEnabled()) << "no script here";
  }
  const Node scripted("/script");
  Listener<SimStatus> status("/script/sim/status");
  rviz::Config config;
  config.mapSetValue("Namespace", "/script");
  panel_->load(config);
  ASSERT_TRUE(waitInGui([&] { return button("stage_lift")->isEnabled() && !status.messages.empty(); }, 30.0));
  EXPECT_TRUE(status.last().paused);
  EXPECT_EQ(status.last().stage, "settle");
  EXPECT_FALSE(button("stage_settle")->isEnabled()) << "is there already";
  button("stage_unfold")->click();  // this scenario has no such stage: it stops at the next one
  EXPECT_TRUE(waitInGui([&] { return answer() == "pause: paused"; })) << answer().toStdString();
  EXPECT_TRUE(waitInGui([&] { return status.last().paused && status.last().stage == "lift"; }));
  EXPECT_LT(status.last().time_s, 1.5) << "not at the end of the lift";
}

TEST_F(PanelTest, TareMakesTheReadingZeroAndThePlotBeginsAnew) {
  ASSERT_TRUE(waitInGui([&] { return text("force").contains("now 1."); })) << text("force").toStdString();
  button("tare")->click();
  EXPECT_TRUE(waitInGui([&] { return answer().startsWith("tare: "); }));
  EXPECT_TRUE(waitInGui([&] { return text("force").contains("now 0.0 kN"); })) << text("force").toStdString();
}

TEST_F(PanelTest, FlagComesWithItsRemedy) {
  find<QDoubleSpinBox>("full_speed")->setValue(2.0);
  auto* hoist = find<QSlider>("hoist");
  QTest::mousePress(hoist, Qt::LeftButton, Qt::NoModifier, pointOn(hoist, 1.0));
  EXPECT_TRUE(waitInGui([&] { return find<QTextBrowser>("flags")->toPlainText().contains("crane.max_speed_mps"); }));
  QTest::mouseRelease(hoist, Qt::LeftButton, Qt::NoModifier, pointOn(hoist, 0.0));
  EXPECT_TRUE(find<QTextBrowser>("flags")->toPlainText().contains("speed_limited"));
}

TEST_F(PanelTest, BadNamespaceIsRefusedInWords) {
  auto* field = find<QLineEdit>("namespace");
  field->clear();
  QTest::keyClicks(field, "no good!");
  QTest::keyClick(field, Qt::Key_Return);
  EXPECT_TRUE(answer().startsWith("Namespace: ")) << answer().toStdString();
}

TEST_F(PanelTest, PropertiesAreSaved) {
  rviz::Config config;
  panel_->save(config);
  QString name;
  float speed_mps = 0.0F, step_s = 0.0F;
  ASSERT_TRUE(config.mapGetString("Namespace", &name));
  ASSERT_TRUE(config.mapGetFloat("Full Speed", &speed_mps));
  ASSERT_TRUE(config.mapGetFloat("Step", &step_s));
  EXPECT_EQ(name, "/east");
  EXPECT_NEAR(speed_mps, 0.2, 1e-6);
  EXPECT_NEAR(step_s, 0.5, 1e-6);
}

TEST_F(PanelTest, SurvivesTheDeathAndRestartOfTheNode) {
  ASSERT_TRUE(waitInGui([&] { return status_.last().time_s > 1.5; }));
  node_->end(SIGKILL);
  EXPECT_TRUE(waitInGui([&] { return text("head").contains("No rig in /east"); }));
  EXPECT_FALSE(button("pause")->isEnabled());
  node_ = std::make_unique<Node>("/east");
  EXPECT_TRUE(waitInGui([&] { return text("head").contains("manual"); }, 30.0));
  EXPECT_TRUE(waitInGui([&] { return text("force").contains("now"); }));
  // Services of the new node, and its crane.
  button("pause")->click();
  EXPECT_TRUE(waitInGui([&] { return answer() == "pause: paused"; })) << answer().toStdString();
  ASSERT_TRUE(waitInGui([&] { return button("pause")->isEnabled() && button("pause")->text() == "Resume"; }));
  button("pause")->click();
  auto* hoist = find<QSlider>("hoist");
  QTest::mousePress(hoist, Qt::LeftButton, Qt::NoModifier, pointOn(hoist, 1.0));
  EXPECT_TRUE(waitInGui([&] { return speed() > 0.1; }));
  QTest::mouseRelease(hoist, Qt::LeftButton, Qt::NoModifier, pointOn(hoist, 1.0));
}

TEST_F(PanelTest, HungNodeDoesNotHangTheGui) {
  // A service that takes its time: the panel's own event loop must go on meanwhile.
  ros::NodeHandle west("/west");
  SimStatus status;
  status.stage = "manual";
  auto publisher = west.advertise<SimStatus>("sim/status", 1, true);
  publisher.publish(status);
  rviz::Config config;
  config.mapSetValue("Namespace", "/west");
  panel_->load(config);
  bool called = false;
  auto service = west.advertiseService<std_srvs::Trigger::Request, std_srvs::Trigger::Response>(
      "load_cell/tare", boost::function<bool(std_srvs::Trigger::Request&, std_srvs::Trigger::Response&)>(
                            [&](std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
                              called = true;
                              response.success = false;
                              response.message = "not now";
                              return true;
                            }));
  ASSERT_TRUE(waitInGui([&] { return button("tare")->isEnabled(); }));
  button("tare")->click();
  // Nobody serves callbacks here: the call stays open, and the GUI works on.
  const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(500);
  int turns = 0;
  while (std::chrono::steady_clock::now() < until) {
    QApplication::processEvents(QEventLoop::AllEvents, 10);
    ++turns;
  }
  EXPECT_GT(turns, 10);
  EXPECT_FALSE(called);
  EXPECT_FALSE(button("tare")->isEnabled()) << "one call at a time";
  EXPECT_TRUE(waitInGui([&] { return answer() == "tare: not now"; })) << answer().toStdString();
}

}  // namespace
}  // namespace brash_ice_rig

int main(int argc, char** argv) {
  QApplication application(argc, argv);
  return brash_ice_rig::runRosTest(argc, argv, "panel_test");
}
