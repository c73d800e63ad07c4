// SPDX-License-Identifier: Apache-2.0
// Goal: a person's eye finds a scale that no drive tells, and its word holds for that scale alone. Method: words a
// little off, and off by gears, signs and other joints; a note kept, another scale in the file, a note taken away.
#include "drivers/protocol/seen_angle.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "tests/support/temporary_directory.hpp"

namespace takt::drivers {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

config::Joint damiao() {
  config::Joint joint;
  config::Drive& drive = joint.drive;
  drive.protocol = config::DriveProtocol::mit;
  drive.variant = "damiao";
  drive.gear_ratio = 3;
  return joint;
}

std::string contradicted(double moved, double seen) {
  return contradicted_by_eye(damiao(), {.moved = moved * kDegree, .seen = seen * kDegree});
}

TEST(SeenAngle, AnEyeIsRightWithinADegreeOrATenth) {
  for (const double seen : {4.1, 5.0, 5.9}) EXPECT_EQ(contradicted(5, seen), "") << seen;
  for (const double seen : {3.9, 6.1, -5.0, 0.0}) EXPECT_NE(contradicted(5, seen), "") << seen;
  EXPECT_EQ(contradicted(-40, -43.5), "");
  EXPECT_NE(contradicted(-40, -45), "");
}

TEST(SeenAngle, ItNamesWhatIsWrong) {
  EXPECT_EQ(contradicted(5, 15),
            "you saw +15.0 deg, its drive told +5.0 deg: gear_ratio is 1 by that, the robot file says 3, or "
            "position_range is another than the drive's");
  EXPECT_NE(contradicted(5, -5).find("direction is the opposite"), std::string::npos);
  EXPECT_NE(contradicted(5, 0).find("another joint moved, or none"), std::string::npos);
  EXPECT_NE(contradicted(5, std::nan("")), "");
}

// Goal: of a slide an eye sees millimetres. Method: a gear of 100 rad per metre, seen a little off and by half.
TEST(SeenAngle, OfASlideItIsALength) {
  config::Joint slide = damiao();
  slide.kind = config::JointKind::slide;
  slide.drive.gear_ratio = 100;
  EXPECT_EQ(contradicted_by_eye(slide, {.moved = 0.005, .seen = 0.0059}), "");
  EXPECT_EQ(contradicted_by_eye(slide, {.moved = -0.04, .seen = -0.0435}), "");
  EXPECT_EQ(
      contradicted_by_eye(slide, {.moved = 0.02, .seen = 0.01}),
      "you saw +10.0 mm, its drive told +20.0 mm: gear_ratio is 200 rad/m by that, the robot file says 100 rad/m, "
      "or position_range is another than the drive's");
  EXPECT_NE(contradicted_by_eye(slide, {.moved = 0.005, .seen = 0.0005}).find("another joint moved"),
            std::string::npos);
  EXPECT_EQ(text_of(slide.kind, {.moved = -0.005, .seen = -0.0051, .day = "2026-05-03"}),
            "-5.1 mm seen where the drive told -5.0 mm, 2026-05-03");
}

TEST(SeenAngle, ItHoldsForTheScaleThatItWasSaidOf) {
  const test::TemporaryDirectory directory;
  config::RobotConfig robot;
  robot.joints.resize(2);
  for (config::Joint& joint : robot.joints) joint = damiao();
  EXPECT_FALSE(seen_angle(directory.path(), robot, 1).has_value());
  ASSERT_TRUE(
      keep_seen_angle(directory.path(), robot, 1, SeenAngle{5 * kDegree, 5.5 * kDegree, "2026-05-03"}).has_value());
  const auto kept = seen_angle(directory.path(), robot, 1);
  ASSERT_TRUE(kept.has_value());
  EXPECT_EQ(text_of(config::JointKind::hinge, *kept), "+5.5 deg seen where the drive told +5.0 deg, 2026-05-03");
  EXPECT_FALSE(seen_angle(directory.path(), robot, 0).has_value());
  robot.joints[1].limits.torque = 7;
  EXPECT_TRUE(seen_angle(directory.path(), robot, 1).has_value()) << "no scale";
  robot.joints[1].drive.gear_ratio = 6;
  EXPECT_FALSE(seen_angle(directory.path(), robot, 1).has_value());
  robot.joints[1].drive.gear_ratio = 3;
  robot.joints[1].kind = config::JointKind::slide;
  EXPECT_FALSE(seen_angle(directory.path(), robot, 1).has_value()) << "it was an angle";
  robot.joints[1].kind = config::JointKind::hinge;
  std::ofstream(directory.path("seen-1"), std::ios::app).close();
  EXPECT_TRUE(seen_angle(directory.path(), robot, 1).has_value());
  EXPECT_TRUE(keep_seen_angle(directory.path(), robot, 1, std::nullopt).has_value());
  EXPECT_FALSE(seen_angle(directory.path(), robot, 1).has_value());
  EXPECT_FALSE(keep_seen_angle("/proc/nowhere", robot, 1, SeenAngle{1, 1, "today"}).has_value());
}

}  // namespace
}  // namespace takt::drivers
