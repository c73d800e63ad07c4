// SPDX-License-Identifier: Apache-2.0
// takt-policy-bridge: on the robot, in the place of a policy host, for a policy that runs on another machine.
#include <fmt/format.h>

#include "policy_host/remote/bridge.hpp"
#include "policy_host/remote/program.hpp"

namespace takt::policy_host::remote {
namespace {

constexpr char kProgram[] = "takt-policy-bridge";

int refuse(int exit_code, const std::string& sentence) {
  return program::refuse(exit_code, fmt::format("{}: {}", kProgram, sentence));
}

int serve(const CommonOptions& options) {
  const auto prepared = prepare(options);
  if (!prepared) return refuse(config::kExitBadConfiguration, prepared.error());
  auto bridge = Bridge::open(prepared->robot, prepared->runtime_directory, prepared->policy_hash);
  if (!bridge) return refuse(kExitUnavailable, bridge.error());
  (*bridge)->run(program::stop_on_signals());
  return 0;
}

}  // namespace
}  // namespace takt::policy_host::remote

int main(int argc, char** argv) {
  using namespace takt::policy_host::remote;
  CommonOptions options;
  CLI::App app(
      "Lets a policy on another machine move a robot (docs/remote-policy.md). It shows observations to policy servers "
      "in the robot file's DDS domain, and plays the answers of one.\n"
      "Example: takt run robot.yaml --policy-host takt-policy-bridge --arm");
  add_common(app, options);
  app.footer("Exit codes: 0 ended by a signal, 64 command line, 65 robot file refused, 69 no DDS domain, 70 bug.");
  if (const auto ended = takt::program::parse(app, argc, argv)) return *ended;
  return takt::program::run(kProgram, [&] { return serve(options); });
}
