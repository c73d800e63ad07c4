// SPDX-License-Identifier: Apache-2.0
// takt joint home: where a joint is since power-on, by the word of the person who holds it there or sees it at its
// stop.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <memory>
#include <optional>

#include "cli/command.hpp"
#include "cli/quantity_option.hpp"
#include "cli/robot/direct_bus.hpp"
#include "cli/robot/drive_listener.hpp"
#include "commissioning/home_place.hpp"
#include "commissioning/stop_search.hpp"
#include "config/joint_units.hpp"
#include "config/load.hpp"
#include "drivers/protocol/home_note.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "drivers/protocol/shown_unit.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/contract/pace.hpp"

namespace takt::cli {
namespace {

struct HomeOptions {
  std::string joint, robot_file, runtime_dir;
  std::string to_stop;  // forward, backward; empty: by hand
  JointOption at, torque, speed, within;
};

constexpr double kHeld = 2;      // degrees, of a slide mm: as still as a hand holds a joint
constexpr double kTaken = 0.02;  // rad, of a slide of its motor: what is read back against what was said

// "12.34 deg", "12.34 mm"
std::string exactly(const config::Joint& joint, double q) {
  const drivers::ShownUnit unit = drivers::shown_unit(joint.kind);
  return fmt::format("{:.2f} {}", q / unit.size, unit.symbol);
}

Refusal refusal(const config::Joint& joint, const std::string& why) {
  return {kExitFailed, fmt::format("joint {}: {}", joint.name, why)};
}

// The drive takes it, and says so.
std::expected<void, Refusal> tell_drive(const config::Joint& joint, const drivers::CanFrame& frame, double at,
                                        drivers::CanBus& bus, DriveListener& listener) {
  bus.send(frame);
  listener.settle();
  const JointFeedback& feedback = listener.feedback();
  if (std::abs(listener.q() - at) > kTaken * config::per_rad(joint))
    return std::unexpected(
        refusal(joint, fmt::format("reads {}: its drive did not take it", exactly(joint, listener.q()))));
  if (feedback.drive_state != DriveState::disabled)
    return std::unexpected(
        refusal(joint, "its drive reports " + drivers::error_name(joint.drive, feedback.error_code)));
  return {};
}

// True: the person typed the joint's name, and the joint stayed where it was.
std::expected<void, Refusal> confirm(const config::Joint& joint, DriveListener& listener) {
  const double before = listener.q();
  const auto typed = listener.wait_for_line();
  if (!typed || *typed != joint.name)
    return std::unexpected(refusal(joint, "not confirmed: nothing was changed (type the joint's name)"));
  const double moved = listener.q() - before;
  if (std::abs(moved) <= kHeld * drivers::shown_unit(joint.kind).size) return {};
  return std::unexpected(refusal(
      joint, fmt::format("moved {} meanwhile: hold it still, and say it again", drivers::shown(joint.kind, moved))));
}

// Of a drive within a turn whose limits tell the turn: where it is by itself.
std::optional<double> place_by_limits(const config::Joint& joint, const JointFeedback& feedback) {
  const bool is_it = joint.drive.position_after_power_up == config::PositionAfterPowerUp::within_a_turn &&
                     joint.drive.protocol != config::DriveProtocol::moteus;
  const bool in_doubt = drivers::kind_of(feedback.error_code) == drivers::SetupFault::home_unknown;
  return is_it && !in_doubt ? std::optional(double{feedback.q}) : std::nullopt;
}

// The joint is at `at`: asked for, told to the drive or kept.
std::expected<int, Refusal> make_known(const DirectRobot& robot, std::size_t index, double at, drivers::CanBus& bus,
                                       DriveListener& listener) {
  const config::Joint& joint = robot.config.joints[index];
  const auto frame = commissioning::home_frame(joint, at);
  double shift = 0;
  if (!frame) {
    const auto found = commissioning::shift_between(joint, listener.q(), at);
    if (!found) return std::unexpected(refusal(joint, found.error()));
    shift = *found;
  }
  fmt::print("joint {} reads {}; type its name and Enter if it is at {}:\n", joint.name, exactly(joint, listener.q()),
             exactly(joint, frame ? at : listener.q() + shift));
  std::fflush(stdout);
  if (const auto confirmed = confirm(joint, listener); !confirmed) return std::unexpected(confirmed.error());
  if (frame) {
    if (const auto told = tell_drive(joint, *frame, at, bus, listener); !told) return std::unexpected(told.error());
    fmt::print("joint {} reads {} now; its drive forgets it with its supply\n", joint.name,
               exactly(joint, listener.q()));
    return kExitOk;
  }
  const drivers::HomeNote note{.shift = shift, .left_at = listener.q() + shift};
  const auto written = drivers::write_home_note(robot.runtime_directory, robot.config, index, note);
  if (!written) return std::unexpected(refusal(joint, written.error()));
  fmt::print(
      "joint {} is at {}, {}{} from what it reads. Its drive cannot keep that, and nothing tells "
      "whether "
      "it\nwas switched off since: it holds for one start of the executive within {:.0f} min, with the joint left "
      "where "
      "it is\n",
      joint.name, exactly(joint, note.left_at), std::signbit(shift) ? "" : "+", exactly(joint, shift),
      drivers::kHomeNoteLasts.seconds() / 60);
  return kExitOk;
}

volatile std::sig_atomic_t g_home_interrupted = 0;

// What the drive reads at the stop. Interrupting it releases the drive first.
std::expected<double, Refusal> lead_to_stop(const DirectRobot& robot, std::size_t index,
                                            const commissioning::StopWish& wish, drivers::CanBus& bus,
                                            drivers::JointDriver& driver) {
  const config::Joint& joint = robot.config.joints[index];
  if (joint.passive) return std::unexpected(refusal(joint, "is passive: nothing can move it"));
  const auto permission = permit_torque(robot.config);
  if (!permission) return std::unexpected(permission.error());
  std::signal(SIGINT, [](int) { g_home_interrupted = 1; });
  std::signal(SIGTERM, [](int) { g_home_interrupted = 1; });
  commissioning::StopSearch search(joint, wish, driver);
  std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out;
  std::array<drivers::ReceivedFrame, 64> received;
  for (Pace pace(monotonic_now(), robot.config.control.period); !search.ended(); pace.advance(monotonic_now())) {
    sleep_until(pace.due());
    if (g_home_interrupted != 0) search.give_up();
    const std::size_t count = bus.receive(received);
    for (std::size_t i = 0; i < count; ++i) driver.decode(received[i]);
    const std::size_t frames = search.tick(monotonic_now(), out);
    for (std::size_t i = 0; i < frames; ++i) bus.send(out[i]);
  }
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
  if (!search.failure().empty()) return std::unexpected(refusal(joint, search.failure()));
  return search.stop_at();
}

// What was asked for, in base units.
struct HomeAsked {
  double at = 0;
  commissioning::StopWish stop;
};

std::expected<HomeAsked, std::string> home_asked(const HomeOptions& options, const config::Joint& joint) {
  const auto at = options.at.of(joint), speed = options.speed.of(joint), torque = options.torque.of(joint),
             within = options.within.of(joint);
  for (const auto* const each : {&at, &speed, &torque, &within})
    if (!*each) return std::unexpected(each->error());
  const config::Limits& limits = joint.limits;
  const HomeAsked all{.at = at->value(),
                      .stop = {.direction = options.to_stop == "forward" ? 1 : -1,
                               .speed = speed->value(),
                               .torque = torque->value_or(0.1 * limits.torque),
                               .within = within->value_or(limits.q_max - limits.q_min)}};
  if (all.stop.torque > limits.torque)
    return std::unexpected(fmt::format("--torque {0} {2} exceeds limits.torque {1} {2} of {3}", all.stop.torque,
                                       limits.torque, config::kJointTorque.unit(joint.kind), joint.name));
  if (const auto possible = commissioning::check_place(joint, all.at); !possible)
    return std::unexpected("--at: " + possible.error());
  return all;
}

std::expected<int, Refusal> home(const HomeOptions& options) {
  const auto robot = load_robot(options.robot_file, options.runtime_dir);
  if (!robot) return std::unexpected(robot.error());
  const auto index = find_joint(*robot, options.joint);
  if (!index) return std::unexpected(index.error());
  const config::Joint& joint = robot->config.joints[*index];
  if (!commissioning::forgets_home(joint.drive))
    return std::unexpected(
        refusal(joint,
                "by the robot file its drive knows where it is since power-on (position_after_power_up: absolute); "
                "another zero for it: takt bus zero"));
  const auto wished = home_asked(options, joint);
  if (!wished) return std::unexpected(Refusal{kExitUsage, wished.error()});
  const auto alone = require_alone(*robot);
  if (!alone) return std::unexpected(alone.error());
  auto driver = drivers::make_lone_driver(robot->config, *index);
  if (!driver) return std::unexpected(Refusal{config::kExitBadConfiguration, driver.error()});
  auto bus = open_bus(*robot, joint.bus);
  if (!bus) return std::unexpected(bus.error());
  DriveListener listener(**bus, **driver, robot->config.control.period);
  if (!listener.wait_until_disabled()) return std::unexpected(refusal(joint, listener.why_not_disabled(joint.drive)));
  if (const auto place = place_by_limits(joint, listener.feedback()))
    return std::unexpected(refusal(
        joint, fmt::format("is at {}: of the turns that its drive cannot tell apart, limits.position leaves that "
                           "one; if you see it elsewhere, its zero is wrong: takt bus zero",
                           exactly(joint, *place))));
  if (options.to_stop.empty()) return make_known(*robot, *index, wished->at, **bus, listener);
  const auto stop_at = lead_to_stop(*robot, *index, wished->stop, **bus, **driver);
  if (!stop_at) return std::unexpected(stop_at.error());
  listener.settle();  // let go, it may have sprung back
  return make_known(*robot, *index, wished->at + listener.q() - *stop_at, **bus, listener);
}

}  // namespace

void add_joint_home(CLI::App& joint, int& exit_code) {
  CLI::App* command = joint.add_subcommand("home", "Say where a joint is whose drive forgot it with its supply.");
  auto options = std::make_shared<HomeOptions>();
  command->add_option("joint", options->joint, "name in the robot file")->required();
  command->add_option("--robot", options->robot_file, "robot file")->required();
  command->add_option("--runtime-dir", options->runtime_dir,
                      "where loopback buses are (default ROBOT in $XDG_RUNTIME_DIR/takt, as root /run/takt)");
  options->at.add(*command, "--at", {"deg", "mm"}, "where it is held, or where the stop is, joint side")->required();
  command->add_option("--to-stop", options->to_stop, "lead it to its stop first, softly: forward or backward")
      ->check(CLI::IsMember({"forward", "backward"}));
  options->speed.add(*command, "--speed", {"deg/s", "mm/s"}, "with --to-stop: at most this fast", 5)
      ->check(CLI::Range(0.1, 30.0));
  options->torque
      .add(*command, "--torque", {"Nm", "N"}, "with --to-stop: never exceeded (default a tenth of limits.torque)")
      ->check(CLI::PositiveNumber);
  options->within
      .add(*command, "--within", {"deg", "mm"},
           "with --to-stop: how far at most (default the width of limits.position)")
      ->check(CLI::PositiveNumber);
  command->footer(
      "Example: takt joint home elbow --robot robot.yaml --at 0deg\n"
      "Example: takt joint home elbow --robot robot.yaml --at -90deg --to-stop backward\n"
      "Hold the joint at a place that you know; the drive stays disabled. With --to-stop it is enabled and led to its "
      "stop:\n"
      "gravity is not carried, and what is odd lets it go. Then you are asked to type the joint's name. A moteus\n"
      "and an ODrive keep it until their supply goes. Of others it is kept for the next start of the executive; of a "
      "drive\n"
      "that cannot tell several places apart, the one nearest to --at is meant.\n"
      "Exit codes: 0 known now, 1 refused, in doubt, not confirmed, or the drive did not take it, 64 command line, 65 "
      "configuration,\n"
      "69 the bus is not there.");
  command->callback([options, &exit_code] {
    const auto done = home(*options);
    if (!done) fmt::print(stderr, "takt joint home: {}\n", done.error().sentence);
    exit_code = done ? *done : done.error().exit_code;
  });
}

}  // namespace takt::cli
