// SPDX-License-Identifier: Apache-2.0
// Goal: what a policy host reads of a gamepad is the person's wish while its button is held, what the robot file
// declares otherwise, and nothing outside its limits, whatever the pad does: cut, frozen, late, lying. Method: the
// command in a thread; recorded events through a FIFO (simulated_pad.hpp); the reader is the policy host's, with its
// judgement.
#include <gtest/gtest.h>
#include <linux/input.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "cli/command.hpp"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "policy_host/sensor_link.hpp"
#include "tests/cli/robot/simulated_pad.hpp"
#include "tests/support/files.hpp"

namespace takt::cli {
namespace {

constexpr std::array<double, 2> kLow{-0.5, -1}, kHigh{0.3, 2};

class GamepadCommand : public testing::Test {
 protected:
  GamepadCommand() {
    std::filesystem::remove_all(directory_);
    std::filesystem::create_directories(directory_);
    std::string robot = test::text_of("config/arm6.yaml");
    const std::string sensors = "\nsensors:\n", network = "file: arm6_reach.onnx";
    robot.insert(robot.find(sensors) + sensors.size(),
                 "  - name: wish\n    values: 2\n    timeout: 1 s\n    unit: m/s\n"
                 "    command: { minimum: [-0.5, -1], maximum: [0.3, 2], when_absent: [0, 0.25] }\n");
    robot.replace(robot.find(network), network.size(),
                  "file: " + std::filesystem::absolute("config/arm6_reach.onnx").string());
    std::ofstream(robot_file_) << robot;
    robot_ = config::load(robot_file_).value();
    pad_.emplace(device_);
  }
  ~GamepadCommand() override {
    pad_.reset();
    if (person_.joinable()) person_.join();
  }
  int say(std::vector<std::string> words) const {
    std::vector<std::string> all{"takt", "gamepad", "wish", "--robot", robot_file_, "--runtime-dir", directory_};
    all.insert(all.end(), words.begin(), words.end());
    std::vector<const char*> argv;
    for (const std::string& word : all) argv.push_back(word.c_str());
    return run_command_line(commands(), static_cast<int>(argv.size()), argv.data());
  }
  void plug_in() {
    person_ = std::thread([this] { exit_code_ = say({"--device", device_}); });
    link_.emplace(config::sensor_socket(directory_, "wish"), hello());
  }
  static Hello hello() {
    Hello hello;
    hello.role = Role::sensor_reader;
    return hello;
  }
  void send(std::uint16_t type, std::uint16_t code, std::int32_t value, Duration ahead = {}) const {
    pad_->send(type, code, value, ahead);
  }
  // Sends and reads until the newest sample says this, 20 s at most; every sample on the way is judged.
  bool becomes(
      float first, float second, const std::function<void()>& send_more = [] {}) {
    for (const MonoTime give_up = monotonic_now() + seconds(20); monotonic_now() < give_up;) {
      send_more();
      const std::uint64_t before = sample_.sequence;
      link_->update(monotonic_now(), sample_);
      judge();
      if (sample_.sequence > before && sample_.values[0] == first && sample_.values[1] == second) return true;
      sleep_until(monotonic_now() + milliseconds(2));
    }
    return false;
  }
  void judge() {
    if (sample_.sequence == 0) return;
    const auto verdict =
        policy_host::judge(*std::ranges::find(robot_.sensors, "wish", &config::Sensor::name), sample_, monotonic_now());
    EXPECT_TRUE(verdict == SampleVerdict::usable || verdict == SampleVerdict::too_old) << static_cast<int>(verdict);
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_GE(sample_.values[i], kLow[i]);
      EXPECT_LE(sample_.values[i], kHigh[i]);
    }
  }
  void hold_ahead() {
    send(EV_KEY, BTN_TL, 1);
    send(EV_ABS, ABS_Y, 0);
    send(EV_ABS, ABS_X, 255);
  }
  // Full ahead is the maximum, x to the right the minimum of what goes left.
  bool is_held_ahead() {
    return becomes(std::nextafter(0.3F, 0.0F), -1, [this] { hold_ahead(); });
  }

  std::string directory_ = (std::filesystem::path(testing::TempDir()) / "takt_gamepad").string();
  std::string robot_file_ = directory_ + "/robot.yaml", device_ = directory_ + "/pad";
  config::RobotConfig robot_;
  std::optional<test::SimulatedPad> pad_;
  std::atomic<int> exit_code_ = -1;
  std::optional<policy_host::SensorLink> link_;
  SensorSample sample_;
  std::thread person_;
};

TEST_F(GamepadCommand, SaysTheWishWhileHeldAndWhenAbsentAtOnceAfterwards) {
  plug_in();
  EXPECT_TRUE(becomes(0, 0.25F, [this] { send(EV_ABS, ABS_Y, 0); })) << "not pressed yet";
  EXPECT_TRUE(is_held_ahead());
  send(EV_KEY, BTN_TL, 0);
  EXPECT_TRUE(becomes(0, 0.25F, [this] { send(EV_ABS, ABS_Y, 0); })) << "the stick is still ahead";
}

TEST_F(GamepadCommand, CutItEndsWithOneLine) {
  plug_in();
  ASSERT_TRUE(is_held_ahead());
  testing::internal::CaptureStderr();
  pad_->unplug();
  person_.join();
  EXPECT_EQ(exit_code_, kExitUnavailable);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "takt gamepad: " + device_ + ": the gamepad is gone: plug it in and begin anew\n");
  EXPECT_FALSE(std::filesystem::exists(directory_ + "/sensor-wish.sock"));
}

TEST_F(GamepadCommand, FrozenItSaysWhenAbsentUntilItSpeaks) {
  plug_in();
  ASSERT_TRUE(is_held_ahead());
  EXPECT_TRUE(becomes(0, 0.25F)) << "not one event more";
  EXPECT_TRUE(becomes(std::nextafter(0.3F, 0.0F), -1, [this] { send(EV_ABS, ABS_X, 255); }));
}

TEST_F(GamepadCommand, LateItIsNotBelieved) {
  plug_in();
  ASSERT_TRUE(is_held_ahead());
  EXPECT_TRUE(becomes(0, 0.25F, [this] { send(EV_ABS, ABS_X, 255, milliseconds(-1500)); }));
}

TEST_F(GamepadCommand, LyingItIsNotBelieved) {
  plug_in();
  ASSERT_TRUE(is_held_ahead());
  EXPECT_TRUE(becomes(0, 0.25F, [this] { send(EV_ABS, ABS_Y, -1); })) << "outside its own range";
  ASSERT_TRUE(is_held_ahead());
  EXPECT_TRUE(becomes(0, 0.25F, [this] { send(EV_ABS, ABS_Y, 0, seconds(3600)); })) << "from the future";
}

TEST_F(GamepadCommand, WhatDoesNotFitIsRefused) {
  EXPECT_EQ(say({"--device", robot_file_}), kExitUnavailable) << "no input device";
  EXPECT_EQ(say({"--device", directory_ + "/none"}), kExitUnavailable);
  EXPECT_EQ(say({"--device", device_, "--sticks", "-y,ry"}), kExitUnavailable) << "a stick that the pad lacks";
  EXPECT_EQ(say({"--device", device_, "--dead-man", "tr"}), kExitUnavailable) << "a button that the pad lacks";
  EXPECT_EQ(say({"--device", device_, "--dead-man", "elbow"}), kExitUsage);
  EXPECT_EQ(say({"--device", device_, "--sticks", "-y,w"}), kExitUsage);
  EXPECT_EQ(say({"--device", device_, "--sticks", "y"}), kExitUsage) << "one of two";
}

}  // namespace
}  // namespace takt::cli
