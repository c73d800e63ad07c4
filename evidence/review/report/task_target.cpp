// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/report/task_target.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace takt::evidence {

std::expected<TaskTarget, std::string> TaskTarget::open(const std::string& path) {
  std::ifstream stream(path);
  if (!stream) return std::unexpected(path + ": cannot be read; takt-plant --truth FILE writes it");
  TaskTarget truth(std::move(stream));
  if (!truth.next_) return std::unexpected(path + ": holds no target; takt-plant --truth FILE did not write it");
  return truth;
}

std::optional<config::Vector3> TaskTarget::at(MonoTime now) {
  while (next_ && next_->at <= now) {
    current_ = next_;
    next_ = read();
  }
  return current_ ? std::optional(current_->target) : std::nullopt;
}

std::optional<TaskTarget::Entry> TaskTarget::read() {
  for (std::string line; std::getline(stream_, line);) {
    const auto json = nlohmann::json::parse(line, nullptr, false);
    if (!json.is_object() || !json.contains("monotonic_ns") || !json.contains("target")) continue;
    const auto& at = json["monotonic_ns"];
    const auto& target = json["target"];
    const auto is_number = [](const auto& value) { return value.is_number(); };
    if (!at.is_number_integer() || !target.is_array() || target.size() != 3) continue;
    if (!std::all_of(target.begin(), target.end(), is_number)) continue;
    return Entry{{at.get<std::int64_t>()}, {target[0].get<double>(), target[1].get<double>(), target[2].get<double>()}};
  }
  return {};
}

}  // namespace takt::evidence
