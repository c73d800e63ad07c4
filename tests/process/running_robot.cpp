// SPDX-License-Identifier: Apache-2.0
#include "tests/process/running_robot.hpp"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <thread>
#include <utility>

#include "config/paths.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "tests/process/patient_copy.hpp"
#include "tests/support/files.hpp"

namespace takt::test {

namespace {

constexpr auto kPollEvery = std::chrono::milliseconds(20);
constexpr int kPolls = 1000;  // times kPollEvery: 20 s

}  // namespace

RunningRobot::RunningRobot(const std::string& scenario, const std::string& robot_file,
                           const std::vector<config::Override>& changes, const std::string& world) {
  robot_file_ = patient_copy(robot_file, directory_.path(), changes);
  std::vector<std::string> extra;
  if (!scenario.empty()) extra = {"--scenario", scenario};
  if (!world.empty()) extra.insert(extra.end(), {"--world", world});
  plant_ = start("takt-plant", extra, "plant");
  executive_ = start_executive();
  monitor_ = start_monitor("run");
}

RunningRobot::~RunningRobot() {
  monitor_.reset();
  executive_.reset();
  plant_.reset();
}

Child RunningRobot::start(const std::string& program, std::vector<std::string> extra,
                          const std::string& log_name) const {
  std::vector<std::string> arguments{program, "--robot", robot_file_, "--runtime-dir", directory_.path()};
  arguments.insert(arguments.end(), extra.begin(), extra.end());
  return Child(std::move(arguments), directory_.path(log_name + ".log"));
}

Child RunningRobot::start_executive(const std::string& log_path) {
  if (log_path.empty()) return start("takt-executive", {"--allow-non-realtime"}, "executive");
  return Child({"takt-executive", "--robot", robot_file_, "--runtime-dir", directory_.path(), "--allow-non-realtime"},
               log_path);
}

Child RunningRobot::start_policy_host() {
  return start("takt-policy-host", {}, "policy-host");
}

Child RunningRobot::start_fallback_host() {
  return start("takt-policy-host", {"--fallback"}, "fallback-host");
}

Child RunningRobot::start_rogue(const std::string& behaviour, const std::string& healthy_for) {
  return start("takt-rogue-policy", {"--behaviour", behaviour, "--healthy-for", healthy_for}, "rogue");
}

Child RunningRobot::start_monitor(const std::string& run_directory_name) {
  return start("takt-monitor", {"--run-dir", directory_.path(run_directory_name)}, "monitor");
}

std::optional<OperatorReply> RunningRobot::status() const {
  auto reply =
      ipc::ask(config::executive_socket(directory_.path()), OperatorVerb::status, std::chrono::milliseconds(500));
  if (!reply) return std::nullopt;
  return *reply;
}

bool RunningRobot::takt(std::vector<std::string> arguments) const {
  arguments.insert(arguments.begin(), "takt");
  return Child(std::move(arguments), directory_.path("takt.log")).wait(std::chrono::seconds(60)) == 0;
}

std::uint64_t RunningRobot::let_run(std::uint64_t ticks) const {
  const auto reply = status();
  const std::uint64_t until = (reply ? reply->status.ticks : 0) + ticks;
  (void)wait_until([until](const StatusSnapshot& now) { return now.ticks >= until; });
  return until;
}

std::optional<OperatorReply> RunningRobot::wait_until(const std::function<bool(const StatusSnapshot&)>& holds) const {
  std::optional<OperatorReply> last;
  for (int poll = 0; poll < kPolls; ++poll) {
    if (auto reply = status()) {
      last = reply;
      if (holds(reply->status)) return last;
    }
    std::this_thread::sleep_for(kPollEvery);
  }
  return last;
}

bool RunningRobot::wait_for_mode(Mode mode) const {
  const auto last = wait_until([mode](const StatusSnapshot& status) { return status.tick.mode == mode; });
  return last && last->status.tick.mode == mode;
}

std::string RunningRobot::arm() const {
  std::string refusal = "the executive never answered";
  for (int poll = 0; poll < kPolls; ++poll) {
    const auto reply =
        ipc::ask(config::executive_socket(directory_.path()), OperatorVerb::arm, std::chrono::milliseconds(2000));
    if (reply && reply->done != 0) return {};
    refusal = reply ? reply->sentences : reply.error();
    std::this_thread::sleep_for(kPollEvery);
  }
  return refusal;
}

bool RunningRobot::reset() const {
  for (int poll = 0; poll < kPolls; ++poll) {
    const auto reply =
        ipc::ask(config::executive_socket(directory_.path()), OperatorVerb::reset, std::chrono::milliseconds(2000));
    // In standby the second one accepts where the joints read: what fell while its drive was silent.
    if (reply && reply->done != 0)
      return ipc::ask(config::executive_socket(directory_.path()), OperatorVerb::reset, std::chrono::milliseconds(2000))
          .has_value();
    std::this_thread::sleep_for(kPollEvery);
  }
  return false;
}

bool RunningRobot::finish() {
  executive_->signal(SIGTERM);
  const auto executive = executive_->wait(std::chrono::seconds(20));
  monitor_->signal(SIGTERM);
  const auto monitor = monitor_->wait(std::chrono::seconds(20));
  return executive == 0 && monitor == 0;
}

std::string RunningRobot::logs() const {
  std::string all;
  for (const auto& entry : std::filesystem::directory_iterator(directory_.path())) {
    if (entry.path().extension() != ".log") continue;
    all += "--- " + entry.path().filename().string() + "\n" + text_of(entry.path());
  }
  return all;
}

}  // namespace takt::test
