// SPDX-License-Identifier: Apache-2.0
// takt-policy-server: on the policy's machine, in the place of the executive.
#include <fmt/format.h>
#include <unistd.h>

#include <array>

#include "policy_host/remote/program.hpp"
#include "policy_host/remote/server.hpp"

namespace takt::policy_host::remote {
namespace {

constexpr char kProgram[] = "takt-policy-server";
constexpr std::size_t kLongestName = 64;

struct Options : CommonOptions {
  std::string name;
};

std::string host_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "unnamed";
}

int refuse(int exit_code, const std::string& sentence) {
  return program::refuse(exit_code, fmt::format("{}: {}", kProgram, sentence));
}

int serve(const Options& options) {
  if (options.name.size() > kLongestName)
    return refuse(kExitUsage, fmt::format("--name: at most {} characters", kLongestName));
  const auto policy_user = program::policy_user_of(options);
  if (!policy_user) return refuse(kExitUsage, policy_user.error());
  const auto prepared = prepare(options);
  if (!prepared) return refuse(config::kExitBadConfiguration, prepared.error());
  const ServerOptions chosen{prepared->runtime_directory,
                             options.name.empty() ? host_name().substr(0, kLongestName) : options.name, *policy_user};
  auto server = Server::open(prepared->robot, chosen, prepared->policy_hash);
  if (!server) return refuse(kExitUnavailable, server.error());
  (*server)->run(program::stop_on_signals());
  return 0;
}

}  // namespace
}  // namespace takt::policy_host::remote

int main(int argc, char** argv) {
  using namespace takt::policy_host::remote;
  Options options;
  CLI::App app(
      "Seats a policy on this machine as if it were on the robot, whose takt-policy-bridge it serves over DDS "
      "(docs/remote-policy.md). A policy host then attaches here.\n"
      "Example: takt-policy-server --robot robot.yaml & takt-policy-host --robot robot.yaml");
  add_common(app, options);
  app.add_option("--name", options.name, "of this server in the robot's log; default: the host's");
  takt::program::add_policy_user(app, options, "may be the policy, too");
  app.footer(
      "Exit codes: 0 ended by a signal, 64 command line, 65 robot file refused, 69 no DDS domain, or the runtime\n"
      "directory is another server's or an executive's, 70 bug.");
  if (const auto ended = takt::program::parse(app, argc, argv)) return *ended;
  return takt::program::run(kProgram, [&] { return serve(options); });
}
