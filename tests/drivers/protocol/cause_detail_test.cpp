// SPDX-License-Identifier: Apache-2.0
// Goal: a cause comes with the joint or bus it is about. Method: records made by hand, sentences compared whole.
#include "drivers/protocol/cause_detail.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "config/load.hpp"
#include "drivers/protocol/joint_driver.hpp"

namespace takt::drivers {
namespace {

class CauseDetail : public testing::Test {
 protected:
  CauseDetail() {
    record->header.joint_count = static_cast<std::uint32_t>(robot.joints.size());
    record->header.bus_count = static_cast<std::uint8_t>(robot.buses.size());
    record->header.now = MonoTime{} + seconds(5);
    for (JointRecord& joint : record->joints) {
      joint.feedback.received_at = record->header.now;
      joint.feedback.drive_state = DriveState::enabled;
    }
  }
  [[nodiscard]] std::string detail(Cause cause) const { return cause_detail(cause, *record, robot); }

  config::RobotConfig robot = config::load("config/arm6.yaml").value();
  std::unique_ptr<TickRecord> record = std::make_unique<TickRecord>();
};

TEST_F(CauseDetail, IsEmptyWhereNothingIsWrongAndForTheRobotAsAWhole) {
  for (std::size_t cause = 0; cause < kCauseCount; ++cause) EXPECT_EQ(detail(static_cast<Cause>(cause)), "") << cause;
}

TEST_F(CauseDetail, NamesEveryJointAndWhatItsDriveSays) {
  record->joints[2].feedback = {.received_at = record->header.now, .error_code = 0xB, .drive_state = DriveState::fault};
  record->joints[3].feedback.drive_state = DriveState::fault;
  EXPECT_EQ(detail(Cause::drive_fault),
            "joint elbow: output stage over-temperature; joint wrist_roll: the drive reports a fault");
  record->joints[3].feedback.drive_state = DriveState::disabled;
  EXPECT_EQ(detail(Cause::drive_disabled), "joint wrist_roll: left the enabled state by itself");
}

// Goal: of a drive whose joint may be anywhere the sentence claims no loss of power, and its command works as typed but
// for the place. Method: the fault that the drivers report after a start or a silence, of a rotary joint and a slide.
TEST_F(CauseDetail, APlaceThatIsNotKnownComesWithTheCommandThatTellsIt) {
  record->joints[2].feedback = {.received_at = record->header.now,
                                .error_code = setup_fault_code(SetupFault::home_unknown),
                                .drive_state = DriveState::fault};
  const std::string known =
      "joint elbow: where the joint is, is not known: its drive started, or fell silent and may have lost its supply ";
  EXPECT_EQ(detail(Cause::drive_fault), known + "(takt joint home elbow --robot config/arm6.yaml --at ANGLE)");
  robot.joints[2].kind = config::JointKind::slide;
  EXPECT_EQ(detail(Cause::drive_fault), known + "(takt joint home elbow --robot config/arm6.yaml --at LENGTH)");
}

TEST_F(CauseDetail, TellsHowLongAJointWasSilent) {
  record->joints[0].feedback.received_at = record->header.now - milliseconds(21);
  record->joints[1].feedback.received_at = {};
  EXPECT_EQ(detail(Cause::feedback_lost), "joint base_yaw: silent for 21.0 ms; joint shoulder: never answered");
}

TEST_F(CauseDetail, TellsThatEveryJointFellSilentAtOnce) {
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
    record->joints[joint].feedback.received_at =
        record->header.now - milliseconds(21) - milliseconds(1) * static_cast<std::int64_t>(joint);
  EXPECT_EQ(detail(Cause::feedback_lost),
            "every joint at once, silent for 26.0 ms: the drives' power or the buses (simulated: takt-plant) failed, "
            "or the computer stood still");
  record->joints[0].feedback.received_at = record->header.now;
  EXPECT_EQ(detail(Cause::feedback_lost).find("every joint"), std::string::npos);
}

TEST_F(CauseDetail, TellsWhatCannotBeTrueOfAJoint) {
  record->joints[0].reply_faults = bit(ReplyFault::from_future);
  EXPECT_EQ(detail(Cause::feedback_lost), "joint base_yaw: its newest reply is stamped in the future");
  record->joints[0].reply_faults = bit(ReplyFault::outlier);
  EXPECT_EQ(detail(Cause::feedback_implausible), "") << "one outlier is no cause";
  record->joints[1].reply_faults = bit(ReplyFault::jumped);
  record->joints[2].reply_faults = bit(ReplyFault::contradicts);
  record->joints[3].reply_faults = bit(ReplyFault::frozen);
  EXPECT_EQ(
      detail(Cause::feedback_implausible),
      "joint shoulder: its position jumped further than the joint can move: check its encoder, and home it before "
      "the reset; joint elbow: its positions contradict the drive's own velocity: check encoder, sign and scale "
      "before the reset; joint wrist_roll: its position stands still while the joint moves: check its encoder "
      "before the reset");
}

TEST_F(CauseDetail, TellsThatTheComputerSlept) {
  record->header.slept_ms = 3'249;
  EXPECT_EQ(detail(Cause::feedback_lost), "the computer was suspended for 3.2 s");
}

TEST_F(CauseDetail, TellsWhereTheEnvelopeWasLeft) {
  record->joints[4].feedback.q = 2.0F;  // limit 1.8, margin 0.15
  record->joints[5].dq_estimate = -12.5F;
  EXPECT_EQ(detail(Cause::envelope_exceeded),
            "joint wrist_pitch: at 2.000 rad, outside its limits and margin; "
            "joint wrist_yaw: at -12.500 rad/s, faster than velocity_hard");
}

TEST_F(CauseDetail, OfASlideTellsMetresAndNewtons) {
  robot.joints[4].kind = robot.joints[5].kind = config::JointKind::slide;
  record->joints[4].feedback.q = 2.0F;
  record->joints[5].dq_estimate = -12.5F;
  EXPECT_EQ(detail(Cause::envelope_exceeded),
            "joint wrist_pitch: at 2.000 m, outside its limits and margin; "
            "joint wrist_yaw: at -12.500 m/s, faster than velocity_hard");
  record->joints[5].behind = 1;
  record->joints[5].q_reference = 0.5F;
  const std::string behind = detail(Cause::following_error);
  EXPECT_NE(behind.find("0.500 m from its reference, more than 90 % of limits.torque ("), std::string::npos) << behind;
  EXPECT_NE(behind.find(" N) allows"), std::string::npos) << behind;
}

TEST_F(CauseDetail, TellsWhatTheGuardRefused) {
  record->joints[1].feedback.refused = WireVerdict::slew;
  record->joints[2].feedback.refused = WireVerdict::expired;
  EXPECT_EQ(detail(Cause::internal_error), "joint shoulder: the last guard refused a frame: slew");
}

TEST_F(CauseDetail, TellsWhichPartIsHot) {
  robot.joints[1].limits.temperature = {.warning = 80, .stop = 100, .casing_warning = 60, .casing_stop = 70};
  record->joints[1].feedback.temperature_C = 101;
  EXPECT_EQ(detail(Cause::overtemperature), "joint shoulder: at 101 degC, beyond temperature.stop 100");
  EXPECT_EQ(detail(Cause::temperature_high), "joint shoulder: at 101 degC, beyond temperature.warning 80");
  record->joints[1].feedback.temperature_C = 75;
  record->joints[1].feedback.casing_C = 71;
  EXPECT_EQ(detail(Cause::overtemperature), "joint shoulder: its casing at 71 degC, beyond temperature.casing_stop 70");
}

TEST_F(CauseDetail, NamesTheBus) {
  record->header.buses[1].state = BusState::bus_off;
  robot.file = "r.yaml";
  robot.buses[1].interface = "can1";
  robot.buses[1].when_missing = config::WhenBusMissing::refuse;
  EXPECT_EQ(detail(Cause::bus_off),
            "bus can1: bus-off; where it stays off, this restarts it: takt bus up --robot r.yaml --interface can1");
  robot.buses[1].when_missing = config::WhenBusMissing::loopback;
  EXPECT_EQ(
      detail(Cause::bus_off),
      "bus can1: bus-off; a simulated bus comes back by its scenario, a real one, where it stays off, by: takt bus up "
      "--robot r.yaml --interface can1");
  record->header.buses[0].foreign_frames = 12;
  EXPECT_EQ(detail(Cause::foreign_node), "bus can0: 12 frames foreign since start");
  record->joints[2].reply_faults = bit(ReplyFault::lost) | bit(ReplyFault::delayed);
  EXPECT_EQ(detail(Cause::replies_delayed), "joint elbow: replies late");
  EXPECT_EQ(detail(Cause::replies_repeated), "");
}

}  // namespace
}  // namespace takt::drivers
