// SPDX-License-Identifier: Apache-2.0
// takt joint jog: one joint, a little, softly.
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/quantity_option.hpp"
#include "cli/robot/direct_bus.hpp"
#include "commissioning/holding_torques.hpp"
#include "commissioning/joint_jog.hpp"
#include "config/joint_units.hpp"
#include "config/load.hpp"
#include "drivers/protocol/home_note.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "drivers/protocol/seen_angle.hpp"
#include "drivers/protocol/shown_unit.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/contract/pace.hpp"

namespace takt::cli {
namespace {

struct JointOptions {
  std::string joint, robot_file, runtime_dir;
  JointOption by, torque, speed, saw;
  bool json = false, without_gravity = false;
};

volatile std::sig_atomic_t g_jog_interrupted = 0;

constexpr Duration kFresh = milliseconds(100);  // a position that gravity may be computed from

// The drives that are talked to: all of them where gravity is to be carried, since it depends on where every joint is;
// only the jogged one otherwise. All but that one stay disabled.
class Drives {
 public:
  struct Drive {
    std::unique_ptr<drivers::JointDriver> driver;  // null: left in peace
    std::size_t bus = 0;
  };

  // `robot`: by `notes`.
  static std::expected<Drives, Refusal> open(const DirectRobot& robot, std::size_t jogged, bool all,
                                             std::span<const std::optional<drivers::HomeNote>> notes) {
    Drives opened;
    opened.buses_.resize(robot.config.buses.size());
    for (std::size_t joint = 0; joint < robot.config.joints.size(); ++joint) {
      Drive& drive = opened.drives_.emplace_back();
      drive.bus = robot.config.joints[joint].bus;
      if (!all && joint != jogged) continue;
      auto driver =
          all ? drivers::make_joint_driver(robot.config, joint) : drivers::make_lone_driver(robot.config, joint);
      if (!driver) return std::unexpected(Refusal{config::kExitBadConfiguration, driver.error()});
      drive.driver = std::move(*driver);
      if (notes[joint])
        drive.driver->assume_home(static_cast<float>(notes[joint]->left_at),
                                  drivers::may_have_moved(robot.config.joints[joint]));
      if (opened.buses_[drive.bus] != nullptr) continue;
      auto bus = open_bus(robot, drive.bus);
      if (!bus) return std::unexpected(bus.error());
      opened.buses_[drive.bus] = std::move(*bus);
    }
    return opened;
  }

  [[nodiscard]] drivers::JointDriver& driver(std::size_t joint) { return *drives_[joint].driver; }

  // `jog`: told of every frame on the jogged joint's bus.
  void listen(commissioning::JointJog& jog, std::size_t jogged) {
    for (std::size_t bus = 0; bus < buses_.size(); ++bus) {
      const std::size_t count = buses_[bus] == nullptr ? 0 : buses_[bus]->receive(received_);
      for (std::size_t i = 0; i < count; ++i) {
        if (drives_[jogged].bus == bus) jog.take(received_[i].frame);
        for (const Drive& drive : drives_)
          if (drive.driver && drive.bus == bus && drive.driver->decode(received_[i])) break;
      }
    }
  }
  void speak(commissioning::JointJog& jog, std::size_t jogged, MonoTime now) {
    for (std::size_t joint = 0; joint < drives_.size(); ++joint) {
      if (!drives_[joint].driver) continue;
      const std::size_t frames =
          joint == jogged ? jog.tick(now, out_) : drives_[joint].driver->encode(false, {}, now, {}, out_);
      for (std::size_t i = 0; i < frames; ++i) buses_[drives_[joint].bus]->send(out_[i]);
    }
  }
  // Nothing: some joint has not told, or not lately.
  [[nodiscard]] std::optional<std::vector<double>> positions(MonoTime now) const {
    std::vector<double> q;
    for (const Drive& drive : drives_) {
      const JointFeedback& feedback = drive.driver->feedback();
      if (!feedback.received_at.is_set() || now - feedback.received_at > kFresh) return std::nullopt;
      q.push_back(double{feedback.q});
    }
    return q;
  }

 private:
  std::vector<Drive> drives_;
  std::vector<std::unique_ptr<drivers::CanBus>> buses_;  // null: no drive on it is asked
  std::array<drivers::ReceivedFrame, 64> received_;
  std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out_;
};

// What a person said of the joint holds on where it was moved to, for its drive was heard all the way. A note that
// cannot be written is asked for again.
void keep_home(const DirectRobot& robot, std::size_t joint, drivers::HomeNote note, const JointFeedback& feedback) {
  if (drivers::kind_of(feedback.error_code) == drivers::SetupFault::home_unknown) return;
  note.left_at = double{feedback.q};
  (void)drivers::write_home_note(robot.runtime_directory, robot.config, joint, note);
}

commissioning::GravityTerm gravity_at(std::size_t joint, const config::RobotConfig& robot, const Drives& drives) {
  const auto torques = std::make_shared<const commissioning::HoldingTorques>(robot);
  return [joint, torques, &drives]() -> std::optional<double> {
    const auto q = drives.positions(monotonic_now());
    if (!q) return std::nullopt;
    return torques->at(*q)[joint];
  };
}

// Interrupting it releases the drive first.
void run(commissioning::JointJog& jog, std::size_t jogged, Drives& drives, Duration period) {
  std::signal(SIGINT, [](int) { g_jog_interrupted = 1; });
  std::signal(SIGTERM, [](int) { g_jog_interrupted = 1; });
  for (Pace pace(monotonic_now(), period); !jog.ended(); pace.advance(monotonic_now())) {
    sleep_until(pace.due());
    if (g_jog_interrupted != 0) jog.stop();
    drives.listen(jog, jogged);
    drives.speak(jog, jogged, monotonic_now());
  }
}

// What is known of the joint's scale after it moved.
struct Judgement {
  int exit_code = kExitOk;
  std::string failure;             // why it is none of 0 and 4
  std::vector<std::string> notes;  // in sentences
};

std::string today() {
  const std::time_t now = std::time(nullptr);
  std::tm day{};
  std::array<char, 16> text{};
  ::localtime_r(&now, &day);
  (void)std::strftime(text.data(), text.size(), "%Y-%m-%d", &day);
  return text.data();
}

// What was asked for, in base units.
struct JogAsked {
  commissioning::JogWish wish;
  std::optional<double> saw{};
};

std::expected<JogAsked, std::string> jog_asked(const JointOptions& options, const config::Joint& joint) {
  const auto by = options.by.of(joint), speed = options.speed.of(joint), torque = options.torque.of(joint),
             saw = options.saw.of(joint);
  for (const auto* const each : {&by, &speed, &torque, &saw})
    if (!*each) return std::unexpected(each->error());
  const double most = joint.limits.torque;
  const commissioning::JogWish wish{.by = by->value(), .speed = speed->value(), .torque = torque->value_or(0.1 * most)};
  if (wish.torque > most)
    return std::unexpected(fmt::format("--torque {0} {2} exceeds limits.torque {1} {2} of {3}", wish.torque, most,
                                       config::kJointTorque.unit(joint.kind), joint.name));
  return JogAsked{wish, *saw};
}

bool slides(const config::Joint& joint) {
  return joint.kind == config::JointKind::slide;
}

// JogAsked for at a terminal only: elsewhere --saw says it.
std::optional<double> seen_by_person(const config::Joint& joint, const commissioning::JointJog& jog,
                                     const JogAsked& asked, const JointOptions& options) {
  if (asked.saw) return asked.saw;
  if (options.json || ::isatty(STDIN_FILENO) == 0) return std::nullopt;
  const double size = drivers::shown_unit(joint.kind).size;
  fmt::print("joint {}: {}? Its drive told {:+.1f}; Enter alone: not judged\n", options.joint,
             slides(joint) ? "how far did you see it move, in mm" : "which angle did you see, in degrees",
             jog.moved() / size);
  std::fflush(stdout);
  std::string line;
  double seen = 0;
  if (!std::getline(std::cin, line) || !(std::istringstream(line) >> seen) || !std::isfinite(seen)) return std::nullopt;
  return seen * size;
}

// An eye on the joint outweighs what a drive writes of itself.
void judge_by_eye(const DirectRobot& robot, std::size_t joint, const commissioning::JointJog& jog, double seen,
                  Judgement& judged) {
  const drivers::SeenAngle angle{jog.moved(), seen, today()};
  judged.failure = drivers::contradicted_by_eye(robot.config.joints[joint], angle);
  judged.exit_code = judged.failure.empty() ? kExitOk : kExitWrongScale;
  const auto kept = drivers::keep_seen_angle(robot.runtime_directory, robot.config, joint,
                                             judged.failure.empty() ? std::optional(angle) : std::nullopt);
  judged.notes.push_back(!kept                    ? kept.error()
                         : judged.failure.empty() ? "its scale is the robot file's: " +
                                                        drivers::text_of(robot.config.joints[joint].kind, angle)
                                                  : "nothing is kept of its scale");
}

void judge_by_drive(const DirectRobot& robot, std::size_t joint, const commissioning::JointJog& jog,
                    Judgement& judged) {
  const auto own = jog.own_scale();
  if (own && own->verdict == commissioning::OwnScale::Verdict::wrong) {
    judged.exit_code = kExitWrongScale;
    judged.failure = own->sentence;
    return;
  }
  const std::string believed = jog.believed();
  if (believed.empty()) return;
  if (const auto before = drivers::seen_angle(robot.runtime_directory, robot.config, joint)) {
    judged.notes.push_back("its scale is the robot file's: " +
                           drivers::text_of(robot.config.joints[joint].kind, *before));
    return;
  }
  judged.exit_code = kExitNotSeen;
  judged.notes.push_back(fmt::format(
      "{} {} not judged: no drive tells it. {}", believed, believed.find(" and ") == std::string::npos ? "is" : "are",
      slides(robot.config.joints[joint]) ? "How far did you see it move? Jog again with --saw LENGTH"
                                         : "Which angle did you see? Jog again with --saw ANGLE"));
}

Judgement judge(const DirectRobot& robot, std::size_t joint, const commissioning::JointJog& jog, const JogAsked& asked,
                const JointOptions& options) {
  Judgement judged;
  // A move that was cut short says nothing about scales.
  if (!jog.failure().empty()) return {kExitFailed, jog.failure(), {}};
  const commissioning::VelocityScale velocity = jog.velocity_scale();
  if (velocity.verdict == commissioning::VelocityScale::Verdict::wrong) {
    const auto own = jog.own_scale();
    const bool knows = own && own->verdict == commissioning::OwnScale::Verdict::wrong;
    return {kExitWrongScale, knows ? own->sentence + "; " + velocity.sentence : velocity.sentence, {}};
  }
  judged.notes.push_back(velocity.verdict == commissioning::VelocityScale::Verdict::right
                             ? fmt::format("its velocity belongs to its position: {:.3f}, known within {:.0f} %",
                                           velocity.scale, 100 * velocity.uncertainty)
                             : velocity.sentence);
  if (const auto own = jog.own_scale()) judged.notes.push_back(own->sentence);
  if (const auto seen = seen_by_person(robot.config.joints[joint], jog, asked, options))
    judge_by_eye(robot, joint, jog, *seen, judged);
  else
    judge_by_drive(robot, joint, jog, judged);
  return judged;
}

int report(const config::Joint& joint, const commissioning::JointJog& jog, const Judgement& judged,
           const JointOptions& options) {
  if (options.json) {
    const std::string unit(config::kJointPosition.unit(joint.kind));
    const double scale = jog.velocity_scale().scale;
    const nlohmann::ordered_json line{
        {"joint", options.joint},
        {"from_" + unit, jog.started_at()},
        {"moved_" + unit, jog.moved()},
        {"asked_" + unit, jog.target() - jog.started_at()},
        {"velocity_scale", scale == 0 ? nlohmann::ordered_json() : nlohmann::ordered_json(scale)},
        {"failure", judged.failure},
        {"notes", judged.notes}};
    fmt::print("{}\n", json_line(line));
    return judged.exit_code;
  }
  const drivers::ShownUnit shown = drivers::shown_unit(joint.kind);
  if (jog.failure().empty())
    fmt::print(
        "joint {0}: asked for {1:+.2f} {5}, moved {2:+.2f} {5}, from {3:.2f} to {4:.2f} {5}; drive disabled again\n",
        options.joint, (jog.target() - jog.started_at()) / shown.size, jog.moved() / shown.size,
        jog.started_at() / shown.size, (jog.started_at() + jog.moved()) / shown.size, shown.symbol);
  for (const std::string& note : judged.notes) fmt::print("joint {}: {}\n", options.joint, note);
  if (!judged.failure.empty()) fmt::print(stderr, "joint {}: {}\n", options.joint, judged.failure);
  return judged.exit_code;
}

std::expected<int, Refusal> jog(const JointOptions& options) {
  auto robot = load_robot(options.robot_file, options.runtime_dir);
  if (!robot) return std::unexpected(robot.error());
  const auto index = find_joint(*robot, options.joint);
  if (!index) return std::unexpected(index.error());
  const auto alone = require_alone(*robot);
  if (!alone) return std::unexpected(alone.error());
  const auto notes = drivers::home_notes(robot->runtime_directory, robot->config);
  robot->config = drivers::homed_robot(robot->config, notes);
  const config::Joint& joint = robot->config.joints[*index];
  if (joint.passive)
    return std::unexpected(
        Refusal{kExitUsage, fmt::format("{} is passive: nothing can move it; name a driven joint", joint.name)});
  const auto wished = jog_asked(options, joint);
  if (!wished) return std::unexpected(Refusal{kExitUsage, wished.error()});
  const bool carries = robot->config.model.has_value() && !options.without_gravity;
  auto drives = Drives::open(*robot, *index, carries, notes);
  if (!drives) return std::unexpected(drives.error());
  commissioning::JointJog moving(joint, wished->wish, drives->driver(*index),
                                 carries ? gravity_at(*index, robot->config, *drives) : commissioning::GravityTerm());
  const auto permission = permit_torque(robot->config);
  if (!permission) return std::unexpected(permission.error());
  run(moving, *index, *drives, robot->config.control.period);
  if (const auto& note = notes[*index]) keep_home(*robot, *index, *note, drives->driver(*index).feedback());
  return report(joint, moving, judge(*robot, *index, moving, *wished, options), options);
}

}  // namespace

void add_joint(CLI::App& app, int& exit_code) {
  CLI::App* joint = app.add_subcommand("joint", "Try one joint without a policy.");
  joint->require_subcommand(1);
  CLI::App* command = joint->add_subcommand("jog", "Move one joint a little, softly; its drive alone is enabled.");
  auto options = std::make_shared<JointOptions>();
  command->add_option("joint", options->joint, "name in the robot file")->required();
  command->add_option("--robot", options->robot_file, "robot file")->required();
  command->add_option("--runtime-dir", options->runtime_dir,
                      "where loopback buses are (default ROBOT in $XDG_RUNTIME_DIR/takt, as root /run/takt)");
  options->by.add(*command, "--by", {"deg", "mm"}, "how far, joint side, signed", 5);
  options->speed.add(*command, "--speed", {"deg/s", "mm/s"}, "at most this fast", 10)->check(CLI::Range(0.1, 90.0));
  options->torque
      .add(*command, "--torque", {"Nm", "N"}, "never exceeded, gravity aside (default a tenth of limits.torque)")
      ->check(CLI::PositiveNumber);
  options->saw.add(*command, "--saw", {"deg", "mm"}, "by how much you see it move, signed: judges the gear");
  command->add_flag("--without-gravity", options->without_gravity,
                    "carry nothing and leave the other drives in peace: for a drive on the bench");
  command->add_flag("--json", options->json, "one line of JSON");
  command->footer(
      "Example: takt joint jog elbow --robot robot.yaml --by -5deg\n"
      "Example: takt joint jog finger --robot robot.yaml --by 5mm\n"
      "With a model in the robot file gravity is carried while it moves; support it all the same: at the end the drive "
      "is\n"
      "disabled. Ctrl-C disables it too, and so does straying 2 degrees (2 mm) from the way.\n"
      "What you saw is kept on the drive's card: the only proof of gear_ratio. At a terminal it is asked for.\n"
      "Exit codes: 0 moved as asked, 1 refused, not moved as asked, or the drive failed, 3 moved as asked, and a scale "
      "is\nwrong, 4 moved as asked, and --saw is missing where the drive cannot tell, 64 command line, 65 "
      "configuration, 69 "
      "the bus\nis not there.");
  command->callback([options, &exit_code] {
    const auto done = jog(*options);
    if (!done) fmt::print(stderr, "takt joint jog: {}\n", done.error().sentence);
    exit_code = done ? *done : done.error().exit_code;
  });
  add_joint_home(*joint, exit_code);
}

}  // namespace takt::cli
