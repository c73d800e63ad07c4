// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/run_events.hpp"

#include <time.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>

#include "executive/contract/monotonic_clock.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/run_manifest.hpp"
#include "monitor/record/run_seal.hpp"
#include "monitor/record/word_log.hpp"

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
  const auto count = [&number](const char* key) {
    return static_cast<std::uint64_t>(std::max<std::int64_t>(number(key), 0));
  };
  RunEvent event{.event = text("event"),
                 .at = MonoTime{number("monotonic_ns")},
                 .given = text("given"),
                 .action = text("action"),
                 .process = text("process"),
                 .role = text("role"),
                 .kind = text("kind"),
                 .what = text("what"),
                 .how = text("how"),
                 .length = Duration{number("length_ns")},
                 .first_sequence = count("first_sequence"),
                 .superseded = count("superseded"),
                 .pid = number("pid"),
                 .uid = number("uid"),
                 .done = json.value("done", Json(false)) == Json(true)};
  if (event.event.empty() || event.at < MonoTime{1} || event.at > kLatest) return std::nullopt;
  event.length = std::clamp(event.length, Duration{}, kLongest);
  return event;
}

std::int64_t unix_ns(MonoTime at) {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec - (monotonic_now() - at).ns;
}

}  // namespace

std::string event_line(std::string_view event, MonoTime at, const Json& more) {
  Json line{{"event", event}, {"monotonic_ns", at.ns}, {"utc", utc_text(unix_ns(at))}};
  line.update(more);
  return line.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::vector<RunEvent> read_run_events(const RunFolder& folder) {
  std::vector<RunEvent> events;
  const auto text = read_file(folder.path() + "/" + std::string(kEventsFile));
  if (!text) return events;
  const std::uint64_t sealed = sealed_event_bytes(folder).value_or(text->size());
  std::size_t of_script = 0, of_policies = 0, of_operators = 0;
  for (std::size_t begin = 0; begin < text->size();) {
    const std::size_t end = std::min(text->find('\n', begin), text->size());
    if (auto event = event_of(std::string_view(*text).substr(begin, end - begin))) {
      event->is_sealed = end <= sealed;
      std::size_t& taken = event->event == kPolicyEvent     ? of_policies
                           : event->event == kOperatorEvent ? of_operators
                                                            : of_script;
      if (taken < kMostRunEvents) events.push_back(std::move(*event));
      if (++taken > kMostRunEvents && std::min({of_script, of_policies, of_operators}) > kMostRunEvents) break;
    }
    begin = end + 1;
  }
  return events;
}

}  // namespace takt::monitor
