// SPDX-License-Identifier: Apache-2.0
// Goal: a drive that is set up otherwise than the robot file says is not armed, and the sentence names what is wrong;
// the same drive, set up right, is.
// Method: for each protocol a simulated drive and its host driver in virtual time, and one planted difference per row
// (misconfigured_drives.hpp).
#include "tests/simulation/misconfigured_drives.hpp"

#include <gtest/gtest.h>

#include "tests/simulation/drive_loop.hpp"

namespace takt::simulation {
namespace {

using misconfigured::Planted;
using misconfigured::Row;

class EveryDrive : public testing::TestWithParam<Row> {};

TEST_P(EveryDrive, ArmsWhenItIsRightAndSaysWhatIsWrongWhenNot) {
  const Row& row = GetParam();
  test::DriveLoop loop(row.file, milliseconds(100));
  Planted planted = row.plant(row.file);
  loop.device = std::move(planted.device);
  loop.on_the_way = planted.on_the_way;
  for (int i = 0; i < 3000 && loop.host->feedback().drive_state != DriveState::disabled; ++i) loop.tick(false);
  // A difference may show in the words of a drive that has just been said to be fit.
  for (int i = 0; i < 300; ++i) loop.tick(false);
  double most_torque = 0;
  for (int i = 0; i < 300; ++i) {
    loop.tick(true, {.q = 0.2F, .kp = 5, .kd = 0.5F});
    most_torque = std::max(most_torque, std::abs(loop.torque));
  }
  const JointFeedback& feedback = loop.host->feedback();
  if (*row.sentence == '\0') {
    EXPECT_EQ(feedback.drive_state, DriveState::enabled) << drivers::error_name(row.file, feedback.error_code);
    EXPECT_GT(most_torque, 0);
    return;
  }
  EXPECT_EQ(feedback.drive_state, DriveState::fault);
  const std::string said = drivers::error_name(row.file, feedback.error_code);
  EXPECT_NE(said.find(row.sentence), std::string::npos) << said;
  // Only a drive that says it is enabled and fit can be found to ignore what it is told.
  const bool was_driven = said.find("bit 12") != std::string::npos;
  EXPECT_TRUE(was_driven || most_torque == 0) << "never pushed";
}

// What scan, zero and home wait for: at no instant does a drive that is wrong look disabled, set up and without a
// fault.
TEST_P(EveryDrive, IsNeverTakenForSetUpWhileSomethingIsWrong) {
  const Row& row = GetParam();
  test::DriveLoop loop(row.file, milliseconds(100));
  Planted planted = row.plant(row.file);
  loop.device = std::move(planted.device);
  loop.on_the_way = planted.on_the_way;
  const auto looks_right = [&loop] {
    const JointFeedback& feedback = loop.host->feedback();
    return feedback.received_at.is_set() && loop.host->is_set_up() && feedback.drive_state == DriveState::disabled &&
           feedback.error_code == 0;
  };
  int ticks = 0;
  for (; ticks < 3000 && !looks_right(); ++ticks) loop.tick(false);
  const bool shows_when_enabled = std::string_view(row.sentence).find("bit 12") != std::string_view::npos;
  EXPECT_EQ(ticks < 3000, *row.sentence == '\0' || shows_when_enabled) << ticks << " ms";
}

INSTANTIATE_TEST_SUITE_P(Misconfigured, EveryDrive, testing::ValuesIn(misconfigured::rows()), [](const auto& row) {
  std::string name = row.param.when;
  for (char& c : name)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  return name;
});

}  // namespace
}  // namespace takt::simulation
