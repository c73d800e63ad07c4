// SPDX-License-Identifier: Apache-2.0
// Goal: a robot file means what it says, or is refused with the place and the remedy. Method: a table of broken files
// with the exact complaint; properties of the canonical dump; the committed demo robot.
#include "config/load.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>

#include "config/based_on.hpp"
#include "config/document.hpp"
#include "config/drive_presets.hpp"
#include "config/hash.hpp"
#include "config/key_table.hpp"
#include "config/migrations.hpp"
#include "config/schema.hpp"
#include "config/writer.hpp"
#include "tests/config/refusals.hpp"
#include "tests/config/small_robot.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::config {
namespace {

using test::kSmallRobot;
using test::with;

class EveryRefusal : public testing::TestWithParam<test::Refusal> {};

TEST_P(EveryRefusal, NamesThePlaceTheMistakeAndTheRemedy) {
  const test::Refusal& refusal = GetParam();
  const auto robot = parse(with(refusal.from, refusal.to), "robot.yaml");
  ASSERT_FALSE(robot.has_value());
  std::string complaint = robot.error();
  for (std::size_t at = 0; (at = complaint.find("robot.yaml:", at)) != std::string::npos;)
    complaint.erase(at, std::string_view("robot.yaml:").size());
  EXPECT_EQ(complaint, refusal.complaint);
}

INSTANTIATE_TEST_SUITE_P(Load, EveryRefusal, testing::ValuesIn(test::kRefusals), [](const auto& row) {
  std::string name(row.param.when);
  std::ranges::replace_if(
      name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; }, '_');
  return name;
});

TEST(Load, AllProblemsAreCollectedInFileOrder) {
  std::string text = with("epsilon: 0.01", "epsilon: 2");
  text.replace(text.find("torque: 12 Nm"), 13, "torque: 12");
  const auto robot = parse(text, "r");
  ASSERT_FALSE(robot.has_value());
  EXPECT_EQ(robot.error(),
            "r:6:12: freshness.epsilon: 2 is out of range; write above 0 and below 1\n"
            "r:26:15: joints[0].limits.torque: 12 has no unit; write `12 Nm`");
}

// Goal: no folder named ~ is made, no file looked for in one. A run that was recorded in one stays readable.
TEST(Load, AHomeFolderIsNotExpandedAndSaysSo) {
  const auto complaint = [](std::string_view from, std::string_view to) { return parse(with(from, to), "r").error(); };
  EXPECT_EQ(complaint("sensors:", "record: { directory: ~/runs }\nsensors:"),
            "r:44:22: record.directory: ~ is not expanded; write /home/NAME/runs");
  EXPECT_EQ(complaint("small.onnx", "~eva/small.onnx"),
            "r:47:9: policy.file: ~ is not expanded; write /home/NAME/small.onnx");
  EXPECT_EQ(complaint("small.onnx", "small.onnx\n  engine: { name: ~/engine.so }"),
            "r:48:19: policy.engine.name: ~ is not expanded; write /home/NAME/engine.so");
  EXPECT_TRUE(parse(with("small.onnx", "~small.onnx"), "r")) << "a name that begins so";
  EXPECT_TRUE(parse_recorded(with("sensors:", "record: { directory: ~/runs }\nsensors:"), "r"));
}

// Of what follows from the mistake nothing else is told: not one key of the other kind.
TEST(Load, AnotherKindOfFileHasOneLineThatSaysWhatItIsFor) {
  const auto complaint = [](std::string_view schema) {
    return parse(with("takt.robot/1", schema), "my/file.yaml").error();
  };
  EXPECT_EQ(complaint("takt.panel/1"),
            "my/file.yaml:1:9: is a panel (takt.panel/1), not a robot file; run it: takt panel run my/file.yaml --out "
            "DIR");
  EXPECT_EQ(complaint("takt.scenario/1"),
            "my/file.yaml:1:9: is a scenario (takt.scenario/1), not a robot file; play it: takt run ROBOT "
            "--plant=--scenario=my/file.yaml");
  EXPECT_EQ(complaint("takt.devices/1"),
            "my/file.yaml:1:9: is a devices file (takt.devices/1), not a robot file; simulate it: takt-plant --devices "
            "my/file.yaml");
  EXPECT_EQ(complaint("takt.training/1"),
            "my/file.yaml:1:9: is takt.training/1, not a robot file (takt.robot/1); name another file");
  EXPECT_EQ(complaint("takt.robots/1"),
            "my/file.yaml:1:9: schema: schema `takt.robots/1` is not known; did you mean `takt.robot/1`?");
}

TEST(Load, DdsIsOffUnlessAskedFor) {
  const auto silent = parse(kSmallRobot, "r");
  ASSERT_TRUE(silent.has_value()) << silent.error();
  EXPECT_FALSE(silent->dds.has_value());
  EXPECT_EQ(silent->resolved.find("dds"), std::string::npos) << "a robot without DDS keeps its hash";
  const auto plain = parse(with("sensors:", "dds: {}\nsensors:"), "r");
  ASSERT_TRUE(plain.has_value()) << plain.error();
  EXPECT_EQ(plain->dds->interface, "lo");
  EXPECT_EQ(plain->dds->domain, 0U);
  EXPECT_EQ(plain->dds->joint_state_rate, 100);
  EXPECT_FALSE(plain->dds->allow_requests);
  EXPECT_EQ(plain->dds->security, "");
  EXPECT_EQ(plain->resolved.find("security"), std::string::npos) << "without certificates a robot keeps its hash";
  const auto secured = parse(with("sensors:", "dds: { security: /etc/takt/dds }\nsensors:"), "r");
  ASSERT_TRUE(secured.has_value()) << secured.error();
  EXPECT_EQ(secured->dds->security, "/etc/takt/dds");
  for (const char* const path : {"keys", "'/etc/takt/<dds>'"}) {
    const auto refused = parse(with("sensors:", std::string("dds: { security: ") + path + " }\nsensors:"), "r");
    ASSERT_FALSE(refused.has_value()) << path;
    EXPECT_NE(refused.error().find("dds.security: is no absolute path of letters"), std::string::npos)
        << refused.error();
  }
  const auto wide =
      parse(with("sensors:", "dds: { domain: 7, interface: eth0, peers: [{ address: 10.0.0.2 }] }\nsensors:"), "r");
  ASSERT_TRUE(wide.has_value()) << wide.error();
  EXPECT_EQ(wide->dds->peers.at(0).address, "10.0.0.2");
  const auto again = parse(wide->resolved, "r");
  ASSERT_TRUE(again.has_value()) << again.error();
  EXPECT_EQ(again->sha256, wide->sha256);
}

TEST(Load, ASensorFromRosReadsAsItWasWritten) {
  const auto robot =
      parse(with("timeout: 100 ms }",
                 "timeout: 100 ms, queue: 20, ros: { topic: /hand, type: sensor_msgs/msg/JointState, joints: [{ "
                 "name: a }, { name: b }, { name: c }], quantity: effort } }\ndds: {}"),
            "r");
  ASSERT_TRUE(robot.has_value()) << robot.error();
  const Sensor& sensor = robot->sensors.at(0);
  EXPECT_EQ(sensor.queue, 20U);
  ASSERT_TRUE(sensor.ros);
  EXPECT_EQ(sensor.ros->topic, "/hand");
  EXPECT_EQ(sensor.ros->type, RosType::joint_state);
  EXPECT_EQ(sensor.ros->quantity, RosQuantity::effort);
  EXPECT_EQ(sensor.ros->joints.at(2).name, "c");
  const auto again = parse(robot->resolved, "r");
  ASSERT_TRUE(again.has_value()) << again.error();
  EXPECT_EQ(again->sha256, robot->sha256);
  EXPECT_EQ(parse(kSmallRobot, "r")->sensors.at(0).queue, 0U) << "the newest only, unless asked";
}

TEST(Load, TheTorqueOutputIsAbsentUnlessAskedForAndWhatAFaultDoesToItIsNoDefault) {
  const auto without = parse(kSmallRobot, "r").value();
  EXPECT_FALSE(without.safe_torque_off.has_value());
  EXPECT_EQ(without.resolved.find("safety"), std::string::npos) << "a robot without one keeps its hash";
  const auto with_output = [](const std::string& keys) {
    return parse(with("sensors:", "safety: { safe_torque_off: { " + keys + " } }\nsensors:"), "r");
  };
  const auto line = with_output("line: 17, active: low, on_joint_fault: drop");
  ASSERT_TRUE(line.has_value()) << line.error();
  EXPECT_EQ(line->safe_torque_off->output, TorqueOutputKind::gpio);
  EXPECT_EQ(line->safe_torque_off->chip, "/dev/gpiochip0");
  EXPECT_EQ(line->safe_torque_off->line, 17U);
  EXPECT_EQ(line->safe_torque_off->active, ActiveLevel::low);
  EXPECT_EQ(line->safe_torque_off->on_joint_fault, OnJointFault::drop);
  const auto file = with_output("output: file, file: /run/torque, on_joint_fault: keep");
  ASSERT_TRUE(file.has_value()) << file.error();
  EXPECT_EQ(file->safe_torque_off->file, "/run/torque");
  EXPECT_NE(with_output("line: 17").error().find("`on_joint_fault` is missing"), std::string::npos);
  EXPECT_NE(with_output("on_joint_fault: drop").error().find("`line` is missing"), std::string::npos);
}

TEST(Load, ConvertsUnitsAndFillsDefaults) {
  const auto robot = parse(kSmallRobot, "robot.yaml");
  ASSERT_TRUE(robot.has_value()) << robot.error();
  constexpr double kPi = 3.141592653589793;
  EXPECT_EQ(robot->joints[1].limits.q_min, -kPi / 2);
  EXPECT_DOUBLE_EQ(robot->fallbacks[0].pose[1], kPi / 18);
  EXPECT_EQ(robot->model->links[0].origin_xyz[2], 0.1);
  EXPECT_EQ(robot->freshness.max_age, milliseconds(120));
  EXPECT_EQ(robot->simulation->step, microseconds(500));
  EXPECT_EQ(robot->buses[0].bitrate, 1'000'000U);
  EXPECT_EQ(robot->control.cpu, std::nullopt);
  EXPECT_EQ(robot->control.late_share, 0.25) << "default";
  EXPECT_EQ(robot->joints[0].observer_bandwidth, 200) << "default";
  EXPECT_EQ(robot->policy->input, "obs") << "default";
  EXPECT_EQ(robot->joints[1].drive.id, 2U) << "hexadecimal";
  EXPECT_EQ(robot->degraded.fallback, "tuck");
  EXPECT_EQ(robot->model->links[1].parent, 0);
  EXPECT_EQ(robot->policy->joint_order, (std::vector<std::size_t>{1, 0}));
  EXPECT_EQ(robot->policy->action.joint_of_output, robot->policy->joint_order) << "outputs follow the joint order";
}

// --- joint_defaults ---

constexpr std::string_view kKneesOwn =
    "    limits: { position: [-90 deg, 90 deg], position_margin: 5 deg, velocity: 3 rad/s, velocity_hard: 6 rad/s, "
    "acceleration: 20 rad/s2, torque: 8 Nm, torque_rate: 900 Nm/s, kp: 80 Nm/rad, kd: 3 Nms/rad }\n"
    "    gains: { kp: 40 Nm/rad, kd: 1 Nms/rad, damping: 1 Nms/rad }\n"
    "    inertia: 0.05 kgm2\n";

// The small robot, its knee written by `blocks` and what is left of its own.
std::string by_defaults(const std::string& blocks, const std::string& own) {
  std::string text = with(kKneesOwn, own);
  return text.insert(text.find("joints:\n"), "joint_defaults:\n" + blocks);
}

constexpr const char* kEverybody =
    "  - joints: [\"*\"]\n"
    "    limits: { position: [-1 rad, 1 rad], position_margin: 5 deg, velocity: 3 rad/s, velocity_hard: 6 rad/s, "
    "acceleration: 20 rad/s2, torque: 9 Nm, torque_rate: 900 Nm/s, kp: 80 Nm/rad, kd: 3 Nms/rad }\n"
    "    inertia: 0.07 kgm2\n";

// Goal: a robot written by blocks is the same robot as one written out. Method: a block for all and one by a pattern;
// the joint's own key wins, then the later block, key by key inside a section.
TEST(JointDefaults, MakeTheSameRobotAsOneWrittenOut) {
  const auto plain = parse(kSmallRobot, "r");
  const auto robot =
      parse(by_defaults(std::string(kEverybody) + "  - joints: [\"kn?e\"]\n"
                                                  "    limits: { torque: 8 Nm }\n"
                                                  "    gains: { kp: 40 Nm/rad, kd: 1 Nms/rad, damping: 1 Nms/rad }\n"
                                                  "    inertia: 0.06 kgm2\n",
                        "    limits: { position: [-90 deg, 90 deg] }\n    inertia: 0.05 kgm2\n"),
            "r");
  ASSERT_TRUE(plain && robot) << robot.error();
  EXPECT_EQ(robot->resolved, plain->resolved);
  EXPECT_EQ(robot->hash, plain->hash);
}

// Goal: a key that its section knows only beside another one is not called unknown: what it needs is said. Method: one
// of each kind: another key, another value of the section, of a list's entry, and none that its meaning names.
TEST(Load, AKeyThatNeedsAnotherSaysWhich) {
  const auto complaint = [](const std::string& from, const std::string& to) {
    return parse(with(from, to), "r").error();
  };
  EXPECT_EQ(complaint("  camera: { sensor: target, period: 33 ms, delay: 18 ms, jitter: 4 ms }\n", ""),
            "r:60:3: `target` in `simulation` needs `camera` beside it: what it sees");
  const std::string gpio =
      complaint("sensors:", "safety: { safe_torque_off: { line: 3, file: x, on_joint_fault: keep } }\nsensors:");
  EXPECT_NE(gpio.find("`file` in `safety.safe_torque_off` needs `file` beside it: its path"), std::string::npos)
      << gpio;
  const std::string stop = complaint("sensors:", "stops: { tilt: { how: damping, for: 2 s } }\nsensors:");
  EXPECT_NE(stop.find("`for` in `stops.tilt` needs `hold, policy` beside it: so long, then rest"), std::string::npos)
      << stop;
  const std::string unknown = complaint("  step: 500 us\n", "  step: 500 us\n  colour: red\n");
  EXPECT_NE(unknown.find("unknown key `colour` in `simulation`"), std::string::npos) << unknown;
}

// Goal: what is wrong in a block is told once, with the block's place and whose it is. Method: one fault each.
TEST(JointDefaults, AProblemIsToldOnceWithItsBlock) {
  const std::string own = "    gains: { kp: 40 Nm/rad, kd: 1 Nms/rad, damping: 1 Nms/rad }\n";
  const auto complaint = [&](const std::string& blocks) { return parse(by_defaults(blocks, own), "r").error(); };
  std::string wrong = kEverybody;
  wrong.replace(wrong.find("0.07 kgm2"), 9, "heavy");
  const std::string told = complaint(wrong);
  EXPECT_NE(told.find("joints[1].inertia"), std::string::npos) << told;
  EXPECT_NE(told.find("(joint_defaults[0], 2 joints from hip)"), std::string::npos) << told;
  const std::string both = parse(by_defaults(std::string(kEverybody) + "    colour: red\n", own), "r").error();
  EXPECT_NE(both.find("unknown key `colour` in `joints[0]`"), std::string::npos) << both;
  EXPECT_EQ(std::ranges::count(both, '\n'), 0) << both;
  EXPECT_NE(complaint(std::string(kEverybody) + "  - { joints: [\"*_hip\"], home: 0 rad }\n")
                .find("joint_defaults[1].joints: no joint is called `*_hip`"),
            std::string::npos);
  EXPECT_NE(complaint("  - { inertia: 1 kgm2 }\n").find("joint_defaults[0]: says not which joints it is for"),
            std::string::npos);
  EXPECT_NE(complaint(std::string(kEverybody) + "    name: hip\n").find("is each joint's own"), std::string::npos);
  EXPECT_NE(
      parse(with("joints:\n", "joint_default: []\njoints:\n"), "r").error().find("did you mean `joint_defaults`?"),
      std::string::npos);
}

// Goal: a medium that fails is told as such, in one line. Method: a file of the kernel that gives an error when read.
TEST(Load, AFileThatFailsToBeReadIsNamed) {
  const auto robot = load("/proc/self/mem");
  ASSERT_FALSE(robot);
  EXPECT_EQ(robot.error(), "/proc/self/mem: reading it failed: Input/output error; check the medium");
}

// --- based_on ---

// Goal: a robot that says how it differs from another one is that robot, written out. Method: a folder with the small
// robot and one based on it, which changes a value in a section of a section, a whole list, and nothing else.
class BasedOn : public testing::Test {
 protected:
  BasedOn() { write("base.yaml", kSmallRobot); }
  void write(const std::string& name, std::string_view text) { std::ofstream(folder_.path(name)) << text; }
  std::expected<RobotConfig, std::string> other(std::string_view text) {
    write("other.yaml", text);
    return load(folder_.path("other.yaml"));
  }
  const takt::test::TemporaryDirectory folder_;
};

TEST_F(BasedOn, IsTheSameRobotAsOneWrittenOut) {
  const auto robot = other(
      "based_on: base.yaml\nfreshness: { epsilon: 0.02 }\n"
      "policy: { action: { scale: [0.3, 0.5] } }\n");
  std::string written_out = with("epsilon: 0.01", "epsilon: 0.02");
  constexpr std::string_view kScale = "scale: [0.25, 0.5]";
  written_out.replace(written_out.find(kScale), kScale.size(), "scale: [0.3, 0.5]");
  const auto plain = parse(written_out, folder_.path("plain.yaml"));
  ASSERT_TRUE(robot && plain) << robot.error();
  EXPECT_EQ(robot->hash, plain->hash);
  EXPECT_EQ(robot->policy->file, plain->policy->file);
  EXPECT_FALSE(robot->resolved.contains(kBasedOn)) << "a run folder's robot file stands alone";
}

TEST_F(BasedOn, AListReplacesTheBaseList) {
  const auto robot = other("based_on: base.yaml\nbuses: [{ name: only, interface: can7 }]\n");
  ASSERT_FALSE(robot);
  EXPECT_NE(robot.error().find("/base.yaml:18:10: joints[0].bus: bus `left` is not known; write one of: only"),
            std::string::npos)
      << robot.error();
}

// Goal: each problem names the file and the line where it is written. Method: one mistake in the base, one in the file.
TEST_F(BasedOn, ProblemsAreToldWhereTheyAreWritten) {
  write("base.yaml", with("epsilon: 0.01", "epsilon: 2"));
  const auto robot = other("based_on: base.yaml\nfreshness: { confidence: 3 }\n");
  ASSERT_FALSE(robot);
  const std::string own = folder_.path("other.yaml"), base = folder_.path("base.yaml");
  EXPECT_TRUE(robot.error().starts_with(own + ":2:26: freshness.confidence: 3 is out of range")) << robot.error();
  EXPECT_NE(robot.error().find("\n" + base + ":6:12: freshness.epsilon: 2 is out of range"), std::string::npos)
      << robot.error();
}

TEST_F(BasedOn, ABaseThatCannotBeOneIsRefused) {
  write("deeper.yaml", "based_on: base.yaml\n");
  write("broken.yaml", "robot: [\n");
  write("empty.yaml", "");
  for (const auto& [text, sentence] : {
           std::pair{"based_on: deeper.yaml\n", "deeper.yaml is based on base.yaml itself; name that one"},
           std::pair{"based_on: ../base.yaml\n", "../base.yaml is a path; name a file in this folder"},
           std::pair{"based_on: [base.yaml]\n", "based_on: holds a list; write the name of a robot file"},
           std::pair{"based_on: none.yaml\n", "none.yaml: cannot be read: No such file or directory"},
           std::pair{"based_on: other.yaml\n", "other.yaml is based on other.yaml itself"},
           std::pair{"based_on: broken.yaml\n", "broken.yaml:2:1: YAML cannot be read"},
           std::pair{"based_on: empty.yaml\n", "empty.yaml holds no robot; name another file"},
           std::pair{"based_on: .\n", "is not a regular file; name a file"},
       }) {
    const auto robot = other(text);
    ASSERT_FALSE(robot) << text;
    EXPECT_NE(robot.error().find(sentence), std::string::npos) << robot.error();
  }
}

TEST(Load, ModelGivesRangesAndExplicitOnesOverrideThem) {
  const auto named = parse(kSmallRobot, "r");
  ASSERT_TRUE(named.has_value());
  const Drive& preset = named->joints[0].drive;
  EXPECT_EQ(preset.position_range, 12.5);
  EXPECT_EQ(preset.velocity_range, 50);
  EXPECT_EQ(preset.torque_range, 65);
  EXPECT_EQ(preset.kp_range, 500);
  EXPECT_EQ(preset.kd_range, 5);
  const auto overridden = parse(with("model: AK10-9,", "model: AK10-9, torque_range: 17 Nm,"), "r");
  ASSERT_TRUE(overridden.has_value());
  EXPECT_EQ(overridden->joints[0].drive.torque_range, 17);
  EXPECT_EQ(overridden->joints[0].drive.velocity_range, 50);
}

// Goal: no preset but what the makers say. Method: numbers of RobStride's manuals (RS00; RS03, 4.1.2 in revisions
// 251112, 260112 and 260713; RS06) beside each other; a seller's table has 50 and 17, 50, 20 and 60 for these.
TEST(Load, RobstridePresetsAreTheManuals) {
  struct Row {
    std::string_view model;
    double velocity, torque, kp, kd;
  };
  for (const Row& row : {Row{"RS00", 33, 14, 500, 5}, Row{"RS03", 20, 60, 5000, 100}, Row{"RS06", 50, 36, 5000, 100}}) {
    const DrivePreset* const preset = find_drive_preset(DriveProtocol::robstride, row.model);
    ASSERT_NE(preset, nullptr) << row.model;
    EXPECT_EQ(preset->velocity, row.velocity) << row.model;
    EXPECT_EQ(preset->torque, row.torque) << row.model;
    EXPECT_EQ(preset->kp, row.kp) << row.model;
    EXPECT_EQ(preset->kd, row.kd) << row.model;
  }
}

// Goal: where sources conflict (AK60-6 45 or 50 rad/s; AK80-9 and AK80-6 by firmware; RS05 5.5 or 6 Nm) the model is no
// answer, whichever number is thought right; what the file says is. Method: the same robot without and with the range.
TEST(Load, ARangeThatSourcesDisagreeAboutMustBeWritten) {
  const std::string ak = with("model: AK10-9", "model: AK60-6");
  const auto refused = parse(ak, "r");
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(
      refused.error(),
      "r:19:12: key `velocity_range` is missing in `joints[0].drive`; add it: public sources do not settle it "
      "for AK60-6 (45 or 50 rad/s), and a wrong range scales every command: write what the drive's own manual says");
  const auto written = parse(with("model: AK10-9", "model: AK60-6, velocity_range: 45 rad/s"), "r");
  ASSERT_TRUE(written.has_value()) << written.error();
  EXPECT_EQ(written->joints[0].drive.velocity_range, 45);
  EXPECT_EQ(written->joints[0].drive.torque_range, 15) << "the rest is the model's";

  constexpr std::string_view kTmotor =
      "{ protocol: mit, variant: tmotor, model: AK10-9, id: 1, reply_id: 0, position_after_power_up: absolute }";
  const auto rs05 = parse(with(kTmotor, "{ protocol: robstride, model: RS05, id: 1 }"), "r");
  ASSERT_FALSE(rs05.has_value());
  EXPECT_NE(rs05.error().find("key `torque_range` is missing"), std::string::npos) << rs05.error();
  EXPECT_NE(rs05.error().find("RS05 (5.5 or 6 Nm)"), std::string::npos) << rs05.error();
  EXPECT_EQ(rs05.error().find("velocity_range"), std::string::npos) << "both sources say 50 rad/s: " << rs05.error();
}

// Goal: one source alone is no preset, and neither are two that differ: AK70-10 (24 or 25 Nm), DM4340 (8 or 10 rad/s),
// RS01, RS02 and RS04 (one source beside a seller's table). Method: the robot with the model alone.
TEST(Load, ARangeThatOneSourceAloneTellsMustBeWritten) {
  constexpr std::string_view kTmotor =
      "{ protocol: mit, variant: tmotor, model: AK10-9, id: 1, reply_id: 0, position_after_power_up: absolute }";
  struct Row {
    const char* drive;
    const char* key;
    const char* said;
  };
  const Row rows[] = {
      {"{ protocol: mit, variant: tmotor, model: AK70-10, id: 1, reply_id: 0, position_after_power_up: absolute }",
       "torque_range", "AK70-10 (24 or 25 Nm)"},
      {"{ protocol: mit, variant: damiao, model: DM4340, id: 1, reply_id: 0x11 }", "velocity_range",
       "DM4340 (8 or 10 rad/s)"},
      {"{ protocol: robstride, model: RS01, id: 1 }", "velocity_range", "44 rad/s, one source"},
      {"{ protocol: robstride, model: RS02, id: 1 }", "kp_range", "500 Nm/rad, one source"},
      {"{ protocol: robstride, model: RS04, id: 1 }", "torque_range", "120 Nm, one source"},
  };
  for (const Row& row : rows) {
    const auto refused = parse(with(kTmotor, row.drive), "r");
    ASSERT_FALSE(refused.has_value()) << row.drive;
    EXPECT_NE(refused.error().find("key `" + std::string(row.key) + "` is missing"), std::string::npos)
        << refused.error();
    EXPECT_NE(refused.error().find(row.said), std::string::npos) << refused.error();
  }
}

// Goal: no drive is taken to know more of its place after power-on than is known of its kind. Method: the key
// left out, and written, for each kind.
TEST(Load, WhatAReadingIsWorthAfterPowerOnIsAsItsKindHasIt) {
  constexpr std::string_view kTmotor =
      "{ protocol: mit, variant: tmotor, model: AK10-9, id: 1, reply_id: 0, position_after_power_up: absolute }";
  const std::string damiao = "protocol: mit, variant: damiao, model: DM8009, id: 1, reply_id: 0x11",
                    rs03 = "protocol: robstride, model: RS03, id: 1",
                    cybergear = "protocol: robstride, model: CyberGear, id: 1",
                    servo = "protocol: cia402, id: 1, counts_per_turn: 4096, rated_torque: 18 Nm, torque_range: 18 Nm";
  const auto read = [&](const std::string& drive, const std::string& worth = "") {
    const std::string key = worth.empty() ? "" : ", position_after_power_up: " + worth;
    return parse(with(kTmotor, "{ " + drive + key + " }"), "r");
  };
  using enum PositionAfterPowerUp;
  for (const std::string& drive : {damiao, rs03}) {
    const auto left_out = read(drive), written = read(drive, "within_a_turn");
    ASSERT_TRUE(left_out && written) << (left_out ? written.error() : left_out.error());
    EXPECT_EQ(left_out->joints[0].drive.position_after_power_up, within_a_turn) << drive;
    EXPECT_EQ(left_out->hash, written->hash) << drive;
    EXPECT_TRUE(read(drive, "absolute")) << drive;
  }
  struct Row {
    std::string drive, worth, said;
  };
  const Row refused[] = {
      {servo, "", "key `position_after_power_up` is missing"},
      {servo, "within_a_turn", "cia402 drives count from where they were switched on, or know their place"},
      {damiao, "one_of_several, places_per_turn: 9", "write within_a_turn"},
      {cybergear, "", "a CyberGear forgets its zero with its supply, and cannot save it; write unknown"},
      {cybergear, "absolute", "write unknown"},
  };
  for (const Row& row : refused) {
    const auto robot = read(row.drive, row.worth);
    ASSERT_FALSE(robot) << row.drive << row.worth;
    EXPECT_NE(robot.error().find(row.said), std::string::npos) << robot.error();
  }
  EXPECT_EQ(read(servo, "unknown").error().find("position_after_power_up"), std::string::npos)
      << "its id is another matter";
}

// Goal: what is printed on the drive may be written. Method: the maker's name, and the robot is the one with ours.
TEST(Load, TheMakersNameOfADriveIsTheModel) {
  constexpr std::string_view kTmotor =
      "{ protocol: mit, variant: tmotor, model: AK10-9, id: 1, reply_id: 0, position_after_power_up: absolute }";
  const auto written = [&](const std::string& model) {
    return parse(with(kTmotor, "{ protocol: mit, variant: damiao, model: " + model +
                                   ", id: 1, reply_id: 0x11, torque_range: 20 Nm }"),
                 "r");
  };
  const auto makers = written("DM-J4310-2EC"), ours = written("DM4310");
  ASSERT_TRUE(makers.has_value()) << makers.error();
  ASSERT_TRUE(ours.has_value()) << ours.error();
  EXPECT_EQ(makers->joints[0].drive.velocity_range, 30);
  EXPECT_EQ(makers->resolved, ours->resolved);
}

// Goal: `parent: base` means one thing. Method: a joint of that name, wherever the file names it.
TEST(Load, NoJointIsCalledAsTheRobotsBase) {
  std::string text(kSmallRobot);
  for (std::size_t at = text.find("knee"); at != std::string::npos; at = text.find("knee", at))
    text.replace(at, 4, "base");
  const auto robot = parse(text, "r");
  ASSERT_FALSE(robot.has_value());
  EXPECT_NE(robot.error().find("model.links[1].joint: `base` is what a link's parent calls the robot's base"),
            std::string::npos)
      << robot.error();
}

// Goal: each number has a source, in the table and in the document. Method: docs/drives.md has a row for each.
TEST(Load, EveryPresetNamesItsSource) {
  const std::string page = read_file("docs/drives.md").value_or("");
  for (const DriveProtocol protocol : {DriveProtocol::mit, DriveProtocol::robstride}) {
    for (const DrivePreset& preset : presets_of(protocol)) {
      EXPECT_FALSE(preset.source.empty()) << preset.model;
      const bool complete = preset.position > 0 && preset.velocity > 0 && preset.torque > 0 && preset.kp > 0;
      EXPECT_NE(complete, !preset.unsettled.empty()) << preset.model;
      const auto number = [](double value) { return value == kUnsettled ? "write it" : fmt::format("{}", value); };
      const std::string row =
          fmt::format("| {} | {} | {} |", preset.model, number(preset.velocity), number(preset.torque));
      EXPECT_NE(page.find(row), std::string::npos) << row;
    }
  }
}

TEST(Load, APolicyLiesBesideItsRobotFileAndRunsInTheWorkingDirectory) {
  const auto robot = parse(kSmallRobot, "/somewhere/robots/r.yaml");
  ASSERT_TRUE(robot.has_value());
  EXPECT_EQ(robot->policy->file, "/somewhere/robots/small.onnx");
  EXPECT_EQ(robot->record.directory, std::filesystem::current_path() / "runs");
}

TEST(Load, ABinaryFileIsRefusedInOneLine) {
  const auto robot = parse(std::string_view("\x08\x07\0\x12", 4), "policy.onnx");
  ASSERT_FALSE(robot.has_value());
  EXPECT_EQ(robot.error(), "policy.onnx: is a binary file; name one of YAML text");
}

// What stands in a file is printed: a value with an escape sequence may not get as far as a terminal, nor may the
// complaint about it.
// Threat: robot-file-terminal
TEST(Load, NothingInAFileMovesTheCursor) {
  for (const char* value : {"\"small\\e[2J\"", "\"small\\x9b2J\"",
                            "small\xC2\x9b"
                            "2J"}) {
    std::string text(kSmallRobot);
    text.replace(text.find("robot: small") + 7, 5, value);
    const auto robot = parse(text, "r");
    ASSERT_FALSE(robot.has_value()) << value;
    EXPECT_NE(robot.error().find("control character"), std::string::npos) << robot.error();
    EXPECT_EQ(robot.error().find('\x1b'), std::string::npos);
    EXPECT_EQ(robot.error().find("\xC2\x9b"), std::string::npos);
  }
}

TEST(Load, DemoRobotIsValid) {
  const auto robot = load("config/arm6.yaml");
  ASSERT_TRUE(robot.has_value()) << robot.error();
  EXPECT_EQ(robot->joints.size(), 6U);
  EXPECT_EQ(robot->policy->steps, 16U);
}

TEST(Load, FileThatCannotBeReadSaysWhy) {
  EXPECT_EQ(load("no/such/robot.yaml").error(),
            "no/such/robot.yaml: cannot be read: No such file or directory; check the path");
  EXPECT_EQ(load("config").error(), "config: is not a regular file; name a file");
  const auto huge = std::filesystem::path(testing::TempDir()) / "huge.yaml";
  std::ofstream(huge) << std::string((1U << 20U) + 1, '#');
  EXPECT_NE(load(huge.string()).error().find("at most 1048576 are read"), std::string::npos);
  std::filesystem::remove(huge);
  EXPECT_EQ(parse("", "r").error(), "r: holds no robot; begin with `schema: takt.robot/1`");
  EXPECT_EQ(parse("- 1\n", "r").error(), "r:1:1: holds no robot; begin with `schema: takt.robot/1`");
}

// Threat: robot-file
TEST(Load, DeepNestingIsRefusedNotRecursedInto) {
  const auto robot = parse(std::string(100'000, '['), "r");
  ASSERT_FALSE(robot.has_value());
}

// The hash says "same robot": the canonical text must read back to itself, wherever the file lies.
TEST(Resolved, ReadsBackToTheSameHash) {
  for (const std::string_view text : {kSmallRobot}) {
    const auto robot = parse(text, "/a/r.yaml");
    ASSERT_TRUE(robot.has_value());
    const auto again = parse(robot->resolved, "/elsewhere/run/config.yaml");
    ASSERT_TRUE(again.has_value()) << again.error();
    EXPECT_EQ(again->resolved, robot->resolved);
    EXPECT_EQ(again->hash, robot->hash);
    EXPECT_EQ(again->sha256, robot->sha256);
  }
}

// Whether a key that has a default is written out or left out: the same robot. Method: every robot file of ours with
// every default written out.
TEST(Resolved, ADefaultWrittenOutChangesNoHash) {
  std::size_t robots = 0;
  for (const auto& entry : std::filesystem::directory_iterator("config")) {
    if (entry.path().extension() != ".yaml" || entry.path().stem() == "devices") continue;
    const auto robot = load(entry.path().string());
    ASSERT_TRUE(robot.has_value()) << robot.error();
    const std::string full = with_every_default(*robot);
    EXPECT_GT(full.size(), robot->resolved.size());
    const auto again = parse(full, entry.path().string());
    ASSERT_TRUE(again.has_value()) << again.error();
    EXPECT_EQ(again->resolved, robot->resolved);
    EXPECT_EQ(again->sha256, robot->sha256);
    ++robots;
  }
  EXPECT_GE(robots, 8U);
}

// Goal: a robot keeps its hash when Takt gets a key. Method: a description, and the same with three more keys.
TEST(Resolved, ANewKeyWithADefaultChangesNoText) {
  const auto text_of = [](bool has_new_keys, double value, bool flag) {
    Writer writer(Defaults::left_out);
    writer.section({"limits", ""}, [&](Fields& f) {
      double torque = 5;
      f.quantity({"torque", ""}, torque, Dimension::torque, any_value());
      if (!has_new_keys) return;
      f.quantity({"margin", "", "10 deg"}, value, Dimension::angle, any_value());
      f.flag({"hard", "", "false"}, flag);
      f.section({"more", "", "{}"}, [&](Fields& more) { more.flag({"hard", "", "false"}, flag); });
    });
    return writer.result();
  };
  const double ten_degrees = 10 * std::numbers::pi / 180;
  EXPECT_EQ(text_of(false, 0, false), "limits:\n  torque: 5 Nm\n");
  EXPECT_EQ(text_of(true, ten_degrees, false), text_of(false, 0, false));
  EXPECT_NE(text_of(true, 1, false), text_of(false, 0, false));
  EXPECT_EQ(text_of(true, ten_degrees, true), "limits:\n  torque: 5 Nm\n  hard: true\n  more:\n    hard: true\n");
}

// What an earlier version recorded is read for looking back, without the keys that are gone; what is to move a robot is
// not.
TEST(Migrations, OfARecordAreMadeAndOfARobotAreSaid) {
  std::string text = with("spin: 100 us }", "spin: 100 us, overrun_limit: 50 }");
  text += "stops: { command_lost: { how: posture, fallback: tuck, for: 2 s } }\n";
  const auto refused = parse(text, "r");
  ASSERT_FALSE(refused);
  for (const char* const key : {"control.overrun_limit: gone since", "stops.command_lost.how: `posture` is gone since",
                                "stops.command_lost.fallback: gone since"})
    EXPECT_NE(refused.error().find(key), std::string::npos) << key << "\n" << refused.error();
  const auto recorded = parse_recorded(text, "r");
  ASSERT_TRUE(recorded) << recorded.error();
  ASSERT_EQ(recorded->stops.size(), 1U);
  EXPECT_EQ(recorded->stops[0].how, StopHow::hold);
  EXPECT_FALSE(parse_recorded(with("robot: small", "robot: small\nno_such_key: 1"), "r"));
}

// Goal: what a robot file said in an earlier version is taken, or each complaint names what to write instead. Method:
// config/arm6.yaml as six past commits had it.
TEST(Migrations, RobotFilesOfPastCommitsAreTakenOrTold) {
  int files = 0;
  for (const auto& file : std::filesystem::directory_iterator("tests/config/past")) {
    ++files;
    const auto robot = load(file.path().string());
    if (robot) continue;
    std::istringstream lines(robot.error());
    for (std::string line; std::getline(lines, line);)
      EXPECT_TRUE(line.contains("gone since version") || line.contains("; write ") || line.contains("; add it"))
          << line;
    EXPECT_FALSE(robot.error().contains("known here")) << robot.error();
  }
  EXPECT_EQ(files, 6);
}

// Goal: no change of this house changes a robot's hash unseen. Where a default changes, or what a text looks like,
// raise kDefaultsRevision, say so in CHANGELOG.md under Breaking, and put the new hash here. The robot stays as it is.
TEST(Resolved, TheHashOfARobotStays) {
  constexpr std::string_view kRobot = R"(schema: takt.robot/1
robot: fixed
freshness: { max_age: 120 ms, epsilon: 0.01, window: 1 s, recover_after: 250 ms, stop_after: 600 ms }
feedback: { timeout: 20 ms }
degraded: { behaviour: hold }
buses: [{ name: left, interface: can0, fd: true }]
joints:
  - name: hip
    bus: left
    drive: { protocol: moteus, id: 1, torque_range: 2 Nm, servo_kp: 4 Nm/rad, servo_kd: 0.1 Nms/rad }
    limits: { position: [-1 rad, 1 rad], position_margin: 0.1 rad, velocity: 2 rad/s, velocity_hard: 4 rad/s, acceleration: 10 rad/s2, torque: 2 Nm, torque_rate: 90 Nm/s, kp: 20 Nm/rad, kd: 1 Nms/rad }
    gains: { kp: 10 Nm/rad, kd: 0.5 Nms/rad, damping: 0.5 Nms/rad }
    inertia: 0.1 kgm2
)";
  EXPECT_EQ(parse(kRobot, "r").value().sha256, "58bc2f2b4792256e202e9ea84bfb3e78927737dabb8553cc1466bfdf5eb13fb6");
}

// Goal: a text that leaves a default out means the same in every later version. Method: the defaults of revision 1, of
// which each still stands in the table of keys, or its key is gone and config/migrations says so.
TEST(Resolved, TheDefaultsOfARevisionStay) {
  std::ifstream file(fmt::format("tests/config/defaults_{}.txt", kDefaultsRevision));
  const std::string table = key_table();
  std::size_t lines = 0;
  for (std::string line; std::getline(file, line); ++lines) {
    const std::size_t tab = line.find('\t');
    const std::string key = line.substr(0, tab);
    const std::string begin = "\n| `" + key + "` |", otherwise = "; `" + line.substr(tab + 1) + "` |";
    bool is_there = migration_of(key) != nullptr;
    for (std::size_t row = table.find(begin); row != std::string::npos; row = table.find(begin, row + 1))
      is_there |= table.substr(row + 1, table.find('\n', row + 1) - row).contains(otherwise);
    EXPECT_TRUE(is_there) << key << " has not the default " << line.substr(tab + 1) << " any more";
  }
  EXPECT_GE(lines, 150U);
}

RC_GTEST_PROP(Resolved, ReadsBackToTheSameHashWhateverTheNumbers, ()) {
  const auto number = [](double low, double high) {
    const auto part = *rc::gen::inRange<std::int64_t>(0, 1'000'000'000'000);
    return low + (high - low) * static_cast<double>(part) / 1e12;
  };
  const auto print = [](double value) {
    char text[64];
    std::snprintf(text, sizeof text, "%.17g", value);
    return std::string(text);
  };
  std::string text =
      with("[-90 deg, 90 deg]", "[" + print(number(-300, -20)) + " deg, " + print(number(20, 300)) + " deg]");
  const auto put = [&](std::string_view from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
  };
  put("inertia: 0.05 kgm2", "inertia: " + print(number(1e-6, 10)) + " kgm2");
  put("epsilon: 0.01", "epsilon: " + print(number(1e-9, 0.999)));
  put("max_age: 120 ms", "max_age: " + print(number(100, 500)) + " ms");
  put("scale: [0.25, 0.5]", "scale: [" + print(number(-1e6, 1e6)) + ", " + print(number(-1e-6, 1e-6)) + "]");
  const auto robot = parse(text, "r");
  RC_ASSERT(robot.has_value());
  const auto again = parse(robot->resolved, "r");
  RC_ASSERT(again.has_value());
  RC_ASSERT(again->hash == robot->hash);
  RC_ASSERT(again->joints[1].limits.q_min == robot->joints[1].limits.q_min);
  RC_ASSERT(again->freshness.max_age == robot->freshness.max_age);
}

TEST(Resolved, AnyChangedValueChangesTheHash) {
  const auto robot = parse(kSmallRobot, "r");
  const auto other = parse(with("torque: 12 Nm", "torque: 12.0001 Nm"), "r");
  ASSERT_TRUE(robot && other);
  EXPECT_NE(robot->hash, other->hash);
  const auto spelled_differently = parse(with("120 ms", "0.12 s"), "r");
  ASSERT_TRUE(spelled_differently.has_value());
  EXPECT_EQ(robot->hash, spelled_differently->hash);
}

// FIPS 180-2's example, and FNV-1a by its definition.
TEST(Hash, KnownAnswers) {
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  const auto robot = parse(kSmallRobot, "r");
  ASSERT_TRUE(robot.has_value());
  std::uint64_t expected = 0xCBF29CE484222325ULL;
  for (const char c : std::string_view("hip\0knee\0", 9))
    expected = (expected ^ static_cast<unsigned char>(c)) * 0x100000001B3ULL;
  EXPECT_EQ(joint_names_hash(*robot), expected);
}

TEST(Hash, PolicyFileIsHashedWholeAndItsAbsenceIsASentence) {
  const auto file = std::filesystem::path(testing::TempDir()) / "policy.bin";
  std::ofstream(file) << "abc";
  const auto hash = policy_hash(file.string());
  ASSERT_TRUE(hash.has_value());
  EXPECT_EQ(*hash, 0xba7816bf8f01cfeaULL);
  std::filesystem::remove(file);
  EXPECT_NE(policy_hash(file.string()).error().find("No such file"), std::string::npos);
}

// Goal: nothing is read for hours to be refused then. Method: a file of 1 TiB that takes no room on the disk.
// Threat: policy-file-size
TEST(Hash, APolicyThatNoRobotPcCanLoadIsNotReadToItsEnd) {
  const auto file = std::filesystem::path(testing::TempDir()) / "sparse.onnx";
  std::ofstream{file};
  std::error_code refused;
  std::filesystem::resize_file(file, std::uintmax_t{1} << 40U, refused);
  if (refused) GTEST_SKIP() << "no sparse file of 1 TiB here: " << refused.message() << ": NOT TESTED";
  EXPECT_NE(policy_hash(file.string()).error().find("larger than 16 GiB"), std::string::npos);
  std::filesystem::remove(file);
}

TEST(Hash, WeightsBesideThePolicyAreItsPart) {
  const auto file = std::filesystem::path(testing::TempDir()) / "beside.onnx";
  const std::string data = file.string() + ".data";
  std::ofstream(file) << "a";
  EXPECT_EQ(policy_files(file.string()), std::vector<std::string>{file.string()});
  std::ofstream(data) << "bc";
  EXPECT_EQ(policy_files(file.string()), (std::vector<std::string>{file.string(), data}));
  // `cd FOLDER && sha256sum beside.onnx beside.onnx.data | sha256sum`
  const std::string sha256 = policy_sha256(file.string()).value();
  EXPECT_EQ(sha256, sha256_hex(sha256_hex("a") + "  beside.onnx\n" + sha256_hex("bc") + "  beside.onnx.data\n"));
  EXPECT_EQ(policy_hash(file.string()).value(), leading_64_bits(sha256));
  std::ofstream(file) << "ab";
  std::ofstream(data) << "c";
  EXPECT_NE(policy_sha256(file.string()).value(), sha256) << "weights begin elsewhere";
  std::filesystem::remove(data);
  EXPECT_EQ(policy_sha256(file.string()).value(), sha256_hex("ab")) << "one file's is the file's";
  std::filesystem::create_directory(data);
  EXPECT_NE(policy_hash(file.string()).error().find(data), std::string::npos);
  std::filesystem::remove(data);
  std::filesystem::remove(file);
}

// No process writes into the FIFO, and a device never ends: neither is read.
TEST(Hash, WhatIsNoRegularFileIsNotRead) {
  const std::string file = std::string(testing::TempDir()) + "fifo.onnx";
  std::filesystem::remove(file);
  ASSERT_EQ(mkfifo(file.c_str(), 0600), 0);
  alarm(30);
  for (const std::string& path : {file, std::string("/dev/zero"), std::string(testing::TempDir())}) {
    const auto hash = policy_hash(path);
    ASSERT_FALSE(hash.has_value()) << path;
    EXPECT_EQ(hash.error(), "policy file " + path + ": is not a regular file; check `policy.file`");
  }
  alarm(0);
  std::filesystem::remove(file);
}

// The reference in the documentation is this table, word for word.
TEST(KeyTable, DocumentationListsEveryKey) {
  const std::string page = takt::test::text_of("docs/configuration.md");
  EXPECT_NE(page.find(key_table()), std::string::npos)
      << "docs/configuration.md is out of date; put in the output of `takt config keys`";
}

}  // namespace
}  // namespace takt::config
