// SPDX-License-Identifier: Apache-2.0
// takt bus disable: every drive of a robot is told to be disabled, until it says that it is. What the executive's unit
// runs after the executive ended, however it ended; so a bus that is not there does not keep it from the others.
#include <fmt/format.h>

#include <cstdio>
#include <ctime>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/quantity_option.hpp"
#include "cli/robot/asked_drives.hpp"
#include "config/load.hpp"
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
  static std::expected<Disabler, Refusal> open(const DirectRobot& robot) {
    auto drives = AskedDrives::open(robot);
    if (!drives) return std::unexpected(drives.error());
    return Disabler(std::move(*drives));
  }

  void turn() {
    drives_.turn();
    for (std::size_t joint = 0; joint < drives_.count(); ++joint) {
      const JointFeedback& feedback = drives_.feedback(joint);
      if (feedback.received_at.is_set() && is_disabled(feedback)) disabled_[joint] = true;
    }
  }
  // Why buses are not there.
  [[nodiscard]] const std::vector<std::string>& missing() const { return drives_.missing(); }
  // It said so since we began; no process enables it meanwhile.
  [[nodiscard]] bool disabled(std::size_t joint) const { return disabled_[joint]; }
  // Of those that are reached.
  [[nodiscard]] std::vector<std::size_t> not_disabled() const {
    std::vector<std::size_t> joints;
    for (std::size_t joint = 0; joint < drives_.count(); ++joint)
      if (drives_.is_reached(joint) && !disabled_[joint]) joints.push_back(joint);
    return joints;
  }

 private:
  explicit Disabler(AskedDrives drives) : drives_(std::move(drives)), disabled_(drives_.count()) {}

  AskedDrives drives_;
  std::vector<bool> disabled_;
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
    fmt::print("{}\n", json_line(nlohmann::ordered_json{{"disabled", all}, {"joints", said}}));
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
