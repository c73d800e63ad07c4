// SPDX-License-Identifier: Apache-2.0
// Goal: the simulated ODrive keeps the device side of CANSimple: bytes, states, watchdog, broadcasts.
// Method: frames written out by hand from the protocol's facts; the host's codec is not used here.
#include "simulation/odrive_device.hpp"

#include <gtest/gtest.h>

#include <map>

#include "tests/drivers/bus/frame_text.hpp"

namespace takt::simulation {
namespace {

using test::frame_of;
using test::hex;

class SimulatedOdrive : public testing::Test {
 protected:
  static config::Drive node3() {
    config::Drive drive;
    drive.protocol = config::DriveProtocol::odrive;
    drive.id = 3;
    drive.torque_range = 6;
    return drive;
  }
  void send(std::uint32_t id, std::string_view bytes) {
    Frames answers;
    device.receive(frame_of(id, bytes), now, answers);
    EXPECT_TRUE(answers.empty()) << "a drive that only broadcasts";
  }
  double update(double position = 0, double velocity = 0) {
    now = now + milliseconds(1);
    Frames said;
    const double torque = device.update({position, velocity}, now, milliseconds(1), said);
    for (const drivers::CanFrame& frame : said) {
      ++count[frame.id];
      newest[frame.id] = hex(frame);
    }
    return torque;
  }
  void enable() {
    send(0x06B, "0100000001000000");
    send(0x067, "08000000");
  }
  OdriveDevice device{node3(), milliseconds(100)};
  MonoTime now{1};
  std::map<std::uint32_t, int> count;
  std::map<std::uint32_t, std::string> newest;
};

TEST_F(SimulatedOdrive, BroadcastsByItself) {
  for (int ms = 0; ms < 1000; ++ms) update(M_PI_2, M_PI);
  EXPECT_EQ(count[0x069], 1000);
  EXPECT_EQ(count[0x061], 100);
  EXPECT_EQ(count[0x07C], 100);
  EXPECT_EQ(count[0x075], 10);
  EXPECT_EQ(count[0x063], 10);
  EXPECT_EQ(count[0x077], 10);
  EXPECT_EQ(newest[0x069], "0000803e0000003f") << "a quarter turn, half a turn per second";
  EXPECT_EQ(newest[0x061], "0000000001000000") << "idle, no error";
  EXPECT_EQ(newest[0x077].substr(0, 8), "00004042") << "48 V";
}

TEST_F(SimulatedOdrive, AppliesTorqueInClosedLoopWithTorqueControlOnly) {
  send(0x06E, "000040bf");
  EXPECT_EQ(update(), 0) << "idle";
  EXPECT_TRUE(device.brake_engaged());
  send(0x067, "08000000");
  send(0x06E, "000040bf");
  EXPECT_EQ(update(), 0) << "still position control";
  send(0x06B, "0100000001000000");
  EXPECT_EQ(update(), -0.75);
  EXPECT_FALSE(device.brake_engaged());
  send(0x06E, "0000c84200000000");  // 100 Nm, padded to 8
  EXPECT_EQ(update(), 6) << "clamped to the drive's torque";
  send(0x06E, "0000c07f");
  EXPECT_EQ(update(), 0) << "NaN pushes nowhere";
  send(0x06E, "000040");
  send(0x067, "0100");
  EXPECT_EQ(device.state(), DeviceState::enabled) << "too short to mean anything";
  send(0x067, "01000000");
  EXPECT_EQ(update(), 0);
  EXPECT_EQ(device.state(), DeviceState::disabled);
}

TEST_F(SimulatedOdrive, HeartbeatTellsClosedLoop) {
  enable();
  for (int ms = 0; ms < 20; ++ms) update();
  EXPECT_EQ(newest[0x061], "0000000008000000");
}

TEST_F(SimulatedOdrive, OnlyTorquesFeedTheWatchdog) {
  enable();
  for (int ms = 0; ms < 100; ++ms) {
    enable();
    update();
  }
  EXPECT_EQ(device.state(), DeviceState::enabled) << "exactly at the limit";
  enable();
  update();
  EXPECT_EQ(device.state(), DeviceState::lost);
  EXPECT_LT(update(0, 2), 0) << "brakes";
  for (int ms = 0; ms < 100; ++ms) update();
  EXPECT_EQ(newest[0x061], "0000000101000000") << "watchdog expired, idle";
  EXPECT_EQ(newest[0x063], "0000000100000001");
  enable();
  EXPECT_EQ(device.state(), DeviceState::lost) << "no way back without clearing";
  send(0x078, "00");
  EXPECT_EQ(device.state(), DeviceState::disabled);
  enable();
  EXPECT_EQ(device.state(), DeviceState::enabled);
}

TEST_F(SimulatedOdrive, ErrorsAreReportedUntilCleared) {
  enable();
  EXPECT_TRUE(device.inject(DeviceFault::over_temperature));
  EXPECT_EQ(device.state(), DeviceState::error);
  for (int ms = 0; ms < 20; ++ms) update();
  EXPECT_EQ(newest[0x061], "0020000001000000");
  send(0x078, "00");
  EXPECT_EQ(device.state(), DeviceState::disabled);
  EXPECT_FALSE(device.inject(DeviceFault::overload)) << "no such error";
  send(0x062, "");
  EXPECT_EQ(device.state(), DeviceState::error) << "emergency stop";
}

TEST_F(SimulatedOdrive, SupplyOffAndOnForgetsEverything) {
  enable();
  send(0x06E, "000040bf");
  device.power_cycle(now);
  EXPECT_EQ(device.state(), DeviceState::booting);
  count.clear();
  for (int ms = 0; ms < 199; ++ms) update();
  send(0x067, "08000000");
  EXPECT_TRUE(count.empty()) << "says nothing while it boots";
  update();
  EXPECT_EQ(device.state(), DeviceState::disabled);
  send(0x067, "08000000");
  EXPECT_EQ(update(), 0) << "position control again";
}

TEST_F(SimulatedOdrive, OtherNodesAndKindsOfFramesAreNotForIt) {
  send(0x047, "08000000");
  drivers::CanFrame odd = frame_of(0x067, "08000000");
  Frames answers;
  for (bool drivers::CanFrame::*flag :
       {&drivers::CanFrame::extended, &drivers::CanFrame::fd, &drivers::CanFrame::remote}) {
    drivers::CanFrame copy = odd;
    copy.*flag = true;
    device.receive(copy, now, answers);
  }
  EXPECT_EQ(device.state(), DeviceState::disabled);
}

}  // namespace
}  // namespace takt::simulation
