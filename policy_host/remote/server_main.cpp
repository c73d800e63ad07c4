// SPDX-License-Identifier: Apache-2.0
// takt-policy-server: on the policy's machine, in the place of the executive.
#include <unistd.h>

#include <array>
#include <optional>

#include "executive/ipc/unix_socket.hpp"
#include "policy_host/remote/program.hpp"
#include "policy_host/remote/server.hpp"

namespace takt::policy_host::remote {
namespace {

constexpr char kProgram[] = "takt-policy-server";
constexpr std::size_t kLongestName = 64;

struct Options : CommonOptions {
  std::string name, policy_user;
};

std::string host_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "unnamed";
}

int serve(const Options& options) {
  if (options.name.size() > kLongestName)
    return refuse(kProgram, kExitUsage, fmt::format("--name: at most {} characters", kLongestName));
  std::optional<uid_t> policy_user;
  if (!options.policy_user.empty()) {
    const auto user = ipc::user_id(options.policy_user);
    if (!user) return refuse(kProgram, kExitUsage, "--policy-user: " + user.error());
    policy_user = *user;
  }
  const auto prepared = prepare(options);
  if (!prepared) return refuse(kProgram, config::kExitBadConfiguration, prepared.error());
  const ServerOptions chosen{prepared->runtime_directory,
                             options.name.empty() ? host_name().substr(0, kLongestName) : options.name, policy_user};
  auto server = Server::open(prepared->robot, chosen, prepared->policy_hash);
  if (!server) return refuse(kProgram, kExitUnavailable, server.error());
  (*server)->run(g_stop);
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
  app.add_option("--policy-user", options.policy_user, "a user who may be the policy, too; default: ours only");
  app.footer(
      "Exit codes: 0 ended by a signal, 64 command line, 65 robot file refused, 69 no DDS domain, or the runtime\n"
      "directory is another server's or an executive's, 70 bug.");
  return run_program(kProgram, app, argc, argv, [&] { return serve(options); });
}
