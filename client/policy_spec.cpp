// SPDX-License-Identifier: Apache-2.0
#include "client/policy_spec.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string_view>

#include "config/join_names.hpp"
#include "config/units.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::client {
namespace {

// What the authors of policies that are conditioned on the path being played call it: real-time chunking.
constexpr std::string_view kRealTimeChunking = "rtc";

std::expected<void, Refusal> check_join(const config::RobotConfig& robot, const std::string& said) {
  if (said.empty()) return {};
  const std::string_view wanted =
      said == kRealTimeChunking ? config::name(config::JoinKind::prefix) : std::string_view(said);
  if (std::ranges::find(config::kJoinNames, wanted) == config::kJoinNames.end()) {
    return refuse(
        fmt::format("join \"{}\" of the policy's chunk: there is no such join; there are {}, and {}, which is {}", said,
                    fmt::join(config::kJoinNames, ", "), kRealTimeChunking, config::name(config::JoinKind::prefix)));
  }
  const std::string_view there = config::name(robot.policy->action.join.kind);
  if (wanted == there) return {};
  return refuse(
      fmt::format("{}: policy.action.join is {}, the policy's chunks are made for {}: write `join: {{ kind: {} }}` "
                  "in policy.action there, or have the policy say {}",
                  robot.file, there, said, wanted, there));
}

std::expected<void, Refusal> check_chunk(const config::RobotConfig& robot, const PolicySpec& spec) {
  const config::Policy& policy = *robot.policy;
  const auto step = config::parse_quantity(spec.step, config::Dimension::time);
  if (!step) return refuse(fmt::format("step \"{}\" of the policy's chunk: {}", spec.step, step.error()));
  if (spec.steps != policy.steps) {
    return refuse(fmt::format("{}: policy.steps is {}, the policy's chunks have {}: make them equal", robot.file,
                              policy.steps, spec.steps));
  }
  if (std::llround(*step) != policy.step_period.ns) {
    return refuse(fmt::format("{}: policy.step_period is {}, the policy's is {}: make them equal", robot.file,
                              config::format_duration(policy.step_period), spec.step));
  }
  return check_join(robot, spec.join);
}

std::expected<void, Refusal> check_unit(const config::RobotConfig& robot, const config::Sensor& sensor,
                                        const std::string& unit) {
  if (unit.empty() || unit == sensor.unit) return {};
  return refuse(fmt::format("{}: sensor {} gives {}, the policy reads {}: make them equal (`unit` there)", robot.file,
                            sensor.name, sensor.unit, unit));
}

std::expected<void, Refusal> check_age(const config::RobotConfig& robot, const config::Sensor& sensor,
                                       const std::string& max_age) {
  if (max_age.empty()) return {};
  const auto age = config::parse_quantity(max_age, config::Dimension::time);
  if (!age) return refuse(fmt::format("max_age \"{}\" of the policy's {}: {}", max_age, sensor.name, age.error()));
  if (std::llround(*age) == sensor.timeout.ns) return {};
  return refuse(fmt::format("{}: sensor {} has the timeout {}, the policy's max_age is {}: make them equal", robot.file,
                            sensor.name, config::format_duration(sensor.timeout), max_age));
}

std::expected<void, Refusal> check_stream(const config::RobotConfig& robot, const Term& term) {
  const auto sensor = std::ranges::find(robot.sensors, term.stream, &config::Sensor::name);
  if (sensor == robot.sensors.end()) {
    std::string names;
    for (const config::Sensor& known : robot.sensors) names += (names.empty() ? "" : ", ") + known.name;
    return refuse(
        fmt::format("{}: the policy reads stream '{}', which `sensors` does not list ({}); add it there, or "
                    "correct the name",
                    robot.file, term.stream, names.empty() ? "it is empty" : "there is " + names));
  }
  if ((term.kind == TAKT_TERM_IMAGE) != sensor->image.has_value()) {
    return refuse(fmt::format("{}: sensor {} gives {}: read it as what it is", robot.file, term.stream,
                              sensor->image ? "images" : "values, and no images"));
  }
  if (sensor->image && sensor->image->bytes() != term.values && term.values != 0) {
    return refuse(fmt::format("{}: sensor {}'s images are {} x {} x {}, the policy's have {} bytes: make them equal",
                              robot.file, term.stream, sensor->image->height, sensor->image->width,
                              sensor->image->channels, term.values));
  }
  if (term.kind == TAKT_TERM_QUEUE && sensor->queue == 0) {
    return refuse(fmt::format("{}: sensor {} gives its newest sample only: read it as a stream, or add `queue` there",
                              robot.file, term.stream));
  }
  if (!sensor->image && sensor->values != term.values) {
    return refuse(fmt::format("{}: sensor {} has {} values, the policy's stream of that name {}: make them equal",
                              robot.file, term.stream, sensor->values, term.values));
  }
  if (auto fine = check_unit(robot, *sensor, term.unit); !fine) return fine;
  return check_age(robot, *sensor, term.max_age);
}

bool reads(const PolicySpec& spec, const std::string& sensor) {
  return std::ranges::any_of(spec.terms, [&](const Term& term) { return term.stream == sensor; });
}

// The executive refuses commands without a stamp of outside sensors where policy.observation has one: that the policy
// reads the same ones keeps anything else from passing.
std::expected<void, Refusal> check_terms(const config::RobotConfig& robot, const PolicySpec& spec) {
  for (const Term& term : spec.terms) {
    if (term.stream.empty()) continue;
    const auto is_same_queue = [&](const Term& other) {
      return other.kind == TAKT_TERM_QUEUE && term.kind == TAKT_TERM_QUEUE && other.stream == term.stream;
    };
    if (std::ranges::count_if(spec.terms, is_same_queue) > 1)
      return refuse(fmt::format("{}: the policy reads queue {} twice: read it once", robot.file, term.stream));
    if (auto fine = check_stream(robot, term); !fine) return fine;
  }
  const std::vector<std::size_t> listed = policy_host::sensors_in_use(robot);
  for (std::size_t i = 0; i < robot.sensors.size(); ++i) {
    const std::string& name = robot.sensors[i].name;
    const bool is_listed = std::ranges::find(listed, i) != listed.end();
    if (is_listed == reads(spec, name)) continue;
    return refuse(is_listed
                      ? fmt::format("{}: policy.observation lists sensor {}, which the policy does not read: read it, "
                                    "or take it out of there",
                                    robot.file, name)
                      : fmt::format("{}: the policy reads stream {}, which policy.observation does not list: add "
                                    "`- {{ term: sensor, sensor: {} }}` there, and the executive insists on its age",
                                    robot.file, name, name));
  }
  return {};
}

}  // namespace

std::expected<void, Refusal> check_spec(const config::RobotConfig& robot, const PolicySpec& spec) {
  if (auto fine = check_chunk(robot, spec); !fine) return fine;
  return check_terms(robot, spec);
}

}  // namespace takt::client
