// Goal: a policy that sees turns the robot after what is in the image, the image's age is in the age of every command,
// what the network was shown is in the run, and without its camera it is silent. Method: the demo arm in real processes
// under docs/examples/python-sensor/look.onnx; the camera is the test's, and each of its images is as old as it says.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <filesystem>
#include <string>
#include <thread>

#include "client/takt/client.h"
#include "executive/contract/monotonic_clock.hpp"
#include "monitor/record/recorded_run.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/simulation/looking_arm.hpp"

namespace takt::test {
namespace {

constexpr Duration kShutter = milliseconds(30);  // before an image is published

// A bright spot on a dark ground, 30 times a second.
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
  std::string pattern = (std::filesystem::temp_directory_path() / "takt-vision.XXXXXX").string();
  const std::string directory = mkdtemp(pattern.data());
  {
    RunningRobot robot({}, looking_arm(directory));
    const Child policy = robot.start_policy_host();
    std::optional<Camera> camera;
    camera.emplace(robot);
    ASSERT_TRUE(robot.wait_until([](const StatusSnapshot& s) { return s.tick.freshness == Freshness::fresh; }))
        << robot.logs();
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
    EXPECT_TRUE(robot.takt({"policy", "replay", robot.run_directory()})) << robot.logs();
  }
  std::filesystem::remove_all(directory);
}

}  // namespace
}  // namespace takt::test
