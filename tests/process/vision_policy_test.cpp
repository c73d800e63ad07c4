// SPDX-License-Identifier: Apache-2.0
// Goal: a policy that sees turns the robot after what is in the image, the image's age is in the age of every command,
// what the network was shown is in the run, images as files of what the camera sent, and without its camera it is
// silent. An image that is lost is missed by `takt policy replay`. Method: the demo arm in real processes under
// docs/examples/python-sensor/look.onnx; the camera is the test's, and each of its images is as old as it says.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "client/takt/client.h"
#include "executive/contract/monotonic_clock.hpp"
#include "monitor/record/image_file.hpp"
#include "monitor/record/mcap_reader.hpp"
#include "monitor/record/recorded_run.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/simulation/looking_arm.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::test {
namespace {

constexpr Duration kShutter = milliseconds(30);  // before an image is published

// A bright spot on a dark ground.
std::vector<std::uint8_t> picture(std::size_t column) {
  std::vector<std::uint8_t> pixels(kImageHeight * kImageWidth);
  draw_spot(pixels.data(), column);
  return pixels;
}

// Sends it 30 times a second.
class Camera {
 public:
  explicit Camera(const RunningRobot& robot) {
    takt_sensor_spec spec{};
    spec.size = sizeof spec;
    spec.type = TAKT_UINT8;
    spec.robot_file = robot.robot_file().c_str();
    spec.runtime_directory = robot.directory().c_str();
    spec.name = "cam0";
    spec.height = kImageHeight;
    spec.width = kImageWidth;
    spec.channels = 1;
    std::array<char, 512> why{};
    EXPECT_EQ(takt_sensor_open(&spec, &sensor_, why.data(), why.size()), TAKT_OK) << why.data();
    films_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested() && sensor_ != nullptr) {
        film();
        std::this_thread::sleep_for(std::chrono::milliseconds(33));
      }
    });
  }
  Camera(const Camera&) = delete;
  Camera& operator=(const Camera&) = delete;
  ~Camera() {
    films_ = {};
    takt_sensor_close(sensor_);
  }
  void show_spot_at(std::size_t column) { column_ = column; }

 private:
  void film() {
    draw_spot(static_cast<std::uint8_t*>(takt_sensor_values(sensor_)), column_);
    EXPECT_EQ(takt_sensor_publish(sensor_, (monotonic_now() - kShutter).ns), TAKT_OK) << takt_sensor_sentence(sensor_);
  }

  takt_sensor* sensor_ = nullptr;
  std::atomic<std::size_t> column_ = 4;
  std::jthread films_;
};

struct Seen {
  float lowest = HUGE_VALF, highest = -HUGE_VALF;  // base's reference while it tracked, rad
  Duration youngest = seconds(100);                // image under a command that was played
  std::uint64_t ticks = 0;
};

// The column of the spot in every image of the run; each has to be one that Camera sends.
std::set<std::size_t> spots_in(const std::string& folder) {
  std::set<std::size_t> spots;
  const auto run = monitor::open_run(folder);
  const auto image = [&](const monitor::ShownImage& shown) {
    ASSERT_EQ(shown.file, monitor::ImageFile::stored);
    const auto bytes = monitor::read_image(run->folder, shown.shape, shown.sha256);
    ASSERT_TRUE(bytes) << bytes.error();
    const auto begin = std::ranges::find(*bytes, std::uint8_t{240});
    const auto column = static_cast<std::size_t>(begin - bytes->begin()) % kImageWidth;
    EXPECT_EQ(*bytes, picture(column));
    spots.insert(column);
  };
  EXPECT_TRUE(monitor::scan_run(
      *run, {.tick = {}, .command = {}, .keyframe = {}, .loss = {}, .policy_input = {}, .image = image}));
  return spots;
}

// Images that the policy was shown, and pictures of them for viewers: as many as fit, and these are small.
std::pair<int, int> images_and_pictures_in(const std::string& folder) {
  std::pair<int, int> counted;
  const auto ticks = monitor::McapReader::open(monitor::RunFolder(folder).ticks());
  EXPECT_TRUE(ticks) << ticks.error();
  if (!ticks) return counted;
  (void)ticks->scan([&](const monitor::McapMessage& message) {
    if (message.topic == "/takt/image") ++counted.first;
    if (message.schema_name == "sensor_msgs/msg/CompressedImage") ++counted.second;
    return true;
  });
  return counted;
}

// Exit code and what it printed.
std::pair<std::optional<int>, std::string> replay_policy(const RunningRobot& robot) {
  const std::string log = robot.directory() + "/policy-replay.log";
  Child replay({"takt", "policy", "replay", robot.run_directory()}, log);
  const auto exit_code = replay.wait(std::chrono::seconds(60));
  return {exit_code, text_of(log)};
}

Seen seen_in(const std::string& folder) {
  Seen seen;
  const auto run = monitor::open_run(folder);
  EXPECT_TRUE(run) << run.error();
  if (!run) return seen;
  const auto tick = [&](const monitor::RecordedTick& recorded) {
    const TickRecordHeader& header = recorded.record.header;
    if (header.mode != Mode::tracking || header.player != Player::policy) return;
    ++seen.ticks;
    seen.lowest = std::min(seen.lowest, recorded.record.joints[0].q_reference);
    seen.highest = std::max(seen.highest, recorded.record.joints[0].q_reference);
    seen.youngest = std::min(seen.youngest, header.age.sense + header.age.queue);
  };
  EXPECT_TRUE(monitor::scan_run(*run, {.tick = tick, .command = {}, .keyframe = {}, .loss = {}}));
  return seen;
}

TEST(VisionPolicy, TurnsAfterWhatItSeesAndSaysHowOldThatWas) {
  const TemporaryDirectory directory;
  {
    RunningRobot robot({}, looking_arm(directory.path()));
    const Child policy = robot.start_policy_host();
    std::optional<Camera> camera;
    camera.emplace(robot);
    ASSERT_TRUE(robot.wait_until([](const StatusSnapshot& s) {
      return s.tick.seats[Seat::policy].freshness == Freshness::fresh;
    })) << robot.logs();
    ASSERT_EQ(robot.arm(), "") << robot.logs();
    ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
    robot.let_run(2000);
    camera->show_spot_at(52);
    robot.let_run(3000);
    camera.reset();
    EXPECT_TRUE(robot.wait_for_mode(Mode::damped_stop)) << robot.logs();
    ASSERT_TRUE(robot.finish()) << robot.logs();

    const Seen seen = seen_in(robot.run_directory());
    EXPECT_GT(seen.ticks, 2000U);
    EXPECT_LT(seen.lowest, -0.08F) << "0.3 rad from one edge of the image to the other";
    EXPECT_GT(seen.highest, 0.08F);
    EXPECT_GE(seen.youngest, kShutter);
    const auto [same, judged] = replay_policy(robot);
    EXPECT_EQ(same, 0) << judged << robot.logs();
    EXPECT_EQ(spots_in(robot.run_directory()), (std::set<std::size_t>{4, 52}));
    const auto [shown, pictures] = images_and_pictures_in(robot.run_directory());
    EXPECT_GT(shown, 50);
    EXPECT_EQ(pictures, shown);
    const std::filesystem::directory_iterator images(robot.run_directory() + "/images");
    ASSERT_EQ(std::distance(begin(images), end(images)), 2) << "as many files as there were pictures";
    std::filesystem::remove(*std::filesystem::directory_iterator(robot.run_directory() + "/images"));
    const auto [lost, said] = replay_policy(robot);
    EXPECT_EQ(lost, 2) << said;
    EXPECT_NE(said.find("is missing: it was lost since the run"), std::string::npos) << said;
  }
}

}  // namespace
}  // namespace takt::test
