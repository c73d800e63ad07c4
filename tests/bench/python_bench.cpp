// SPDX-License-Identifier: Apache-2.0
// takt-bench-python: what one step of a Python policy costs beside its inference, against the C++ policy host, in one
// run.
//
// Method: an executive's mailbox publishes an observation of the demo arm every 5 ms and a target every time; a host
// answers it without inferring anything: takt-policy-host's own loop around an empty engine, or python3 with the
// package `takt`. The figure is from the observation's reading to the chunk's publication, less the inference, by the
// stamps in the commands. They take turns; medians over repetitions of each repetition's p50 and p99.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <atomic>
#include <filesystem>
#include <fstream>

#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "policy_host/host.hpp"
#include "tests/bench/bench.hpp"
#include "tests/policy_host/fake_server.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::bench {
namespace {

constexpr Duration kPeriod = milliseconds(5);
constexpr double kMostMicroseconds = 50.0;  // target: Python's median beyond the C++ host's

struct Options {
  int repetitions = 5, observations = 300;
  bool as_json = false;
};

class Nothing : public policy_host::Policy {
 public:
  explicit Nothing(const config::RobotConfig& robot)
      : input_(config::observation_width(robot)), output_(robot.policy->steps * config::outputs_per_step(robot)) {}
  [[nodiscard]] std::size_t input_size() const override { return input_; }
  [[nodiscard]] std::size_t output_size() const override { return output_; }
  void infer(std::span<const float> /*input*/, std::span<float> output) override { std::ranges::fill(output, 0.0F); }
  void reset() override {}

 private:
  std::size_t input_, output_;
};

config::RobotConfig robot_in(const std::string& directory) {
  const auto arm = policy_host::must(config::load("config/arm6.yaml"));
  const std::array<config::Override, 2> changes{{{"policy.period", "5 ms"}, {"policy.file", arm.policy->file}}};
  const auto robot = policy_host::must(config::with_overrides(arm, changes));
  std::ofstream(directory + "/robot.yaml") << robot.resolved;
  return policy_host::must(config::load(directory + "/robot.yaml"));
}

// Nanoseconds beside the inference, of every command that answers the observations published here.
std::vector<double> overheads(const config::RobotConfig& robot, const std::string& directory, int observations) {
  policy_host::FakeExecutive executive(config::executive_socket(directory), config::largest_policy_input(robot));
  policy_host::FakeSensor sensor(config::sensor_socket(directory, "target"));
  const MonoTime give_up = monotonic_now() + seconds(20);
  while (!executive.acknowledged() && monotonic_now() < give_up) sleep_until(monotonic_now() + milliseconds(5));
  std::vector<double> figures;
  if (!executive.acknowledged()) return figures;
  Observation observation;
  observation.period = kPeriod;
  observation.joint_count = 6;
  observation.mode = static_cast<std::uint8_t>(Mode::tracking);
  SensorSample sample;
  sample.value_count = 3;
  MonoTime due = monotonic_now() + kPeriod;
  for (int i = 0; i < observations; ++i, due = due + kPeriod) {
    sleep_until(due);
    sample.sequence = ++observation.id;
    sample.sensed_at = sample.published_at = monotonic_now();
    sensor.publish(sample);
    observation.oldest_sensed_at = observation.published_at = monotonic_now();
    executive.publish(observation);
    sleep_until(due + milliseconds(4));
    CommandChunk chunk;
    if (!executive.read(chunk)) continue;
    const CommandHeader& at = chunk.header;
    figures.push_back(
        static_cast<double>(((at.published_at - at.dequeued_at) - (at.infer_ended_at - at.infer_started_at)).ns));
  }
  return figures;
}

struct Contender {
  const char* name;
  std::function<void(const config::RobotConfig&, const std::string&)> run;  // in a child, until it is terminated
  std::vector<double> p50{}, p99{};
};

std::atomic<bool> g_stop = false;

void run_own_host(const config::RobotConfig& robot, const std::string& directory) {
  signal(SIGTERM, [](int) { g_stop = true; });
  Nothing nothing(robot);
  policy_host::Policy* const engines[] = {&nothing};
  policy_host::Host(robot, directory, policy_host::must(config::policy_hash(robot.policy->file)), engines).run(g_stop);
}

void run_python(const config::RobotConfig& robot, const std::string& directory) {
  setenv("PYTHONPATH", TAKT_PYTHON_PACKAGE, 1);
  execl(TAKT_PYTHON, TAKT_PYTHON, TAKT_PYTHON_PEER, robot.file.c_str(), directory.c_str(), nullptr);
}

void measure(Contender& contender, int observations) {
  const test::TemporaryDirectory directory;
  const config::RobotConfig robot = robot_in(directory.path());
  ChildProcess host([&] { contender.run(robot, directory.path()); });
  const std::vector<double> figures = overheads(robot, directory.path(), observations);
  host.terminate();
  if (figures.size() < static_cast<std::size_t>(observations) / 2) return;
  contender.p50.push_back(1e-3 * median(figures));
  contender.p99.push_back(1e-3 * percentile(figures, 0.99));
}

int run(const Options& options) {
  const Report report(options.as_json);
  std::array<Contender, 2> contenders{{{"C++ policy host", run_own_host}, {"Python policy", run_python}}};
  for (int repetition = 0; repetition < options.repetitions; ++repetition)
    for (Contender& contender : contenders) measure(contender, options.observations);
  for (const Contender& contender : contenders) {
    if (contender.p50.empty()) {
      report.remark(fmt::format("{} answered too few observations", contender.name));
      return 1;
    }
    report.figure(fmt::format("{:<16} beside the inference  p50 {:7.1f} us  p99 {:7.1f} us", contender.name,
                              median(contender.p50), median(contender.p99)),
                  {{"bench", "python"},
                   {"row", contender.name},
                   {"p50_us", median(contender.p50)},
                   {"p99_us", median(contender.p99)}});
  }
  const double own = median(contenders[0].p50), python = median(contenders[1].p50);
  const bool reached = python - own <= kMostMicroseconds;
  report.figure(fmt::format("Python beyond C++, median     {:7.1f} us  = {:.0f} times  (<= {:.0f} us: {})",
                            python - own, python / own, kMostMicroseconds, reached ? "reached" : "MISSED"),
                {{"bench", "python"},
                 {"row", "python_beyond_cpp"},
                 {"us", python - own},
                 {"ratio", python / own},
                 {"target_us", kMostMicroseconds},
                 {"reached", reached}});
  return 0;
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  CLI::App app{"What a step of a Python policy costs beside its inference"};
  takt::bench::Options options;
  app.add_flag("--json", options.as_json, "one JSON object per figure");
  app.add_option("--repetitions", options.repetitions)->check(CLI::Range(1, 100))->capture_default_str();
  app.add_option("--observations", options.observations, "per repetition")
      ->check(CLI::Range(10, 10'000))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return takt::bench::run(options);
}
