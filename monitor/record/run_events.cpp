// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/run_events.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>

#include "monitor/record/bounded_file.hpp"
#include "monitor/record/run_seal.hpp"

namespace takt::monitor {
namespace {

using Json = nlohmann::ordered_json;

// So that no sum of instants overflows, whatever a file says.
constexpr MonoTime kLatest{std::int64_t{1} << 61U};
constexpr Duration kLongest = seconds(1'000'000);

std::optional<RunEvent> event_of(std::string_view line) {
  const Json json = Json::parse(line, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  const auto text = [&json](const char* key) {
    const auto found = json.find(key);
    return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  const auto number = [&json](const char* key) {
    const auto found = json.find(key);
    return found != json.end() && found->is_number_integer() ? found->get<std::int64_t>() : 0;
  };
  RunEvent event{.event = text("event"),
                 .at = MonoTime{number("monotonic_ns")},
                 .given = text("given"),
                 .action = text("action"),
                 .process = text("process"),
                 .what = text("what"),
                 .how = text("how"),
                 .length = Duration{number("length_ns")}};
  if (event.event.empty() || event.at < MonoTime{1} || event.at > kLatest) return std::nullopt;
  event.length = std::clamp(event.length, Duration{}, kLongest);
  return event;
}

}  // namespace

std::vector<RunEvent> read_run_events(const RunFolder& folder) {
  std::vector<RunEvent> events;
  const auto text = read_file(folder.path() + "/" + std::string(kEventsFile));
  if (!text) return events;
  const std::uint64_t sealed = sealed_event_bytes(folder).value_or(text->size());
  for (std::size_t begin = 0; begin < text->size() && events.size() < kMostRunEvents;) {
    const std::size_t end = std::min(text->find('\n', begin), text->size());
    if (auto event = event_of(std::string_view(*text).substr(begin, end - begin))) {
      event->is_sealed = end <= sealed;
      events.push_back(std::move(*event));
    }
    begin = end + 1;
  }
  return events;
}

}  // namespace takt::monitor
