// Goal: an MTi on a serial port is a robot's IMU, and whatever happens to it ends in imu_lost, inside the envelope:
// cut, frozen, late, garbage; plugged in again it serves on. Method: real processes, the demo arm with an IMU; behind a
// pseudo-terminal a simulated MTi, written from its protocol's description.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>
#include <unistd.h>

#include <atomic>
#include <deque>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <random>
#include <thread>

#include "executive/contract/monotonic_clock.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/process/sent_frames.hpp"
#include "tests/sensors/imu/mti_encoder.hpp"

namespace takt::test {
namespace {

using namespace std::chrono_literals;

// How a simulated MTi behaves: all well; the same values in fresh messages; messages that wait for two seconds; bytes
// that are none.
enum class Health { well, frozen, late, garbage };

// 200 messages a second, level, a little noise. `link` leads to its terminal while it lives.
class SimulatedMti {
 public:
  explicit SimulatedMti(const std::string& link)
      : link_(link), master_(posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) {
    EXPECT_EQ(grantpt(master_), 0);
    EXPECT_EQ(unlockpt(master_), 0);
    std::filesystem::remove(link_);
    std::filesystem::create_symlink(ptsname(master_), link_);
    thread_ = std::jthread([this](const std::stop_token& stop) { speak(stop); });
  }
  ~SimulatedMti() {
    thread_ = {};
    std::filesystem::remove(link_);
    close(master_);
  }
  void turn(Health health) { health_ = health; }

 private:
  void speak(const std::stop_token& stop) {
    MonoTime next = monotonic_now();
    for (std::uint16_t counter = 0; !stop.stop_requested(); ++counter) {
      next = next + milliseconds(5);
      sleep_until(next);
      if (health_ != Health::frozen) says_.rate[0] = 1e-3F * static_cast<float>(random_() % 10);
      says_.counter = counter;
      says_.ticks = static_cast<std::uint32_t>(monotonic_now().ns / 100'000);
      Bytes bytes = message(0x36, mtdata2(says_));
      if (health_ == Health::garbage)
        for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random_());
      waiting_.push_back({next + (health_ == Health::late ? seconds(2) : Duration{}), bytes});
      while (!waiting_.empty() && waiting_.front().due <= monotonic_now()) {
        (void)!write(master_, waiting_.front().bytes.data(), waiting_.front().bytes.size());
        waiting_.pop_front();
      }
    }
  }
  struct Waiting {
    MonoTime due;
    Bytes bytes;
  };
  std::string link_;
  int master_;
  std::atomic<Health> health_ = Health::well;
  std::mt19937 random_{1};
  MtiSays says_;
  std::deque<Waiting> waiting_;
  std::jthread thread_;
};

std::string text_of(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

class TaktImu : public testing::Test {
 protected:
  TaktImu() {
    EXPECT_NE(mkdtemp(folder_.data()), nullptr);
    std::filesystem::copy_file("config/arm6_reach.onnx", folder_ + "/arm6_reach.onnx");
    std::string arm = text_of("config/arm6.yaml");
    const std::string sensors = "\nsensors:\n";
    arm.insert(arm.find(sensors) + sensors.size(), "  - { name: torso, values: 10, timeout: 300 ms }\n");
    std::ofstream(robot_file()) << arm << "\nimu: { sensor: torso, tilt: 0.5 rad, frozen_after: 300 ms }\n";
  }
  ~TaktImu() override { std::filesystem::remove_all(folder_); }
  [[nodiscard]] std::string robot_file() const { return folder_ + "/arm6.yaml"; }
  [[nodiscard]] std::string port() const { return folder_ + "/mti"; }
  [[nodiscard]] Child start_imu(const RunningRobot& robot) const {
    return Child({"takt-imu", "--robot", robot.robot_file(), "--port", port(), "--runtime-dir", robot.directory()},
                 robot.directory() + "/imu.log");
  }
  // Arms, lets the trouble begin, and judges: the IMU is lost, the robot stops, no frame left the envelope.
  void expect_lost(const std::function<void(SimulatedMti&)>& trouble) const {
    RunningRobot robot({}, robot_file());
    SimulatedMti mti(port());
    Child imu = start_imu(robot);
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
    const SentFrames frames = judge_sent_frames(robot.run_directory() + "/can.log", config::load(robot_file()).value());
    EXPECT_GT(frames.motion_commands, 100U);
    EXPECT_EQ(frames.first_violation, "");
    Child replay({"takt", "replay", robot.run_directory()}, robot.directory() + "/replay.log");
    EXPECT_EQ(replay.wait(60s), 0) << text_of(robot.directory() + "/replay.log");
  }

  std::string folder_ = testing::TempDir() + "takt-imu-XXXXXX";
};

TEST_F(TaktImu, FrozenItIsLost) {
  expect_lost([](SimulatedMti& mti) { mti.turn(Health::frozen); });
}

TEST_F(TaktImu, LateItIsLostAlsoWhenItsMessagesComeAgain) {
  expect_lost([](SimulatedMti& mti) { mti.turn(Health::late); });
}

TEST_F(TaktImu, GarbageIsNoImu) {
  expect_lost([](SimulatedMti& mti) { mti.turn(Health::garbage); });
}

TEST_F(TaktImu, CutItIsLostAndPluggedInAgainItServes) {
  RunningRobot robot({}, robot_file());
  Child imu = start_imu(robot);
  const std::string log = robot.directory() + "/imu.log";
  ASSERT_TRUE(is_said(log, port() + ": No such file or directory")) << "it waits for its port";
  auto mti = std::make_unique<SimulatedMti>(port());
  const Child policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  mti.reset();
  ASSERT_TRUE(robot.wait_for_mode(Mode::damped_stop)) << robot.logs();
  expect_imu_lost(robot);
  EXPECT_TRUE(is_said(log, port() + " vanished")) << text_of(log);
  mti = std::make_unique<SimulatedMti>(port());
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
    words.insert(words.begin(), {"takt-imu", "--runtime-dir", folder_, "--port", port()});
    return Child(words, folder_ + "/imu.log").wait(20s);
  };
  EXPECT_EQ(ends_with({"--robot", "config/arm6.yaml"}), 65) << "no imu";
  EXPECT_EQ(ends_with({"--robot", robot_file(), "--baud", "12345"}), 64);
  EXPECT_EQ(ends_with({"--robot", robot_file(), "--rpy", "0 rad,1 m,0 rad"}), 64);
  EXPECT_EQ(ends_with({}), 64);
}

}  // namespace
}  // namespace takt::test
