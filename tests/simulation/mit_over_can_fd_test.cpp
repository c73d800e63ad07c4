// SPDX-License-Identifier: Apache-2.0
// Goal: a Damiao drive that speaks CAN FD is set up, enabled, led and stopped as a classic one is, in FD frames alone,
// by our driver and the drive's own side; one that runs at another rate is named and not armed. Method: both in a loop.
#include <gtest/gtest.h>

#include "drivers/protocol/protocol_table.hpp"
#include "simulation/mit_device.hpp"
#include "tests/simulation/drive_loop.hpp"

namespace takt::drivers {
namespace {

config::Drive damiao(std::uint32_t fd_bitrate) {
  config::Drive drive;
  drive.protocol = config::DriveProtocol::mit;
  drive.variant = "damiao";
  drive.id = 3;
  drive.reply_id = 0x13;
  drive.fd_bitrate = fd_bitrate;
  drive.position_range = 12.5;
  drive.velocity_range = 30;
  drive.torque_range = 10;
  drive.kp_range = 500;
  drive.kd_range = 5;
  return drive;
}

constexpr DriveSetpoint kThere{.q = 0.9F, .dq = 0, .kp = 20, .kd = 1, .tau = 0};

TEST(MitOverCanFd, IsSetUpEnabledLedAndStopped) {
  test::DriveLoop loop(damiao(5'000'000), milliseconds(100));
  int classic = 0, fd = 0;
  loop.on_the_way = [&](CanFrame& frame) {
    (frame.fd && frame.bit_rate_switch ? fd : classic) += 1;
    return true;
  };
  for (int ms = 0; ms < 300; ++ms) loop.tick(false);
  ASSERT_GE(loop.ticks_until(DriveState::enabled, true, kThere), 0);
  for (int ms = 0; ms < 1500; ++ms) loop.tick(true, kThere);
  EXPECT_NEAR(loop.joint_q(), 0.9, 5e-3);
  EXPECT_NEAR(loop.host->feedback().q, 0.9, 5e-3);
  EXPECT_GT(loop.host->feedback().casing_C, 0);
  ASSERT_GE(loop.ticks_until(DriveState::disabled, false), 0);
  EXPECT_EQ(classic, 0);
  EXPECT_GT(fd, 3000);
}

TEST(MitOverCanFd, AnotherRateInItsRegisterIsNamedAndNotArmed) {
  test::DriveLoop loop(damiao(5'000'000), milliseconds(100));
  loop.device = simulation::make_device(damiao(2'000'000), milliseconds(100));
  for (int ms = 0; ms < 300; ++ms) loop.tick(false);
  EXPECT_EQ(loop.host->feedback().drive_state, DriveState::fault);
  EXPECT_NE(error_name(damiao(5'000'000), loop.host->feedback().error_code).find("bit rate of CAN FD (register 35)"),
            std::string::npos);
  EXPECT_EQ(loop.ticks_until(DriveState::enabled, true, kThere), -1);
}

TEST(MitOverCanFd, ADriveThatAnswersInClassicFramesIsNamed) {
  test::DriveLoop loop(damiao(5'000'000), milliseconds(100));
  loop.device = simulation::make_device(damiao(0), milliseconds(100));
  for (int ms = 0; ms < 100; ++ms) loop.tick(false);
  EXPECT_FALSE(loop.host->feedback().received_at.is_set());
  // As a drive does that hears CAN FD and is set to classic frames.
  loop.device = simulation::make_device(damiao(5'000'000), milliseconds(100));
  loop.on_the_way = [](CanFrame& frame) {
    if (frame.id == 0x13) frame.fd = frame.bit_rate_switch = false;
    return true;
  };
  for (int ms = 0; ms < 100; ++ms) loop.tick(false);
  EXPECT_FALSE(loop.host->feedback().received_at.is_set());
  EXPECT_EQ(loop.host->feedback().drive_state, DriveState::fault);
  EXPECT_NE(error_name(damiao(5'000'000), loop.host->feedback().error_code).find("classic frames, not CAN FD"),
            std::string::npos);
}

}  // namespace
}  // namespace takt::drivers
