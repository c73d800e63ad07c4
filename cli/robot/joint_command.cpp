// takt joint jog: one joint, a little, softly.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <memory>

#include "cli/command.hpp"
#include "cli/robot/direct_bus.hpp"
#include "config/load.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "drivers/tools/joint_jog.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/contract/pace.hpp"

namespace takt::cli {
namespace {

struct Options {
  std::string joint, robot_file, runtime_dir;
  double by_degrees = 5, torque = 0, speed_degrees = 10;
  bool json = false;
};

volatile std::sig_atomic_t g_interrupted = 0;

// Interrupting it releases the drive first.
void run(drivers::JointJog& jog, drivers::JointDriver& driver, drivers::CanBus& bus, Duration period) {
  std::signal(SIGINT, [](int) { g_interrupted = 1; });
  std::signal(SIGTERM, [](int) { g_interrupted = 1; });
  std::array<drivers::ReceivedFrame, 64> received;
  std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out;
  for (Pace pace(monotonic_now(), period); !jog.ended(); pace.advance(monotonic_now())) {
    sleep_until(pace.due());
    if (g_interrupted != 0) jog.stop();
    const std::size_t count = bus.receive(received);
    for (std::size_t i = 0; i < count; ++i) driver.decode(received[i]);
    const std::size_t frames = jog.tick(monotonic_now(), out);
    for (std::size_t i = 0; i < frames; ++i) bus.send(out[i]);
  }
}

constexpr double kDegree = 3.14159265358979323846 / 180;

int report(const drivers::JointJog& jog, const Options& options) {
  const bool failed = !jog.failure().empty();
  if (options.json)
    fmt::print(
        "{{\"joint\":\"{}\",\"from_rad\":{:.6f},\"moved_rad\":{:.6f},\"asked_rad\":{:.6f},\"failure\":\"{}\"}}\n",
        options.joint, jog.started_at(), jog.moved(), jog.target() - jog.started_at(), jog.failure());
  else if (failed)
    fmt::print(stderr, "joint {}: {}\n", options.joint, jog.failure());
  else
    fmt::print("joint {}: asked for {:+.2f} deg, moved {:+.2f} deg, from {:.2f} to {:.2f} deg; drive disabled again\n",
               options.joint, (jog.target() - jog.started_at()) / kDegree, jog.moved() / kDegree,
               jog.started_at() / kDegree, (jog.started_at() + jog.moved()) / kDegree);
  return failed ? kExitFailed : kExitOk;
}

std::expected<int, Refusal> jog(const Options& options) {
  const auto robot = load_robot(options.robot_file, options.runtime_dir);
  if (!robot) return std::unexpected(robot.error());
  const auto index = find_joint(*robot, options.joint);
  if (!index) return std::unexpected(index.error());
  const auto alone = require_alone(*robot);
  if (!alone) return std::unexpected(alone.error());
  const config::Joint& joint = robot->config.joints[*index];
  if (joint.passive)
    return std::unexpected(
        Refusal{kExitUsage, fmt::format("{} is passive: nothing can move it; name a driven joint", joint.name)});
  const double most = joint.limits.torque;
  const double torque = options.torque > 0 ? options.torque : 0.1 * most;
  if (torque > most)
    return std::unexpected(
        Refusal{kExitUsage, fmt::format("--torque {} Nm exceeds limits.torque {} Nm of {}", torque, most, joint.name)});
  auto driver = drivers::make_lone_driver(robot->config, *index);
  if (!driver) return std::unexpected(Refusal{config::kExitBadConfiguration, driver.error()});
  auto bus = open_bus(*robot, joint.bus);
  if (!bus) return std::unexpected(bus.error());
  const drivers::JogWish wish{options.by_degrees * kDegree, options.speed_degrees * kDegree, torque};
  drivers::JointJog moving(joint, wish, **driver);
  run(moving, **driver, **bus, robot->config.control.period);
  return report(moving, options);
}

}  // namespace

void add_joint(CLI::App& app, int& exit_code) {
  CLI::App* joint = app.add_subcommand("joint", "Try one joint without a policy.");
  joint->require_subcommand(1);
  CLI::App* command = joint->add_subcommand("jog", "Move one joint a little, softly; its drive alone is enabled.");
  auto options = std::make_shared<Options>();
  command->add_option("joint", options->joint, "name in the robot file")->required();
  command->add_option("--robot", options->robot_file, "robot file")->required();
  command->add_option("--runtime-dir", options->runtime_dir, "where loopback buses are (default /run/takt/<robot>)");
  command->add_option("--by", options->by_degrees, "degrees, joint side, signed")->capture_default_str();
  command->add_option("--speed", options->speed_degrees, "degrees per second")
      ->check(CLI::Range(0.1, 90.0))
      ->capture_default_str();
  command->add_option("--torque", options->torque, "Nm that are never exceeded (default a tenth of limits.torque)")
      ->check(CLI::PositiveNumber);
  command->add_flag("--json", options->json, "one line of JSON");
  command->footer(
      "Example: takt joint jog elbow --robot robot.yaml --by -5\n"
      "Hold or support the joint: without a policy nothing carries it. Ctrl-C disables the drive.\n"
      "Exit codes: 0 moved, 1 refused or the drive failed, 64 command line, 65 configuration, 69 the bus is not "
      "there.");
  command->callback([options, &exit_code] {
    const auto done = jog(*options);
    if (!done) fmt::print(stderr, "takt joint jog: {}\n", done.error().sentence);
    exit_code = done ? *done : done.error().exit_code;
  });
}

}  // namespace takt::cli
