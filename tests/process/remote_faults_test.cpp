// SPDX-License-Identifier: Apache-2.0
// Goal: whatever takes a remote policy's commands away, the run alone names the part that failed: the bridge, the wire,
// the server, the policy, a sensor, a stranger or a twin; and the server of every command is known from the run. What
// must not take them away does not. Method: the demo arm in real processes tracks by a policy in another network
// namespace; one fault each; then the incident, `takt report` and the run's sources are read.
//
//   remote_faults_test [--runs N] [--kinds NAME,NAME,...] [--keep FOLDER]     default: every kind once
// Prints a line a run, and a table. Exit codes: 0 every run named its part, 1 not, 77 this machine cannot.
#include <fmt/format.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "monitor/judge/run_metrics.hpp"
#include "monitor/record/recorded_run.hpp"
#include "tests/policy_host/fake_server.hpp"
#include "tests/process/faulty_network.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/support/files.hpp"

namespace takt::test {
namespace {

using policy_host::FakeExecutive;
using policy_host::FakeSensor;

bool until(const std::function<bool()>& holds) {
  for (int poll = 0; poll < 1000; ++poll) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return holds();
}

// The sensor `target` of one robot, on a thread of its own.
class Target {
 public:
  explicit Target(const std::string& directory) : sensor_(std::make_unique<FakeSensor>(socket_in(directory))) {
    thread_ = std::thread([this] { run(); });
  }
  ~Target() {
    stop_ = true;
    thread_.join();
  }
  Target(const Target&) = delete;
  Target& operator=(const Target&) = delete;
  void fall_silent() { silent_ = true; }

 private:
  static std::string socket_in(const std::string& directory) { return config::sensor_socket(directory, "target"); }
  void run() {
    for (std::uint64_t sequence = 1; !stop_; std::this_thread::sleep_for(std::chrono::milliseconds(20))) {
      if (silent_) continue;
      SensorSample sample;
      sample.published_at = sample.sensed_at = monotonic_now();
      sample.value_count = 3;
      sample.values[0] = 0.38F;
      sample.values[2] = 0.35F;
      sample.sequence = sequence++;
      sensor_->publish(sample);
    }
  }
  std::unique_ptr<FakeSensor> sensor_;
  std::atomic<bool> stop_ = false, silent_ = false;
  std::thread thread_;
};

// A robot of the same name: an executive that only shows observations, and a sensor.
class Twin {
 public:
  Twin(const std::string& directory, std::uint32_t joints)
      : executive_(config::executive_socket(directory)), target_(directory), thread_([this, joints] { run(joints); }) {}
  ~Twin() {
    stop_ = true;
    thread_.join();
  }
  Twin(const Twin&) = delete;
  Twin& operator=(const Twin&) = delete;
  [[nodiscard]] std::uint64_t commands() const { return commands_; }
  [[nodiscard]] std::string problem() const { return executive_.said(PolicyWordKind::problem).sentence; }

 private:
  void run(std::uint32_t joints) {
    for (std::uint64_t id = 1; !stop_; ++id, std::this_thread::sleep_for(std::chrono::milliseconds(20))) {
      Observation observation;
      observation.id = id;
      observation.tick = id * 20;
      observation.published_at = observation.oldest_sensed_at = monotonic_now();
      observation.period = milliseconds(20);
      observation.joint_count = joints;
      executive_.publish(observation);
      CommandChunk chunk;
      if (executive_.acknowledged() && executive_.read(chunk)) ++commands_;
    }
  }
  FakeExecutive executive_;
  Target target_;
  std::atomic<bool> stop_ = false;
  std::atomic<std::uint64_t> commands_ = 0;
  std::thread thread_;
};

struct Server {
  std::optional<Child> server, host;
};

// One run: the robot, its bridge, and the policy server `far`, tracking.
class Stage {
 public:
  explicit Stage(const std::vector<std::string>& host_options)
      : base_(std::filesystem::temp_directory_path() / fmt::format("takt-faults-{}.yaml", getpid())) {
    std::string text = text_of("config/arm6.yaml");
    // The target is ours: what the plant serves cannot fail alone.
    for (const std::string key : {"  camera: { sensor: target", "  target: { kind: lissajous"}) {
      const std::size_t at = text.find(key);
      if (at != std::string::npos) text.erase(at, text.find('\n', at) + 1 - at);
    }
    const std::string policy = "file: arm6_reach.onnx";
    text.replace(text.find(policy), policy.size(),
                 "file: " + (std::filesystem::current_path() / "config/arm6_reach.onnx").string());
    std::ofstream(base_) << text
                         << "\ndds: { interface: takt0, peers: [{ address: 10.77.0.1 }, { address: 10.77.0.2 }] }\n";
    robot = std::make_unique<RunningRobot>(
        "", base_,
        std::vector<config::Override>{
            {"freshness.max_age", "400 ms"}, {"freshness.stop_after", "1500 ms"}, {"control.late_share", "1"}});
    target = std::make_unique<Target>(robot->directory());
    bridge.emplace(start(0, "takt-policy-bridge", robot->directory(), "bridge"));
    far = start_server("far", 1, host_options);
  }
  ~Stage() { std::filesystem::remove(base_); }
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  [[nodiscard]] bool tracks() const {
    return robot->arm().empty() && robot->wait_for_mode(Mode::tracking) && robot->let_run(500) != 0;
  }
  Child start(int side, const std::string& program, const std::string& directory, const std::string& log_name,
              const std::vector<std::string>& more = {}) {
    std::vector<std::string> words{program, "--robot", robot->robot_file(), "--runtime-dir", directory};
    words.insert(words.end(), more.begin(), more.end());
    return network.start(side, words, log(log_name));
  }
  Server start_server(const std::string& name, int side, const std::vector<std::string>& host_options = {}) {
    const std::string directory = robot->directory() + "/" + name;
    std::filesystem::create_directories(directory);
    Server server;
    server.server.emplace(start(side, "takt-policy-server", directory, name, {"--name", name}));
    server.host.emplace(start(side, "takt-policy-host", directory, name, host_options));
    return server;
  }
  std::unique_ptr<Twin> start_twin() {
    const std::string directory = robot->directory() + "/twin";
    std::filesystem::create_directories(directory);
    auto twin = std::make_unique<Twin>(directory, 6);
    twin_bridge.emplace(start(0, "takt-policy-bridge", directory, "twin"));
    return twin;
  }
  [[nodiscard]] std::string log(const std::string& name) const { return robot->directory() + "/" + name + ".log"; }
  [[nodiscard]] bool is_logged(const std::string& name, const std::string& words) const {
    return until([&] { return text_of(log(name)).find(words) != std::string::npos; });
  }

  FaultyNetwork network;
  std::unique_ptr<RunningRobot> robot;
  std::unique_ptr<Target> target;
  std::optional<Child> bridge, twin_bridge;
  Server far;

 private:
  std::string base_;
};

struct Kind {
  std::string name, part;
  std::string words;                           // in the incident and the report; empty: nothing may stop the robot
  std::function<bool(Stage&)> act;             // false: the fault could not be made
  std::vector<std::string> host_options = {};  // of the policy's host
  std::size_t servers = 1;                     // whose commands the robot followed
};

bool has_stranger(Stage& stage, const std::string& how, const std::string& log, const std::string& words) {
  const Child stranger = stage.network.start(
      1, {std::string(TAKT_BIN_DIR) + "/remote_stranger", stage.robot->robot_file(), how}, stage.log("stranger"));
  const bool is_sent = stage.is_logged("stranger", "sent");
  stage.robot->let_run(3000);
  return is_sent && stage.is_logged(log, words);
}

bool is_taken_over(Stage& stage, const std::string& name) {
  return stage.is_logged("bridge", "is silent: " + name + " takes over") && stage.robot->let_run(1000) != 0;
}

std::vector<Kind> kinds() {
  const NetworkFaults cut{.delay = {}, .jitter = {}, .loss = 0, .twice = 0, .is_cut = true};
  NetworkFaults deaf_server = {}, mute_server = {};
  deaf_server.cut_from = 0;
  mute_server.cut_from = 1;
  const auto send = [](std::optional<Child>& child, int signal) {
    child->signal(signal);
    return true;
  };
  return {
      {"policy-killed", "policy", "has no policy: its host left", [=](Stage& s) { return send(s.far.host, SIGKILL); }},
      {"policy-ends", "policy", "has no policy: its host left", [=](Stage& s) { return send(s.far.host, SIGTERM); }},
      {"policy-hangs", "policy", "hears this robot, and its policy does not answer",
       [=](Stage& s) { return send(s.far.host, SIGSTOP); }},
      {"policy-answers-nan",
       "policy",
       "gives answers that are not played",
       [](Stage&) { return true; },
       {"--fault", "12 s for 600 s: bad_actions_nan 1"}},
      {"policy-too-slow",
       "policy",
       "its policy does not answer",
       [](Stage&) { return true; },
       {"--fault", "12 s for 600 s: publish_delay 5 s"}},
      {"server-killed", "server", "its machine answers: takt-policy-server ended there, or hangs",
       [=](Stage& s) { return send(s.far.server, SIGKILL); }},
      {"server-ends", "server", "its machine answers: takt-policy-server ended there, or hangs",
       [=](Stage& s) { return send(s.far.server, SIGTERM); }},
      {"server-hangs", "server", "its machine answers: takt-policy-server ended there, or hangs",
       [=](Stage& s) { return send(s.far.server, SIGSTOP); }},
      {"servers-killed",
       "server",
       "policy server near is not heard, and its machine answers: takt-policy-server ended there",
       [=](Stage& s) {
         const Server near = s.start_server("near", 1);
         if (!s.is_logged("near", "begins a session") || s.robot->let_run(1000) == 0) return false;
         send(s.far.server, SIGKILL);
         return is_taken_over(s, "near");
       },
       {},
       2},
      {"wire-cut", "wire", "nor is its machine: the network to it failed",
       [=](Stage& s) { return s.network.set(cut), true; }},
      {"wire-to-server-cut", "wire", "does not hear this robot: the network to it failed",
       [=](Stage& s) { return s.network.set(deaf_server), true; }},
      {"wire-from-server-cut", "wire", "nor is its machine: the network to it failed",
       [=](Stage& s) { return s.network.set(mute_server), true; }},
      {"wire-slow", "wire", "nor is its machine: the network to it failed",
       [=](Stage& s) { return s.network.set({.delay = seconds(10), .jitter = {}}), true; }},
      {"bridge-killed", "bridge", "its host left (takt-policy-bridge",
       [=](Stage& s) { return send(s.bridge, SIGKILL); }},
      {"bridge-hangs", "bridge", "takt-policy-bridge (pid", [=](Stage& s) { return send(s.bridge, SIGSTOP); }},
      {"sensor-silent", "sensor", "sensor target", [](Stage& s) { return s.target->fall_silent(), true; }},
      {"sensor-gone", "sensor", "sensor target", [](Stage& s) { return s.target.reset(), true; }},
      {"stranger-moves-it",
       "stranger",
       "policy server stranger is not heard, and its machine answers",
       [=](Stage& s) {
         const Server stranger = s.start_server("stranger", 1);
         if (!s.is_logged("stranger", "begins a session") || s.robot->let_run(1000) == 0) return false;
         send(s.far.server, SIGKILL);
         return is_taken_over(s, "stranger");
       },
       {},
       2},
      {"stranger-observes", "stranger", "",
       [](Stage& s) { return has_stranger(s, "observations", "far", "two processes show observations of robot"); }},
      {"stranger-answers", "stranger", "",
       [](Stage& s) { return has_stranger(s, "answers", "bridge", "under another server's number"); }},
      {"twin-beside", "twin", "",
       [](Stage& s) {
         const auto twin = s.start_twin();
         const bool is_said = until([&] { return twin->problem().find("answers another robot") != std::string::npos; });
         s.robot->let_run(1000);
         const bool is_unmoved = twin->commands() == 0;
         s.twin_bridge.reset();
         return is_said && is_unmoved && s.is_logged("far", "two processes show observations of robot");
       }},
      {"twin-has-the-server", "twin", "answers another robot of this name",
       [=](Stage& s) {
         const auto twin = s.start_twin();
         if (!s.is_logged("far", "two processes show observations of robot")) return false;
         send(s.bridge, SIGSTOP);
         if (!until([&] { return twin->commands() > 20; })) return false;
         send(s.bridge, SIGCONT);
         // The stop is the bridge's; what keeps the robot from going on is the twin.
         const bool is_stopped = s.robot->wait_for_mode(Mode::damped_stop) && s.robot->reset();
         const bool is_told = until([&] {
           const auto reply = ipc::ask(config::executive_socket(s.robot->directory()), OperatorVerb::arm,
                                       std::chrono::milliseconds(2000));
           return reply &&
                  std::string(reply->sentences).find("answers another robot of this name") != std::string::npos;
         });
         s.twin_bridge.reset();
         return is_stopped && is_told;
       }},
  };
}

// Empty: as it should be. Else what is wrong.
std::string judge(const Kind& kind, const Stage& stage) {
  const auto run = monitor::open_run(stage.robot->run_directory());
  if (!run) return run.error();
  const auto metrics = monitor::metrics_of(*run);
  if (!metrics) return metrics.error();
  const std::string report_file = stage.log("report");
  if (Child({"takt", "report", stage.robot->run_directory()}, report_file).wait(std::chrono::seconds(60)) != 0)
    return "takt report failed: " + text_of(report_file);
  const std::string report = text_of(report_file);
  std::vector<std::string> sources;
  for (const monitor::CommandSource& source : metrics->command_sources) {
    const std::size_t open = source.what.find(" ("), close = source.what.find(')');
    const bool is_known = source.what.starts_with("policy server ") && open != std::string::npos && close == open + 34;
    if (!is_known || source.first_sequence == 0) return "no server and GUID: " + source.what;
    sources.push_back(source.what);
  }
  std::ranges::sort(sources);
  if (std::ranges::unique(sources).begin() - sources.begin() != static_cast<std::ptrdiff_t>(kind.servers))
    return fmt::format("{} servers instead of {}", sources.size(), kind.servers);
  if (kind.words.empty())
    return text_of(stage.robot->run_directory() + "/transitions.jsonl").find("degraded") == std::string::npos
               ? ""
               : "it was silenced for longer than max_age";
  if (kind.name == "twin-has-the-server")
    return text_of(stage.robot->run_directory() + "/events.jsonl").find(kind.words) != std::string::npos
               ? ""
               : "not in events.jsonl";
  const auto lost = std::ranges::find(metrics->incidents, Cause::command_lost, &incident::Incident::cause);
  if (lost == metrics->incidents.end()) return "no incident command_lost";
  if (lost->sentence.find(kind.words) == std::string::npos) return "incident: " + lost->sentence;
  return report.find(kind.words) == std::string::npos ? "not in the report" : "";
}

std::string try_once(const Kind& kind, const std::string& keep) {
  Stage stage(kind.host_options);
  std::string wrong;
  if (!stage.tracks())
    wrong = "it never tracked: " + stage.robot->arm();
  else if (!kind.act(stage))
    wrong = "the fault was not told";
  else if (!kind.words.empty() && kind.name != "twin-has-the-server" && !stage.robot->wait_for_mode(Mode::damped_stop))
    wrong = "it never stopped";
  if (wrong.empty()) stage.robot->let_run(300);
  if (!stage.robot->finish() && wrong.empty()) wrong = "its programs ended badly";
  if (wrong.empty()) wrong = judge(kind, stage);
  if (!wrong.empty() && !keep.empty()) {
    std::error_code ignored;
    std::filesystem::copy(stage.robot->run_directory(), keep + "/" + kind.name,
                          std::filesystem::copy_options::recursive | std::filesystem::copy_options::overwrite_existing,
                          ignored);
    std::ofstream(keep + "/" + kind.name + ".log")
        << stage.robot->logs() << text_of(stage.log("bridge")) << text_of(stage.log("far"));
  }
  return wrong;
}

int run_all(int runs, const std::string& wanted, const std::string& keep) {
  std::map<std::string, std::pair<int, int>> by_part;
  int named = 0, all = 0;
  for (const Kind& kind : kinds()) {
    if (!wanted.empty() && ("," + wanted + ",").find("," + kind.name + ",") == std::string::npos) continue;
    for (int run = 1; run <= runs; ++run) {
      const std::string wrong = try_once(kind, keep);
      ++all;
      ++by_part[kind.part].second;
      if (wrong.empty()) ++named, ++by_part[kind.part].first;
      fmt::print("{:<22}{:<10}run {}: {}\n", kind.name, kind.part, run, wrong.empty() ? "named" : wrong);
      std::fflush(stdout);
    }
  }
  for (const auto& [part, counts] : by_part) fmt::print("{:<10}{} of {}\n", part, counts.first, counts.second);
  fmt::print("{} of {} runs named their part\n", named, all);
  return all > 0 && named == all ? 0 : 1;
}

}  // namespace
}  // namespace takt::test

int main(int argc, char** argv) {
  int runs = 1;
  std::string kinds, keep;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string option = argv[i], value = argv[i + 1];
    if (option == "--runs") std::from_chars(value.data(), value.data() + value.size(), runs);
    if (option == "--kinds") kinds = value;
    if (option == "--keep") keep = value;
  }
  if (const std::string why = takt::test::FaultyNetwork::why_not(); !why.empty()) {
    fmt::print("SKIPPED: {}\n", why);
    return 77;
  }
  return takt::test::run_all(runs, kinds, keep);
}
