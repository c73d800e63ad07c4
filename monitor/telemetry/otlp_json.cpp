// SPDX-License-Identifier: Apache-2.0
#include "monitor/telemetry/otlp_json.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

namespace takt::monitor {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kInternal = 1;                           // SPAN_KIND_INTERNAL
constexpr int kStatusError = 2;                        // STATUS_CODE_ERROR
constexpr int kSeverityInfo = 9, kSeverityError = 17;  // SEVERITY_NUMBER_INFO, SEVERITY_NUMBER_ERROR
constexpr int kCumulative = 2;                         // AGGREGATION_TEMPORALITY_CUMULATIVE

// OTLP's JSON has 64-bit integers as text.
Json integer(std::uint64_t value) {
  return fmt::format("{}", value);
}

Json attribute(std::string_view key, std::string_view value) {
  return {{"key", key}, {"value", {{"stringValue", value}}}};
}

Json attribute(std::string_view key, std::uint64_t value) {
  return {{"key", key}, {"value", {{"intValue", integer(value)}}}};
}

Json resource(const OtlpSource& source, std::string_view service) {
  return {{"attributes",
           {attribute("service.name", service), attribute("service.namespace", "takt"),
            attribute("service.version", source.version), attribute("service.instance.id", source.run_id),
            attribute("takt.robot", source.robot), attribute("takt.config_sha256", source.config_sha256)}}};
}

Json scope(const OtlpSource& source) {
  return {{"name", "takt"}, {"version", source.version}};
}

// Vigna's splitmix64: spreads close numbers over all bits.
std::uint64_t mixed(std::uint64_t value) {
  value += 0x9E3779B97F4A7C15U;
  value = (value ^ (value >> 30U)) * 0xBF58476D1CE4E5B9U;
  value = (value ^ (value >> 27U)) * 0x94D049BB133111EBU;
  return value ^ (value >> 31U);
}

enum class Identified : std::uint64_t { command = 1, observation = 2, refusal = 3 };

struct TraceId {
  std::uint64_t high, low;
  [[nodiscard]] std::string text() const { return fmt::format("{:016x}{:016x}", high, low); }
  // `number` tells the spans of one trace apart.
  [[nodiscard]] std::string span(std::uint64_t number) const {
    const std::uint64_t id = mixed(low ^ mixed(number));
    return fmt::format("{:016x}", id != 0 ? id : 1);
  }
};

std::uint64_t mixed(std::string_view text) {
  std::uint64_t value = text.size();
  for (const char c : text) value = mixed(value ^ static_cast<unsigned char>(c));
  return value;
}

TraceId trace_id(const OtlpSource& source, Identified what, std::uint64_t session, std::uint64_t number) {
  const std::uint64_t run = mixed(source.run_id);
  return {run | 1U, mixed(mixed(run ^ static_cast<std::uint64_t>(what)) ^ mixed(session) ^ number)};
}

class SpanWriter {
 public:
  explicit SpanWriter(const OtlpSource& source) : source_(source) {}

  void write(const CommandTrace& trace) {
    if (trace.arrival != Arrival::accepted) return write_refused(trace);
    const TraceId id = trace_id(source_, Identified::command, trace.policy_session, trace.sequence);
    const TraceId observation = trace_id(source_, Identified::observation, 0, trace.observation);
    Json root = span(id, "command", trace.sensed_at, trace.actuated_at, 0);
    root["attributes"] =
        Json::array({attribute("takt.sequence", trace.sequence), attribute("takt.observation", trace.observation),
                     attribute("takt.tick", trace.tick), attribute("takt.mode", name(trace.mode)),
                     attribute("takt.age_ns", static_cast<std::uint64_t>((trace.consumed_at - trace.sensed_at).ns))});
    root["links"] = Json::array({{{"traceId", observation.text()}, {"spanId", observation.span(0)}}});
    executive_.push_back(std::move(root));
    executive_.push_back(child(id, "sense", trace.sensed_at, trace.observed_at, 1));
    policy_host_.push_back(child(id, "queue", trace.observed_at, trace.infer_began_at, 2));
    policy_host_.push_back(child(id, "infer", trace.infer_began_at, trace.infer_ended_at, 3));
    policy_host_.push_back(child(id, "publish", trace.infer_ended_at, trace.consumed_at, 4));
    executive_.push_back(child(id, "consume", trace.consumed_at, trace.actuating_at, 5));
    executive_.push_back(child(id, "actuate", trace.actuating_at, trace.actuated_at, 6));
    if (std::exchange(observation_, trace.observation) == trace.observation) return;
    Json seen = span(observation, "observation", trace.sensed_at, trace.observed_at, 0);
    seen["attributes"] = Json::array({attribute("takt.observation", trace.observation)});
    executive_.push_back(std::move(seen));
  }

  // By its tick: a refused command's number may be another's.
  void write_refused(const CommandTrace& trace) {
    Json root = span(trace_id(source_, Identified::refusal, trace.policy_session, trace.tick), "command",
                     trace.sensed_at, trace.actuated_at, 0);
    root["attributes"] =
        Json::array({attribute("takt.sequence", trace.sequence), attribute("takt.tick", trace.tick),
                     attribute("takt.mode", name(trace.mode)), attribute("takt.arrival", name(trace.arrival))});
    root["status"] = {{"code", kStatusError}, {"message", fmt::format("refused: {}", name(trace.arrival))}};
    executive_.push_back(std::move(root));
  }

  Json request() {
    return {{"resourceSpans", {spans_of("takt-executive", executive_), spans_of("takt-policy-host", policy_host_)}}};
  }

 private:
  [[nodiscard]] Json instant(MonoTime at) const { return fmt::format("{}", at.ns + source_.monotonic_to_unix_ns); }
  [[nodiscard]] Json span(const TraceId& id, std::string_view name, MonoTime from, MonoTime to,
                          std::uint64_t number) const {
    return {{"traceId", id.text()}, {"spanId", id.span(number)},          {"name", name},
            {"kind", kInternal},    {"startTimeUnixNano", instant(from)}, {"endTimeUnixNano", instant(to)}};
  }
  [[nodiscard]] Json child(const TraceId& id, std::string_view name, MonoTime from, MonoTime to,
                           std::uint64_t number) const {
    Json made = span(id, name, from, to, number);
    made["parentSpanId"] = id.span(0);
    return made;
  }
  Json spans_of(std::string_view service, Json& spans) {
    return {{"resource", resource(source_, service)},
            {"scopeSpans", {{{"scope", scope(source_)}, {"spans", std::move(spans)}}}}};
  }

  const OtlpSource& source_;
  Json executive_ = Json::array(), policy_host_ = Json::array();
  std::uint64_t observation_ = 0;
};

class MetricWriter {
 public:
  MetricWriter(std::int64_t since_unix_ns, std::int64_t now_unix_ns)
      : since_(fmt::format("{}", since_unix_ns)), now_(fmt::format("{}", now_unix_ns)) {}

  // A family without points is left out, and so is a count of 0 beside others: a sum says since when it counts.
  void write(const MetricFamily& family) {
    Json points = Json::array();
    for (const MetricSample& sample : family.samples)
      if (Json point = std::visit([&](const auto& value) { return point_of(family, sample, value); }, sample.value);
          !point.is_null())
        points.push_back(std::move(point));
    if (points.empty()) return;
    Json data{{"dataPoints", std::move(points)}};
    if (family.kind != MetricKind::gauge) data["aggregationTemporality"] = kCumulative;
    if (family.kind == MetricKind::counter) data["isMonotonic"] = true;
    metrics_.push_back({{"name", family.name}, {"description", family.help}, {"unit", family.unit}});
    metrics_.back()[kDataKeys[static_cast<std::size_t>(family.kind)]] = std::move(data);
  }
  Json take() { return std::move(metrics_); }

 private:
  static constexpr std::array<const char*, 3> kDataKeys{"gauge", "sum", "histogram"};

  Json point(const MetricFamily& family, const MetricSample& sample) const {
    Json point{{"timeUnixNano", now_}};
    if (family.kind != MetricKind::gauge) point["startTimeUnixNano"] = since_;
    for (const auto& [key, value] : sample.labels)
      point["attributes"].push_back(attribute(key, std::string_view(value)));
    return point;
  }
  Json point_of(const MetricFamily& family, const MetricSample& sample, std::uint64_t value) const {
    if (value == 0 && family.kind == MetricKind::counter && !sample.labels.empty()) return nullptr;
    Json json = point(family, sample);
    json["asInt"] = integer(value);
    return json;
  }
  Json point_of(const MetricFamily& family, const MetricSample& sample, double value) const {
    if (!std::isfinite(value)) return nullptr;  // JSON has no such number
    Json json = point(family, sample);
    json["asDouble"] = value;
    return json;
  }
  Json point_of(const MetricFamily& family, const MetricSample& sample, const Histogram* histogram) const {
    Json bounds = Json::array(), counts = Json::array();
    for (const Duration bound : histogram->bounds) bounds.push_back(static_cast<double>(bound.ns) / 1e9);
    for (const std::uint64_t times : histogram->counts) counts.push_back(integer(times));
    Json json = point(family, sample);
    json.update({{"count", integer(histogram->count)},
                 {"sum", static_cast<double>(histogram->sum.ns) / 1e9},
                 {"bucketCounts", std::move(counts)},
                 {"explicitBounds", std::move(bounds)}});
    return json;
  }
  std::string since_, now_;
  Json metrics_ = Json::array();
};

}  // namespace

std::string otlp_traces(const OtlpSource& source, std::span<const CommandTrace> traces) {
  SpanWriter writer(source);
  for (const CommandTrace& trace : traces) writer.write(trace);
  return writer.request().dump();
}

std::string otlp_logs(const OtlpSource& source, std::span<const incident::Incident> incidents) {
  Json records = Json::array();
  for (const incident::Incident& incident : incidents)
    records.push_back(
        {{"timeUnixNano", fmt::format("{}", incident.at.ns + source.monotonic_to_unix_ns)},
         {"severityNumber", incident.asked ? kSeverityInfo : kSeverityError},
         {"severityText", incident.asked ? "INFO" : "ERROR"},
         {"body", {{"stringValue", incident.sentence}}},
         {"attributes",
          Json::array({attribute("takt.tick", incident.tick), attribute("takt.mode", name(incident.to)),
                       attribute("takt.cause", name(incident.cause)), attribute("takt.where", incident.where),
                       attribute("takt.error_code", std::uint64_t{incident.error_code})})}});
  return Json{{"resourceLogs",
               {{{"resource", resource(source, "takt-executive")},
                 {"scopeLogs", {{{"scope", scope(source)}, {"logRecords", std::move(records)}}}}}}}}
      .dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string otlp_metrics(const OtlpSource& source, std::span<const MetricFamily> families, MonoTime since,
                         MonoTime now) {
  MetricWriter writer(since.ns + source.monotonic_to_unix_ns, now.ns + source.monotonic_to_unix_ns);
  for (const MetricFamily& family : families) writer.write(family);
  return Json{{"resourceMetrics",
               {{{"resource", resource(source, "takt-executive")},
                 {"scopeMetrics", {{{"scope", scope(source)}, {"metrics", writer.take()}}}}}}}}
      .dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace takt::monitor
