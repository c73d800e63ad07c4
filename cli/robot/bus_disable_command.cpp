// SPDX-License-Identifier: Apache-2.0
// takt bus disable: every drive of a robot is told to be disabled, until it says that it is. What the executive's unit
// runs after the executive ended, however it ended; so a bus that is not there does not keep it from the others.
#include <fmt/format.h>

#include <array>
#include <cstdio>
#include <ctime>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "cli/command.hpp"
#include "cli/quantity_option.hpp"
#include "cli/robot/direct_bus.hpp"
#include "config/load.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "executive/contract/monotonic_clock.hpp"

namespace takt::cli {
namespace {

struct BusDisableOptions {
  std::string robot_file, runtime_dir;
  double seconds = 1;
  bool json = false;
};

// A drive with an error of its own has switched its power stage off; one whose settings displease the driver may not.
bool is_disabled(const JointFeedback& feedback) {
  constexpr std::uint32_t kOurOwnCodes = 0x8000'0000U;  // drivers::SetupFault
  switch (feedback.drive_state) {
    case DriveState::disabled:
      return true;
    case DriveState::fault:
      return (feedback.error_code & kOurOwnCodes) == 0;
    case DriveState::unknown:
    case DriveState::enabled:
      return false;
  }
  return false;
}

class Disabler {
 public:
  // The error: a drive of the file that no driver can be made for.
  static std::expected<Disabler, Refusal> open(const DirectRobot& robot) {
    Disabler made(robot.config);
    for (std::size_t joint = 0; joint < robot.config.joints.size(); ++joint) {
      auto driver = drivers::make_joint_driver(robot.config, joint);
      if (!driver) return std::unexpected(Refusal{config::kExitBadConfiguration, driver.error()});
      made.drivers_.push_back(std::move(*driver));
    }
    made.disabled_.resize(made.drivers_.size());
    for (std::size_t bus = 0; bus < robot.config.buses.size(); ++bus) {
      auto opened = open_bus(robot, bus);
      if (!opened) made.missing_.push_back(opened.error().sentence);
      made.buses_.push_back(opened ? std::move(*opened) : nullptr);
    }
    return made;
  }

  // One control period: what came in is heard, every drive is told once more.
  void turn() {
    for (std::size_t bus = 0; bus < buses_.size(); ++bus) hear(bus);
    for (std::size_t joint = 0; joint < drivers_.size(); ++joint) {
      const JointFeedback& feedback = drivers_[joint]->feedback();
      if (feedback.received_at.is_set() && is_disabled(feedback)) disabled_[joint] = true;
    }
    std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out;
    for (std::size_t joint = 0; joint < drivers_.size(); ++joint) {
      if (!is_reached(joint)) continue;
      const std::size_t frames = drivers_[joint]->encode(false, {}, {}, {}, out);
      for (std::size_t i = 0; i < frames; ++i) buses_[robot_->joints[joint].bus]->send(out[i]);
    }
  }
  // Whether its bus is there.
  [[nodiscard]] bool is_reached(std::size_t joint) const { return buses_[robot_->joints[joint].bus] != nullptr; }
  // Why buses are not there.
  [[nodiscard]] const std::vector<std::string>& missing() const { return missing_; }
  // It said so since we began; nobody enables it meanwhile.
  [[nodiscard]] bool disabled(std::size_t joint) const { return disabled_[joint]; }
  // Of those that are reached.
  [[nodiscard]] std::vector<std::size_t> not_disabled() const {
    std::vector<std::size_t> joints;
    for (std::size_t joint = 0; joint < drivers_.size(); ++joint)
      if (is_reached(joint) && !disabled_[joint]) joints.push_back(joint);
    return joints;
  }

 private:
  explicit Disabler(const config::RobotConfig& robot) : robot_(&robot) {}
  void hear(std::size_t bus) {
    if (!buses_[bus]) return;
    const std::size_t count = buses_[bus]->receive(received_);
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t joint = 0; joint < drivers_.size(); ++joint)
        if (robot_->joints[joint].bus == bus && drivers_[joint]->decode(received_[i])) break;
  }

  const config::RobotConfig* robot_;
  std::vector<std::unique_ptr<drivers::CanBus>> buses_;  // null: not there
  std::vector<std::string> missing_;
  std::vector<std::unique_ptr<drivers::JointDriver>> drivers_;
  std::vector<bool> disabled_;
  std::array<drivers::ReceivedFrame, 64> received_;
};

// A drive that was enabled when it last spoke may have spoken before it heard: at least so many periods are sent.
constexpr int kLeastTurns = 10;

int report(const DirectRobot& robot, const Disabler& disabler, bool json) {
  const auto& joints = robot.config.joints;
  const auto left = disabler.not_disabled();
  const bool all = left.empty() && disabler.missing().empty();
  if (json) {
    nlohmann::ordered_json said = nlohmann::ordered_json::array();
    for (std::size_t joint = 0; joint < joints.size(); ++joint)
      said.push_back({{"joint", joints[joint].name}, {"disabled", disabler.disabled(joint)}});
    fmt::print("{}\n", nlohmann::ordered_json{{"disabled", all}, {"joints", said}}.dump());
  } else if (all) {
    fmt::print("all {} drives of {} say that they are disabled\n", joints.size(), robot.config.robot);
  }
  for (const std::size_t joint : left)
    fmt::print(stderr,
               "joint {}: its drive does not say that it is disabled; it was told so all the same: check its power and "
               "wiring\n",
               joints[joint].name);
  for (const std::string& why : disabler.missing())
    fmt::print(stderr, "takt bus disable: {}; its drives were not told\n", why);
  if (!disabler.missing().empty()) return kExitUnavailable;
  return left.empty() ? kExitOk : kExitFailed;
}

std::expected<int, Refusal> disable(const BusDisableOptions& options) {
  const auto robot = load_robot(options.robot_file, options.runtime_dir);
  if (!robot) return std::unexpected(robot.error());
  const auto alone = require_alone(*robot);
  if (!alone) return std::unexpected(alone.error());
  auto disabler = Disabler::open(*robot);
  if (!disabler) return std::unexpected(disabler.error());
  const Duration period = robot->config.control.period;
  const timespec pause{period.ns / 1'000'000'000, period.ns % 1'000'000'000};
  const MonoTime give_up = monotonic_now() + Duration{static_cast<std::int64_t>(options.seconds * 1e9)};
  const auto goes_on = [&] { return !disabler->not_disabled().empty() && monotonic_now() < give_up; };
  for (int turn = 0; turn < kLeastTurns || goes_on(); ++turn) {
    disabler->turn();
    ::nanosleep(&pause, nullptr);
  }
  return report(*robot, *disabler, options.json);
}

}  // namespace

void add_bus_disable(CLI::App& bus, int& exit_code) {
  CLI::App* command = bus.add_subcommand("disable", "Tell every drive to be disabled, and wait until it says so.");
  auto options = std::make_shared<BusDisableOptions>();
  command->add_option("--robot", options->robot_file, "robot file")->required();
  command->add_option("--runtime-dir", options->runtime_dir,
                      "where loopback buses are (default ROBOT in $XDG_RUNTIME_DIR/takt, as root /run/takt)");
  add_quantity(*command, "--seconds", options->seconds, "s", "wait for answers at most this long")
      ->check(CLI::Range(0.01, 60.0))
      ->capture_default_str();
  command->add_flag("--json", options->json, "one line of JSON");
  command->footer(
      "Example: takt bus disable --robot robot.yaml\n"
      "Refused while an executive answers: that one is asked to stop with `takt stop`. systemd runs this after the\n"
      "executive ended. A disabled arm is carried by nothing: support it.\n"
      "Exit codes: 0 every drive says that it is disabled, 1 refused or a drive does not, 64 command line,\n"
      "65 configuration, 69 a bus is not there: the drives on the others were told.");
  command->callback([options, &exit_code] {
    const auto done = disable(*options);
    if (!done) fmt::print(stderr, "takt bus disable: {}\n", done.error().sentence);
    exit_code = done ? *done : done.error().exit_code;
  });
}

}  // namespace takt::cli
