// SPDX-License-Identifier: Apache-2.0
// Goal: the JSON is OTLP's, and tells one trace per command whose spans add up. Method: constructed traces and a
// virtual robot's metrics are read back; OpenTelemetry's own message definitions judge the format in node_otlp_check.
#include "monitor/telemetry/otlp_json.hpp"

#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "tests/monitor/record/virtual_robot.hpp"

namespace takt::monitor {
namespace {

using Json = nlohmann::json;

constexpr MonoTime kNow{1'000'000'000};
const OtlpSource kSource{"arm6", "20261121T093300Z-arm6-3f9a2c", "ab", "1", 5'000'000'000};

CommandTrace trace_of(std::uint64_t sequence, std::uint64_t observation) {
  CommandTrace trace;
  trace.sequence = sequence;
  trace.observation = observation;
  trace.policy_session = 1;
  trace.sensed_at = kNow;
  trace.observed_at = kNow + milliseconds(3);
  trace.infer_began_at = kNow + milliseconds(5);
  trace.infer_ended_at = kNow + milliseconds(13);
  trace.consumed_at = kNow + milliseconds(14);
  trace.actuating_at = trace.consumed_at + microseconds(30);
  trace.actuated_at = trace.consumed_at + microseconds(50);
  return trace;
}

std::vector<Json> spans_of(const Json& request) {
  std::vector<Json> spans;
  for (const Json& resource : request.at("resourceSpans"))
    for (const Json& scope : resource.at("scopeSpans"))
      for (const Json& span : scope.at("spans")) spans.push_back(span);
  return spans;
}

std::int64_t instant(const Json& span, const char* which) {
  return std::stoll(span.at(which).get<std::string>());  // text, as OTLP wants it
}

TEST(OtlpTraces, TheStagesOfACommandFollowOneAnother) {
  const CommandTrace trace = trace_of(7, 5);
  std::map<std::string, Json> by_name;
  for (const Json& span : spans_of(Json::parse(otlp_traces(kSource, std::span(&trace, 1)))))
    by_name[span.at("name")] = span;
  const Json& root = by_name.at("command");
  EXPECT_EQ(instant(root, "startTimeUnixNano"), kNow.ns + kSource.monotonic_to_unix_ns);
  EXPECT_EQ(root.at("traceId").get<std::string>().size(), 32U);
  EXPECT_EQ(root.at("spanId").get<std::string>().size(), 16U);
  std::int64_t at = instant(root, "startTimeUnixNano");
  for (const char* stage : {"sense", "queue", "infer", "publish", "consume", "actuate"}) {
    const Json& span = by_name.at(stage);
    EXPECT_EQ(span.at("traceId"), root.at("traceId"));
    EXPECT_EQ(span.at("parentSpanId"), root.at("spanId"));
    EXPECT_EQ(instant(span, "startTimeUnixNano"), at) << stage;
    at = instant(span, "endTimeUnixNano");
  }
  EXPECT_EQ(at, instant(root, "endTimeUnixNano"));
  EXPECT_EQ(root.at("links").at(0).at("traceId"), by_name.at("observation").at("traceId"));
  EXPECT_EQ(root.at("links").at(0).at("spanId"), by_name.at("observation").at("spanId"));
  EXPECT_NE(by_name.at("observation").at("traceId"), root.at("traceId"));
}

TEST(OtlpTraces, NoTwoSpansShareAnId) {
  std::vector<CommandTrace> traces;
  for (std::uint64_t i = 1; i <= 1000; ++i) traces.push_back(trace_of(i, 1 + i / 2));
  std::set<std::string> spans, roots;
  std::size_t observations = 0;
  for (const Json& span : spans_of(Json::parse(otlp_traces(kSource, traces)))) {
    EXPECT_TRUE(spans.insert(span.at("traceId").get<std::string>() + span.at("spanId").get<std::string>()).second);
    if (span.at("name") == "command") roots.insert(span.at("traceId"));
    if (span.at("name") == "observation") ++observations;
  }
  EXPECT_EQ(roots.size(), 1000U);
  EXPECT_EQ(observations, 501U) << "one span per observation, however many commands answer it";
}

TEST(OtlpMetrics, AHistogramHasOneCountMoreThanBounds) {
  LiveMetrics metrics(demo_robot());
  metrics.begin("run");
  VirtualRobot robot;
  robot.run(300);
  metrics.tick(robot.latest());
  const Json request =
      Json::parse(otlp_metrics(kSource, metric_families(metrics, demo_robot()), kNow, kNow + seconds(10)));
  std::size_t histograms = 0, sums = 0;
  for (const Json& metric : request.at("resourceMetrics").at(0).at("scopeMetrics").at(0).at("metrics")) {
    EXPECT_FALSE(metric.at("description").get<std::string>().empty());
    sums += metric.contains("sum") ? 1U : 0U;
    if (!metric.contains("histogram")) continue;
    for (const Json& point : metric.at("histogram").at("dataPoints")) {
      ++histograms;
      EXPECT_EQ(point.at("bucketCounts").size(), point.at("explicitBounds").size() + 1);
      std::uint64_t sum = 0;
      for (const Json& count : point.at("bucketCounts")) sum += std::stoull(count.get<std::string>());
      EXPECT_EQ(std::to_string(sum), point.at("count").get<std::string>());
      EXPECT_EQ(point.at("startTimeUnixNano"), std::to_string(kNow.ns + kSource.monotonic_to_unix_ns));
    }
  }
  EXPECT_EQ(histograms, 4 + kAgeStageCount + demo_robot().buses.size());
  EXPECT_GE(sums, 5U);
}

// Goal: what Prometheus is told, OTLP is told too, under a name each. Method: the families of one robot; of two no name
// is the same; OTLP's request has each that has something to say.
TEST(OtlpMetrics, SaysWhatPrometheusIsTold) {
  LiveMetrics metrics(demo_robot());
  metrics.begin("run");
  VirtualRobot robot;
  robot.run(300);
  metrics.tick(robot.latest());
  metrics.loss({"tick", "overwritten", 3, 1, 5});
  const auto families = metric_families(metrics, demo_robot());
  const Json request = Json::parse(otlp_metrics(kSource, families, kNow, kNow + seconds(10)));
  std::set<std::string> told;
  for (const Json& metric : request.at("resourceMetrics").at(0).at("scopeMetrics").at(0).at("metrics"))
    told.insert(metric.at("name"));
  std::set<std::string_view> names, prometheus;
  for (const MetricFamily& family : families) {
    EXPECT_TRUE(names.insert(family.name).second) << family.name;
    EXPECT_TRUE(prometheus.insert(family.prometheus).second) << family.prometheus;
  }
  EXPECT_GE(told.size(), 25U);
  for (const char* name : {"takt.record.losses", "takt.joint.temperature", "takt.bus.state", "takt.mode", "takt.ticks"})
    EXPECT_TRUE(told.contains(name)) << name;
  EXPECT_FALSE(told.contains("takt.candidate.in_charge")) << "there was none";
}

}  // namespace
}  // namespace takt::monitor
