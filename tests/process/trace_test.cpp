// SPDX-License-Identifier: Apache-2.0
// Goal: a trace tells the same story as the run folder. Method: a robot of real processes that is tracking already is
// traced for two seconds by `takt trace` and read back by babeltrace2; then every tick must be there, with the age and
// the command that the monitor recorded, and every command whose answering was traced must pair up across processes.
// A trace has begun only when every running process is in it, also after a session daemon that was killed, which leaves
// processes to look for the next one every five seconds. A session daemon that was not there before is ended again.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "monitor/record/recorded_run.hpp"
#include "tests/process/running_robot.hpp"

namespace takt::test {
namespace {

constexpr std::uint64_t kTracedTicks = 2000;

struct Event {
  std::string name;
  std::map<std::string, std::string, std::less<>> fields;
  [[nodiscard]] std::int64_t number(std::string_view field) const {
    const auto found = fields.find(field);
    return found == fields.end() ? -1 : std::stoll(found->second);
  }
};

std::string output_of(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  std::string all;
  char part[4096];
  while (const std::size_t size = fread(part, 1, sizeof part, pipe.get())) all.append(part, size);
  return all;
}

bool installed(const std::string& program) {
  return !output_of("command -v " + program).empty();
}

// A line of babeltrace2: "[time] (+delta) host takt:NAME: { cpu_id = 0 }, { vpid = 7 }, { tick = 5, age_ns = 12 }".
Event parse(const std::string& line) {
  constexpr std::string_view kProvider = " takt:";
  Event event;
  const std::size_t name = line.find(kProvider);
  if (name == std::string::npos) return event;
  const std::size_t name_end = line.find(": {", name);
  event.name = line.substr(name + kProvider.size(), name_end - name - kProvider.size());
  std::istringstream words(line.substr(name_end + 2));
  std::string word, before, field;
  while (words >> word) {
    if (before == "=") event.fields[field] = word.ends_with(',') ? word.substr(0, word.size() - 1) : word;
    if (word == "=") field = before;
    before = word;
  }
  return event;
}

// Of these processes only: a session daemon traces every robot of the machine.
std::map<std::string, std::vector<Event>> read_trace(const std::string& directory, const std::set<pid_t>& of) {
  std::map<std::string, std::vector<Event>> events;
  std::istringstream lines(output_of("babeltrace2 '" + directory + "' 2>&1"));
  for (std::string line; std::getline(lines, line);) {
    Event event = parse(line);
    if (!event.name.empty() && of.contains(static_cast<pid_t>(event.number("vpid"))))
      events[event.name].push_back(std::move(event));
  }
  return events;
}

// The daemon that a trace leaves behind, by the file it names itself in.
pid_t session_daemon() {
  const char* const home = std::getenv("HOME");
  const std::string directory = geteuid() == 0 ? "/var/run/lttng" : std::string(home ? home : "") + "/.lttng";
  pid_t pid = 0;
  std::ifstream(directory + "/lttng-sessiond.pid") >> pid;
  return pid > 0 && kill(pid, 0) == 0 ? pid : 0;
}

void end_session_daemon(int signal) {
  const pid_t daemon = session_daemon();
  if (daemon == 0) return;
  kill(daemon, signal);
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (kill(daemon, 0) == 0 && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

class TraceTest : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* program : {"lttng", "lttng-sessiond", "babeltrace2"}) {
      if (!installed(program)) GTEST_SKIP() << program << " is not installed: NO TRACE WAS TESTED";
    }
    daemon_was_there_ = session_daemon() != 0;
  }
  ~TraceTest() override {
    if (!daemon_was_there_) end_session_daemon(SIGTERM);
  }
  // What a daemon leaves behind that had no time to say goodbye.
  void kill_a_session_daemon() const {
    if (daemon_was_there_) return;
    (void)output_of("lttng-sessiond --daemonize --no-kernel 2>&1");
    end_session_daemon(SIGKILL);
  }
  static int takt(const RunningRobot& robot, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "takt");
    return Child(std::move(arguments), robot.directory() + "/takt.log").wait(std::chrono::seconds(30)).value_or(-1);
  }
  // What the review printed; it must have exited with 0.
  static nlohmann::json review_of(const RunningRobot& robot, std::vector<std::string> arguments) {
    const std::string printed = robot.directory() + "/review.json";
    arguments.insert(arguments.begin(), "takt");
    EXPECT_EQ(Child(std::move(arguments), printed).wait(std::chrono::seconds(30)), 0);
    return nlohmann::json::parse(std::ifstream(printed), nullptr, false);
  }
  static void expect_consecutive(const std::vector<Event>& events) {
    ASSERT_GT(events.size(), kTracedTicks / 2);
    for (std::size_t i = 1; i < events.size(); ++i) {
      ASSERT_EQ(events[i].number("tick"), events[i - 1].number("tick") + 1) << "at event " << i;
    }
  }
  static void expect_ages_as_recorded(const std::map<std::string, std::vector<Event>>& trace,
                                      const std::string& run_directory) {
    std::map<std::int64_t, TickRecordHeader> records;
    const auto run = monitor::open_run(run_directory);
    ASSERT_TRUE(run.has_value()) << run.error();
    const auto scan = monitor::scan_run(*run, {.tick =
                                                   [&](const monitor::RecordedTick& tick) {
                                                     const TickRecordHeader& header = tick.record.header;
                                                     records[static_cast<std::int64_t>(header.tick)] = header;
                                                   },
                                               .command = {},
                                               .keyframe = {},
                                               .loss = {}});
    ASSERT_TRUE(scan.has_value()) << scan.error();
    for (const Event& end : trace.at("tick_end")) {
      const auto record = records.find(end.number("tick"));
      ASSERT_NE(record, records.end()) << end.number("tick");
      EXPECT_EQ(end.number("age_ns"), record->second.age.total().ns);
      EXPECT_EQ(end.number("sequence"), static_cast<std::int64_t>(record->second.seats[Seat::policy].command_sequence));
      EXPECT_EQ(end.number("mode"), static_cast<std::int64_t>(record->second.mode));
    }
    for (const Event& consumed : trace.at("command_consumed")) {
      const AgeParts& age = records.at(consumed.number("tick")).age;
      EXPECT_EQ(consumed.number("sense_ns"), age.sense.ns);
      EXPECT_EQ(consumed.number("queue_ns"), age.queue.ns);
      EXPECT_EQ(consumed.number("infer_ns"), age.infer.ns);
      EXPECT_EQ(consumed.number("publish_ns"), age.publish.ns);
      EXPECT_EQ(consumed.number("hold_ns"), age.hold.ns);
    }
  }

 private:
  bool daemon_was_there_ = false;
};

TEST_F(TraceTest, TellsTheSameStoryAsTheRunFolder) {
  kill_a_session_daemon();
  RunningRobot robot;
  Child policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();

  const std::string directory = robot.directory() + "/trace";
  ASSERT_EQ(takt(robot, {"trace", "start", "--output", directory}), 0) << robot.logs();
  EXPECT_EQ(takt(robot, {"trace", "start"}), 1) << "a second trace must be refused";
  const std::uint64_t until = robot.status().value().status.ticks + kTracedTicks;
  robot.wait_until([until](const StatusSnapshot& status) { return status.ticks >= until; });
  EXPECT_EQ(takt(robot, {"trace", "stop"}), 0) << robot.logs();
  EXPECT_EQ(takt(robot, {"trace", "stop"}), 69) << "no trace runs any more";
  const std::set<pid_t> robot_processes{robot.executive().pid(), robot.monitor().pid(), policy.pid()};
  policy.signal(SIGTERM);
  EXPECT_EQ(policy.wait(std::chrono::seconds(20)), 0);
  ASSERT_TRUE(robot.finish()) << robot.logs();

  const auto trace = read_trace(directory, robot_processes);
  for (const char* name :
       {"init", "tick_begin", "tick_end", "command_consumed", "observation_published", "dequeue_begin", "dequeue_end",
        "infer_begin", "infer_end", "publish_begin", "publish_end", "drain_begin", "drain_end"}) {
    ASSERT_TRUE(trace.contains(name)) << "no event " << name << " in the trace";
  }
  expect_consecutive(trace.at("tick_begin"));
  expect_consecutive(trace.at("tick_end"));
  expect_ages_as_recorded(trace, robot.run_directory());

  std::set<std::string> processes;
  for (const Event& init : trace.at("init")) processes.insert(init.fields.at("process"));
  EXPECT_EQ(processes, (std::set<std::string>{"\"takt-executive\"", "\"takt-monitor\"", "\"takt-policy-host\""}));

  std::map<std::int64_t, std::int64_t> observation_of;  // by sequence, as the policy host published it
  for (const Event& published : trace.at("publish_end")) {
    observation_of[published.number("sequence")] = published.number("observation_id");
  }
  std::size_t paired = 0;
  for (const Event& consumed : trace.at("command_consumed")) {
    const auto published = observation_of.find(consumed.number("sequence"));
    if (published == observation_of.end()) continue;  // published before the trace began
    EXPECT_EQ(consumed.number("observation_id"), published->second);
    ++paired;
  }
  EXPECT_GT(paired, 50U) << "two seconds of a 50 Hz policy";
}

TEST_F(TraceTest, AFlightRecorderWritesOnlyWhenAsked) {
  RunningRobot robot;
  const std::string directory = robot.directory() + "/flight";
  ASSERT_EQ(takt(robot, {"trace", "start", "--flight-recorder", "--output", directory}), 0) << robot.logs();
  robot.let_run(kTracedTicks);
  const std::set<pid_t> executive{robot.executive().pid()};
  EXPECT_TRUE(read_trace(directory, executive).empty());
  EXPECT_EQ(takt(robot, {"trace", "snapshot"}), 0) << robot.logs();
  EXPECT_EQ(takt(robot, {"trace", "stop"}), 0) << robot.logs();
  expect_consecutive(read_trace(directory, executive)["tick_end"]);
  EXPECT_NE(robot.logs().find("snapshot in " + directory), std::string::npos) << robot.logs();
}

TEST_F(TraceTest, TheReviewFindsTheRecordsAgesInTheTrace) {
  RunningRobot robot;
  Child policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  const std::string directory = robot.directory() + "/trace";
  ASSERT_EQ(takt(robot, {"trace", "start", "--output", directory}), 0) << robot.logs();
  const std::uint64_t until = robot.status().value().status.ticks + kTracedTicks;
  robot.wait_until([until](const StatusSnapshot& status) { return status.ticks >= until; });
  EXPECT_EQ(takt(robot, {"trace", "stop"}), 0) << robot.logs();
  policy.signal(SIGTERM);
  EXPECT_EQ(policy.wait(std::chrono::seconds(20)), 0);
  ASSERT_TRUE(robot.finish()) << robot.logs();

  const std::string perfetto = robot.directory() + "/trace.json";
  const nlohmann::json review = review_of(
      robot, {"trace", "review", directory, "--run", robot.run_directory(), "--perfetto", perfetto, "--json"});
  const nlohmann::json& records = review.at("records");
  EXPECT_TRUE(records.at("agree").get<bool>()) << records.dump();
  EXPECT_GT(records.at("ages").get<std::uint64_t>(), kTracedTicks / 2);
  EXPECT_GT(records.at("commands").get<std::uint64_t>(), 50U) << "two seconds of a 50 Hz policy";
  EXPECT_EQ(records.at("unrecorded_ticks"), 0);
  EXPECT_TRUE(review.at("losses").empty()) << review.at("losses").dump();
  for (const char* stage : {"sense", "queue", "infer", "publish", "consume", "actuate", "total", "tick", "drain"})
    EXPECT_GT(review.at("latency").at(stage).at("count"), 50) << stage;
  EXPECT_EQ(review.at("worst").size(), 10U);
  const nlohmann::json drawn = nlohmann::json::parse(std::ifstream(perfetto));
  EXPECT_GT(std::ranges::count_if(drawn.at("traceEvents"), [](const auto& event) { return event.at("ph") == "f"; }),
            50);

  RunningRobot other;  // of another session: nothing to compare
  other.wait_until([](const StatusSnapshot& status) { return status.ticks > 100; });
  ASSERT_TRUE(other.finish()) << other.logs();
  EXPECT_EQ(takt(robot, {"trace", "review", directory, "--run", other.run_directory()}), 1);
  EXPECT_EQ(takt(robot, {"trace", "review", robot.run_directory()}), 1) << "a run folder is not a trace";
}

TEST_F(TraceTest, AFlightRecorderWritesWhenARobotLeavesTracking) {
  RunningRobot robot;
  Child policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  const std::string directory = robot.directory() + "/flight";
  EXPECT_EQ(takt(robot, {"trace", "start", "--snapshot-on-leaving-tracking"}), 64)
      << "only a flight recorder remembers";
  ASSERT_EQ(
      takt(robot, {"trace", "start", "--flight-recorder", "--snapshot-on-leaving-tracking", "--output", directory}), 0)
      << robot.logs();
  const std::uint64_t until = robot.status().value().status.ticks + kTracedTicks;
  robot.wait_until([until](const StatusSnapshot& status) { return status.ticks >= until; });
  EXPECT_TRUE(read_trace(directory, {robot.executive().pid()}).empty()) << "still tracking";

  policy.signal(SIGKILL);
  ASSERT_TRUE(robot.wait_for_mode(Mode::damped_stop)) << robot.logs();
  robot.wait_until([&directory](const StatusSnapshot&) { return std::filesystem::exists(directory); });
  EXPECT_EQ(takt(robot, {"trace", "stop"}), 0) << robot.logs();
  EXPECT_EQ(output_of("lttng --no-sessiond list-triggers 2>&1").find("takt-left-tracking"), std::string::npos);
  ASSERT_TRUE(robot.finish()) << robot.logs();
  const nlohmann::json review =
      review_of(robot, {"trace", "review", directory, "--run", robot.run_directory(), "--json"});
  EXPECT_GT(review.at("records").at("ticks").get<std::uint64_t>(), kTracedTicks / 2);
  EXPECT_TRUE(review.at("records").at("agree").get<bool>()) << review.dump();
}

}  // namespace
}  // namespace takt::test
