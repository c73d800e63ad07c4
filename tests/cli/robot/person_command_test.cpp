// SPDX-License-Identifier: Apache-2.0
// Goal: operator input reaches the readers of the sensor for as long as it is given, and what the robot file does not
// allow is refused before it is published. Method: the command in a thread, a reader on its real socket; refusals by
// exit code.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "cli/command.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "tests/support/files.hpp"

namespace takt::cli {
namespace {

class PersonCommand : public testing::Test {
 protected:
  PersonCommand() {
    std::filesystem::create_directories(directory_);
    std::string robot = test::text_of("config/arm6.yaml");
    const std::string sensors = "\nsensors:\n", network = "file: arm6_reach.onnx";
    robot.insert(robot.find(sensors) + sensors.size(),
                 "  - name: wish\n    values: 2\n    timeout: 100 ms\n    unit: m/s\n"
                 "    command: { minimum: [-0.5, 0], maximum: [1, 2], when_absent: [0, 0] }\n");
    robot.replace(robot.find(network), network.size(),
                  "file: " + std::filesystem::absolute("config/arm6_reach.onnx").string());
    std::ofstream(robot_file_) << robot;
  }
  int say(std::vector<std::string> words) {
    std::vector<std::string> all{"takt", "command"};
    all.insert(all.end(), words.begin(), words.end());
    for (const std::string& word : {std::string("--robot"), robot_file_, std::string("--runtime-dir"), directory_})
      all.push_back(word);
    std::vector<const char*> argv;
    for (const std::string& word : all) argv.push_back(word.c_str());
    return run_command_line(commands(), static_cast<int>(argv.size()), argv.data());
  }
  std::string directory_ = (std::filesystem::path(testing::TempDir()) / "takt_person").string();
  std::string robot_file_ = directory_ + "/robot.yaml";
};

TEST_F(PersonCommand, IsASensorForAsLongAsItIsSaid) {
  int exit_code = -1;
  std::thread person([&] { exit_code = say({"wish", "0.5", "2", "--for", "1.5s"}); });
  Hello hello;
  hello.role = Role::sensor_reader;
  SensorSample sample;
  std::uint64_t first = 0;
  for (const MonoTime give_up = monotonic_now() + seconds(20);
       monotonic_now() < give_up && sample.sequence < first + 2;) {
    auto lease = ipc::attach(directory_ + "/sensor-wish.sock", hello, std::chrono::milliseconds(200));
    if (lease) {
      auto segment =
          ipc::Segment::adopt_read_only(lease->descriptors[0].release(), ipc::ring_bytes(ipc::sensor_mailbox()));
      auto reader = ipc::SlotReader::attach(segment.value().readable(), ipc::sensor_mailbox());
      (void)reader.value().read_latest(std::as_writable_bytes(std::span(&sample, 1)));
      if (first == 0) first = sample.sequence;
      if (first != 0) continue;
    }
    sleep_until(monotonic_now() + milliseconds(1));
  }
  person.join();
  EXPECT_EQ(exit_code, kExitOk);
  ASSERT_NE(first, 0U);
  EXPECT_GE(sample.sequence, first + 2) << "again and again, so that its age stays below the timeout";
  EXPECT_EQ(sample.value_count, 2U);
  EXPECT_EQ(sample.values[0], 0.5F);
  EXPECT_EQ(sample.values[1], 2.0F);
  EXPECT_FALSE(std::filesystem::exists(directory_ + "/sensor-wish.sock")) << "it is over";
}

TEST_F(PersonCommand, IsRefusedBeforeAnybodyHearsIt) {
  EXPECT_EQ(say({"wish", "1.01", "0"}), kExitUsage) << "above its maximum";
  EXPECT_EQ(say({"wish", "0", "-0.01"}), kExitUsage);
  EXPECT_EQ(say({"wish", "nan", "0"}), kExitUsage);
  EXPECT_EQ(say({"wish", "0.5"}), kExitUsage) << "one of two";
  EXPECT_EQ(say({"target", "0", "0", "0"}), 65) << "a sensor, and no command";
  EXPECT_EQ(say({"nobody", "0"}), 65);
}

}  // namespace
}  // namespace takt::cli
