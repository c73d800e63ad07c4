// SPDX-License-Identifier: Apache-2.0
#include "cli/run/supervisor.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "cli/command.hpp"
#include "cli/run/status_text.hpp"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "config/printable.hpp"
#include "executive/incident/log_hint.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/strict_json.hpp"

namespace takt::cli {
namespace {

constexpr Duration kReadyWithin = seconds(60);  // a network's library from a cold disk; an earlier end is told at once
constexpr Duration kToldToWait = seconds(5);
constexpr Duration kArmedWithin = seconds(10);
constexpr Duration kToldWithin = seconds(1);  // what arming waits for
constexpr Duration kTrackingWithin = seconds(10);
constexpr Duration kPollEvery = milliseconds(20);
constexpr Duration kDisplayEvery = milliseconds(100);
constexpr Duration kTrackingSeenWithin = milliseconds(2);  // origin of the scenario's times
constexpr Duration kAnswerWithin = seconds(10);  // a script that throttles the control core lets it wait for a second
constexpr Duration kRestartEvery = seconds(1);
constexpr Duration kRestRecorded = milliseconds(1500);  // of a stopped robot, before a scripted run ends

Duration steady_now() {
  return {std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1)};
}

bool is_stopped(Mode mode) {
  switch (mode) {
    case Mode::damped_stop:
    case Mode::fault_latched:
    case Mode::standby:
      return true;
    case Mode::arming:
    case Mode::tracking:
    case Mode::degraded:
      return false;
  }
  return false;
}

bool is_essential(ProcessName process) {
  return process == ProcessName::executive || process == ProcessName::plant;
}

// A program's own exit code says more than ours when it is one of the documented ones.
// What a process that hangs at its start has not done.
std::string_view readiness_of(ProcessName process) {
  switch (process) {
    case ProcessName::plant:
      return "it serves no bus or no camera; start it by hand to see what it waits for";
    case ProcessName::executive:
      return "it answers no request; start it by hand to see what it waits for";
    case ProcessName::monitor:
    case ProcessName::policy:
    case ProcessName::fallback:
      break;
  }
  return "it did not attach to the executive; start it by hand beside the robot to see what it waits for";
}

int exit_code_for(const ChildProcess& child) {
  const int code = child.exit_code().value_or(kExitFailed);
  if (code == 127) return kExitUnavailable;
  return code >= kExitUsage && code <= 71 ? code : kExitFailed;
}

}  // namespace

Supervisor::Supervisor(const config::RobotConfig& robot, RunOptions options)
    : robot_(robot),
      options_(std::move(options)),
      processes_(robot_, options_.place),
      display_(robot.freshness.max_age),
      contention_(robot_, options_.place.runtime_directory + "/logs/load.log"),
      events_(options_.place.run_directory),
      plant_log_(options_.place.runtime_directory + "/logs/takt-plant.log"),
      person_(options_.rearm_after),
      made_at_(steady_now()) {
  signal(SIGPIPE, SIG_IGN);  // who reads our screen may leave; the robot goes on
  sigset_t watched;
  sigemptyset(&watched);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGCHLD}) sigaddset(&watched, signal);
  sigprocmask(SIG_BLOCK, &watched, nullptr);
  signals_ = signalfd(-1, &watched, SFD_CLOEXEC | SFD_NONBLOCK);
}

Supervisor::~Supervisor() {
  close(signals_);
}

Duration Supervisor::now() const {
  return steady_now() - made_at_;
}

int Supervisor::run() {
  note_beginning();
  Outcome outcome = start_all();
  if (outcome && options_.arm) outcome = arm();
  if (outcome) outcome = follow();
  display_.finish();
  End end = outcome.error();  // follow() always ends with one
  if (!end.sentence.empty()) std::fprintf(end.exit_code == 0 ? stdout : stderr, "%s\n", end.sentence.c_str());
  if (const auto last = processes_.ask(OperatorVerb::status)) incident_ = last->incident;
  miss_the_rest();
  events_.note("ending", {{"because", end.sentence.empty() ? "the duration is over" : end.sentence}});
  processes_.end_all();
  for (const ProcessName process : processes_.wanted()) note_ended(label(process), processes_.find(process));
  for (std::size_t i = 0; i < options_.place.sensors.size(); ++i)
    note_ended(label(options_.place.sensors[i]), processes_.find_sensor(i));
  note_plant_faults();
  for (const std::string& fault : options_.plant_faults)
    miss(fmt::format("{}: {}", options_.plant_scenario, fault), "its instant did not come");
  for (const ProcessName process : {ProcessName::executive, ProcessName::monitor}) {
    const ChildProcess* child = processes_.find(process);
    const bool as_asked = !child || child->exit_code() == 0 || reported_dead_.contains(process);
    if (end.exit_code != kExitOk || as_asked) continue;
    fmt::print(stderr, "{} {} while ending\n{}", program(process), child->how_it_ended(), child->last_words());
    end.exit_code = exit_code_for(*child);
  }
  const bool is_missed = end.exit_code == kExitOk && !never_happened_.empty();
  if (is_missed)
    for (const std::string& sentence : never_happened_) fmt::print(stderr, "never happened: {}\n", sentence);
  const std::string logs = processes_.settle_logs();
  const bool recorded = access(options_.place.run_directory.c_str(), F_OK) == 0;
  std::printf("%s %s\n", recorded ? "run folder:" : "no run folder was written; logs:",
              config::printable(recorded ? options_.place.run_directory : logs).c_str());
  if (recorded) tell_loads();
  tell_incident(end);
  if (end.exit_code == kExitOk && (is_missed || (was_recorded_ && !recorded))) return kExitFailed;
  return end.exit_code == kExitOk ? exit_code_of_the_dead() : end.exit_code;
}

void Supervisor::miss(const std::string& given, const std::string& why) {
  never_happened_.push_back(fmt::format("{}: {}", given, why));
  events_.note("missed", {{"given", given}, {"why", why}});
}

void Supervisor::note_beginning() {
  nlohmann::ordered_json command = nlohmann::ordered_json::array();
  std::ifstream words("/proc/self/cmdline");
  for (std::string word; std::getline(words, word, '\0');) command.push_back(word);
  events_.note("run", {{"command", command}, {"robot_file", options_.place.robot_file}});
  if (options_.plant_scenario.empty()) return;
  const auto text = monitor::read_file(options_.plant_scenario);
  if (!text) return;
  events_.note("scenario", {{"file", options_.plant_scenario}, {"sha256", config::sha256_hex(*text)}, {"text", *text}});
}

void Supervisor::note_started(const std::string& label, const ChildProcess* child) {
  started_at_[label] = now();
  if (child != nullptr) events_.note("started", {{"process", label}, {"pid", child->pid()}});
}

bool Supervisor::is_restart_due(const std::string& label) const {
  const auto newest = started_at_.find(label);
  return options_.restart && (newest == started_at_.end() || now() >= newest->second + kRestartEvery);
}

void Supervisor::note_ended(const std::string& label, const ChildProcess* child) {
  if (child == nullptr || child->how_it_ended().empty() || !noted_ended_.insert(child->pid()).second) return;
  const std::string how = child->how_it_ended(), signal = child->ended_by();
  events_.note("ended", {{"process", label},
                         {"pid", child->pid()},
                         {"how", how},
                         {"signal", signal.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(signal)},
                         {"exit_code", signal.empty() ? nlohmann::ordered_json(child->exit_code().value_or(0))
                                                      : nlohmann::ordered_json()}});
}

// Each instant is the plant's own word.
void Supervisor::note_plant_faults() {
  if (options_.plant_scenario.empty()) return;
  for (const PlantLog::Line& line : plant_log_.news()) {
    events_.note("fault", {{"given", options_.plant_scenario}, {"what", line.what}}, line.at);
    if (const auto due = std::ranges::find(options_.plant_faults, line.what); due != options_.plant_faults.end())
      options_.plant_faults.erase(due);
  }
}

void Supervisor::miss_the_rest() {
  const std::string why =
      tracking_since_ ? fmt::format("the run ended {:.1f} s after tracking began", (now() - *tracking_since_).seconds())
                      : std::string("tracking never began") + (options_.arm ? "" : "; takt run arms with --arm");
  for (; next_event_ < options_.events.size(); ++next_event_)
    if (!is_end(options_.events[next_event_])) miss(as_given(options_.events[next_event_]), why);
}

void Supervisor::tell_loads() const {
  const auto text = monitor::read_file(options_.place.run_directory + "/metrics.json");
  const auto metrics = text ? monitor::parse_strict(*text) : std::unexpected(text.error());
  if (!metrics || !metrics->is_object() || !metrics->contains("load_mismatches")) return;
  for (const nlohmann::ordered_json& each : metrics->at("load_mismatches"))
    if (each.is_object() && each.contains("sentence") && each["sentence"].is_string())
      fmt::print(stderr, "warning: {}\n", config::printable(each["sentence"].get<std::string>()));
}

// Of a process that failed meanwhile, of itself, and that the run went on without.
int Supervisor::exit_code_of_the_dead() {
  for (const ProcessName process : reported_dead_)
    if (const ChildProcess* child = processes_.find(process); !killed_by_script_.contains(process))
      if (child != nullptr && child->exit_code() != kExitOk) return exit_code_for(*child);
  for (const std::size_t sensor : dead_sensors_)
    if (const ChildProcess* child = processes_.find_sensor(sensor); child->exit_code() != kExitOk)
      return exit_code_for(*child);
  return kExitOk;
}

std::string Supervisor::incident_text(const IncidentNote& incident) {
  std::string sentence = incident_sentence(incident);
  const std::size_t hint = sentence.find(incident::kPolicyLogHint);
  const ChildProcess* const policy = processes_.find(ProcessName::policy);
  if (hint != std::string::npos && policy != nullptr && reported_dead_.contains(ProcessName::policy))
    sentence.replace(hint, incident::kPolicyLogHint.size(), label(ProcessName::policy) + " " + policy->how_it_ended());
  return sentence;
}

// What the script killed or stopped ends as it was asked to.
void Supervisor::tell_incident(End& end) {
  const std::string sentence = incident_text(incident_);
  if (sentence.empty()) return;
  const bool is_asked = incident_.asked != 0 || script_ends_run_;
  std::fflush(stdout);
  std::fprintf(is_asked ? stdout : stderr, "%s\n", sentence.c_str());
  if (end.exit_code == kExitOk && !is_asked) end.exit_code = kExitStopped;
}

Supervisor::Outcome Supervisor::start_all() {
  for (const ProcessName process : processes_.wanted()) {
    if (auto started = processes_.start(process); !started)
      return std::unexpected(End{kExitUnavailable, started.error()});
    for (const std::string& gap : processes_.find(process)->gaps())
      display_.note(fmt::format("warning: {}: {}", label(process), gap));
    note_started(label(process), processes_.find(process));
    if (auto ready = wait_ready(process); !ready) return ready;
    if (process == ProcessName::executive)  // before the policy, which needs what they serve
      if (auto ready = start_sensors(); !ready) return ready;
  }
  ready_at_ = now();
  if (!options_.events.empty() && !options_.arm)
    display_.note("note: what is scripted counts from tracking, and waits until something arms the robot (--arm)");
  if (const auto status = processes_.ask_status(); status && status->realtime == 0)
    display_.note(
        "warning: without real-time guarantees on this machine: fine for a look, not for a robot, and every artifact "
        "says "
        "so; `takt doctor` says how to correct it");
  return {};
}

Supervisor::Outcome Supervisor::start_sensors() {
  const std::vector<SensorProgram>& sensors = options_.place.sensors;
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    if (auto started = processes_.start_sensor(i); !started)
      return std::unexpected(End{kExitUnavailable, started.error()});
    note_started(label(sensors[i]), processes_.find_sensor(i));
  }
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    ChildProcess& child = *processes_.find_sensor(i);
    const auto fails = [&](int exit_code, const std::string& how) {
      return std::unexpected(End{exit_code, fmt::format("--sensor {}={} {}\n{}", sensors[i].sensor, sensors[i].command,
                                                        how, child.last_words())});
    };
    for (const Duration give_up = now() + kReadyWithin; !processes_.is_sensor_ready(i);) {
      if (auto alive = look_after_children(); !alive) return alive;
      if (!child.alive()) return fails(exit_code_for(child), child.how_it_ended() + " before it served the sensor");
      if (now() >= give_up)
        return fails(kExitUnavailable,
                     fmt::format("did not serve the sensor within {} s: does it open {} in {}?",
                                 kReadyWithin.ns / seconds(1).ns, sensors[i].sensor, options_.place.runtime_directory));
      if (auto paused = pause(now() + kPollEvery); !paused) return paused;
    }
  }
  return {};
}

Supervisor::Outcome Supervisor::wait_ready(ProcessName process) {
  const Duration began = now();
  for (bool is_told = false; now() < began + kReadyWithin;) {
    if (auto alive = look_after_children(); !alive) return alive;
    if (!is_told && now() >= began + kToldToWait) {
      is_told = true;
      display_.note(fmt::format("{} is still starting", label(process)));
    }
    // One that was ready before may take this one along: the cause is told, not what came of it.
    for (const ProcessName started : processes_.wanted()) {
      ChildProcess* child = processes_.find(started);
      if (!child || child->alive() || (started != process && !is_essential(started))) continue;
      return std::unexpected(
          End{exit_code_for(*child), fmt::format("{} {} before {} was ready\n{}", label(started), child->how_it_ended(),
                                                 started == process ? "it" : label(process), child->last_words())});
    }
    if (processes_.is_ready(process, processes_.ask_status())) return {};
    if (auto paused = pause(now() + kPollEvery); !paused) return paused;
  }
  const ChildProcess& child = *processes_.find(process);
  return std::unexpected(
      End{kExitUnavailable,
          fmt::format("{} ({}) was not ready within {} s: {}\n{}", label(process), child.options().arguments.front(),
                      kReadyWithin.ns / seconds(1).ns, readiness_of(process), child.last_words())});
}

Supervisor::Outcome Supervisor::arm() {
  std::string missing = " no answer from the executive";
  Duration tell_at = now() + kToldWithin;
  for (const Duration give_up = now() + kArmedWithin; now() < give_up;) {
    const auto reply = processes_.ask(OperatorVerb::arm);
    if (reply && (reply->done != 0 || !is_stopped(reply->status.tick.mode))) return {};  // another operator was quicker
    if (reply) {
      missing.clear();
      for (const std::string& sentence : sentences_of(*reply)) missing += "\n  " + sentence;
    }
    if (auto alive = look_after_children(); !alive) return alive;
    if (robot_.policy && reported_dead_.contains(ProcessName::policy))  // it will not come by waiting
      return std::unexpected(
          End{exit_code_for(*processes_.find(ProcessName::policy)), "arming was refused:" + missing});
    if (now() >= tell_at) {
      display_.note("waiting to arm:" + missing);
      tell_at = give_up;
    }
    if (auto paused = pause(now() + kPollEvery); !paused) return paused;
  }
  return std::unexpected(End{kExitFailed, "arming was refused:" + missing});
}

Supervisor::Outcome Supervisor::follow() {
  const Duration armed_at = answered_at_ = now();
  for (Duration next_display = now();;) {
    if (auto alive = look_after_children(); !alive) return alive;
    if (auto fired = fire_due_events(); !fired) return fired;
    if (now() >= next_display) {
      next_display = now() + (options_.arm && !tracking_since_ ? kTrackingSeenWithin : kDisplayEvery);
      if (const auto reply = processes_.ask(OperatorVerb::status)) {
        see(*reply);
        if (auto goes_on = judge_progress(reply->status); !goes_on) return goes_on;
      } else {
        look_for_socket();
      }
    }
    if (auto goes_on = judge_time(); !goes_on) return goes_on;
    if (options_.arm && !tracking_since_ && now() > armed_at + kTrackingWithin)
      return std::unexpected(End{kExitFailed, "armed, but tracking did not begin; see the mode above"});
    Duration wake = next_display;
    if (tracking_since_ && next_event_ < options_.events.size())
      wake = std::min(wake, *tracking_since_ + options_.events[next_event_].at);
    if (auto paused = pause(wake); !paused) return paused;
  }
}

void Supervisor::see(const OperatorReply& reply) {
  const StatusSnapshot& status = reply.status;
  was_recorded_ |= status.tick.recorded_through != 0;
  answered_at_ = now();
  if (reply.incident.stands != 0 && reply.incident.tick != incident_.tick) display_.note(incident_text(reply.incident));
  incident_ = reply.incident;
  const bool tracks = status.tick.mode == Mode::tracking || status.tick.mode == Mode::degraded;
  if (!tracking_since_ && tracks) {
    tracking_since_ = answered_at_;
    events_.note("tracking", {{"note", "instants of --at count from here"}});
  }
  display_.show(answered_at_ - tracking_since_.value_or(*ready_at_), status);
  if (tracks) asked_to_stop_ = false;
  rearm(status.tick.mode, reply.incident.stop_asked != 0 && !asked_to_stop_);
}

void Supervisor::look_for_socket() {
  const std::string socket = config::executive_socket(options_.place.runtime_directory);
  if (socket_is_gone_ || access(socket.c_str(), F_OK) == 0) return;
  socket_is_gone_ = true;
  display_.note(fmt::format("{} was removed: `takt stop` cannot reach this robot; Ctrl+C here stops it", socket));
}

Supervisor::Outcome Supervisor::judge_time() const {
  const auto origin = options_.arm ? tracking_since_ : ready_at_;
  if (options_.duration && origin && now() >= *origin + *options_.duration) return std::unexpected(End{});
  if (now() >= answered_at_ + kAnswerWithin)
    return std::unexpected(
        End{kExitUnavailable,
            fmt::format("{} has not answered for {} s: the run ends; it is frozen, or its machine has no time for it",
                        program(ProcessName::executive), kAnswerWithin.ns / seconds(1).ns)});
  return {};
}

Supervisor::Outcome Supervisor::judge_progress(const StatusSnapshot& status) {
  if (script_ends_run_ && !options_.to_the_end && next_event_ == options_.events.size() &&
      is_stopped(status.tick.mode)) {
    if (!stopped_at_) stopped_at_ = now();
    if (now() >= *stopped_at_ + kRestRecorded)
      return std::unexpected(
          End{kExitOk, fmt::format("the robot stopped ({}); nothing is left to do", name(status.tick.mode))});
  } else {
    stopped_at_.reset();
  }
  return {};
}

Supervisor::Outcome Supervisor::look_after_children() {
  processes_.reap_orphans();
  for (const ProcessName process : processes_.wanted()) {
    ChildProcess* child = processes_.find(process);
    if (!child || child->alive() || !ready_at_) continue;
    if (!reported_dead_.insert(process).second) {
      if (is_restart_due(label(process))) (void)restart(process);
      continue;
    }
    note_ended(label(process), processes_.find(process));
    display_.note(fmt::format("{} {}", label(process), child->how_it_ended()));
    // A program that ended by itself said why; one that was killed could not.
    if (std::string words = child->last_words(); child->exit_code() && !words.empty() && !is_essential(process)) {
      words.pop_back();
      display_.note(words);
    }
    if (is_essential(process))
      return std::unexpected(
          End{std::max(exit_code_for(*child), kExitFailed),
              fmt::format("{} {}: the run ends\n{}", program(process), child->how_it_ended(), child->last_words())});
    if (is_restart_due(label(process))) (void)restart(process);
  }
  look_after_sensors();
  contention_.reap();
  events_.flush();
  note_plant_faults();
  return {};
}

// A robot whose policy misses a sensor stops by its contract; the run goes on.
void Supervisor::look_after_sensors() {
  for (std::size_t i = 0; i < options_.place.sensors.size(); ++i) {
    ChildProcess* const child = processes_.find_sensor(i);
    if (child == nullptr || child->alive() || !ready_at_) continue;
    const std::string name = label(options_.place.sensors[i]);
    if (dead_sensors_.insert(i).second) {
      note_ended(name, child);
      std::string words = child->last_words();
      display_.note(fmt::format("{} {}", name, child->how_it_ended()));
      if (!words.empty()) {
        words.pop_back();
        display_.note(words);
      }
    }
    if (!is_restart_due(name)) continue;
    started_at_[name] = now();
    if (const auto started = processes_.start_sensor(i); !started) {
      display_.note(started.error());
      continue;
    }
    dead_sensors_.erase(i);
    note_started(name, processes_.find_sensor(i));
    display_.note(name + " restarted");
  }
}

std::string Supervisor::restart(ProcessName process) {
  std::string why;
  if (ChildProcess* child = processes_.find(process); child && child->alive())
    why = fmt::format("{} still runs", label(process));
  if (why.empty()) {
    note_ended(label(process), processes_.find(process));
    started_at_[label(process)] = now();
    if (auto started = processes_.start(process); !started) why = started.error();
  }
  if (why.empty()) {
    reported_dead_.erase(process);
    note_started(label(process), processes_.find(process));
  }
  display_.note(why.empty() ? fmt::format("{} restarted", label(process)) : why);
  return why;
}

Supervisor::Outcome Supervisor::fire_due_events() {
  while (tracking_since_ && next_event_ < options_.events.size() &&
         now() >= *tracking_since_ + options_.events[next_event_].at) {
    const Event& event = options_.events[next_event_++];
    display_.note(fmt::format("{:6.1f} s  script: {}", event.at.seconds(), event.text));
    events_.note("script", {{"given", as_given(event)},
                            {"action", name(event.action)},
                            {"process", label(event.process)},
                            {"length_ns", event.length.ns}});
    if (auto fired = fire(event); !fired) return fired;
  }
  return {};
}

Supervisor::Outcome Supervisor::fire(const Event& event) {
  switch (event.action) {
    case ActionKind::freeze:
      send(event, SIGSTOP);
      return {};
    case ActionKind::thaw:
      send(event, SIGCONT);
      return {};
    case ActionKind::kill:
      send(event, SIGKILL);
      killed_by_script_.insert(event.process);
      // With a fallback policy the robot goes on.
      script_ends_run_ |=
          event.process == ProcessName::policy && !options_.restart && config::fallback_policy_of(robot_) == nullptr;
      return {};
    case ActionKind::start:
      if (const std::string why = restart(event.process); !why.empty()) miss(as_given(event), why);
      return {};
    case ActionKind::hog:
    case ActionKind::throttle:
    case ActionKind::crowd:
    case ActionKind::load:
    case ActionKind::unload:
      if (auto applied = contention_.apply(event); !applied)
        return std::unexpected(End{applied.error().exit_code, applied.error().sentence});
      return {};
    case ActionKind::arm:
      request(event, OperatorVerb::arm);
      return {};
    case ActionKind::reset:
      request(event, OperatorVerb::reset);
      return {};
    case ActionKind::stop:
      script_ends_run_ = asked_to_stop_ = true;
      request(event, OperatorVerb::stop);
      return {};
    case ActionKind::fault:  // it looks after itself
      return {};
  }
  return {};
}

void Supervisor::send(const Event& event, int signal) {
  ChildProcess* const child = processes_.find(event.process);
  if (child != nullptr && child->alive()) return child->signal(signal);
  if (!is_end(event)) miss(as_given(event), fmt::format("{} did not run then", label(event.process)));
}

void Supervisor::request(const Event& event, OperatorVerb verb) {
  const auto reply = processes_.ask(verb);
  if (!reply) {
    display_.note(reply.error());
    return miss(as_given(event), reply.error());
  }
  const std::vector<std::string> sentences = sentences_of(*reply);
  for (const std::string& sentence : sentences) display_.note(sentence);
  if (reply->done == 0) miss(as_given(event), sentences.empty() ? "it was refused" : sentences.front());
}

void Supervisor::rearm(Mode mode, bool stopped_by_another) {
  const OperatorStep step = person_.next(mode, stopped_by_another, now());
  if (step == OperatorStep::none) return;
  if (step == OperatorStep::reset_if_only_the_stop_blocks) {
    const auto refused = processes_.ask(OperatorVerb::arm);  // names everything that blocks
    if (!refused || sentences_of(*refused).size() != 1) return;
  }
  const OperatorVerb verb = step == OperatorStep::arm ? OperatorVerb::arm : OperatorVerb::reset;
  const auto reply = processes_.ask(verb);
  if (!reply || reply->done == 0) return;
  display_.note(verb == OperatorVerb::arm ? "armed again" : "the stop was reset");
  events_.note("request", {{"given", "--rearm-after"}, {"action", verb == OperatorVerb::arm ? "arm" : "reset"}});
}

Supervisor::Outcome Supervisor::pause(Duration until) {
  const std::int64_t wait_ns = std::max<std::int64_t>(0, (until - now()).ns);
  const timespec timeout{.tv_sec = wait_ns / seconds(1).ns, .tv_nsec = wait_ns % seconds(1).ns};
  pollfd waiting{.fd = signals_, .events = POLLIN, .revents = 0};
  if (ppoll(&waiting, 1, &timeout, nullptr) <= 0) return {};
  signalfd_siginfo signal{};
  while (read(signals_, &signal, sizeof signal) == static_cast<ssize_t>(sizeof signal))
    if (signal.ssi_signo != SIGCHLD)
      return std::unexpected(
          End{kExitOk, fmt::format("SIG{}: ending", sigabbrev_np(static_cast<int>(signal.ssi_signo)))});
  return {};
}

}  // namespace takt::cli
