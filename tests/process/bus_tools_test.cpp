// Goal: the tools for the person at the robot work on a bus with drives of all five protocols, and keep away from one
// that an executive drives. Method: takt-plant alone as the hardware, the real `takt` command against it.
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <thread>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "tests/process/patient_copy.hpp"
#include "tests/process/running_robot.hpp"

namespace takt::test {
namespace {

constexpr char kRobot[] = "config/dual_arm12.yaml";

class BusTools : public testing::Test {
 protected:
  struct Ended {
    int exit_code = -1;
    std::string output;
    [[nodiscard]] nlohmann::json json() const { return nlohmann::json::parse(output); }
  };
  BusTools() {
    std::string pattern = testing::TempDir() + "takt-bus-tools.XXXXXX";
    directory_ = mkdtemp(pattern.data());
    robot_ = patient_copy(kRobot, directory_);
    plant_.emplace(std::vector<std::string>{"takt-plant", "--robot", robot_, "--runtime-dir", directory_},
                   directory_ + "/plant.log");
    const auto last_bus = config::loopback_socket(directory_, "can3");
    for (int i = 0; i < 500 && !std::filesystem::exists(last_bus); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  ~BusTools() override {
    plant_.reset();
    std::filesystem::remove_all(directory_);
  }
  Ended takt(const std::vector<std::string>& words) {
    Child child = start(words);
    return end(child);
  }
  Child start(std::vector<std::string> words) {
    words.insert(words.begin(), "takt");
    words.insert(words.end(), {"--robot", robot_, "--runtime-dir", directory_});
    return {words, directory_ + "/takt-" + std::to_string(++commands_) + ".out"};
  }
  // Of the command started last.
  Ended end(Child& child) {
    const int exit_code = child.wait(std::chrono::seconds(60)).value_or(-1);
    std::ifstream file(directory_ + "/takt-" + std::to_string(commands_) + ".out");
    return {exit_code, {std::istreambuf_iterator<char>(file), {}}};
  }

  std::string directory_, robot_;
  std::optional<Child> plant_;
  int commands_ = 0;
};

TEST_F(BusTools, ScanFindsEveryJointsDrive) {
  const Ended scan = takt({"bus", "scan", "--json", "--last-id", "20"});
  ASSERT_EQ(scan.exit_code, 0) << scan.output;
  const auto lines = scan.json();
  EXPECT_EQ(lines.size(), 12U) << scan.output;
  for (const auto& line : lines) EXPECT_TRUE(line.at("joint").is_string()) << line;
}

class JogOfEveryProtocol : public BusTools, public testing::WithParamInterface<const char*> {};

TEST_P(JogOfEveryProtocol, MovesTheJointAndLetsGo) {
  const Ended jog = takt({"joint", "jog", GetParam(), "--by", "3", "--speed", "20", "--torque", "4", "--json"});
  ASSERT_EQ(jog.exit_code, 0) << jog.output;
  EXPECT_NEAR(jog.json().at("moved_rad").get<double>(), 3 * 0.01745, 0.015) << jog.output;
}

INSTANTIATE_TEST_SUITE_P(Joints, JogOfEveryProtocol,
                         testing::Values("left_wrist_roll", "left_wrist_yaw", "right_base_yaw", "right_wrist_yaw"),
                         [](const auto& joint) { return std::string(joint.param); });

// The demo arm's shoulder carries the arm: it moves as asked in either direction, or says that it did not.
TEST_F(BusTools, JogGoesWhereItIsToldAgainstGravityOrNotAtAll) {
  for (const char* by : {"5", "-5"}) {
    const Ended jog = takt({"joint", "jog", "left_shoulder", "--by", by, "--json"});
    ASSERT_EQ(jog.exit_code, 0) << jog.output;
    EXPECT_NEAR(jog.json().at("moved_rad").get<double>(), std::stod(by) * 0.01745, 0.02) << jog.output;
  }
  const Ended beyond = takt({"joint", "jog", "left_shoulder", "--by", "500"});
  EXPECT_EQ(beyond.exit_code, 1) << beyond.output;
  EXPECT_NE(beyond.output.find("outside limits.position"), std::string::npos) << beyond.output;
}

// Periods that a pause swallowed are skipped: sent in a burst, their frames would look to the driver like as many ticks
// without a reply. Pauses are far shorter than the drive's watchdog.
TEST_F(BusTools, JogGoesOnAfterAPause) {
  Child jog = start({"joint", "jog", "right_wrist_yaw", "--by", "3", "--speed", "20", "--torque", "4", "--json"});
  for (int pause = 0; pause < 12; ++pause) {
    jog.signal(SIGSTOP);
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    jog.signal(SIGCONT);
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
  }
  const Ended ended = end(jog);
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
}

TEST_F(BusTools, ZeroSetsOrSaysTheOffset) {
  const Ended said = takt({"bus", "zero", "left_shoulder"});
  EXPECT_EQ(said.exit_code, 0);
  EXPECT_NE(said.output.find("with --yes"), std::string::npos) << said.output;
  const Ended done = takt({"bus", "zero", "left_shoulder", "--yes"});
  EXPECT_EQ(done.exit_code, 0) << done.output;
  EXPECT_NE(done.output.find("and reads -0.000"), std::string::npos) << done.output;
  const Ended offset = takt({"bus", "zero", "right_shoulder"});
  EXPECT_NE(offset.output.find("offset: -0.600"), std::string::npos) << offset.output;
}

TEST_F(BusTools, NothingIsSentWhileAnExecutiveRunsButWatchingIsFine) {
  Child executive({"takt-executive", "--robot", robot_, "--runtime-dir", directory_, "--allow-non-realtime"},
                  directory_ + "/executive.log");
  Ended watch;
  for (int i = 0; i < 20; ++i) {
    watch = takt({"bus", "watch", "--seconds", "1", "--json"});
    const auto joints = watch.json().at("joints");
    if (std::ranges::all_of(joints, [](const auto& joint) { return joint.at("seen").template get<bool>(); })) break;
  }
  EXPECT_EQ(watch.exit_code, 0);
  for (const auto& joint : watch.json().at("joints")) EXPECT_TRUE(joint.at("seen").get<bool>()) << joint;
  for (const std::vector<std::string>& command : {std::vector<std::string>{"bus", "scan"},
                                                  {"bus", "zero", "left_shoulder"},
                                                  {"joint", "jog", "left_shoulder"},
                                                  {"bus", "disable"}}) {
    const Ended refused = takt(command);
    EXPECT_EQ(refused.exit_code, 1) << refused.output;
    EXPECT_NE(refused.output.find("an executive runs in"), std::string::npos) << refused.output;
  }
  executive.signal(SIGTERM);
  EXPECT_EQ(executive.wait(std::chrono::seconds(20)), 0);
}

// What the executive's unit runs after it: an executive that is killed leaves enabled drives behind.
class BusDisable : public testing::Test {
 protected:
  BusDisable() : policy_(robot_.start_policy_host()) {}
  void kill_the_tracking_executive() {
    ASSERT_EQ(robot_.arm(), "") << robot_.logs();
    ASSERT_TRUE(robot_.wait_for_mode(Mode::tracking)) << robot_.logs();
    robot_.executive().signal(SIGKILL);
    robot_.executive().wait(std::chrono::seconds(5));
  }
  // Exit code, and what was said of the joints.
  std::pair<std::optional<int>, nlohmann::json> disable() {
    const std::string log = robot_.directory() + "/disable.out";
    Child command(
        {"takt", "bus", "disable", "--json", "--robot", robot_.robot_file(), "--runtime-dir", robot_.directory()}, log);
    const auto exit_code = command.wait(std::chrono::seconds(30));
    std::ifstream file(log);
    std::string line;
    while (std::getline(file, line) && !line.starts_with('{')) {
    }
    return {exit_code, nlohmann::json::parse(line).at("joints")};
  }
  RunningRobot robot_{{}, kRobot};
  Child policy_;
};

TEST_F(BusDisable, DisablesWhatAKilledExecutiveLeftEnabled) {
  kill_the_tracking_executive();
  const auto [exit_code, joints] = disable();
  EXPECT_EQ(exit_code, 0) << joints;
  EXPECT_EQ(joints.size(), 12U);
  for (const auto& joint : joints) EXPECT_TRUE(joint.at("disabled").get<bool>()) << joint;
}

TEST_F(BusDisable, ABusThatIsGoneDoesNotKeepItFromTheOthers) {
  kill_the_tracking_executive();
  std::filesystem::remove(config::loopback_socket(robot_.directory(), "can0"));
  const auto [exit_code, joints] = disable();
  EXPECT_EQ(exit_code, 69) << joints;
  EXPECT_EQ(std::ranges::count_if(joints, [](const auto& joint) { return joint.at("disabled").template get<bool>(); }),
            9);
}

TEST_F(BusTools, ASilentDriveIsMissed) {
  plant_.reset();
  const Ended scan = takt({"bus", "scan"});
  EXPECT_EQ(scan.exit_code, 69) << scan.output;
  EXPECT_EQ(takt({"bus", "disable"}).exit_code, 69);
  const Ended jog = takt({"joint", "jog", "no_such_joint"});
  EXPECT_EQ(jog.exit_code, 64);
  EXPECT_NE(jog.output.find("has no joint `no_such_joint`"), std::string::npos) << jog.output;
}

}  // namespace
}  // namespace takt::test
