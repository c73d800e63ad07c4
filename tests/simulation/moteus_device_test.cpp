// SPDX-License-Identifier: Apache-2.0
// Goal: the simulated moteus keeps the device side of the register protocol: bytes, modes, law, watchdog, faults.
// Method: frames written out by hand from docs/protocol/can.md and registers.md; the host's codec is not used here.
#include "simulation/moteus_device.hpp"

#include <gtest/gtest.h>

#include <random>

#include "tests/drivers/bus/frame_text.hpp"

namespace takt::simulation {
namespace {

using test::frame_of;
using test::hex;

class SimulatedMoteus : public testing::Test {
 protected:
  static config::Drive number1() {
    config::Drive drive;
    drive.protocol = config::DriveProtocol::moteus;
    drive.id = 1;
    drive.torque_range = 6;
    drive.servo_kp = 20;
    drive.servo_kd = 2;
    return drive;
  }
  // The reply's bytes; empty: none.
  std::string send(std::string_view bytes, std::uint32_t id = 0x8001) {
    Frames answers;
    device.receive(frame_of(id, bytes, true, true), now, answers);
    EXPECT_LE(answers.size(), 1U);
    if (answers.empty()) return {};
    EXPECT_EQ(answers[0].id, 0x100U);
    EXPECT_TRUE(answers[0].fd);
    return hex(answers[0]);
  }
  double update(double position = 0, double velocity = 0) {
    now = now + milliseconds(1);
    return device.update({position, velocity}, now, milliseconds(1), said);
  }
  std::string mode() { return send("1100"); }
  Frames said;
  MoteusDevice device{number1(), milliseconds(100)};
  MonoTime now{1};
};

TEST_F(SimulatedMoteus, ObeysAndAnswersTheDocumentedFrame) {
  // 80 steps of position, 256 of velocity, as in the documented reply; torque 0 so far; 48 V is 96 steps, 25 deg C.
  update(0.008 * 2 * M_PI, 0.064 * 2 * M_PI);
  EXPECT_EQ(send("01000a07206000200150ff140400130d"), "2404000a00500000010000230d601900");
  EXPECT_EQ(device.state(), DeviceState::enabled);
}

TEST_F(SimulatedMoteus, AnswersOnlyWhenAsked) {
  EXPECT_EQ(send("01000a1100", 0x0001), "");
  EXPECT_EQ(device.state(), DeviceState::enabled) << "obeyed all the same";
  EXPECT_EQ(send("01000a", 0x8001), "") << "nothing to say";
  EXPECT_EQ(send("1100", 0x8002), "") << "somebody else";
  EXPECT_EQ(send("1100", 0x18001), "");
}

TEST_F(SimulatedMoteus, AnswersInEveryType) {
  update(2 * M_PI * 0.25, 0);
  EXPECT_EQ(send("1101"), "210119");
  EXPECT_EQ(send("1501"), "2501c409");
  EXPECT_EQ(send("1901"), "2901a8610000");
  EXPECT_EQ(send("1d01"), "2d010000803e");
  update(2 * M_PI * 100, 0);
  EXPECT_EQ(send("1501"), "2501ff7f") << "saturates";
}

TEST_F(SimulatedMoteus, PadsItsAnswer) {
  const std::string answer = send("1f011100");
  EXPECT_EQ(answer.size(), 2 * 20U) << "14 + 3 bytes";
  EXPECT_EQ(answer.substr(2 * 17), "505050");
}

TEST_F(SimulatedMoteus, ServoLawWithItsOwnGains) {
  // Position 0.5 rev/(2 pi) = 0.5 rad is float 0.0795775 (3da2f983), kp scale 0.5, kd scale 0.25, all else default.
  send(
      "01000a"
      "0d2083f9a23d"
      "0e230000003f0000803e");
  EXPECT_NEAR(update(0.2, -1), 0.5 * 20 * 0.3 + 0.25 * 2 * 1, 1e-5);
  EXPECT_EQ(update(-10, 0), 6) << "clamped to the drive's torque";
  send(
      "01000a"
      "0d2083f9a23d"
      "0d250000003f");
  EXPECT_EQ(update(-10, 0), 0.5) << "and to the commanded maximum";
  send(
      "01000a"
      "0d220000803f"
      "0e23000000000000803f");
  EXPECT_EQ(update(3, 2), 1) << "no stiffness: the kd scale is held down to it";
}

TEST_F(SimulatedMoteus, PositionAdvancesWithTheVelocity) {
  // 1 rev/s, kp scale 1, kd scale 0: a millisecond later the law's position is 0.001 rev further.
  send(
      "01000a"
      "0e20000000000000803f"
      "0d2400000000");
  EXPECT_NEAR(update(), 0, 1e-9);
  EXPECT_NEAR(update(), 20 * 0.001 * 2 * M_PI, 1e-6);
}

TEST_F(SimulatedMoteus, TheModeComesFirst) {
  send("01000a");
  send("0d220000803f");
  EXPECT_EQ(update(), 0) << "a torque without a mode is no command";
}

TEST_F(SimulatedMoteus, TheCommandsOwnWatchdogExpiresIntoMode11) {
  send(
      "01000a"
      "0d270ad7233c");  // 0.01 s
  for (int ms = 0; ms < 10; ++ms) {
    update();
    mode();  // questions do not feed it
  }
  EXPECT_EQ(device.state(), DeviceState::enabled) << "exactly at the limit";
  update();
  EXPECT_EQ(device.state(), DeviceState::lost);
  EXPECT_EQ(mode(), "21000b");
  EXPECT_LT(update(0, 2), 0) << "brakes";
  send("01000a");
  EXPECT_EQ(mode(), "21000b") << "a position command does not lead out";
  send("010000");
  EXPECT_EQ(mode(), "210000");
  send("01000a");
  EXPECT_EQ(mode(), "21000a");
}

TEST_F(SimulatedMoteus, DefaultAndNoWatchdog) {
  send("01000a");
  for (int ms = 0; ms < 101; ++ms) update();
  EXPECT_EQ(device.state(), DeviceState::lost) << "0: the drive's own";
  send("010000");
  send(
      "01000a"
      "0d270000c07f");
  for (int ms = 0; ms < 10'000; ++ms) update();
  EXPECT_EQ(device.state(), DeviceState::enabled) << "NaN: none";
}

TEST_F(SimulatedMoteus, FaultsStayUntilStopped) {
  send("01000a");
  EXPECT_TRUE(device.inject(DeviceFault::over_temperature));
  EXPECT_EQ(update(), 0);
  EXPECT_EQ(send("1100110f"), "210001210f26");
  send("01000a");
  EXPECT_EQ(mode(), "210001");
  send("010000");
  EXPECT_EQ(send("1100110f"), "210000210f00");
  EXPECT_FALSE(device.inject(DeviceFault::overload)) << "no such code";
}

TEST_F(SimulatedMoteus, SupplyOffAndOn) {
  send("01000a");
  device.power_cycle(now);
  EXPECT_EQ(mode(), "") << "boots";
  for (int ms = 0; ms < 200; ++ms) update();
  EXPECT_EQ(mode(), "210000");
}

TEST_F(SimulatedMoteus, NonsenseEndsTheFrameAndNothingElse) {
  EXPECT_EQ(send("1100"
                 "ff"
                 "1100"),
            "210000");
  EXPECT_EQ(send("01"), "");
  EXPECT_EQ(send("0c0620"
                 "0000"),
            "");
  EXPECT_EQ(send("1ca00100"), "") << "an answer that fits no frame";
  std::mt19937_64 random(7);
  for (int i = 0; i < 100'000; ++i) {
    drivers::CanFrame frame;
    frame.id = 0x8001;
    frame.extended = frame.fd = true;
    frame.length = static_cast<std::uint8_t>(random() % 65);
    for (std::uint8_t& byte : frame.data) byte = static_cast<std::uint8_t>(random() % 64);
    Frames answers;
    device.receive(frame, now, answers);
    ASSERT_LE(std::abs(update(0.1, 0.1)), 6);
    for (const drivers::CanFrame& answer : answers) ASSERT_LE(answer.length, 64);
  }
}

}  // namespace
}  // namespace takt::simulation
