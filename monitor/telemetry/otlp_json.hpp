// SPDX-License-Identifier: Apache-2.0
// OpenTelemetry's OTLP in JSON: one line per export request, as the file exporter writes it and OTLP/HTTP posts it
// (opentelemetry.io, "OTLP File Exporter" and "OTLP/HTTP": 64-bit integers as strings, ids in hex). Pure.
//
// One trace per command: root `command` with children sense, queue, infer, publish, consume, actuate, each under the
// resource of the process that spent the time, and a link from the root to the span of the observation it answers,
// which is a trace of its own. A refused command is a trace of one span whose status is an error and says why. Stops
// and faults are log records: an error unless it was requested. Ids come from run and numbers, so that the same
// records give the same bytes.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "monitor/telemetry/command_traces.hpp"
#include "monitor/telemetry/metric_families.hpp"

namespace takt::monitor {

// What every line says about where it comes from.
struct OtlpSource {
  std::string robot;
  std::string run_id;
  std::string config_sha256;
  std::string version;                    // of Takt
  std::int64_t monotonic_to_unix_ns = 0;  // run_manifest.hpp, ClockOffset
};

// No line end in any.
std::string otlp_traces(const OtlpSource& source, std::span<const CommandTrace> traces);
std::string otlp_logs(const OtlpSource& source, std::span<const incident::Incident> incidents);
// `families` count from `since` on.
std::string otlp_metrics(const OtlpSource& source, std::span<const MetricFamily> families, MonoTime since,
                         MonoTime now);

}  // namespace takt::monitor
