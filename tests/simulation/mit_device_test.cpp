// SPDX-License-Identifier: Apache-2.0
// Goal: the simulated drive keeps the device side of the protocol: bytes, states, watchdog, answers that lag one frame.
// Method: frames written out by hand from the protocol's facts; the host's codec is not used here.
#include "simulation/mit_device.hpp"

#include <gtest/gtest.h>

#include <optional>

namespace takt::simulation {
namespace {

config::Drive damiao(std::string variant = "damiao") {
  config::Drive drive;
  drive.variant = std::move(variant);
  drive.id = 4;
  drive.reply_id = 0x14;
  drive.position_range = 12.5;
  drive.velocity_range = 30;
  drive.torque_range = 10;
  drive.kp_range = 500;
  drive.kd_range = 5;
  return drive;
}

drivers::CanFrame command(std::uint64_t eight_bytes, std::uint32_t id = 4) {
  drivers::CanFrame frame;
  frame.id = id;
  frame.length = 8;
  for (unsigned i = 0; i < 8; ++i) frame.data[i] = static_cast<std::uint8_t>(eight_bytes >> (56 - 8 * i));
  return frame;
}

constexpr std::uint64_t kEnter = 0xFFFFFFFFFFFFFFFC, kExit = 0xFFFFFFFFFFFFFFFD, kSetZero = 0xFFFFFFFFFFFFFFFE,
                        kClear = 0xFFFFFFFFFFFFFFFB;
// DM4310: p 0.5, v 1.0, kp 20, kd 0.5, t -2.0 (vector of the protocol's notes).
constexpr std::uint64_t kMotion = 0x851e8430a3199666;
constexpr Duration kWatchdog = milliseconds(100);

class SimulatedDrive : public testing::Test {
 protected:
  int status_of(std::uint64_t bytes) {
    const auto answer = answer_of(drive, command(bytes));
    EXPECT_TRUE(answer);
    return answer ? answer->data[0] >> 4 : -1;
  }
  double update(double position = 0, double velocity = 0) {
    now = now + milliseconds(1);
    return drive.update({position, velocity}, now, milliseconds(1), said);
  }
  std::optional<drivers::CanFrame> answer_of(Device& device, const drivers::CanFrame& frame) {
    Frames answers;
    device.receive(frame, now, answers);
    EXPECT_LE(answers.size(), 1U);
    return answers.empty() ? std::nullopt : std::optional(answers.front());
  }
  Frames said;
  MitDevice drive{damiao(), kWatchdog};
  MonoTime now{1};
};

TEST_F(SimulatedDrive, AnswersTellTheEarlierState) {
  EXPECT_EQ(status_of(kEnter), 0);
  EXPECT_EQ(status_of(kMotion), 1);
  EXPECT_EQ(status_of(kExit), 1);
  EXPECT_EQ(status_of(kExit), 0);
}

TEST_F(SimulatedDrive, TheReplyIsPackedAsTheProtocolSays) {
  update(0.5, 1.0);
  const auto answer = answer_of(drive, command(kExit));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->id, 0x14U);
  EXPECT_EQ(answer->length, 8);
  // (0.5 + 12.5) * 65535 / 25 = 34078.2 = 0x851E; (1 + 30) * 4095 / 60 = 2115.7 = 0x843; torque 0: 2047.5 = 0x7FF.
  const std::uint8_t expected[8]{0x04, 0x85, 0x1E, 0x84, 0x37, 0xFF, 25, 25};
  for (int i = 0; i < 8; ++i) EXPECT_EQ(answer->data[i], expected[i]) << i;
}

TEST_F(SimulatedDrive, ATMotorReplyHasSixBytesAndNoState) {
  MitDevice tmotor(damiao("tmotor"), kWatchdog);
  const auto answer = answer_of(tmotor, command(kEnter));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->length, 6);
  EXPECT_EQ(answer->data[0], 4);
}

TEST_F(SimulatedDrive, TorqueIsTheImpedanceLawWhenEnabledOnly) {
  answer_of(drive, command(kMotion));
  EXPECT_EQ(update(), 0) << "disabled";
  EXPECT_TRUE(drive.brake_engaged());
  answer_of(drive, command(kEnter));
  EXPECT_FALSE(drive.brake_engaged());
  EXPECT_EQ(update(), 0) << "entering motor mode forgets older commands";
  answer_of(drive, command(kMotion));
  // kp (p - q) + kd (v - dq) + t, with the fields' quanta.
  EXPECT_NEAR(update(0.2, -1), 20 * 0.3 + 0.5 * 2 - 2, 0.06);
  EXPECT_EQ(update(-10, 0), 10) << "clamped to the drive's torque";
}

TEST_F(SimulatedDrive, TheWatchdogTripsOnMissingMotionCommandsOnly) {
  answer_of(drive, command(kEnter));
  answer_of(drive, command(kMotion));
  for (int ms = 0; ms < 100; ++ms) update();
  EXPECT_EQ(drive.state(), DeviceState::enabled) << "exactly at the limit";
  update();
  EXPECT_EQ(drive.state(), DeviceState::lost);
  EXPECT_LT(update(0, 2), 0) << "brakes";
  EXPECT_GT(update(0, -2), 0) << "both ways";
  EXPECT_EQ(update(3, 0), 0) << "and pushes nowhere";
  EXPECT_EQ(status_of(kMotion), 0xD);
  EXPECT_EQ(status_of(kEnter), 0xD) << "a motion command does not bring it back";
  EXPECT_EQ(status_of(kExit), 0xD) << "nor does entering motor mode";
  EXPECT_EQ(status_of(kClear), 0xD);
  EXPECT_EQ(status_of(kEnter), 0) << "cleared";
  EXPECT_EQ(status_of(kEnter), 1);
}

TEST_F(SimulatedDrive, TelemetryTrafficDoesNotFeedTheWatchdog) {
  answer_of(drive, command(kEnter));
  for (int ms = 0; ms <= 100; ++ms) {
    answer_of(drive, command(kEnter));
    update();
  }
  EXPECT_EQ(drive.state(), DeviceState::lost);
}

TEST_F(SimulatedDrive, ALostTMotorDriveComesBackThroughExitAndEnter) {
  MitDevice tmotor(damiao("tmotor"), kWatchdog);
  answer_of(tmotor, command(kEnter));
  now = now + milliseconds(200);
  tmotor.update({}, now, milliseconds(1), said);
  EXPECT_EQ(tmotor.state(), DeviceState::lost);
  answer_of(tmotor, command(kExit));
  answer_of(tmotor, command(kEnter));
  EXPECT_EQ(tmotor.state(), DeviceState::enabled);
}

TEST_F(SimulatedDrive, SetZeroMovesTheOrigin) {
  update(1.5);
  answer_of(drive, command(kSetZero));
  answer_of(drive, command(kEnter));
  answer_of(drive, command(0x80008000'00000800 | 0));  // p just above 0, no gains
  update(1.5);
  const auto answer = answer_of(drive, command(kEnter));
  EXPECT_EQ(answer->data[1] << 8 | answer->data[2], 0x7FFF) << "the old 1.5 rad is the new zero";
}

TEST_F(SimulatedDrive, InjectedErrorsAreReportedUntilCleared) {
  answer_of(drive, command(kEnter));
  drive.inject(DeviceFault::over_current);
  EXPECT_EQ(update(-1), 0);
  EXPECT_TRUE(drive.brake_engaged());
  EXPECT_EQ(status_of(kEnter), 0xA);
  EXPECT_EQ(status_of(kClear), 0xA);
  EXPECT_EQ(status_of(kExit), 0);
}

TEST_F(SimulatedDrive, APowerCycleSaysNothingUntilBootedAndForgetsThatItWasEnabled) {
  answer_of(drive, command(kEnter));
  drive.power_cycle(now);
  EXPECT_FALSE(answer_of(drive, command(kEnter)));
  EXPECT_TRUE(drive.brake_engaged());
  for (Duration waited; waited < kBootTime; waited = waited + milliseconds(1)) update();
  EXPECT_EQ(drive.state(), DeviceState::disabled);
  EXPECT_EQ(status_of(kEnter), 0);
}

// [drive low, drive high, operation, register, value low first] on 0x7FF.
TEST_F(SimulatedDrive, TellsItsSettings) {
  const auto value = [this](std::uint64_t question) {
    const auto answer = answer_of(drive, command(question, 0x7FF));
    EXPECT_TRUE(answer);
    if (!answer) return std::uint64_t{0};
    EXPECT_EQ(answer->id, 0x14U);
    std::uint64_t all = 0;
    for (int i = 0; i < 8; ++i) all = all << 8U | answer->data[i];
    return all;
  };
  EXPECT_EQ(value(0x0400331500000000), 0x0400331500004841U) << "12.5 = 41480000";
  EXPECT_EQ(value(0x0400331600000000), 0x040033160000f041U) << "30 = 41F00000";
  EXPECT_EQ(value(0x0400331700000000), 0x0400331700002041U) << "10 = 41200000";
  EXPECT_EQ(value(0x0400330a00000000), 0x0400330a01000000U) << "MIT mode";
  EXPECT_EQ(value(0x0400330900000000), 0x04003309d0070000U) << "100 ms = 2000 units of 50 us";
  EXPECT_FALSE(answer_of(drive, command(0x0500331500000000, 0x7FF))) << "another drive's";
  EXPECT_FALSE(answer_of(drive, command(0x0400336300000000, 0x7FF))) << "no such register";
  EXPECT_EQ(value(0x0400CC0000000000) >> 56U, 0x04U) << "refresh: a report, disabled";
  MitDevice tmotor(damiao("tmotor"), kWatchdog);
  EXPECT_FALSE(answer_of(tmotor, command(0x0400331500000000, 0x7FF)));
}

TEST_F(SimulatedDrive, ObeysItsSettings) {
  answer_of(drive, command(0x04005517'0000a041, 0x7FF));  // torque range 20
  answer_of(drive, command(kEnter));
  answer_of(drive, command(kMotion));
  EXPECT_NEAR(update(0.5, 1.0), -4, 0.06) << "the code that meant -2 Nm means twice that";
  EXPECT_FALSE(answer_of(drive, command(0x04005517'00002041, 0x7FF))) << "not while enabled";
  answer_of(drive, command(kExit));
  answer_of(drive, command(0x04005509'00000000, 0x7FF));  // time-out off
  answer_of(drive, command(kEnter));
  answer_of(drive, command(kMotion));
  for (int ms = 0; ms < 500; ++ms) update(0.5, 1.0);
  EXPECT_EQ(drive.state(), DeviceState::enabled);
  answer_of(drive, command(kExit));
  answer_of(drive, command(0x0400550a'02000000, 0x7FF));  // position and velocity mode
  answer_of(drive, command(kEnter));
  answer_of(drive, command(kMotion));
  EXPECT_EQ(update(0.5, 1.0), 0) << "motion commands mean nothing in another mode";
}

TEST_F(SimulatedDrive, WrittenSettingsOutliveThePowerOnlyWhenStored) {
  const auto torque_range = [this] {
    const auto answer = answer_of(drive, command(0x0400331700000000, 0x7FF));
    return answer ? answer->data[6] << 8 | answer->data[7] : 0;
  };
  const auto power_cycle = [this] {
    drive.power_cycle(now);
    for (int ms = 0; ms < 300; ++ms) update();
  };
  answer_of(drive, command(0x04005517'0000a041, 0x7FF));
  EXPECT_EQ(torque_range(), 0xa041);
  power_cycle();
  EXPECT_EQ(torque_range(), 0x2041) << "forgotten";
  answer_of(drive, command(0x04005517'0000a041, 0x7FF));
  answer_of(drive, command(0x0400aa01'00000000, 0x7FF));
  power_cycle();
  EXPECT_EQ(torque_range(), 0xa041) << "stored";
}

TEST_F(SimulatedDrive, FramesThatAreNotForItAreNotAnswered) {
  EXPECT_FALSE(answer_of(drive, command(kEnter, 5)));
  drivers::CanFrame odd = command(kEnter);
  odd.length = 7;
  EXPECT_FALSE(answer_of(drive, odd));
  odd = command(kEnter);
  odd.extended = true;
  EXPECT_FALSE(answer_of(drive, odd));
  EXPECT_EQ(drive.state(), DeviceState::disabled);
}

TEST_F(SimulatedDrive, HardWorkWarmsTheWinding) {
  answer_of(drive, command(kEnter));
  for (int s = 0; s < 200; ++s) {
    answer_of(drive, command(0x80007FF0000007FFU | 0xFFF));  // full torque
    now = now + milliseconds(50);
    drive.update({}, now, seconds(1), said);
  }
  const auto answer = answer_of(drive, command(kExit));
  EXPECT_GT(answer->data[7], 75) << "close to the final 85 degrees";
  EXPECT_LT(answer->data[6], answer->data[7]);
}

}  // namespace
}  // namespace takt::simulation
