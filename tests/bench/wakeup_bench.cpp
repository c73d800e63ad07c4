// SPDX-License-Identifier: Apache-2.0
// How late the control thread wakes: the product's own wake-up code, sleep and hybrid, beside cyclictest at the same
// priority, period and processor, interleaved, idle and under load on the other processors.
//
// Each repetition runs all three for the same time in processes of their own; figures are medians over repetitions of
// that repetition's p50 and p99. Maxima are not reported: a virtual machine stalls for tens of milliseconds at times.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <span>
#include <thread>

#include "executive/runtime/realtime_setup.hpp"
#include "executive/runtime/wakeup.hpp"
#include "tests/bench/bench.hpp"

namespace takt::bench {
namespace {

constexpr int kPriority = 80;
constexpr Duration kPeriod = milliseconds(1);
constexpr Duration kSpin = microseconds(100);
constexpr std::size_t kMaxWakeUps = 10'000;
constexpr int kHistogramMicroseconds = 1000;  // cyclictest's resolution is 1 us
constexpr double kSleepTarget = 1.4;          // x cyclictest's p99, in a virtual machine
constexpr double kHybridTarget = 0.1;

struct Latencies {
  std::size_t count = 0;
  std::array<double, kMaxWakeUps> us{};
};

struct Quantiles {
  double p50 = 0, p99 = 0;
};

Quantiles quantiles_of(std::span<const double> us) {
  const std::vector<double> samples(us.begin(), us.end());
  return {percentile(samples, 0.50), percentile(samples, 0.99)};
}

config::Control control_on(int cpu, config::WakeMode wake) {
  config::Control control;
  control.period = kPeriod;
  control.priority = kPriority;
  control.cpu = cpu;
  control.wake = wake;
  control.spin = kSpin;
  return control;
}

// In a child: the product's set-up and wake-up, `count` times. Empty where real-time rights are missing.
Quantiles measure_ours(config::WakeMode wake, int cpu, std::size_t count) {
  const Shared<Latencies> latencies;
  {
    ChildProcess child([&] {
      const config::Control control = control_on(cpu, wake);
      const runtime::ProcessSetup process = runtime::prepare_process(control);
      if (!runtime::is_realtime(runtime::prepare_thread(control))) return;
      runtime::SystemClock clock;
      runtime::Wakeup wakeup(clock, wake, kSpin);
      MonoTime due = clock.now() + milliseconds(20);
      for (std::size_t i = 0; i < count; ++i) {
        const Duration late = wakeup.wait_until(due) - due;
        latencies->us[i] = static_cast<double>(late.ns) * 1e-3;
        latencies->count = i + 1;
        do due = due + kPeriod;
        while (due < clock.now());
      }
    });
  }
  return quantiles_of(std::span(latencies->us).first(latencies->count));
}

// "000012 000345": 345 wake-ups were 12 us late.
std::map<int, std::uint64_t> read_histogram(std::FILE* text) {
  std::map<int, std::uint64_t> histogram;
  char line[256];
  while (std::fgets(line, sizeof line, text) != nullptr) {
    int us = 0;
    unsigned long count = 0;
    if (line[0] != '#' && std::sscanf(line, "%d %lu", &us, &count) == 2 && count > 0) histogram[us] = count;
  }
  return histogram;
}

double histogram_percentile(const std::map<int, std::uint64_t>& histogram, double fraction) {
  std::uint64_t total = 0;
  for (const auto& [us, count] : histogram) total += count;
  std::uint64_t so_far = 0;
  for (const auto& [us, count] : histogram) {
    so_far += count;
    if (static_cast<double>(so_far) >= fraction * static_cast<double>(total)) return us;
  }
  return std::nan("");
}

Quantiles measure_cyclictest(int cpu, std::size_t count) {
  const std::string command = fmt::format("timeout 60 cyclictest -q -m -t 1 -a {} -p {} -i {} -l {} -h {} 2>/dev/null",
                                          cpu, kPriority, kPeriod.ns / 1000, count, kHistogramMicroseconds);
  std::FILE* const output = popen(command.c_str(), "r");
  if (output == nullptr) return {std::nan(""), std::nan("")};
  const auto histogram = read_histogram(output);
  pclose(output);
  return {histogram_percentile(histogram, 0.50), histogram_percentile(histogram, 0.99)};
}

bool is_installed(const std::string& program) {
  return std::filesystem::exists("/usr/bin/" + program) || std::filesystem::exists("/usr/sbin/" + program);
}

// stress-ng on every processor but one, while the object lives.
class Load {
 public:
  Load(const std::vector<int>& cpus, int spared) : pid_(fork()) {
    if (pid_ != 0) return;
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    std::vector<int> others;
    for (const int cpu : cpus) {
      if (cpu != spared || cpus.size() == 1) others.push_back(cpu);
    }
    run_on(others);
    for (std::FILE* said : {stdout, stderr})
      if (std::freopen("/dev/null", "w", said) == nullptr) _exit(127);
    const std::string workers = std::to_string(others.size());
    execlp("stress-ng", "stress-ng", "--cpu", workers.c_str(), "--vm", workers.c_str(), "--vm-bytes", "64M", "--timer",
           workers.c_str(), "--timeout", "80s", nullptr);
    _exit(127);
  }
  Load(const Load&) = delete;
  Load& operator=(const Load&) = delete;
  ~Load() {
    kill(pid_, SIGTERM);
    waitpid(pid_, nullptr, 0);
  }

 private:
  pid_t pid_;
};

struct Series {
  const char* name;
  std::vector<double> p50, p99;
  void add(const Quantiles& quantiles) {
    p50.push_back(quantiles.p50);
    p99.push_back(quantiles.p99);
  }
};

struct Plan {
  int cpu = 0;
  int repetitions = 5;
  std::size_t count = 2000;
};

void report_series(const Report& report, const char* load, const Series& series, const Series& peer, double target) {
  const double p50 = median(series.p50);
  const double p99 = median(series.p99);
  const double ratio = p99 / median(peer.p99);
  nlohmann::ordered_json row{{"bench", "wakeup"}, {"load", load},  {"mode", series.name},
                             {"p50_us", p50},     {"p99_us", p99}, {"repetitions", series.p99.size()}};
  std::string text = fmt::format("{:8} {:10} p50 {:7.2f} us   p99 {:7.2f} us", load, series.name, p50, p99);
  if (target > 0 && std::isfinite(ratio)) {
    row["p99_x_cyclictest"] = ratio;
    row["target"] = target;
    text += fmt::format("   p99 is {:.2f} x cyclictest (target <= {})", ratio, target);
  }
  report.figure(text, row);
}

void measure(const Report& report, const char* load, const Plan& plan) {
  Series sleep{"sleep", {}, {}}, hybrid{"hybrid", {}, {}}, cyclictest{"cyclictest", {}, {}};
  for (int i = 0; i < plan.repetitions; ++i) {
    if (is_installed("cyclictest")) cyclictest.add(measure_cyclictest(plan.cpu, plan.count));
    sleep.add(measure_ours(config::WakeMode::sleep, plan.cpu, plan.count));
    hybrid.add(measure_ours(config::WakeMode::hybrid, plan.cpu, plan.count));
  }
  if (!cyclictest.p99.empty()) report_series(report, load, cyclictest, cyclictest, 0);
  report_series(report, load, sleep, cyclictest, kSleepTarget);
  report_series(report, load, hybrid, cyclictest, kHybridTarget);
}

int run(const Plan& plan, bool as_json) {
  const Report report(as_json);
  const auto cpus = allowed_cpus();
  if (!Pinned(plan.cpu).is_realtime()) {
    report.remark("no real-time rights (SCHED_FIFO): run as root, or raise RLIMIT_RTPRIO");
    return 71;
  }
  if (!is_installed("cyclictest")) report.remark("cyclictest is not installed (rt-tests): no comparison");
  measure(report, "idle", plan);
  if (!is_installed("stress-ng")) {
    report.remark("stress-ng is not installed: idle only");
    return 0;
  }
  const Load load(cpus, plan.cpu);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  measure(report, "stress", plan);
  return 0;
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  takt::bench::Plan plan;
  plan.cpu = takt::bench::allowed_cpus().back();
  bool as_json = false;
  CLI::App app("Wake-up latency of takt-executive's control thread beside cyclictest, at 1 kHz.");
  app.add_flag("--json", as_json, "one JSON object per line");
  app.add_option("--repetitions", plan.repetitions, "interleaved repetitions")->check(CLI::Range(1, 20));
  app.add_option("--wakeups", plan.count, "wake-ups per repetition and mode")->check(CLI::Range(100, 10'000));
  app.add_option("--cpu", plan.cpu, "processor to wake on (default: the last one)");
  CLI11_PARSE(app, argc, argv);
  return takt::bench::run(plan, as_json);
}
