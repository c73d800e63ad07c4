// SPDX-License-Identifier: Apache-2.0
// Goal: whatever a simulation plays of a robot's sensors, a scenario strikes by its name, and no other's. Method: a
// pendulum in a forked world that gives a sensor and images, through real mailboxes: each is read after every step,
// while another fault strikes each of them; a third sensor is not played.
#include "simulation/simulated_sensors.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <optional>
#include <vector>

#include "config/paths.hpp"
#include "executive/contract/image_sample.hpp"
#include "tests/simulation/forked_world.hpp"
#include "tests/simulation/plant_robots.hpp"

namespace takt::simulation {
namespace {

using test::ForkedWorld;
using testing::HasSubstr;

constexpr std::uint32_t kHeight = 2, kWidth = 3;
constexpr std::size_t kEye = 0, kFilm = 1;

config::RobotConfig seeing_pendulum() {
  config::RobotConfig robot = test::pendulum(2, 0.5);
  robot.sensors.clear();
  robot.sensors.push_back({.name = "eye", .values = 1, .timeout = seconds(1)});
  robot.sensors.push_back({.name = "film", .timeout = seconds(1), .image = config::ImageShape{kHeight, kWidth, 1}});
  robot.sensors.push_back({.name = "hand", .values = 1, .timeout = seconds(1)});
  robot.simulation->camera_sensor.clear();
  return robot;
}

// Every step sees: its number.
void see(const std::string& path) {
  test::play(path, 0,
             [](takt_world& world, takt_world_state& state) {
               if (world.kind == TAKT_WORLD_RESET) return true;
               const std::uint64_t step = state.time_ns / world.step.step_ns;
               state.sensor[0] = static_cast<double>(step);
               state.sensor_sequence = step;
               std::memset(takt_world_pixels(&world, 0), static_cast<int>(step), std::size_t{kHeight} * kWidth);
               takt_world_show(&world, 0, state.time_ns);
               return true;
             },
             "eye", 1, {{"film", kHeight, kWidth, 1, 0}});
}

Scenario scenario(const std::string& events, const config::RobotConfig& robot) {
  return parse_scenario("schema: takt.scenario/1\nevents:\n" + events, "s", robot).value();
}

class Mailbox {
 public:
  Mailbox(const std::string& socket, const ipc::RingShape& shape) {
    Hello hello;
    hello.role = Role::sensor_reader;
    auto lease = ipc::attach(socket, hello, std::chrono::seconds(10));
    if (!lease) throw std::runtime_error(lease.error());
    segment_ = ipc::Segment::adopt_read_only(lease->descriptors.at(0).release(), ipc::ring_bytes(shape)).value();
    reader_ = ipc::SlotReader::attach(segment_->readable(), shape).value();
  }
  // The newest, or none that is new.
  template <class Message>
  std::optional<Message> read() {
    std::vector<std::byte> into(ipc::ring_bytes(ipc::sensor_mailbox()));
    if (reader_->read_latest(into).status != ipc::ReadStatus::fresh) return std::nullopt;
    Message message;
    std::memcpy(&message, into.data(), sizeof message);
    behind_ = static_cast<std::uint8_t>(into[sizeof message]);
    return message;
  }
  [[nodiscard]] int behind() const { return behind_; }  // the byte behind the message read last

 private:
  std::optional<ipc::Segment> segment_;
  std::optional<ipc::SlotReader> reader_;
  int behind_ = 0;
};

class SimulatedSensorsTest : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  const std::string folder_ = testing::TempDir() + "takt_simulated_sensors";
  const config::RobotConfig robot_ = seeing_pendulum();
};

TEST_F(SimulatedSensorsTest, AScenarioStrikesEachByItsName) {
  const ForkedWorld process(see);
  auto world = OutsideMechanics::connect(robot_, process.path(), 1);
  ASSERT_TRUE(world) << world.error().sentence;
  OutsideMechanics& played = **world;
  RobotPlant body = RobotPlant::make_in(std::move(*world), robot_).value();
  auto sensors = SimulatedSensors::open(robot_, folder_, {}, body.now(), body, &played);
  ASSERT_TRUE(sensors) << sensors.error();
  ScenarioPlayer player(scenario("  - { at: 10 ms, sensor: eye, lies: 1, for: 10 ms }\n"
                                 "  - { at: 5 ms, sensor: film, drop: 1, for: 10 ms }\n",
                                 robot_),
                        robot_, [](const std::string&) {});
  Mailbox eye(config::sensor_socket(folder_, "eye"), ipc::sensor_mailbox());
  Mailbox film(config::sensor_socket(folder_, "film"), ipc::image_mailbox(kHeight, kWidth, 1));
  for (int step = 1; step <= 30; ++step) {
    player.advance(body);
    body.step();
    sensors->look(body, player, body.now());
    const auto seen = eye.read<SensorSample>();
    ASSERT_TRUE(seen) << step;
    EXPECT_EQ(seen->values[0], static_cast<float>(step > 10 && step <= 20 ? -step : step));
    const auto image = film.read<ImageHeader>();
    EXPECT_EQ(image.has_value(), step <= 5 || step > 15) << step;
    if (image) {
      EXPECT_EQ(film.behind(), step);
    }
  }
}

TEST_F(SimulatedSensorsTest, WhatNobodyPlaysHereIsNotStruck) {
  const ForkedWorld process(see);
  auto world = OutsideMechanics::connect(robot_, process.path(), 1);
  ASSERT_TRUE(world) << world.error().sentence;
  OutsideMechanics& played = **world;
  RobotPlant body = RobotPlant::make_in(std::move(*world), robot_).value();
  const auto sensors = SimulatedSensors::open(robot_, folder_, {}, body.now(), body, &played);
  ASSERT_TRUE(sensors) << sensors.error();
  EXPECT_EQ(sensors->unplayed(scenario("  - { at: 1 s, sensor: film, fault: freeze }\n", robot_), "s.yaml"), "");
  EXPECT_THAT(sensors->unplayed(scenario("  - { at: 1 s, sensor: hand, lies: 1 }\n", robot_), "s.yaml"),
              HasSubstr("s.yaml: lies of 100 % of sensor hand, which this simulation does not play"));
  EXPECT_FALSE(std::filesystem::exists(config::sensor_socket(folder_, "hand")));
}

}  // namespace
}  // namespace takt::simulation
