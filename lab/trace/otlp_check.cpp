// SPDX-License-Identifier: Apache-2.0
#include "lab/trace/otlp_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

namespace takt::lab {
namespace {

using SpanJson = nlohmann::json;

struct ExportedTrace {
  std::optional<ToldCommand> root;
  std::map<std::string, Duration> spans;  // by name
};

// 64-bit integers are text in OTLP's JSON.
std::int64_t integer(const SpanJson& value) {
  return std::stoll(value.get<std::string>());
}

ToldCommand root_of(const SpanJson& span) {
  ToldCommand command;
  for (const SpanJson& attribute : span.at("attributes")) {
    const std::string key = attribute.at("key");
    if (key == "takt.tick") command.tick = static_cast<std::uint64_t>(integer(attribute.at("value").at("intValue")));
    if (key == "takt.sequence")
      command.sequence = static_cast<std::uint64_t>(integer(attribute.at("value").at("intValue")));
    if (key == "takt.age_ns") command.age.ns = integer(attribute.at("value").at("intValue"));
  }
  return command;
}

void add(const SpanJson& request, std::map<std::string, ExportedTrace>& traces) {
  for (const SpanJson& resource : request.at("resourceSpans"))
    for (const SpanJson& scope : resource.at("scopeSpans"))
      for (const SpanJson& span : scope.at("spans")) {
        ExportedTrace& trace = traces[span.at("traceId")];
        const std::string name = span.at("name");
        if (name == "command") trace.root = root_of(span);
        trace.spans[name] = Duration{integer(span.at("endTimeUnixNano")) - integer(span.at("startTimeUnixNano"))};
      }
}

}  // namespace

std::expected<std::vector<ToldCommand>, std::string> read_told_commands(std::istream& lines) {
  std::map<std::string, ExportedTrace> traces;
  std::size_t number = 0;
  try {
    for (std::string line; std::getline(lines, line);) {
      ++number;
      add(SpanJson::parse(line), traces);
    }
  } catch (const std::exception& error) {
    return std::unexpected(fmt::format("line {} is no OTLP export request of traces: {}", number, error.what()));
  }
  std::vector<ToldCommand> told;
  for (const auto& [id, trace] : traces) {
    if (!trace.root) continue;  // an observation's
    ToldCommand command = *trace.root;
    const std::array<std::pair<const char*, Duration*>, 4> parts{{{"sense", &command.parts.sense},
                                                                  {"queue", &command.parts.queue},
                                                                  {"infer", &command.parts.infer},
                                                                  {"publish", &command.parts.publish}}};
    for (const auto& [name, part] : parts) {
      const auto span = trace.spans.find(name);
      if (span == trace.spans.end()) return std::unexpected(fmt::format("trace {} has no span {}", id, name));
      *part = span->second;
    }
    told.push_back(command);
  }
  return told;
}

OtlpCheck check_told_commands(const std::vector<ToldCommand>& told, const std::vector<TickFacts>& records) {
  OtlpCheck check;
  const auto compare = [&](std::uint64_t tick, std::string_view what, std::int64_t exported, std::int64_t recorded) {
    if (std::abs(exported - recorded) <= kAgreement.ns) return;
    ++check.disagreement_count;
    if (check.disagreements.size() < RecordCheck::kListed)
      check.disagreements.push_back({tick, what, exported, recorded});
  };
  for (const ToldCommand& command : told) {
    const auto record = std::ranges::lower_bound(records, command.tick, {}, &TickFacts::tick);
    if (record == records.end() || record->tick != command.tick) {
      ++check.unrecorded;
      continue;
    }
    ++check.commands;
    if (command.sequence != record->sequence) {
      ++check.disagreement_count;
      continue;
    }
    compare(command.tick, "age", command.age.ns, record->age.total().ns);
    compare(command.tick, "sense", command.parts.sense.ns, record->age.sense.ns);
    compare(command.tick, "queue", command.parts.queue.ns, record->age.queue.ns);
    compare(command.tick, "infer", command.parts.infer.ns, record->age.infer.ns);
    compare(command.tick, "publish", command.parts.publish.ns, record->age.publish.ns);
  }
  return check;
}

std::string otlp_text(const OtlpCheck& check) {
  std::string text = fmt::format("\nOpenTelemetry {} commands compared", check.commands);
  if (check.unrecorded != 0) text += fmt::format(", {} have no record in the run", check.unrecorded);
  text += '\n';
  for (const Disagreement& each : check.disagreements)
    text += fmt::format("              tick {}: {} is {} ns in the export, {} in the records\n", each.tick, each.what,
                        each.traced, each.recorded);
  return text +
         (check.agrees() ? "              export and records agree\n" : "              export and records DISAGREE\n");
}

}  // namespace takt::lab
