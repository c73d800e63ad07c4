// SPDX-License-Identifier: Apache-2.0
// Goal: the tools for the person at the robot work on a bus with drives of all five protocols, and keep away from one
// that an executive drives. Method: takt-plant alone as the hardware, the real `takt` command against it.
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <thread>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "tests/process/patient_copy.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_directory.hpp"

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
  BusTools() : BusTools([](std::string& /*robot_file*/) {}) {}
  // `edit`: what becomes of the robot file, every default written out.
  explicit BusTools(const std::function<void(std::string&)>& edit, const char* robot = kRobot,
                    const char* last_bus = "can3") {
    robot_ = patient_copy(robot, directory_.path());
    std::string text = text_of(robot_);
    edit(text);
    std::ofstream(robot_) << text;
    plant_.emplace(std::vector<std::string>{"takt-plant", "--robot", robot_, "--runtime-dir", directory_.path()},
                   directory_.path("plant.log"));
    const auto socket = config::loopback_socket(directory_.path(), last_bus);
    for (int i = 0; i < 500 && !std::filesystem::exists(socket); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  Ended takt(const std::vector<std::string>& words) {
    Child child = start(words);
    return end(child);
  }
  Child start(std::vector<std::string> words) {
    words.insert(words.begin(), "takt");
    words.insert(words.end(), {"--robot", robot_, "--runtime-dir", directory_.path()});
    return {words, directory_.path("takt-" + std::to_string(++commands_) + ".out")};
  }
  // Of the command started last.
  Ended end(Child& child) {
    const int exit_code = child.wait(std::chrono::seconds(60)).value_or(-1);
    return {exit_code, text_of(directory_.path("takt-" + std::to_string(commands_) + ".out"))};
  }

  const TemporaryDirectory directory_;
  std::string robot_;
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

// The plant's drives are as they were; the file says another reply id and another rated torque.
TEST_F(BusTools, ScanTellsWhatDiffersFromTheFile) {
  std::string text = text_of(robot_);
  const auto put = [&text](const std::string& key, const std::string& value) {
    const std::size_t at = text.find(key);
    ASSERT_NE(at, std::string::npos) << key;
    text.replace(at + key.size(), text.find('\n', at) - at - key.size(), value);
  };
  put("reply_id: ", "49");
  put("rated_torque: ", "11 Nm");
  std::ofstream(robot_) << text;
  const Ended scan = takt({"bus", "scan", "--json", "--last-id", "20"});
  EXPECT_EQ(scan.exit_code, 1) << scan.output;
  std::string differs;
  for (const auto& line : scan.json())
    for (const auto& what : line.at("differs")) differs += what.get<std::string>() + "\n";
  EXPECT_NE(differs.find("the robot file says reply_id 0x31"), std::string::npos) << differs;
  EXPECT_NE(differs.find("object 6076:00"), std::string::npos) << differs;
  EXPECT_EQ(std::ranges::count(differs, '\n'), 2) << differs;
}

// Drives that answer at once: none is in time for the settings of another.
class ScanOfDamiaoAlone : public BusTools {
 protected:
  ScanOfDamiaoAlone() : BusTools([](std::string& /*robot_file*/) {}, "config/arm6.yaml", "can1") {}
};

TEST_F(ScanOfDamiaoAlone, WaitsUntilEverySettingIsCompared) {
  std::string text = text_of(robot_);
  const std::string torque = "torque_range: ";
  const std::size_t at = text.find(torque) + torque.size();
  text.replace(at, text.find('\n', at) - at, "60 Nm");
  std::ofstream(robot_) << text;
  const Ended scan = takt({"bus", "scan", "--json", "--last-id", "8"});
  EXPECT_EQ(scan.exit_code, 1) << scan.output;
  EXPECT_NE(scan.output.find("torque range (register 23)"), std::string::npos) << scan.output;
}

TEST_F(BusTools, WatchAsksWhereNoOtherProgramDoes) {
  Ended watch;
  for (int i = 0; i < 5; ++i) {
    watch = takt({"bus", "watch", "--seconds", "3", "--json"});
    const auto joints = watch.json().at("joints");
    if (std::ranges::all_of(joints, [](const auto& joint) { return joint.at("seen").template get<bool>(); })) break;
  }
  EXPECT_TRUE(watch.json().at("asked").get<bool>()) << watch.output;
  for (const auto& joint : watch.json().at("joints")) {
    EXPECT_TRUE(joint.at("seen").get<bool>()) << joint;
    EXPECT_EQ(joint.at("state"), "disabled") << joint;
    EXPECT_EQ(joint.at("error"), "") << joint;
  }
  EXPECT_FALSE(takt({"bus", "watch", "--seconds", "1", "--json", "--listen"}).json().at("asked").get<bool>());
}

class JogOfEveryProtocol : public BusTools, public testing::WithParamInterface<const char*> {};

TEST_P(JogOfEveryProtocol, MovesTheJointAndLetsGo) {
  const Ended jog =
      takt({"joint", "jog", GetParam(), "--by", "3deg", "--speed", "20deg/s", "--torque", "4Nm", "--json"});
  ASSERT_EQ(jog.exit_code, 0) << jog.output;
  EXPECT_NEAR(jog.json().at("moved_rad").get<double>(), 3 * 0.01745, 0.015) << jog.output;
}

INSTANTIATE_TEST_SUITE_P(Joints, JogOfEveryProtocol,
                         testing::Values("left_wrist_roll", "left_wrist_yaw", "right_base_yaw", "right_wrist_yaw"),
                         [](const auto& joint) { return std::string(joint.param); });

// The plant's drive has the counts that the file had; the file is written anew, and read by the tool alone.
class JogOfAnotherScale : public BusTools {
 protected:
  void file_says(const std::string& joint, const std::string& old, const std::string& now) {
    std::string text = text_of(robot_);
    const std::size_t at = text.find(old, text.find("name: " + joint + "\n"));
    ASSERT_NE(at, std::string::npos) << old;
    std::ofstream(robot_) << text.replace(at, old.size(), now);
  }
  Ended jog(const std::string& joint) {
    return takt({"joint", "jog", joint, "--without-gravity", "--by", "3deg", "--speed", "20deg/s", "--torque", "4Nm"});
  }
};

TEST_F(JogOfAnotherScale, CountsThatAreNotTheDrivesAreNamed) {
  file_says("right_base_yaw", "counts_per_turn: 65536", "counts_per_turn: 131072");
  const Ended wrong = jog("right_base_yaw");
  EXPECT_EQ(wrong.exit_code, 3) << wrong.output;
  EXPECT_NE(wrong.output.find("the drive has 65536 counts per motor turn"), std::string::npos) << wrong.output;
}

// The demo arm's shoulder carries the arm: it moves as asked in either direction, or says that it did not.
TEST_F(BusTools, JogGoesWhereItIsToldAgainstGravityOrNotAtAll) {
  for (const char* by : {"5deg", "-5deg"}) {
    const Ended jog = takt({"joint", "jog", "left_shoulder", "--by", by, "--json"});
    ASSERT_EQ(jog.exit_code, 0) << jog.output;
    EXPECT_NEAR(jog.json().at("moved_rad").get<double>(), std::stod(by) * 0.01745, 0.02) << jog.output;
  }
  const Ended bare = takt({"joint", "jog", "left_shoulder", "--by", "5"});
  EXPECT_EQ(bare.exit_code, 64);
  EXPECT_NE(bare.output.find("--by: 5 has no unit; write it in rad or deg, of a slide in m or mm"), std::string::npos)
      << bare.output;
  const Ended beyond = takt({"joint", "jog", "left_shoulder", "--by", "500deg"});
  EXPECT_EQ(beyond.exit_code, 1) << beyond.output;
  EXPECT_NE(beyond.output.find("outside limits.position"), std::string::npos) << beyond.output;
}

// Periods that a pause swallowed are skipped: sent in a burst, their frames would look to the driver like as many ticks
// without a reply. Pauses are far shorter than the drive's watchdog.
TEST_F(BusTools, JogGoesOnAfterAPause) {
  Child jog =
      start({"joint", "jog", "right_wrist_yaw", "--by", "3deg", "--speed", "20deg/s", "--torque", "4Nm", "--json"});
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

// Goal: a drive that cannot be zeroed is told of in its own words, and nothing is sent. Method: the plant's drive is as
// it was, and the file means another one; then no drive at all.
TEST_F(BusTools, ZeroQuotesTheDriveThatIsRefused) {
  std::string text = text_of(robot_);
  const std::string protocol = "protocol: mit\n";
  text.insert(text.find(protocol, text.find("name: left_shoulder\n")) + protocol.size(), "      identity: \"70999\"\n");
  std::ofstream(robot_) << text;
  const Ended refused = takt({"bus", "zero", "left_shoulder", "--yes"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_NE(refused.output.find("joint left_shoulder: its drive reports the drive's own settings differ from the robot "
                                "file: identity (register 15)"),
            std::string::npos)
      << refused.output;
  plant_.reset();
  const Ended silent = takt({"bus", "zero", "left_shoulder", "--yes"});
  EXPECT_EQ(silent.exit_code, 69) << silent.output;
}

// Drives that forget with their supply where they are: an ODrive that counts from where it was switched on, and a
// T-Motor drive whose encoder cannot tell places 40 degrees apart from each other. Both joints stand at -1.2 rad.
class JointHome : public BusTools {
 protected:
  JointHome()
      : BusTools([](std::string& robot) {
          put(robot, "left_elbow", "one_of_several\n      places_per_turn: 9");
          put(robot, "right_elbow", "unknown");
        }) {}
  using BusTools::BusTools;
  static void put(std::string& robot, const std::string& joint, const std::string& value) {
    const std::string key = "position_after_power_up: ";
    const std::size_t at = robot.find(key, robot.find("name: " + joint + "\n")) + key.size();
    robot.replace(at, robot.find('\n', at) - at, value);
  }
  // What a person types goes in, as it would at a terminal.
  Ended home(const std::string& typed, const std::string& words) {
    const std::string programs = std::filesystem::read_symlink("/proc/self/exe").parent_path();
    Child shell({"/bin/sh", "-c",
                 "echo " + typed + " | exec " + programs + "/takt joint home " + words + " --robot " + robot_ +
                     " --runtime-dir " + directory_.path()},
                directory_.path("takt-" + std::to_string(++commands_) + ".out"));
    return end(shell);
  }
  // What keeps an executive from being armed, and its log.
  std::pair<std::string, std::string> start_and_try_to_arm() {
    const std::string log = directory_.path("executive.log");
    Child executive({"takt-executive", "--robot", robot_, "--runtime-dir", directory_.path(), "--allow-non-realtime"},
                    log);
    std::string said;
    // Refused in any case: no policy is there. Drives take a moment to say how they are.
    const auto all_are_heard = [&said] {
      return said.find("right_elbow: the drive reports") != std::string::npos &&
             said.find("no recent feedback") == std::string::npos;
    };
    for (int i = 0; i < 100 && !all_are_heard(); ++i) {
      const std::string out = directory_.path("arm-" + std::to_string(++commands_) + ".out");
      Child arm({"takt", "arm", "--runtime-dir", directory_.path()}, out);
      EXPECT_NE(arm.wait(std::chrono::seconds(20)), 0);
      said = text_of(out);
    }
    EXPECT_TRUE(all_are_heard()) << said;
    const std::string out = directory_.path("status-" + std::to_string(++commands_) + ".out");
    Child status({"takt", "status", "--runtime-dir", directory_.path()}, out);
    EXPECT_EQ(status.wait(std::chrono::seconds(20)), 0);
    EXPECT_NE(text_of(out).find("joint right_elbow: the drive reports a fault"), std::string::npos)
        << "in standby a status tells what arm would be refused for: " << text_of(out);
    executive.signal(SIGTERM);
    EXPECT_EQ(executive.wait(std::chrono::seconds(20)), 0);
    return {said, text_of(log)};
  }
};

TEST_F(JointHome, ByHandOfADriveThatKeepsItUntilItsSupplyGoes) {
  const Ended jog = takt({"joint", "jog", "right_elbow", "--without-gravity"});
  EXPECT_EQ(jog.exit_code, 1);
  EXPECT_NE(jog.output.find("takt joint home JOINT --robot FILE --at ANGLE"), std::string::npos) << jog.output;
  const Ended not_meant = home("left_elbow", "right_elbow --at -68.75deg");
  EXPECT_EQ(not_meant.exit_code, 1);
  EXPECT_NE(not_meant.output.find("not confirmed: nothing was changed"), std::string::npos) << not_meant.output;
  EXPECT_EQ(home("right_elbow", "right_elbow --at 200deg").exit_code, 64) << "outside its limits";
  const Ended done = home("right_elbow", "right_elbow --at -68.75deg");
  ASSERT_EQ(done.exit_code, 0) << done.output;
  EXPECT_NE(done.output.find("reads -68.75 deg now"), std::string::npos) << done.output;
  const Ended after = takt({"joint", "jog", "right_elbow", "--without-gravity", "--by", "0.1deg", "--json"});
  EXPECT_EQ(after.output.find("does not know where"), std::string::npos) << after.output;
}

TEST_F(JointHome, WithoutAStopNothingIsTold) {
  const Ended search =
      home("right_wrist_yaw", "right_wrist_yaw --at 90deg --to-stop forward --within 2deg --torque 4Nm");
  EXPECT_EQ(search.exit_code, 1);
  EXPECT_NE(search.output.find("no stop within 2.0 deg"), std::string::npos) << search.output;
  EXPECT_EQ(search.output.find("type its name"), std::string::npos) << search.output;
}

TEST_F(JointHome, OfSeveralPlacesTheNearestHoldsForOneStart) {
  const Ended doubtful = home("left_elbow", "left_elbow --at -49deg");
  EXPECT_EQ(doubtful.exit_code, 1);
  EXPECT_NE(doubtful.output.find("near none of them"), std::string::npos) << doubtful.output;
  const Ended done = home("left_elbow", "left_elbow --at -70deg");
  ASSERT_EQ(done.exit_code, 0) << done.output;
  EXPECT_NE(done.output.find("joint left_elbow is at -68.7"), std::string::npos) << done.output;
  const auto [first, log] = start_and_try_to_arm();
  EXPECT_NE(log.find("joint left_elbow: a person said that it is at -1.2"), std::string::npos) << log;
  EXPECT_NE(first.find("joint right_elbow: the drive reports a fault: where the joint is, is not known"),
            std::string::npos)
      << first;
  EXPECT_EQ(first.find("left_elbow"), std::string::npos) << first;
  const auto [second, later_log] = start_and_try_to_arm();
  EXPECT_NE(second.find("joint left_elbow: the drive reports a fault: where the joint is, is not known"),
            std::string::npos)
      << second;
}

constexpr char kSlideRobot[] = R"(schema: takt.robot/1
robot: slide
freshness: { max_age: 120 ms, epsilon: 0.05, window: 1 s, recover_after: 250 ms, stop_after: 600 ms }
degraded: { behaviour: hold }
feedback: { timeout: 200 ms }
buses: [{ name: b, interface: slide_bus, when_missing: loopback }]
joints:
  - name: finger
    kind: slide
    bus: b
    drive: { protocol: odrive, id: 1, watchdog_waiver: simulated, gear_ratio: 100 rad/m, torque_range: 1 Nm, position_after_power_up: unknown }
    limits: { position: [0 m, 0.1 m], position_margin: 0.01 m, velocity: 0.2 m/s, velocity_hard: 0.4 m/s, acceleration: 2 m/s2, torque: 80 N, torque_rate: 4000 N/s, kp: 8000 N/m, kd: 800 Ns/m }
    gains: { kp: 4000 N/m, kd: 300 Ns/m, damping: 300 Ns/m }
    inertia: 4 kg
    home: 0.05 m
  - name: turn
    bus: b
    drive: { protocol: mit, variant: damiao, id: 2, reply_id: 0x12, position_range: 12.5 rad, velocity_range: 60 rad/s, torque_range: 10 Nm, kp_range: 500 Nm/rad, kd_range: 5 Nms/rad, position_after_power_up: absolute }
    limits: { position: [-1 rad, 1 rad], position_margin: 0.1 rad, velocity: 2 rad/s, velocity_hard: 4 rad/s, acceleration: 20 rad/s2, torque: 10 Nm, torque_rate: 400 Nm/s, kp: 100 Nm/rad, kd: 4 Nms/rad }
    gains: { kp: 20 Nm/rad, kd: 1 Nms/rad, damping: 1 Nms/rad }
    inertia: 0.1 kgm2
model:
  links:
    - { joint: finger, parent: base, origin: { xyz: [0 m, 0 m, 0 m] }, axis: [1, 0, 0], mass: 0 kg, com: [0 m, 0 m, 0 m], inertia: [0 kgm2, 0 kgm2, 0 kgm2] }
    - { joint: turn, parent: finger, origin: { xyz: [0 m, 0 m, 0 m] }, axis: [0, 0, 1], mass: 0 kg, com: [0 m, 0 m, 0 m], inertia: [0 kgm2, 0 kgm2, 0 kgm2] }
  tool: { link: turn, xyz: [0 m, 0 m, 0 m] }
simulation: {}
)";

class ToolsOfASlide : public JointHome {
 protected:
  ToolsOfASlide() : JointHome([](std::string& robot) { robot = kSlideRobot; }, kRobot, "slide_bus") {}
};

// Goal: a slide is moved and placed in millimetres, and a unit of the other kind is refused before anything is sent.
// Method: a slide whose ODrive counts from where it was switched on, and a hinge beside it.
TEST_F(ToolsOfASlide, JogAndHomeAreInMillimetres) {
  const auto refused = [this](const std::vector<std::string>& words, const std::string& sentence) {
    const Ended ended = takt(words);
    EXPECT_EQ(ended.exit_code, 64) << ended.output;
    EXPECT_NE(ended.output.find(sentence), std::string::npos) << ended.output;
  };
  refused({"joint", "jog", "finger", "--by", "0.1rad"},
          "takt joint jog: --by: 0.1rad is an angle, not a length; write it in m or mm: finger slides");
  refused({"joint", "jog", "finger", "--torque", "1 Nm"},
          "takt joint jog: --torque: 1 Nm is a torque, not a force; write it in N: finger slides");
  refused(
      {"joint", "jog", "turn", "--speed", "5mm/s"},
      "takt joint jog: --speed: 5mm/s is a velocity, not an angular velocity; write it in rad/s or deg/s: turn turns");
  refused({"joint", "home", "finger", "--at", "10deg"},
          "takt joint home: --at: 10deg is an angle, not a length; write it in m or mm: finger slides");
  refused({"joint", "jog", "finger", "--torque", "90N"}, "--torque 90 N exceeds limits.torque 80 N of finger");
  refused({"joint", "home", "finger", "--at", "0.2m"}, "--at: 200.0 mm is outside limits.position 0.0 mm to 100.0 mm");
  const Ended homed = home("finger", "finger --at 50mm");
  ASSERT_EQ(homed.exit_code, 0) << homed.output;
  EXPECT_NE(homed.output.find("joint finger reads 50.00 mm now"), std::string::npos) << homed.output;
  const Ended jog = takt({"joint", "jog", "finger", "--by", "5mm", "--saw", "5mm"});
  EXPECT_EQ(jog.exit_code, 0) << jog.output;
  EXPECT_NE(jog.output.find("joint finger: asked for +5.00 mm, moved +"), std::string::npos) << jog.output;
  EXPECT_NE(jog.output.find("its scale is the robot file's: +5.0 mm seen where the drive told +"), std::string::npos)
      << jog.output;
  const Ended back = takt({"joint", "jog", "finger", "--by", "-0.005m", "--json"});
  EXPECT_EQ(back.exit_code, 0) << back.output;
  EXPECT_NEAR(back.json().at("moved_m").get<double>(), -0.005, 0.002) << back.output;
  EXPECT_NEAR(back.json().at("from_m").get<double>(), 0.055, 0.002) << back.output;
  EXPECT_FALSE(back.json().contains("moved_rad")) << back.output;
  const auto joints = takt({"bus", "watch", "--seconds", "1", "--json"}).json().at("joints");
  EXPECT_NEAR(joints.at(0).at("q_m").get<double>(), 0.05, 0.002) << joints;
  EXPECT_TRUE(joints.at(0).contains("tau_N") && !joints.at(0).contains("q_rad")) << joints;
  EXPECT_TRUE(joints.at(1).contains("q_rad") && joints.at(1).contains("tau_Nm")) << joints;
}

TEST_F(BusTools, HomeIsForDrivesThatForgetIt) {
  const Ended home = takt({"joint", "home", "left_shoulder", "--at", "0"});
  EXPECT_EQ(home.exit_code, 1);
  EXPECT_NE(home.output.find("takt bus zero"), std::string::npos) << home.output;
  const Ended zero = takt({"bus", "zero", "right_wrist_yaw", "--yes"});
  EXPECT_EQ(zero.exit_code, 1);
  EXPECT_NE(zero.output.find("takt joint home right_wrist_yaw --robot " + robot_ + " --at ANGLE"), std::string::npos)
      << zero.output;
}

TEST_F(BusTools, NothingIsSentWhileAnExecutiveRunsButWatchingIsFine) {
  Child executive({"takt-executive", "--robot", robot_, "--runtime-dir", directory_.path(), "--allow-non-realtime"},
                  directory_.path("executive.log"));
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
                                                  {"joint", "home", "right_wrist_yaw", "--at", "0"},
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
