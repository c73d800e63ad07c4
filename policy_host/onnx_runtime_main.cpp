// takt-policy-host-onnxruntime: takt-policy-host with ONNX Runtime as its engine, which Takt neither links nor ships.
#include <fmt/format.h>

#include <charconv>
#include <cstdlib>
#include <cstring>

#include "policy_host/flow/flow_policy.hpp"
#include "policy_host/onnx_runtime_policy.hpp"
#include "policy_host/program.hpp"

namespace {

// What a program's environment names, because command lines are the same for every policy host.
constexpr const char* kLibrary = "TAKT_ONNXRUNTIME";          // path, or a name that the dynamic linker finds
constexpr const char* kThreads = "TAKT_ONNXRUNTIME_THREADS";  // of one inference; default 1
constexpr const char* kUsualName = "libonnxruntime.so.1";
constexpr int kMostThreads = 64;

std::expected<int, std::string> threads() {
  const char* const said = std::getenv(kThreads);
  if (said == nullptr) return 1;
  int count = 0;
  const char* const end = said + std::strlen(said);
  const auto [rest, error] = std::from_chars(said, end, count);
  if (error == std::errc{} && rest == end && count >= 1 && count <= kMostThreads) return count;
  return std::unexpected(fmt::format("{}: `{}` is no number of threads: say 1 to {}", kThreads, said, kMostThreads));
}

std::expected<std::unique_ptr<takt::policy_host::Policy>, std::string> load(const takt::config::RobotConfig& robot) {
  const auto count = threads();
  if (!count) return std::unexpected(count.error());
  const char* const named = std::getenv(kLibrary);
  auto runtime = takt::onnx_runtime::OnnxRuntime::open(named != nullptr ? named : kUsualName, *count);
  if (!runtime)
    return std::unexpected(fmt::format("{}; install ONNX Runtime, or say where its libonnxruntime.so is: {}=PATH",
                                       runtime.error(), kLibrary));
  auto network = takt::policy_host::load_onnx_runtime_policy(
      *std::move(runtime), robot.policy->file, takt::policy_host::network_input(*robot.policy), robot.policy->output);
  if (!network) return network;
  return takt::policy_host::with_sampler(robot, *std::move(network));
}

}  // namespace

int main(int argc, char** argv) {
  return takt::policy_host::run_policy_host(argc, argv, load);
}
