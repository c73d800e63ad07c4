// SPDX-License-Identifier: Apache-2.0
// takt-bench-boundary: what the boundary around a policy costs: its start, beside the same program without one, and
// each publication afterwards. Interleaved; p50 and p90 over all repetitions.
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "policy_host/boundary.hpp"
#include "tests/bench/bench.hpp"
#include "tests/bench/mailbox_figures.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::bench {
namespace {

constexpr double kMostStart_ms = 30, kMostPublish_us = 50;  // targets

enum class Side : std::uint8_t { outside, behind };

std::size_t go(Side side, const std::string& runtime_directory) {
  if (side == Side::outside) return 0;
  return policy_host::go_behind_boundary({.runtime_directory = runtime_directory}).size();
}

// From fork to the end of /bin/true, ms. `refused` counts layers that this kernel did not give.
double start_ms(Side side, const std::string& runtime_directory, std::size_t& refused) {
  const std::int64_t begin = ticks();
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("fork failed");
  if (child == 0) {
    const std::size_t layers = go(side, runtime_directory);
    if (layers != 0) _exit(static_cast<int>(layers));
    execl("/bin/true", "true", nullptr);
    _exit(100);
  }
  int status = 0;
  waitpid(child, &status, 0);
  const double ms = static_cast<double>(ticks() - begin) * ns_per_tick() * 1e-6;
  refused = std::max(refused, static_cast<std::size_t>(WEXITSTATUS(status)));
  return ms;
}

// Of 512 bytes into a mailbox, us.
Spread publish_us(Side side, const std::string& runtime_directory) {
  const Shared<Spread> spread;
  {
    ChildProcess child([&] {
      go(side, runtime_directory);
      *spread = uncontended(allowed_cpus().back()).write;
    });
  }
  return {spread->p50 * 1e-3, spread->p99 * 1e-3};
}

void report_start(const Report& report, const std::vector<double>& outside, const std::vector<double>& behind) {
  const double p50 = percentile(behind, 0.5) - percentile(outside, 0.5);
  const double p90 = percentile(behind, 0.9) - percentile(outside, 0.9);
  const bool reached = p50 <= kMostStart_ms;
  report.figure(fmt::format("start behind the boundary   p50 {:6.2f} ms  p90 {:6.2f} ms more than without, which takes "
                            "{:.2f} ms (<= {:.0f}: {})",
                            p50, p90, percentile(outside, 0.5), kMostStart_ms, reached ? "reached" : "MISSED"),
                {{"bench", "boundary"},
                 {"row", "start"},
                 {"p50_ms_more", p50},
                 {"p90_ms_more", p90},
                 {"without_p50_ms", percentile(outside, 0.5)},
                 {"target_ms", kMostStart_ms},
                 {"reached", reached}});
}

void report_publish(const Report& report, const std::vector<double>& outside, const std::vector<double>& behind) {
  const double p50 = percentile(behind, 0.5);
  const bool reached = p50 <= kMostPublish_us;
  report.figure(fmt::format("publish 512 B behind it     p50 {:6.3f} us, without {:.3f} us (<= {:.0f}: {})", p50,
                            percentile(outside, 0.5), kMostPublish_us, reached ? "reached" : "MISSED"),
                {{"bench", "boundary"},
                 {"row", "publish"},
                 {"p50_us", p50},
                 {"without_p50_us", percentile(outside, 0.5)},
                 {"target_us", kMostPublish_us},
                 {"reached", reached}});
}

int run(int repetitions, bool as_json) {
  const Report report(as_json);
  ns_per_tick();
  const test::TemporaryDirectory folder;
  std::vector<double> outside, behind, plain_publish, fenced_publish;
  std::size_t none = 0, refused = 0;
  for (int i = 0; i < repetitions; ++i) {
    outside.push_back(start_ms(Side::outside, folder.path(), none));
    behind.push_back(start_ms(Side::behind, folder.path(), refused));
  }
  for (int i = 0; i < 5; ++i) {
    plain_publish.push_back(publish_us(Side::outside, folder.path()).p50);
    fenced_publish.push_back(publish_us(Side::behind, folder.path()).p50);
  }
  if (refused != 0)
    report.remark(fmt::format("this kernel refuses {} of its layers: the figures are of the others", refused));
  report_start(report, outside, behind);
  report_publish(report, plain_publish, fenced_publish);
  return 0;
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  int repetitions = 200;
  bool as_json = false;
  CLI::App app("What the boundary around a policy costs at its start and at each publication.");
  app.add_flag("--json", as_json, "one JSON object per line");
  app.add_option("--repetitions", repetitions, "starts on either side")->check(CLI::Range(10, 10'000));
  CLI11_PARSE(app, argc, argv);
  return takt::bench::run(repetitions, as_json);
}
