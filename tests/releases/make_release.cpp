// SPDX-License-Identifier: Apache-2.0
// make_release DIR: what this release writes, for later ones to read: DIR/run, a short run of the virtual robot that
// loses its policy and stops, and DIR/artifact, an artifact of sample rows. See RELEASING.md.
#include <cstdio>
#include <exception>
#include <filesystem>
#include <stdexcept>

#include "executive/contract/version.hpp"
#include "tests/lab/artifact/sample_artifact.hpp"
#include "tests/lab/artifact/sample_rows.hpp"
#include "tests/monitor/record/recorded_demo.hpp"

namespace {

constexpr std::uint64_t kTicks = 1'000;
constexpr std::uint64_t kFrozenFrom = 200;

void make_run(const std::string& folder) {
  takt::monitor::VirtualRobot robot;
  auto run = takt::monitor::record(robot, folder, kTicks,
                                   [&](std::uint64_t tick) { robot.policy_is_frozen = tick >= kFrozenFrom; });
  run.manifest.executive = {{"version", takt::version()}, {"source_sha256", takt::source_sha256()}};
  if (const auto written = run.folder.write_manifest(run.manifest); !written) throw std::runtime_error(written.error());
  for (const char* const bulky : {"/can.log.zst", "/seal.json"}) std::filesystem::remove(folder + bulky);
}

void make_artifact(const std::string& folder) {
  using namespace takt::lab;
  using namespace takt::evidence;
  const std::vector<RolloutRow> rows{sample_row("method-a", 1), failed_row("method-a", 2), sample_row("method-b", 1)};
  write_artifact(folder, sample_manifest({"method-a", "method-b"}, rows.size()), rows);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 64;
  try {
    const std::string folder = argv[1];
    std::filesystem::create_directories(folder);
    make_run(folder + "/run");
    make_artifact(folder + "/artifact");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_release: %s\n", error.what());
    return 1;
  }
  return 0;
}
