// SPDX-License-Identifier: Apache-2.0
#include "executive/program/program.hpp"

#include <csignal>
#include <cstdio>
#include <exception>

#include "config/paths.hpp"
#include "config/printable.hpp"
#include "executive/contract/version.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "executive/log/program_log.hpp"
#include "executive/program/command_line_error.hpp"

namespace takt::program {
namespace {

std::atomic<bool> g_stop = false;
static_assert(std::atomic<bool>::is_always_lock_free);

}  // namespace

CLI::Option* add_robot(CLI::App& app, RobotOptions& options, const std::string& what) {
  return app.add_option("--robot", options.robot, what)->required();
}

void add_runtime_directory(CLI::App& app, RobotOptions& options) {
  app.add_option("--runtime-dir", options.runtime_directory,
                 "where sockets live (default ROBOT in $XDG_RUNTIME_DIR/takt, as root /run/takt)");
}

void add_policy_user(CLI::App& app, RobotOptions& options, const std::string& may) {
  app.add_option("--policy-user", options.policy_user, "a user who " + may + "; default: ours only");
}

std::string runtime_directory_of(const RobotOptions& options, const config::RobotConfig& robot) {
  return options.runtime_directory.empty() ? config::default_runtime_directory(robot.robot) : options.runtime_directory;
}

std::expected<std::optional<uid_t>, std::string> policy_user_of(const RobotOptions& options) {
  if (options.policy_user.empty()) return std::nullopt;
  const auto user = ipc::user_id(options.policy_user);
  if (!user) return std::unexpected("--policy-user: " + user.error());
  return *user;
}

std::atomic<bool>& stop_on_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { g_stop = true; };
  for (const int number : {SIGTERM, SIGINT, SIGHUP}) sigaction(number, &action, nullptr);
  return g_stop;
}

int refuse(int exit_code, const std::string& sentence) {
  std::fprintf(stderr, "%s\n", config::printable(sentence).c_str());
  return exit_code;
}

std::optional<int> parse(CLI::App& app, int argc, char** argv) {
  app.set_version_flag("--version", std::string(version()));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::fputs(command_line_answer(app, error).c_str(), stderr);
    return kExitUsage;
  }
  return std::nullopt;
}

int run(const std::string& name, const std::function<int()>& body) {
  try {
    log::log_to_stderr(name);
    return body();
  } catch (const std::exception& error) {
    return refuse(kExitInternal, name + ": internal error: " + error.what());
  }
}

}  // namespace takt::program
