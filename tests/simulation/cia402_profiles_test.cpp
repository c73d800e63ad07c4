// SPDX-License-Identifier: Apache-2.0
// Goal: which drives a CiA 402 host can expect, and what becomes of each in each mode: enabled and following, stopped
// when the host dies, or refused with a sentence that names the object. docs/drives.md shows this very table.
// Method: one simulated profile per difference that drives have; host and drive in virtual time.
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "drivers/protocol/protocol_table.hpp"
#include "simulation/cia402_device.hpp"
#include "tests/simulation/drive_loop.hpp"
#include "tests/support/files.hpp"

namespace takt::simulation {
namespace {

using config::Cia402Mode;

struct Profile {
  const char* name;
  Cia402Profile drive;
  config::Cia402VelocityUnit unit = config::Cia402VelocityUnit::counts_per_s;  // as the robot file says
};

constexpr std::uint32_t kRpm = 0x00B4'4700, kTenthRpm = 0xFFB4'4700;

const std::vector<Profile>& profiles() {
  using enum config::Cia402VelocityUnit;
  static const std::vector<Profile> all{
      {"everything there", {}},
      {"no deadline for RPDOs (1400 has subs 1 and 2)", {.has_deadline = false}},
      {"neither that nor a heartbeat consumer (1016)", {.has_deadline = false, .has_heartbeat_watch = false}},
      {"one PDO each way", {.has_second_pdos = false}},
      {"fixed mapping, the one that we want", {.map = Cia402Profile::Map::fixed}},
      {"fixed mapping, controlword and statusword alone", {.map = Cia402Profile::Map::fixed_words_only}},
      {"velocity in rpm, told by 60A9; the file says rpm", {.speed_counts = 60, .velocity_unit = kRpm}, rpm},
      {"velocity in rpm, told by 60A9; the file says counts", {.speed_counts = 60, .velocity_unit = kRpm}},
      {"velocity in 0.1 rpm, told by 60A9; the file says rpm", {.speed_counts = 600, .velocity_unit = kTenthRpm}, rpm},
      {"velocity in rpm, no 60A9; the file says rpm", {.speed_counts = 60}, rpm},
      {"no torque limit (6072)", {.has_max_torque = false}},
      {"profile modes alone (6502)", {.modes = 0x07}},
      {"6061 does not go with 6060", {.shows_mode = false}},
      {"enabled, and ignores its target (bit 12)", {.follows = false}},
  };
  return all;
}

config::Drive drive_of(const Profile& profile, Cia402Mode mode) {
  config::Drive drive;
  drive.protocol = config::DriveProtocol::cia402;
  drive.mode = mode;
  drive.id = 5;
  drive.counts_per_turn = 1 << 17;
  drive.rated_torque = 10;
  drive.torque_range = 3;
  drive.velocity_unit = profile.unit;
  return drive;
}

// What the host makes of it: "arms", or the sentence.
std::string outcome(const Profile& profile, Cia402Mode mode) {
  const config::Drive drive = drive_of(profile, mode);
  test::DriveLoop loop(drive, {});
  loop.device = std::make_unique<Cia402Device>(drive, Duration{}, profile.drive);
  const auto sentence = [&] { return "refused: " + drivers::error_name(drive, loop.host->feedback().error_code); };
  for (int i = 0; i < 1000 && loop.host->feedback().drive_state != DriveState::disabled; ++i) loop.tick(false);
  if (loop.host->feedback().drive_state != DriveState::disabled) return sentence();
  for (int i = 0; i < 200; ++i) loop.tick(true, {});
  if (loop.host->feedback().drive_state != DriveState::enabled) return sentence();
  const drivers::DriveSetpoint target{.q = 1, .kp = 8, .kd = 1.2F};
  for (int i = 0; i < 4000; ++i) loop.tick(true, target);
  EXPECT_NEAR(loop.joint_q(), 1, 0.02) << profile.name;
  EXPECT_LT(std::abs(loop.motor_dq), 0.2) << profile.name;
  EXPECT_EQ(loop.device->state(), DeviceState::enabled);
  for (int i = 0; i < 70; ++i) loop.silent_tick();
  EXPECT_EQ(loop.device->state(), DeviceState::lost) << profile.name << ": the host is gone";
  return "arms";
}

std::string table() {
  std::ostringstream text;
  text << "| the simulated drive | CST | CSP | CSV |\n|---|---|---|---|\n";
  for (const Profile& profile : profiles()) {
    text << "| " << profile.name;
    const std::string torque = outcome(profile, Cia402Mode::cst);
    text << " | " << torque;
    for (const Cia402Mode mode : {Cia402Mode::csp, Cia402Mode::csv}) {
      const std::string made = outcome(profile, mode);
      text << " | " << (made == torque && made != "arms" ? "as CST" : made);
    }
    text << " |\n";
  }
  return text.str();
}

TEST(Cia402Profiles, TheDocumentShowsWhatBecomesOfEach) {
  const std::string page = test::text_of("docs/drives.md");
  const std::string made = table();
  EXPECT_NE(page.find(made), std::string::npos) << "docs/drives.md must show:\n" << made;
}

// A waiver lets the drive in that nothing stops; the robot file then says so wherever it is quoted.
TEST(Cia402Profiles, AWaivedWatchdogArms) {
  config::Drive drive = drive_of({}, Cia402Mode::cst);
  drive.watchdog_waiver = "an enable line goes through a relay that this computer holds";
  test::DriveLoop loop(drive, {});
  loop.device = std::make_unique<Cia402Device>(drive, Duration{},
                                               Cia402Profile{.has_deadline = false, .has_heartbeat_watch = false});
  EXPECT_GE(loop.ticks_until(DriveState::disabled, false), 0);
  EXPECT_GE(loop.ticks_until(DriveState::enabled, true), 0);
}

}  // namespace
}  // namespace takt::simulation
