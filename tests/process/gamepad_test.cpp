// SPDX-License-Identifier: Apache-2.0
// Goal: a robot that follows a gamepad stays inside its envelope, and on its wheels, whatever the pad does: held hard
// over, frozen, late, lying, cut. Method: the balancer in real processes, `takt gamepad` on a simulated pad; the run
// folder is judged afterwards.
#include <gtest/gtest.h>
#include <linux/input.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "cli/command.hpp"
#include "config/load.hpp"
#include "monitor/record/frame_log.hpp"
#include "tests/cli/robot/simulated_pad.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/process/sent_frames.hpp"

namespace takt::test {
namespace {

// rad/s; of all that the left wheel was told. Frames of config/balancer.yaml's drive 1: 12 bits over +-60 rad/s from
// the third byte on; those that end in FC or more switch it on and off.
double fastest_wheel(const std::string& run) {
  double fastest = 0;
  std::istringstream log(monitor::read_frame_log(monitor::RunFolder(run)).value_or(""));
  for (std::string line; std::getline(log, line);) {
    const std::size_t hash = line.find(" 001#");
    if (hash == std::string::npos || line.size() < hash + 21 || line.compare(hash + 5, 8, "FFFFFFFF") == 0) continue;
    fastest = std::max(fastest, std::abs(std::stoi(line.substr(hash + 9, 3), nullptr, 16) * 120.0 / 4095 - 60));
  }
  return fastest;
}

class GamepadProcess : public testing::Test {
 protected:
  GamepadProcess() {
    std::filesystem::remove(device_);
    pad_.emplace(device_);
    person_ = std::thread([this] {
      const std::vector<const char*> words{"takt",
                                           "gamepad",
                                           "velocity_command",
                                           "--device",
                                           device_.c_str(),
                                           "--robot",
                                           robot_.robot_file().c_str(),
                                           "--runtime-dir",
                                           robot_.directory().c_str()};
      exit_code_ = cli::run_command_line(cli::commands(), static_cast<int>(words.size()), words.data());
    });
  }
  ~GamepadProcess() override {
    pad_.reset();
    if (person_.joinable()) person_.join();
    std::filesystem::remove(device_);
  }
  // Says something every 20 ms, for so many ticks.
  void say(std::uint64_t ticks, const std::function<void(int)>& something) const {
    const auto status = robot_.status();
    const std::uint64_t until = (status ? status->status.ticks : 0) + ticks;
    int times = 0;
    (void)robot_.wait_until([&](const StatusSnapshot& now) {
      something(times++);
      return now.ticks >= until;
    });
  }
  void hold(std::int32_t ahead, std::int32_t turn) const {
    pad_->send(EV_KEY, BTN_TL, 1);
    pad_->send(EV_ABS, ABS_Y, ahead);
    pad_->send(EV_ABS, ABS_RX, turn);
  }

  RunningRobot robot_{
      {}, "config/balancer.yaml", {{"simulation.mujoco.model", std::filesystem::absolute("config/balancer.xml")}}};
  std::string device_ = testing::TempDir() + "takt-pad";
  std::optional<SimulatedPad> pad_;
  int exit_code_ = -1;
  std::thread person_;
};

TEST_F(GamepadProcess, ThePadMayDoWhatItWants) {
  const Child fallback = robot_.start_fallback_host();
  const Child policy = robot_.start_policy_host();
  ASSERT_EQ(robot_.arm(), "") << robot_.logs();
  ASSERT_TRUE(robot_.wait_for_mode(Mode::tracking)) << robot_.logs();
  say(500, [this](int) { hold(0, 255); });
  say(500, [this](int times) { hold(times % 2 * 255, times % 2 * 255); });      // from end to end
  robot_.let_run(300);                                                          // frozen, held ahead
  say(200, [this](int) { pad_->send(EV_ABS, ABS_Y, 0, milliseconds(-900)); });  // late
  say(100, [this](int) { hold(-1'000'000, 1'000'000); });                       // lying
  say(100, [this](int) { pad_->send(EV_KEY, BTN_TL, 1, seconds(3600)); });      // from the future
  say(200, [this](int) { hold(0, 0); });
  pad_->unplug();  // cut, held ahead
  robot_.let_run(300);
  EXPECT_TRUE(robot_.wait_for_mode(Mode::tracking)) << robot_.logs();
  person_.join();
  EXPECT_EQ(exit_code_, kExitUnavailable);
  ASSERT_TRUE(robot_.finish()) << robot_.logs();
  const SentFrames frames = judge_sent_frames(robot_.run_directory(), config::load(robot_.robot_file()).value());
  EXPECT_GT(frames.motion_commands, 1000U);
  EXPECT_EQ(frames.first_violation, "");
  EXPECT_GT(fastest_wheel(robot_.run_directory()), 8)
      << "it does not follow the pad: from end to end it is told 16 rad/s, and 4 while the sticks rest";
  Child replay({"takt", "replay", robot_.run_directory()}, robot_.directory() + "/replay.log");
  EXPECT_EQ(replay.wait(std::chrono::seconds(60)), 0);
}

}  // namespace
}  // namespace takt::test
