// SPDX-License-Identifier: Apache-2.0
// Goal: what a session's OTLP metrics say they count since is what they count. Method: a virtual robot runs on while
// one session's exporter ends and another's begins, whose first ticks are history from the rings; the files are read
// back.
#include "monitor/telemetry/otlp_exporter.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/monitor/record/virtual_robot.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

using Json = nlohmann::json;

class OtlpSessions : public test::TemporaryFolder {
 protected:
  OtlpSessions() { config_.otlp = config::Otlp{true, "", milliseconds(100)}; }

  OtlpExporter begin(const std::string& folder, MonoTime now) {
    std::filesystem::create_directories(path(folder));
    auto exporter =
        OtlpExporter::start(config_, {"virtual", folder, "ab", "1", 0}, path(folder), 1U << 30U, nullptr, now);
    if (!exporter) throw std::runtime_error(exporter.error());
    return std::move(*exporter);
  }
  void run(OtlpExporter& exporter, int ticks) {
    for (int tick = 0; tick < ticks; ++tick) {
      robot_.run(1);
      exporter.tick(robot_.latest());
      exporter.export_if_due(robot_.latest().header.now);
    }
  }
  [[nodiscard]] MonoTime now() const { return robot_.latest().header.now; }
  // Metric by name, of each export in order.
  std::vector<std::map<std::string, Json>> exports_of(const std::string& folder) {
    std::vector<std::map<std::string, Json>> exports;
    std::ifstream file(path(folder) + "/otlp_metrics.jsonl");
    for (std::string line; std::getline(file, line);) {
      auto& metrics = exports.emplace_back();
      const Json request = Json::parse(line);
      for (const Json& metric : request.at("resourceMetrics").at(0).at("scopeMetrics").at(0).at("metrics"))
        metrics[metric.at("name")] = metric;
    }
    return exports;
  }
  static int modes_in(const Json& metric) {
    int modes = 0;
    for (const Json& point : metric["gauge"]["dataPoints"]) modes += point["asInt"] == "1" ? 1 : 0;
    return modes;
  }

  config::RobotConfig config_ = demo_robot();
  VirtualRobot robot_;
};

TEST_F(OtlpSessions, SumsBeginWithTheSession) {
  OtlpExporter first = begin("first", MonoTime{1});
  run(first, 700);
  first.finish(now());
  std::vector<TickRecord> history;
  for (int tick = 0; tick < 40; ++tick) {
    robot_.run(1);
    history.push_back(robot_.latest());
  }
  const MonoTime attached = now() + Duration{1};
  OtlpExporter second = begin("second", attached);
  for (const TickRecord& record : history) second.tick(record);
  run(second, 300);
  second.finish(now());

  const Json ticks = exports_of("second").back().at("takt.ticks")["sum"]["dataPoints"][0];
  EXPECT_EQ(ticks["startTimeUnixNano"], std::to_string(attached.ns));
  EXPECT_EQ(ticks["asInt"], "300");
  const Json lateness = exports_of("second").back().at("takt.wakeup.lateness")["histogram"]["dataPoints"][0];
  EXPECT_EQ(lateness["count"], "300");
  EXPECT_EQ(exports_of("first").back().at("takt.ticks")["sum"]["dataPoints"][0]["asInt"], "700");
}

TEST_F(OtlpSessions, AnExecutiveThatRunsIsInOneModeAndOneThatEndedInNone) {
  OtlpExporter exporter = begin("run", MonoTime{1});
  run(exporter, 300);
  exporter.finish(now());
  const auto exports = exports_of("run");
  ASSERT_GT(exports.size(), 1U);
  EXPECT_EQ(modes_in(exports.front().at("takt.mode")), 1);
  EXPECT_EQ(modes_in(exports.back().at("takt.mode")), 0);
}

}  // namespace
}  // namespace takt::monitor
