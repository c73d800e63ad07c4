// SPDX-License-Identifier: Apache-2.0
// Goal: the simulated drive keeps the device side of the RobStride protocol: bytes, states, parameters, watchdog.
// Method: frames written out by hand from the protocol's facts; the host's codec is not used here.
#include "simulation/robstride_device.hpp"

#include <gtest/gtest.h>

#include <optional>

namespace takt::simulation {
namespace {

config::Drive cybergear() {
  config::Drive drive;
  drive.model = "CyberGear";
  drive.protocol = config::DriveProtocol::robstride;
  drive.id = 5;
  drive.host_id = 253;
  drive.position_range = 12.566370614359172;
  drive.velocity_range = 30;
  drive.torque_range = 12;
  drive.kp_range = 500;
  drive.kd_range = 5;
  return drive;
}

drivers::CanFrame frame_of(std::uint32_t id, std::uint64_t eight_bytes = 0) {
  drivers::CanFrame frame;
  frame.id = id;
  frame.extended = true;
  frame.length = 8;
  for (unsigned i = 0; i < 8; ++i) frame.data[i] = static_cast<std::uint8_t>(eight_bytes >> (56 - 8 * i));
  return frame;
}

std::uint64_t bytes_of(const drivers::CanFrame& frame) {
  std::uint64_t all = 0;
  for (int i = 0; i < 8; ++i) all = all << 8U | frame.data[i];
  return all;
}

const drivers::CanFrame kGetId = frame_of(0x0000FD05), kEnable = frame_of(0x0300FD05), kStop = frame_of(0x0400FD05),
                        kClear = frame_of(0x0400FD05, 0x0100000000000000),
                        kSetZero = frame_of(0x0600FD05, 0x0100000000000000),
                        // p 1.0, v -2.0, kp 100, kd 1.5, t 3.0 (worked out in robstride_codec_test.cpp).
    kMotion = frame_of(0x019FFF05, 0x8a2f777733334ccc);
constexpr Duration kWatchdog = milliseconds(100);

class SimulatedRobstride : public testing::Test {
 protected:
  std::optional<drivers::CanFrame> answer_of(const drivers::CanFrame& frame) {
    Frames answers;
    drive.receive(frame, now, answers);
    EXPECT_LE(answers.size(), 1U);
    return answers.empty() ? std::nullopt : std::optional(answers.front());
  }
  // Bits 8..23 of the answer's id: mode, faults, drive.
  std::uint32_t data_after(const drivers::CanFrame& frame) {
    const auto answer = answer_of(frame);
    EXPECT_TRUE(answer && answer->id >> 24U == 2U && (answer->id & 0xFFU) == 0xFDU);
    return answer ? answer->id >> 8U & 0xFFFFU : 0;
  }
  double update(double position = 0, double velocity = 0) {
    now = now + milliseconds(1);
    return drive.update({position, velocity}, now, milliseconds(1), said);
  }
  Frames said;
  RobstrideDevice drive{cybergear(), kWatchdog};
  MonoTime now{1};
};

constexpr std::uint32_t kReset = 0x0005, kRunning = 0x8005;

TEST_F(SimulatedRobstride, TellsItsIdentityToEveryHost) {
  const auto answer = answer_of(kGetId);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->id, 0x000005FEU);
  EXPECT_EQ(answer->length, 8);
}

TEST_F(SimulatedRobstride, FeedbackTellsItsMode) {
  EXPECT_EQ(data_after(kStop), kReset);
  EXPECT_EQ(data_after(kMotion), kReset) << "a motion command enables nothing";
  EXPECT_EQ(data_after(kEnable), kRunning);
  EXPECT_EQ(data_after(kMotion), kRunning);
  EXPECT_EQ(data_after(kStop), kReset);
}

TEST_F(SimulatedRobstride, FeedbackIsPackedAsTheProtocolSays) {
  update(1.0, -2.0);
  const auto answer = answer_of(kStop);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->id, 0x020005FDU);
  // The codes of position 1.0 and velocity -2.0 as above, or one below where it is cut off; torque 0: 32767.5; 25.0
  // degrees: 250 = FA.
  EXPECT_EQ(bytes_of(*answer) >> 48U, 0x8a2fU);
  EXPECT_NEAR(static_cast<double>(bytes_of(*answer) >> 32U & 0xFFFFU), 0x7777, 1);
  EXPECT_EQ(bytes_of(*answer) & 0xFFFFFFFFU, 0x7fff00faU);
}

TEST_F(SimulatedRobstride, AnswersTheHostThatAsked) {
  const auto answer = answer_of(frame_of(0x0400AA05));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->id, 0x020005AAU);
}

TEST_F(SimulatedRobstride, TorqueIsTheImpedanceLawWhenRunningOnly) {
  answer_of(kMotion);
  EXPECT_EQ(update(), 0) << "not enabled";
  EXPECT_TRUE(drive.brake_engaged());
  answer_of(kEnable);
  EXPECT_FALSE(drive.brake_engaged());
  EXPECT_EQ(update(), 0) << "enabling forgets older commands";
  answer_of(kMotion);
  // kp (p - q) + kd (v - dq) + t, with the fields' quanta.
  EXPECT_NEAR(update(0.95, -3), 100 * 0.05 + 1.5 * 1 + 3, 0.01);
  EXPECT_EQ(update(-10, 0), 12) << "clamped to the drive's torque";
  answer_of(kStop);
  EXPECT_EQ(update(-10, 0), 0);
}

TEST_F(SimulatedRobstride, TheWatchdogTripsOnMissingMotionCommandsOnly) {
  answer_of(kEnable);
  answer_of(kMotion);
  for (int ms = 0; ms < 100; ++ms) {
    answer_of(frame_of(0x1100FD05, 0x1970000000000000));  // telemetry
    answer_of(kEnable);
    update(1.0, -2.0);
  }
  EXPECT_EQ(drive.state(), DeviceState::enabled) << "exactly at the limit";
  update();
  EXPECT_EQ(drive.state(), DeviceState::lost);
  EXPECT_LT(update(0, 2), 0) << "brakes";
  EXPECT_GT(update(0, -2), 0) << "both ways";
  EXPECT_EQ(update(3, 0), 0) << "and pushes nowhere";
  EXPECT_EQ(data_after(kMotion), kReset) << "reported as reset, without a fault; motion does not bring it back";
  EXPECT_EQ(drive.state(), DeviceState::lost);
  EXPECT_EQ(data_after(kStop), kReset);
  EXPECT_EQ(drive.state(), DeviceState::disabled);
  EXPECT_EQ(data_after(kEnable), kRunning);
}

TEST_F(SimulatedRobstride, TheTimeoutIsAParameterThatCanBeSwitchedOff) {
  // 200C, low byte first; 100 ms = 2000 units = 07D0.
  const auto told = answer_of(frame_of(0x1100FD05, 0x0c20000000000000));
  ASSERT_TRUE(told);
  EXPECT_EQ(told->id, 0x110005FDU);
  EXPECT_EQ(bytes_of(*told), 0x0c200000d0070000U);
  EXPECT_EQ(data_after(frame_of(0x1200FD05, 0x0c20000000000000)), kReset) << "a setting is answered by feedback";
  answer_of(kEnable);
  for (int ms = 0; ms < 500; ++ms) update();
  EXPECT_EQ(drive.state(), DeviceState::enabled) << "off: nobody stops it";
  answer_of(frame_of(0x1200FD05, 0x0c20000014000000));  // 20 units: 1 ms
  update();
  EXPECT_EQ(drive.state(), DeviceState::lost);
}

// The makers' manuals of RS00 to RS06: 7028, u32, 20000 is 1 s, 0 as delivered and after power-on, type 18 writes it
// for as long as there is power; a reading that fails has 01 in bits 16..23 of the answer's id.
TEST_F(SimulatedRobstride, ARobstrideForgetsItsTimeoutAndRefusesTheCybergears) {
  config::Drive rs00 = cybergear();
  rs00.model = "RS00";
  drive = RobstrideDevice(rs00, kWatchdog);
  const drivers::CanFrame ask = frame_of(0x1100FD05, 0x2870000000000000);
  EXPECT_EQ(bytes_of(*answer_of(ask)), 0x2870000000000000U) << "off as delivered";
  answer_of(kEnable);
  for (int ms = 0; ms < 500; ++ms) update();
  EXPECT_EQ(drive.state(), DeviceState::enabled);
  answer_of(frame_of(0x1200FD05, 0x2870000014000000));  // 20 units: 1 ms
  EXPECT_EQ(bytes_of(*answer_of(ask)), 0x2870000014000000U);
  update();
  update();
  EXPECT_EQ(drive.state(), DeviceState::lost);
  const auto refused = answer_of(frame_of(0x1100FD05, 0x0c20000000000000));
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->id, 0x110105FDU);
  drive.power_cycle(now);
  for (int ms = 0; ms < 300; ++ms) update();
  EXPECT_EQ(bytes_of(*answer_of(ask)), 0x2870000000000000U);
}

TEST_F(SimulatedRobstride, AnotherRunModeDoesNotObeyMotion) {
  answer_of(frame_of(0x1200FD05, 0x0570000002000000));
  EXPECT_EQ(bytes_of(*answer_of(frame_of(0x1100FD05, 0x0570000000000000))), 0x0570000002000000U);
  answer_of(kEnable);
  answer_of(kMotion);
  EXPECT_EQ(update(-10, 0), 0);
}

TEST_F(SimulatedRobstride, TellsPositionVelocityAndSupplyAsFloats) {
  update(1.5, -0.25);
  const auto bits = [this](std::uint64_t index) {
    return bytes_of(*answer_of(frame_of(0x1100FD05, index << 48U))) & 0xFFFFFFFFU;
  };
  EXPECT_EQ(bits(0x1970), 0x0000c03fU) << "1.5 = 3FC00000";
  EXPECT_EQ(bits(0x1b70), 0x000080beU) << "-0.25 = BE800000";
  EXPECT_EQ(bits(0x1c70), 0x00004042U) << "48 = 42400000";
  EXPECT_FALSE(answer_of(frame_of(0x1100FD05, 0xFFFF000000000000))) << "no such parameter";
}

TEST_F(SimulatedRobstride, SetZeroMovesTheOriginUntilPowerIsOff) {
  update(1.5);
  answer_of(kSetZero);
  EXPECT_EQ(bytes_of(*answer_of(kStop)) >> 48U, 0x7fffU);
  update(1.5);
  EXPECT_EQ(bytes_of(*answer_of(kStop)) >> 48U, 0x7fffU);
  drive.power_cycle(now);
  for (int ms = 0; ms < 300; ++ms) update(1.5);
  // (1.5 + 4 pi) * 65535 / (8 pi) = 36678.8.
  EXPECT_EQ(bytes_of(*answer_of(kStop)) >> 48U, 36678U);
}

TEST_F(SimulatedRobstride, InjectedErrorsAreReportedUntilCleared) {
  struct Row {
    DeviceFault fault;
    std::uint32_t bits;    // of feedback
    std::uint64_t report;  // type 21, low byte first
  };
  const Row rows[] = {{DeviceFault::under_voltage, 1, 0x0400000000000000},
                      {DeviceFault::over_current, 2, 0x0000010000000000},
                      {DeviceFault::over_temperature, 4, 0x0100000000000000},
                      {DeviceFault::encoder, 8, 0x8000000000000000}};
  for (const Row& row : rows) {
    said.clear();
    answer_of(kEnable);
    ASSERT_TRUE(drive.inject(row.fault));
    EXPECT_EQ(update(-1), 0);
    EXPECT_TRUE(drive.brake_engaged());
    update();
    ASSERT_EQ(said.size(), 1U) << "reported once by itself";
    EXPECT_EQ(said[0].id, 0x150005FDU);
    EXPECT_EQ(bytes_of(said[0]), row.report);
    EXPECT_EQ(data_after(kEnable), row.bits << 8U | kReset) << "not enabled while it shows";
    EXPECT_EQ(data_after(kStop), row.bits << 8U | kReset) << "a plain stop clears nothing";
    EXPECT_EQ(data_after(kClear), kReset);
  }
  EXPECT_FALSE(drive.inject(DeviceFault::over_voltage));
  EXPECT_FALSE(drive.inject(DeviceFault::overload));
  EXPECT_EQ(drive.state(), DeviceState::disabled);
}

TEST_F(SimulatedRobstride, APowerCycleSaysNothingUntilBootedAndForgetsWhatWasWritten) {
  answer_of(frame_of(0x1200FD05, 0x0570000002000000));
  answer_of(kEnable);
  drive.power_cycle(now);
  EXPECT_FALSE(answer_of(kEnable));
  EXPECT_TRUE(drive.brake_engaged());
  for (Duration waited; waited < kBootTime; waited = waited + milliseconds(1)) update();
  EXPECT_EQ(drive.state(), DeviceState::disabled);
  EXPECT_EQ(bytes_of(*answer_of(frame_of(0x1100FD05, 0x0570000000000000))), 0x0570000000000000U);
}

TEST_F(SimulatedRobstride, FramesThatAreNotForItAreNotAnswered) {
  EXPECT_FALSE(answer_of(frame_of(0x0300FD06))) << "another drive";
  EXPECT_FALSE(answer_of(frame_of(0x1F00FD05))) << "no such type";
  drivers::CanFrame odd = kEnable;
  odd.length = 7;
  EXPECT_FALSE(answer_of(odd));
  for (bool drivers::CanFrame::*flag :
       {&drivers::CanFrame::fd, &drivers::CanFrame::remote, &drivers::CanFrame::error}) {
    odd = kEnable;
    odd.*flag = true;
    EXPECT_FALSE(answer_of(odd));
  }
  odd = kEnable;
  odd.extended = false;
  EXPECT_FALSE(answer_of(odd));
  EXPECT_EQ(drive.state(), DeviceState::disabled);
}

}  // namespace
}  // namespace takt::simulation
