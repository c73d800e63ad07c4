// SPDX-License-Identifier: Apache-2.0
// Goal: an executive sends nothing to drives that another host commands. Method: simulated drives on loopback buses,
// and one more node that sends what a controller sends, or what drives say.
#include "executive/runtime/open_edge.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "config/load.hpp"
#include "drivers/bus/loopback_bus.hpp"
#include "drivers/protocol/home_note.hpp"
#include "executive/contract/exit_codes.hpp"
#include "tests/executive/runtime/simulated_drives.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::runtime::test {
namespace {

using namespace std::chrono_literals;

// Sends one frame again and again, as a controller at 1 kHz does.
class Stranger {
 public:
  Stranger(const std::string& hub, std::uint32_t id) : bus_(drivers::LoopbackBus::connect(hub, {}).value()) {
    frame_.id = id;
    frame_.length = 8;
    thread_ = std::thread([this] {
      make_this_thread_prompt();
      for (; !done_; std::this_thread::sleep_for(1ms)) bus_->send(frame_);
    });
  }
  ~Stranger() {
    done_ = true;
    thread_.join();
  }
  Stranger(const Stranger&) = delete;
  Stranger& operator=(const Stranger&) = delete;

 private:
  std::unique_ptr<drivers::CanBus> bus_;
  drivers::CanFrame frame_;
  std::atomic<bool> done_ = false;
  std::thread thread_;
};

class OpenEdgeTest : public testing::Test {
 protected:
  [[nodiscard]] std::string hub(std::size_t bus) const {
    return config::loopback_socket(directory_.path(), robot_.buses[bus].interface);
  }

  const takt::test::TemporaryDirectory directory_;
  config::RobotConfig robot_ = config::load("config/arm6.yaml").value();
};

// Threat: second-controller
TEST_F(OpenEdgeTest, ASecondControllerIsHeardBeforeTheFirstFrame) {
  const SimulatedDrives drives(robot_, directory_.path());
  const std::size_t last = robot_.joints.size() - 1;
  const config::Joint& joint = robot_.joints[last];
  const Stranger stranger(hub(joint.bus), joint.drive.id);
  const auto opened = open_edge(robot_, directory_.path(), 5s);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().exit_code, kExitSetUpRefused);
  EXPECT_TRUE(opened.error().sentence.starts_with(robot_.buses[joint.bus].interface + ": ")) << opened.error().sentence;
  EXPECT_NE(opened.error().sentence.find("0x006"), std::string::npos) << opened.error().sentence;
}

TEST_F(OpenEdgeTest, DrivesThatSpeakUnaskedAreNoController) {
  const SimulatedDrives drives(robot_, directory_.path());
  const Stranger drive(hub(robot_.joints[0].bus), robot_.joints[0].drive.reply_id);
  const auto opened = open_edge(robot_, directory_.path(), 5s);
  EXPECT_TRUE(opened) << opened.error().sentence;
}

// What a person said is not lost by a start that came to nothing.
TEST_F(OpenEdgeTest, AStartThatFailsLeavesHomesSaid) {
  config::Drive& drive = robot_.joints[1].drive;
  drive.position_after_power_up = config::PositionAfterPowerUp::one_of_several;
  drive.places_per_turn = 9;
  ASSERT_TRUE(drivers::write_home_note(directory_.path(), robot_, 1, {.shift = 0.7, .left_at = 0.1}));
  ASSERT_FALSE(open_edge(robot_, directory_.path(), 0s)) << "no bus is there";
  const auto left = drivers::take_home_notes(directory_.path(), robot_);
  ASSERT_TRUE(left[1].has_value());
  EXPECT_EQ(left[1]->shift, 0.7);
  EXPECT_FALSE(drivers::take_home_notes(directory_.path(), robot_)[1].has_value()) << "it holds once";
}

TEST_F(OpenEdgeTest, AMissingBusIsAnotherMatter) {
  const auto opened = open_edge(robot_, directory_.path(), 0s);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().exit_code, kExitUnavailable);
}

}  // namespace
}  // namespace takt::runtime::test
