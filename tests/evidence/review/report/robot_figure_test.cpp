// SPDX-License-Identifier: Apache-2.0
// Goal: the page gets the geometry that the robot's file has. Method: the committed robots.
#include "evidence/review/report/robot_figure.hpp"

#include <gtest/gtest.h>

#include "config/load.hpp"

namespace takt::monitor {
namespace {

nlohmann::ordered_json figure_of(const std::string& file) {
  const auto robot = config::load(file);
  if (!robot) throw std::runtime_error(robot.error());
  return evidence::robot_figure(*robot);
}

TEST(RobotFigure, AnArmIsItsLinksAndItsTool) {
  const auto figure = figure_of("config/arm6.yaml");
  EXPECT_EQ(figure.at("kind"), "links");
  ASSERT_EQ(figure.at("links").size(), 6U);
  EXPECT_EQ(figure.at("links").at(2).at("parent"), 1);
  EXPECT_EQ(figure.at("links").at(2).at("xyz"), (std::vector<double>{0, 0, 0.28}));
  EXPECT_EQ(figure.at("tool").at("link"), 5);
  EXPECT_NEAR(figure.at("reach").get<double>(), 0.08 + 0.06 + 0.28 + 0.24 + 0.06 + 0.05 + 0.08, 1e-9);
}

TEST(RobotFigure, ALinkThatSlidesSaysSoAndReachesFurther) {
  auto robot = config::load("config/arm6.yaml");
  ASSERT_TRUE(robot) << robot.error();
  const double before = evidence::robot_figure(*robot).at("reach");
  robot->joints[5].kind = config::JointKind::slide;
  robot->joints[5].limits.q_min = -0.01;
  robot->joints[5].limits.q_max = 0.04;
  const auto figure = evidence::robot_figure(*robot);
  EXPECT_TRUE(figure.at("links").at(5).at("slides"));
  EXPECT_FALSE(figure.at("links").at(4).contains("slides"));
  EXPECT_NEAR(figure.at("reach").get<double>(), before + 0.04, 1e-9);
}

TEST(RobotFigure, TwoArmsStandOnOneBase) {
  const auto figure = figure_of("config/dual_arm12.yaml");
  ASSERT_EQ(figure.at("links").size(), 12U);
  EXPECT_EQ(figure.at("links").at(6).at("parent"), -1);
}

TEST(RobotFigure, ACartCarriesItsPole) {
  const auto figure = figure_of("config/cart_pole.yaml");
  EXPECT_EQ(figure.at("kind"), "cart_pole");
  EXPECT_EQ(figure.at("pole_length"), 0.6);
  EXPECT_EQ(figure.at("pulley_radius"), 0.05);
}

TEST(RobotFigure, WithoutGeometryThereIsNone) {
  EXPECT_TRUE(evidence::robot_figure({}).is_null());
}

}  // namespace
}  // namespace takt::monitor
