// SPDX-License-Identifier: Apache-2.0
// Facts of a tick, and counts by name, in JSON: a duration's name ends with `_ns`; null: there is none. Pure. Headers
// only: what stops a robot is linked to no library.
#pragma once

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <string>

#include "executive/contract/tick_facts.hpp"

namespace takt::monitor {

inline nlohmann::ordered_json in_ns(std::optional<Duration> duration) {
  return duration ? nlohmann::ordered_json(duration->ns) : nullptr;
}

inline nlohmann::ordered_json text_or_null(const std::string& text) {
  return text.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(text);
}

struct JsonFacts {
  void operator()(const std::string& name, const auto& value) { json[name] = value; }
  void operator()(const std::string& name, std::optional<Duration> value) { json[name + "_ns"] = in_ns(value); }
  void operator()(const std::string& name, PolicyHash policy) {
    if (policy.value == 0) return (*this)(name, nullptr);
    (*this)(name, fmt::format("{:016x}", policy.value));
  }
  nlohmann::ordered_json json;
};

inline nlohmann::ordered_json facts_json(const TickRecordHeader& tick) {
  JsonFacts facts;
  tell_facts(tick, facts);
  return std::move(facts.json);
}

// {"accepted": 12, ...}, from the enum's value `first` on.
template <class Enum, class Counts>
nlohmann::ordered_json counts_json(const Counts& counts, std::size_t first = 0) {
  nlohmann::ordered_json json;
  for (std::size_t value = first; value < std::size(counts); ++value)
    json[std::string(name(static_cast<Enum>(value)))] = counts[value];
  return json;
}

}  // namespace takt::monitor
