// SPDX-License-Identifier: Apache-2.0
// Goal: a world in any of the languages that have a client is the world that the plant has in process.
// Method: the same pendulum in Python, over shared memory and over the socket, in JavaScript, and in MuJoCo under
// Node.js, swung beside the simulator's own; then each is asked what it cannot do. Images: a pattern, byte for byte.
// Where node or the npm package @mujoco/mujoco is missing, that case skips; not with TAKT_REQUIRE_NODE=1.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "simulation/arm_dynamics.hpp"
#include "simulation/outside_mechanics.hpp"
#include "tests/simulation/forked_world.hpp"
#include "tests/simulation/plant_robots.hpp"

namespace takt::simulation {
namespace {

using testing::HasSubstr;
constexpr WorldLink::Patience kPatience{seconds(60), seconds(60)};

struct Language {
  const char* name;
  std::vector<std::string> command;  // the socket follows, then `last`
  std::vector<std::string> last;
  std::string needs;  // a file
  double bound;       // rad, after two seconds
};

std::vector<Language> languages() {
  const std::string worlds = "tests/simulation/worlds/";
  return {
      {"Python by shared memory", {TAKT_PYTHON, worlds + "pendulum.py"}, {"memory"}, TAKT_PYTHON, 1e-9},
      {"Python by its socket", {TAKT_PYTHON, worlds + "pendulum.py"}, {"socket"}, TAKT_PYTHON, 1e-9},
      {"JavaScript", {"node", worlds + "pendulum.mjs"}, {}, worlds + "pendulum.mjs", 1e-9},
      {"MuJoCo", {"node", "tests/node/mujoco_world.mjs"}, {}, "tests/node/node_modules/@mujoco/mujoco", 1e-4},
  };
}

void run_it(const Language& language, const std::string& socket) {
  std::vector<std::string> words = language.command;
  words.push_back(socket);
  words.insert(words.end(), language.last.begin(), language.last.end());
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  execvp(arguments[0], arguments.data());
}

bool is_there(const Language& language) {
  const bool node = language.command[0] != "node" || std::system("node --version >/dev/null 2>&1") == 0;
  return node && std::filesystem::exists(language.needs);
}

bool must_be_there() {
  const char* const required = getenv("TAKT_REQUIRE_NODE");
  return required && std::string_view(required) == "1";
}

class Languages : public testing::TestWithParam<std::size_t> {
 protected:
  void SetUp() override {
    if (is_there(language)) return;
    ASSERT_FALSE(must_be_there()) << language.needs << " is missing";
    GTEST_SKIP() << "SKIPPED: " << language.name << ": node or " << language.needs << " is missing";
  }
  const Language language = languages()[GetParam()];
};

config::RobotConfig swinging(double home) {
  config::RobotConfig robot = test::pendulum(2, 0.5);
  robot.joints[0].home = home;
  return robot;
}

TEST_P(Languages, ThePendulumSwingsAsInProcess) {
  const config::RobotConfig robot = swinging(0.7);
  const test::ForkedWorld process([this](const std::string& socket) { run_it(language, socket); });
  auto outside = OutsideMechanics::connect(robot, process.path(), 1, kPatience);
  ASSERT_TRUE(outside) << outside.error().sentence;
  EXPECT_EQ((*outside)->link().is_over_shared_memory(), std::string_view(language.name) == "Python by shared memory");
  const auto inside = ArmDynamics::make(robot).value();
  ArmState here = (*outside)->begin(), there = here;
  ASSERT_EQ(here.q[0], 0.7);
  double apart = 0;
  for (int step = 0; step < 2000; ++step) {
    const Eigen::VectorXd torque = Eigen::VectorXd::Constant(1, std::sin(0.003 * step));
    inside->integrate(here, torque, {{0.02, 0}}, robot.simulation->step);
    (*outside)->integrate(there, torque, {{0.02, 0}}, robot.simulation->step);
    ASSERT_FALSE((*outside)->end()) << (*outside)->end()->sentence;
    apart = std::max(apart, std::abs(here.q[0] - there.q[0]));
    ASSERT_LT(std::abs((*outside)->tool_position(there.q)[0] - inside->tool_position(here.q)[0]), 5e-3) << step;
  }
  EXPECT_LT(apart, language.bound);
  RecordProperty("apart_rad", std::to_string(apart));
  printf("%s: %.3g rad apart after 2 s\n", language.name, apart);
}

// Of tests/simulation/worlds; MuJoCo's judges nothing.
class OwnWorlds : public Languages {};

TEST_P(OwnWorlds, WhatItCannotDoIsSaidInItsOwnWords) {
  const test::ForkedWorld process([this](const std::string& socket) { run_it(language, socket); });
  {
    auto top = OutsideMechanics::connect(swinging(2.99), process.path(), 1, kPatience);
    ASSERT_TRUE(top) << top.error().sentence;
    ArmState state = (*top)->begin();
    for (int step = 0; step < 1000 && !(*top)->end(); ++step)
      (*top)->integrate(state, Eigen::VectorXd::Constant(1, 20), {{0, 0}}, milliseconds(1));
    ASSERT_TRUE((*top)->end());
    EXPECT_EQ(name((*top)->end()->kind), "failed");
    EXPECT_THAT((*top)->end()->sentence, HasSubstr("over the top"));
  }
  // It lives on, for the next simulation, which it cannot play; Python's ends with its exception.
  const auto arm = OutsideMechanics::connect(test::demo_arm(), process.path(), 1, kPatience);
  ASSERT_FALSE(arm);
  EXPECT_EQ(name(arm.error().kind), "unable");
  EXPECT_THAT(arm.error().sentence, HasSubstr("arm6 has 6 joints, a pendulum one"));
}

// --- images ---

constexpr std::size_t kHeight = 4, kWidth = 6, kChannels = 3;

// What tests/simulation/worlds/filming.* draw.
std::vector<std::uint8_t> image_of(std::uint64_t sequence) {
  std::vector<std::uint8_t> pixels(kHeight * kWidth * kChannels);
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<std::uint8_t>(7 * i + 31 * sequence);
  return pixels;
}

config::RobotConfig filmed() {
  config::RobotConfig robot = test::pendulum(2, 0.5);
  robot.sensors.resize(2);
  robot.sensors[0].name = "target";
  robot.sensors[0].values = 1;
  robot.sensors[1].name = "cam0";
  robot.sensors[1].image = config::ImageShape{kHeight, kWidth, kChannels};
  return robot;
}

std::vector<Language> filming_languages() {
  const std::string film = "tests/simulation/worlds/filming";
  return {
      {"Python by shared memory", {TAKT_PYTHON, film + ".py"}, {"memory"}, TAKT_PYTHON, 0},
      {"Python by its socket", {TAKT_PYTHON, film + ".py"}, {"socket"}, TAKT_PYTHON, 0},
      {"JavaScript", {"node", film + ".mjs"}, {}, film + ".mjs", 0},
  };
}

class Filming : public testing::TestWithParam<std::size_t> {};

TEST_P(Filming, ImagesAreTheirsByteForByte) {
  const Language language = filming_languages()[GetParam()];
  if (!is_there(language)) {
    ASSERT_FALSE(must_be_there()) << language.needs << " is missing";
    GTEST_SKIP() << "SKIPPED: " << language.name << ": node is missing";
  }
  const test::ForkedWorld process([&](const std::string& socket) { run_it(language, socket); });
  for (int simulation = 0; simulation < 2; ++simulation) {
    auto world = OutsideMechanics::connect(filmed(), process.path(), 1, kPatience);
    ASSERT_TRUE(world) << world.error().sentence;
    EXPECT_FALSE((*world)->films(0));
    EXPECT_TRUE((*world)->films(1));
    ArmState state = (*world)->begin();
    MonoTime now{1'000'000'000};
    EXPECT_TRUE((*world)->images(now).empty());
    for (std::uint64_t step = 1; step <= 20; ++step) {
      now = now + milliseconds(1);
      (*world)->integrate(state, Eigen::VectorXd::Zero(1), {{0, 0}}, milliseconds(1));
      ASSERT_FALSE((*world)->end()) << (*world)->end()->sentence;
      const auto images = (*world)->images(now);
      ASSERT_EQ(images.size(), step % 4 == 0 ? 1U : 0U) << step;
      if (images.empty()) continue;
      const auto& [sensor, sensed] = images[0];
      EXPECT_EQ(sensor, 1U);
      EXPECT_EQ(sensed.sample.sequence, step / 4);
      EXPECT_EQ((now - sensed.sample.sensed_at).ns, milliseconds(2).ns) << "as old as it says";
      EXPECT_EQ(sensed.sample.published_at, now);
      EXPECT_EQ(*sensed.pixels, image_of(step / 4)) << step;
    }
  }
  auto robot = filmed();
  robot.sensors[1].image->width = kWidth + 1;
  const auto other = OutsideMechanics::connect(robot, process.path(), 1, kPatience);
  ASSERT_FALSE(other);
  EXPECT_THAT(other.error().sentence,
              HasSubstr("images of sensor cam0 are 4 x 6 x 3 here, 4 x 7 x 3 in the robot file"));
}

INSTANTIATE_TEST_SUITE_P(World, Languages, testing::Range<std::size_t>(0, 4));
INSTANTIATE_TEST_SUITE_P(World, OwnWorlds, testing::Range<std::size_t>(0, 3));
INSTANTIATE_TEST_SUITE_P(World, Filming, testing::Range<std::size_t>(0, 3));

}  // namespace
}  // namespace takt::simulation
