// SPDX-License-Identifier: Apache-2.0
// Goal: an MTi on a serial port or a CAN bus is a robot's IMU, and whatever happens to it ends in imu_lost, inside the
// envelope: cut, frozen, late, garbage; plugged in again it serves on. Method: real processes, the demo arm with an
// IMU; behind a pseudo-terminal, or on a simulated bus, a simulated MTi, written from its protocols' descriptions.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <deque>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <random>
#include <thread>

#include "config/paths.hpp"
#include "drivers/bus/loopback_bus.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/process/sent_frames.hpp"
#include "tests/sensors/imu/mti_can_encoder.hpp"
#include "tests/sensors/imu/mti_encoder.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::test {
namespace {

using namespace std::chrono_literals;

// How a simulated MTi behaves: all well; the same values in fresh messages; messages that wait for two seconds; bytes
// that are none.
enum class Health { well, frozen, late, garbage };

// 200 samples a second, level, a little noise. A derived class calls fall_silent() first of all when it ends.
class SimulatedMti {
 public:
  virtual ~SimulatedMti() = default;
  void turn(Health health) { health_ = health; }

 protected:
  void speak() {
    thread_ = std::jthread([this](const std::stop_token& stop) { speak_until(stop); });
  }
  void fall_silent() { thread_ = {}; }
  std::uint8_t noise() { return static_cast<std::uint8_t>(random_()); }

 private:
  virtual void send(const MtiSays& says, bool garbage) = 0;
  void speak_until(const std::stop_token& stop) {
    MonoTime next = monotonic_now();
    for (std::uint16_t counter = 0; !stop.stop_requested(); ++counter) {
      next = next + milliseconds(5);
      sleep_until(next);
      if (health_ != Health::frozen) says_.rate[0] = 4e-3F * static_cast<float>(random_() % 10);
      says_.counter = counter;
      says_.ticks = static_cast<std::uint32_t>(monotonic_now().ns / 100'000);
      waiting_.push_back({next + (health_ == Health::late ? seconds(2) : Duration{}), says_});
      for (; !waiting_.empty() && waiting_.front().due <= monotonic_now(); waiting_.pop_front())
        send(waiting_.front().says, health_ == Health::garbage);
    }
  }
  struct Waiting {
    MonoTime due;
    MtiSays says;
  };
  std::atomic<Health> health_ = Health::well;
  std::mt19937 random_{1};
  MtiSays says_;
  std::deque<Waiting> waiting_;
  std::jthread thread_;
};

// `link` leads to its terminal while it lives.
class SerialMti final : public SimulatedMti {
 public:
  explicit SerialMti(const std::string& link)
      : link_(link), master_(posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) {
    EXPECT_EQ(grantpt(master_), 0);
    EXPECT_EQ(unlockpt(master_), 0);
    std::filesystem::remove(link_);
    std::filesystem::create_symlink(ptsname(master_), link_);
    speak();
  }
  ~SerialMti() override {
    fall_silent();
    std::filesystem::remove(link_);
    close(master_);
  }

 private:
  void send(const MtiSays& says, bool garbage) override {
    Bytes bytes = message(0x36, mtdata2(says));
    if (garbage)
      for (std::uint8_t& byte : bytes) byte = noise();
    (void)!write(master_, bytes.data(), bytes.size());
  }
  std::string link_;
  int master_;
};

// A node of a robot's simulated bus. What a damaged frame is, a CAN controller knows: garbage is groups without
// accelerations.
class CanMti final : public SimulatedMti {
 public:
  CanMti(const RunningRobot& robot, const std::string& interface) {
    const std::string hub = config::loopback_socket(robot.directory(), interface);
    for (int poll = 0; poll < 2000 && !bus_; ++poll) {  // 20 s at most, for the plant
      auto connected = drivers::LoopbackBus::connect(hub, {});
      if (connected) bus_ = std::move(*connected);
      if (!bus_) std::this_thread::sleep_for(10ms);
    }
    if (bus_)
      speak();
    else
      ADD_FAILURE() << "no bus at " << hub;
  }
  ~CanMti() override { fall_silent(); }

 private:
  void send(const MtiSays& says, bool garbage) override {
    drivers::ReceivedFrame heard[32];
    bus_->receive(heard);  // and forgotten
    const auto frames = mti_group(says);
    for (const drivers::CanFrame& frame : std::span(frames).first(garbage ? 3 : 4)) bus_->send(frame);
  }
  std::unique_ptr<drivers::LoopbackBus> bus_;
};

class TaktImu : public testing::Test {
 protected:
  TaktImu() {
    std::filesystem::copy_file("config/arm6_reach.onnx", folder_.path("arm6_reach.onnx"));
    std::string arm = text_of("config/arm6.yaml");
    const std::string sensors = "\nsensors:\n";
    arm.insert(arm.find(sensors) + sensors.size(), "  - { name: torso, values: 10, timeout: 300 ms }\n");
    const std::string joints = "\njoints:\n";
    arm.insert(arm.find(joints), "  - { name: aux, interface: can2, bitrate: 1 Mbit/s, when_missing: loopback }\n");
    std::ofstream(robot_file()) << arm << "\nimu: { sensor: torso, tilt: 0.5 rad, frozen_after: 300 ms }\n";
  }
  [[nodiscard]] std::string robot_file() const { return folder_.path("arm6.yaml"); }
  [[nodiscard]] std::string port() const { return folder_.path("mti"); }
  [[nodiscard]] Child start_imu(const RunningRobot& robot, const std::string& where, const std::string& place) const {
    return Child({"takt-imu", "--robot", robot.robot_file(), where, place, "--runtime-dir", robot.directory()},
                 robot.directory() + "/imu.log");
  }
  // Arms, lets the trouble begin, and judges: the IMU is lost, the robot stops, no frame left the envelope.
  void expect_lost(bool on_can, const std::function<void(std::unique_ptr<SimulatedMti>&)>& trouble) const {
    RunningRobot robot({}, robot_file());
    std::unique_ptr<SimulatedMti> mti;
    if (on_can)
      mti = std::make_unique<CanMti>(robot, "can2");
    else
      mti = std::make_unique<SerialMti>(port());
    Child imu = on_can ? start_imu(robot, "--bus", "aux") : start_imu(robot, "--port", port());
    const Child policy = robot.start_policy_host();
    ASSERT_EQ(robot.arm(), "") << robot.logs();
    ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
    trouble(mti);
    ASSERT_TRUE(robot.wait_for_mode(Mode::damped_stop)) << robot.logs();
    expect_imu_lost(robot);
    robot.let_run(500);
    EXPECT_FALSE(robot.takt({"arm", "--runtime-dir", robot.directory()})) << "it is still lost";
    imu.signal(SIGTERM);
    EXPECT_EQ(imu.wait(20s), 0) << robot.logs();
    ASSERT_TRUE(robot.finish()) << robot.logs();
    expect_inside(robot);
  }
  static void expect_imu_lost(const RunningRobot& robot) {
    const auto status = robot.status();
    ASSERT_TRUE(status);
    EXPECT_NE(std::string(status->incident.sentence).find("imu_lost"), std::string::npos) << status->incident.sentence;
  }
  // 20 s at most.
  static bool is_said(const std::string& log, const std::string& words) {
    for (int poll = 0; poll < 2000 && text_of(log).find(words) == std::string::npos; ++poll)
      std::this_thread::sleep_for(10ms);
    return text_of(log).find(words) != std::string::npos;
  }
  void expect_inside(const RunningRobot& robot) const {
    const SentFrames frames = judge_sent_frames(robot.run_directory(), config::load(robot_file()).value());
    EXPECT_GT(frames.motion_commands, 100U);
    EXPECT_EQ(frames.first_violation, "");
    Child replay({"takt", "replay", robot.run_directory()}, robot.directory() + "/replay.log");
    EXPECT_EQ(replay.wait(60s), 0) << text_of(robot.directory() + "/replay.log");
  }

  const TemporaryDirectory folder_;
};

class TaktImuOn : public TaktImu, public testing::WithParamInterface<bool> {};  // a CAN bus?

TEST_P(TaktImuOn, FrozenItIsLost) {
  expect_lost(GetParam(), [](auto& mti) { mti->turn(Health::frozen); });
}

TEST_P(TaktImuOn, LateItIsLostAlsoWhenItsMessagesComeAgain) {
  expect_lost(GetParam(), [](auto& mti) { mti->turn(Health::late); });
}

TEST_P(TaktImuOn, GarbageIsNoImu) {
  expect_lost(GetParam(), [](auto& mti) { mti->turn(Health::garbage); });
}

TEST_P(TaktImuOn, CutItIsLost) {
  expect_lost(GetParam(), [](auto& mti) { mti.reset(); });
}

INSTANTIATE_TEST_SUITE_P(, TaktImuOn, testing::Bool(),
                         [](const auto& each) { return std::string(each.param ? "Can" : "Serial"); });

TEST_F(TaktImu, PluggedInAgainItServes) {
  RunningRobot robot({}, robot_file());
  Child imu = start_imu(robot, "--port", port());
  const std::string log = robot.directory() + "/imu.log";
  ASSERT_TRUE(is_said(log, port() + ": No such file or directory")) << "it waits for its port";
  auto mti = std::make_unique<SerialMti>(port());
  const Child policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  mti.reset();
  ASSERT_TRUE(robot.wait_for_mode(Mode::damped_stop)) << robot.logs();
  expect_imu_lost(robot);
  EXPECT_TRUE(is_said(log, port() + " vanished")) << text_of(log);
  mti = std::make_unique<SerialMti>(port());
  ASSERT_TRUE(robot.reset()) << robot.logs();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  imu.signal(SIGTERM);
  EXPECT_EQ(imu.wait(20s), 0) << robot.logs();
  ASSERT_TRUE(robot.finish()) << robot.logs();
  expect_inside(robot);
}

TEST_F(TaktImu, WhatDoesNotFitIsRefused) {
  const auto ends_with = [this](std::vector<std::string> words) {
    words.insert(words.begin(), {"takt-imu", "--runtime-dir", folder_.path()});
    return Child(words, folder_.path("imu.log")).wait(20s);
  };
  EXPECT_EQ(ends_with({"--port", port(), "--robot", "config/arm6.yaml"}), 65) << "no imu";
  EXPECT_EQ(ends_with({"--port", port(), "--robot", robot_file(), "--baud", "12345"}), 64);
  EXPECT_EQ(ends_with({"--port", port(), "--robot", robot_file(), "--rpy", "0 rad,1 m,0 rad"}), 64);
  EXPECT_EQ(ends_with({"--port", port()}), 64) << "no robot";
  EXPECT_EQ(ends_with({"--robot", robot_file()}), 64) << "neither port nor bus";
  EXPECT_EQ(ends_with({"--robot", robot_file(), "--port", port(), "--bus", "aux"}), 64) << "both";
  EXPECT_EQ(ends_with({"--robot", robot_file(), "--bus", "can7"}), 65) << "no such bus";
  EXPECT_EQ(ends_with({"--robot", robot_file(), "--bus", "aux", "--can-ids", "1,2"}), 64);
  EXPECT_EQ(ends_with({"--robot", robot_file(), "--bus", "can0", "--can-ids", "0x001,0x021,0x032,0x034"}), 65);
  EXPECT_NE(text_of(folder_.path("imu.log")).find("a drive on bus can0 has 0x001 too"), std::string::npos)
      << text_of(folder_.path("imu.log"));
}

}  // namespace
}  // namespace takt::test
