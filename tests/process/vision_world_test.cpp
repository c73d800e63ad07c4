// SPDX-License-Identifier: Apache-2.0
// Goal: the same images are the same answers in real processes and in virtual time, bit for bit, and a world's images
// reach a real policy host by takt-plant, each as old as the world says. Method: a world that stands still shows the
// demo arm under docs/examples/python-sensor/look.onnx a spot at eight places, so that an answer follows from the image
// alone; the commands of a run of the real programs are held against those of a rollout of the same robot file.
#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <vector>

#include "evidence/rollout/rollout.hpp"
#include "monitor/record/recorded_run.hpp"
#include "policy_host/onnx_policy.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/simulation/looking_arm.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::test {
namespace {

// Of each different command its values, and the age of the youngest image under one.
struct Said {
  std::set<std::vector<std::byte>> values;
  Duration youngest = seconds(100);

  void add(std::span<const std::byte> command) {
    CommandHeader header;
    std::memcpy(&header, command.data(), sizeof header);
    values.emplace(command.begin() + offsetof(CommandChunk, values), command.end());
    youngest = std::min(youngest, header.infer_started_at - header.outside_sensed_at);
  }
};

Said said_in_run(const std::string& folder) {
  Said said;
  const auto run = monitor::open_run(folder);
  EXPECT_TRUE(run) << run.error();
  if (!run) return said;
  const auto command = [&](const monitor::RecordedCommand& recorded) { said.add(recorded.payload); };
  EXPECT_TRUE(monitor::scan_run(*run, {.tick = {}, .command = command, .keyframe = {}, .loss = {}}));
  return said;
}

Said said_in_rollout(const config::RobotConfig& robot, const std::string& world_socket) {
  Said said;
  const auto policy =
      policy_host::load_onnx_policy(robot.policy->file, robot.policy->input, robot.policy->output).value();
  evidence::WorldProcess world(world_socket);
  evidence::RolloutRow row;
  const evidence::RolloutSetup setup{.robot = robot,
                                     .policy = *policy,
                                     .policy_hash = 1,
                                     .task = evidence::Task::world,
                                     .timing = {},
                                     .perturbation = {},
                                     .duration = seconds(5),
                                     .scored = seconds(1),
                                     .bound_m = 1,
                                     .on_command =
                                         [&](const CommandChunk& chunk) {
                                           said.add({reinterpret_cast<const std::byte*>(&chunk), chunk.used_bytes()});
                                         },
                                     .world = &world};
  const auto done = evidence::run_rollout(setup, row);
  EXPECT_TRUE(done) << done.error();
  EXPECT_EQ(row.failure_label, "");
  return said;
}

TEST(VisionWorld, TheSameImagesAreTheSameAnswersInRealProcessesAndInVirtualTime) {
  const ForkedWorld process([](const std::string& path) { play_spots(path, TAKT_WORLD_ERROR); });
  const TemporaryDirectory directory;
  config::RobotConfig patient;
  Said real;
  {
    RunningRobot robot({}, looking_arm(directory.path()), {}, process.path());
    const Child policy = robot.start_policy_host();
    ASSERT_TRUE(robot.wait_until([](const StatusSnapshot& s) {
      return s.tick.seats[Seat::policy].freshness == Freshness::fresh;
    })) << robot.logs();
    robot.let_run(3000);
    patient = config::load(robot.robot_file()).value();
    ASSERT_TRUE(robot.finish()) << robot.logs();
    real = said_in_run(robot.run_directory());
  }
  // The world plays one simulation at a time: takt-plant's has ended.
  const Said in_virtual_time = said_in_rollout(patient, process.path());
  EXPECT_EQ(in_virtual_time.values.size(), kPlaces);
  EXPECT_TRUE(real.values == in_virtual_time.values)
      << real.values.size() << " different answers of the real policy host";
  EXPECT_GE(real.youngest, kImageAge);
  EXPECT_GE(in_virtual_time.youngest, kImageAge);
}

}  // namespace
}  // namespace takt::test
