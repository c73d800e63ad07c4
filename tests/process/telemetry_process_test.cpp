// SPDX-License-Identifier: Apache-2.0
// Goal: Prometheus and OpenTelemetry are told what the robot did. Method: a robot of real processes with `prometheus`
// and `otlp` sections on free ports of loopback; Debian's Prometheus server scrapes it with the rules that are shipped;
// a receiver in this test takes OTLP/HTTP; every command's spans are compared with the run folder's record of its first
// use, to the nanosecond.
#include <gtest/gtest.h>
#include <httplib.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "monitor/record/recorded_run.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/support/files.hpp"
#include "tests/support/replaced.hpp"

namespace takt::test {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

int free_port() {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  EXPECT_EQ(bind(socket, reinterpret_cast<sockaddr*>(&address), size), 0);
  EXPECT_EQ(getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size), 0);
  close(socket);
  return ntohs(address.sin_port);
}

bool until(const std::function<bool()>& holds) {
  for (int poll = 0; poll < 1500; ++poll) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return holds();
}

std::string get(int port, const std::string& path) {
  const auto result = httplib::Client("127.0.0.1", port).Get(path);
  return result && result->status == 200 ? result->body : "";
}

class TelemetryTest : public testing::Test {
 protected:
  TelemetryTest() {
    receiver_.Post("/v1/traces", [this](const httplib::Request& request, httplib::Response&) {
      const std::lock_guard lock(mutex_);
      posted_traces_ += request.body + "\n";
    });
    receiver_.Post("/v1/metrics", [this](const httplib::Request& request, httplib::Response&) {
      const std::lock_guard lock(mutex_);
      posted_metrics_ += request.body + "\n";
    });
    otlp_port_ = receiver_.bind_to_any_port("127.0.0.1");
    receiving_ = std::thread([this] { receiver_.listen_after_bind(); });
    while (!receiver_.is_running()) std::this_thread::yield();
    write_robot_file();
  }
  ~TelemetryTest() override {
    policy_.reset();
    robot_.reset();
    receiver_.stop();
    receiving_.join();
    std::error_code ignored;
    fs::remove(file_, ignored);
  }

  void start() {
    robot_.emplace("", file_);
    policy_.emplace(robot_->start_policy_host());
    ASSERT_EQ(robot_->arm(), "") << robot_->logs();
    ASSERT_TRUE(robot_->wait_for_mode(Mode::tracking)) << robot_->logs();
  }

  std::string name_ = "arm6-telemetry-" + std::to_string(getpid()), file_;
  int metrics_port_ = free_port(), otlp_port_ = 0;
  httplib::Server receiver_;
  std::mutex mutex_;
  std::string posted_traces_, posted_metrics_;  // guarded
  std::thread receiving_;
  std::optional<RunningRobot> robot_;
  std::optional<Child> policy_;

 private:
  // config/arm6.yaml under a name of its own, with both sections.
  void write_robot_file() {
    std::string text = replaced(text_of("config/arm6.yaml"), "robot: arm6", "robot: " + name_);
    text = replaced(text, "file: arm6_reach.onnx", "file: " + (fs::current_path() / "config/arm6_reach.onnx").string());
    text += "\nprometheus: { port: " + std::to_string(metrics_port_) +
            " }\notlp: { endpoint: \"http://127.0.0.1:" + std::to_string(otlp_port_) + "\", metrics_period: 500 ms }\n";
    file_ = testing::TempDir() + name_ + ".yaml";
    std::ofstream(file_) << text;
  }
};

// The newest sample of that name; -1 when there is none.
double sample(const std::string& text, const std::string& begin) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with(begin)) return std::stod(line.substr(line.rfind(' ') + 1));
  return -1;
}

TEST_F(TelemetryTest, PrometheusScrapesARunningRobot) {
  if (std::system("command -v prometheus >/dev/null") != 0)
    GTEST_SKIP() << "prometheus is not installed: NO SCRAPE WAS TESTED";
  start();
  const std::string folder = robot_->directory() + "/prometheus";
  fs::create_directory(folder);
  const int port = free_port();
  std::ofstream(folder + "/prometheus.yml")
      << "global: { scrape_interval: 1s, evaluation_interval: 1s }\nrule_files: [" << fs::current_path().string()
      << "/config/prometheus/takt.rules.yaml]\n"
      << "scrape_configs:\n  - job_name: takt\n    static_configs: [{ targets: ['127.0.0.1:" << metrics_port_
      << "'] }]\n";
  Child server({"/usr/bin/prometheus", "--config.file=" + folder + "/prometheus.yml",
                "--storage.tsdb.path=" + folder + "/data", "--web.listen-address=127.0.0.1:" + std::to_string(port)},
               folder + "/log");
  const auto ask = [&](const std::string& query) {
    const auto result = httplib::Client("127.0.0.1", port).Post("/api/v1/query", httplib::Params{{"query", query}});
    const Json answer = Json::parse(result ? result->body : "", nullptr, false);
    if (answer.is_discarded() || answer["status"] != "success" || answer["data"]["result"].empty()) return -1.0;
    return std::stod(answer["data"]["result"][0]["value"][1].get<std::string>());
  };
  EXPECT_TRUE(until([&] { return ask("takt_ticks_total{robot=\"" + name_ + "\"}") > 1000; })) << robot_->logs();
  EXPECT_EQ(ask("up"), 1);
  EXPECT_EQ(ask("takt_up"), 1);
  EXPECT_EQ(ask("takt_mode{mode=\"tracking\"}"), 1);
  EXPECT_TRUE(until([&] { return ask("takt:command_age_seconds:p95") > 0; })) << "the shipped rules evaluate";
  EXPECT_LT(ask("takt:command_age_seconds:p95"), 1);
}

TEST_F(TelemetryTest, WhatIsScrapedIsWhatWasRecorded) {
  start();
  const auto ticks = [this] { return robot_->status().value().status.ticks; };
  const std::uint64_t enough = ticks() + 1000;
  ASSERT_TRUE(until([&] { return ticks() >= enough; }));
  ASSERT_TRUE(robot_->executive().pid() > 0);
  robot_->executive().signal(SIGTERM);
  std::string text;
  ASSERT_TRUE(until([&] {
    text = get(metrics_port_, "/metrics");
    return sample(text, "takt_up{") == 0;
  })) << robot_->logs();
  ASSERT_TRUE(robot_->finish()) << robot_->logs();
  std::ifstream file(robot_->run_directory() + "/metrics.json");
  const Json metrics = Json::parse(file);
  EXPECT_EQ(sample(text, "takt_ticks_total{"), metrics.at("ticks").at("recorded").get<double>());
  EXPECT_EQ(get(metrics_port_, "/metrics"), "") << "the port is free again";
}

// The monitor's files may not grow any more, as on a disk that is full: Prometheus hears of it, and the robot
// stops.
TEST_F(TelemetryTest, PrometheusHearsThatRecordingStopped) {
  start();
  const std::string unrecorded =
      "takt_record_losses_total{robot=\"" + name_ + "\",ring=\"tick\",reason=\"recording_stopped\"}";
  std::string text;
  const auto scrape = [&] { return text = get(metrics_port_, "/metrics"); };
  ASSERT_TRUE(until([&] { return sample(scrape(), "takt_up{") == 1; })) << robot_->logs();
  EXPECT_EQ(sample(text, unrecorded), 0);
  const rlimit none{1, 1};
  ASSERT_EQ(prlimit(robot_->monitor().pid(), RLIMIT_FSIZE, &none, nullptr), 0);
  EXPECT_TRUE(until([&] { return sample(scrape(), unrecorded) > 0; })) << robot_->logs();
  EXPECT_EQ(sample(text, "takt_up{"), 0);
  const std::string stopped = "takt_mode{robot=\"" + name_ + "\",mode=\"damped_stop\"}";
  EXPECT_TRUE(until([&] { return sample(scrape(), stopped) == 1; })) << text;
  EXPECT_FALSE(robot_->finish()) << "the monitor ends with 1";
}

std::vector<Json> spans_of(const std::string& lines, const std::string& name) {
  std::vector<Json> spans;
  std::istringstream requests(lines);
  for (std::string line; std::getline(requests, line);) {
    const Json request = Json::parse(line);
    for (const Json& resource : request.at("resourceSpans"))
      for (const Json& span : resource.at("scopeSpans").at(0).at("spans"))
        if (span.at("name") == name) spans.push_back(span);
  }
  return spans;
}

std::int64_t attribute(const Json& span, const std::string& key) {
  for (const Json& attribute : span.at("attributes"))
    if (attribute.at("key") == key) return std::stoll(attribute.at("value").at("intValue").get<std::string>());
  return -1;
}

TEST_F(TelemetryTest, OpenTelemetryIsToldTheRecordedAges) {
  start();
  ASSERT_TRUE(until([&] {
    const std::lock_guard lock(mutex_);
    return spans_of(posted_traces_, "command").size() > 50 && !posted_metrics_.empty();
  })) << robot_->logs();
  policy_->signal(SIGTERM);
  ASSERT_TRUE(robot_->finish()) << robot_->logs();

  const std::string written = text_of(robot_->run_directory() + "/otlp_traces.jsonl");
  {
    const std::lock_guard lock(mutex_);
    EXPECT_EQ(posted_traces_, written) << "the file and the receiver get the same";
  }
  const auto run = monitor::open_run(robot_->run_directory());
  ASSERT_TRUE(run.has_value()) << run.error();
  const auto commands = spans_of(written, "command");
  ASSERT_FALSE(commands.empty());
  const std::int64_t begin = attribute(commands.front(), "takt.tick");  // ticks before the monitor came are history
  std::map<std::int64_t, TickRecordHeader> by_tick;
  std::size_t messages = 0;
  const auto scan = monitor::scan_run(*run, {.tick =
                                                 [&](const monitor::RecordedTick& tick) {
                                                   const TickRecordHeader& header = tick.record.header;
                                                   const auto number = static_cast<std::int64_t>(header.tick);
                                                   by_tick[number] = header;
                                                   const bool is_read =
                                                       header.seats[Seat::policy].arrival == Arrival::accepted ||
                                                       is_refusal(header.seats[Seat::policy].arrival);
                                                   messages += number >= begin && is_read ? 1U : 0U;
                                                 },
                                             .command = {},
                                             .keyframe = {},
                                             .loss = {}});
  ASSERT_TRUE(scan.has_value()) << scan.error();
  EXPECT_EQ(commands.size(), messages);
  for (const Json& span : commands) {
    const auto found = by_tick.find(attribute(span, "takt.tick"));
    ASSERT_NE(found, by_tick.end());
    const TickRecordHeader& header = found->second;
    // On a busy machine an answer to what was published before the robot armed may come, and is refused.
    EXPECT_EQ(span.contains("status"), is_refusal(header.seats[Seat::policy].arrival));
    if (span.contains("status")) {
      EXPECT_EQ(span.at("status").at("message"), "refused: " + std::string(name(header.seats[Seat::policy].arrival)));
      continue;
    }
    EXPECT_EQ(attribute(span, "takt.sequence"), static_cast<std::int64_t>(header.seats[Seat::policy].command_sequence));
    EXPECT_EQ(attribute(span, "takt.age_ns"), header.age.total().ns);
    EXPECT_EQ(std::stoll(span.at("startTimeUnixNano").get<std::string>()),
              (header.now - header.age.total()).ns + run->manifest.clock.monotonic_to_unix_ns);
  }
}

}  // namespace
}  // namespace takt::test
