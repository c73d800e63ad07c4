// Goal: an operator whom the robot refuses to arm is told what the drive itself said, not only that it said something.
// Method: a record in which one drive reports that its time-out is off, and the sentence that comes of it.
#include "executive/runtime/arming.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "config/load.hpp"
#include "drivers/protocol/joint_driver.hpp"
#include "executive/setup/tick_config_of.hpp"

namespace takt::runtime {
namespace {

TEST(Arming, ARefusalNamesTheSettingThatTheDriveLacks) {
  const config::RobotConfig robot = config::load("config/arm6.yaml").value();
  const auto config = std::make_unique<pipeline::TickConfig>(config::tick_config_of(robot, 1));
  const auto record = std::make_unique<TickRecord>();
  record->header.tick = 1;
  record->header.joint_count = static_cast<std::uint32_t>(robot.joints.size());
  record->header.now = MonoTime{1'000'000};
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    JointFeedback& feedback = record->joints[joint].feedback;
    feedback.received_at = record->header.now;
    feedback.drive_state = DriveState::disabled;
  }
  JointFeedback& elbow = record->joints[2].feedback;
  elbow.drive_state = DriveState::fault;
  elbow.error_code = drivers::setup_fault_code(drivers::SetupFault::watchdog_off, 9);
  std::string all;
  for (const std::string& sentence :
       missing_for_arming(*record, *config, robot.joints, {.policy_attached = true, .realtime = true}))
    all += sentence + "\n";
  EXPECT_NE(all.find("joint " + robot.joints[2].name +
                     ": the drive reports a fault: the drive's own time-out is off or longer than 1 s"),
            std::string::npos)
      << all;
  EXPECT_NE(all.find("time-out (register 9)"), std::string::npos) << all;
}

}  // namespace
}  // namespace takt::runtime
