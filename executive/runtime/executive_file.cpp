// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/executive_file.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "config/hash.hpp"
#include "config/load.hpp"
#include "config/sha256.hpp"
#include "executive/contract/version.hpp"

namespace takt::runtime {
namespace {

template <class Clock>
std::int64_t nanoseconds_of() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now().time_since_epoch()).count();
}

// By the program itself: under a service manager no other user may look behind /proc/PID/exe.
std::string binary_sha256() {
  return config::file_sha256("/proc/self/exe").value_or("");
}

nlohmann::ordered_json controller_json(const drivers::CanLink& link) {
  nlohmann::ordered_json json{{"state", link.controller_state},    {"bitrate", link.bitrate},
                              {"sample_point", link.sample_point}, {"sjw", link.sjw},
                              {"queue_length", link.queue_length}, {"bus_errors", link.bus_errors},
                              {"went_passive", link.went_passive}, {"went_off", link.went_off},
                              {"restarts", link.restarts}};
  if (link.fd) {
    json["data_bitrate"] = link.data_bitrate;
    json["data_sample_point"] = link.data_sample_point;
    json["data_sjw"] = link.data_sjw;
  }
  if (link.transmit_errors) json["transmit_errors"] = *link.transmit_errors;
  if (link.receive_errors) json["receive_errors"] = *link.receive_errors;
  return json;
}

nlohmann::ordered_json json_of(const ExecutiveFacts& facts) {
  nlohmann::ordered_json steps = nlohmann::ordered_json::array();
  for (const SetupStep& step : facts.steps) {
    steps.push_back({{"name", step.name}, {"ok", step.ok}, {"essential", step.essential}, {"detail", step.detail}});
  }
  nlohmann::ordered_json buses = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < facts.robot.buses.size(); ++i) {
    const config::Bus& bus = facts.robot.buses[i];
    const OpenedBusFacts& opened = facts.buses.at(i);
    buses.push_back({{"name", bus.name}, {"interface", bus.interface}, {"description", opened.description}});
    if (opened.link.exists && !opened.link.is_virtual) buses.back()["controller"] = controller_json(opened.link);
  }
  return {
      {"schema", "takt.executive/1"},
      {"pid", getpid()},
      {"version", version()},
      {"source_sha256", source_sha256()},
      {"binary_sha256", binary_sha256()},
      {"robot", facts.robot.robot},
      {"config_sha256", facts.robot.sha256},
      {"config_hash", fmt::format("{:016x}", facts.robot.hash)},
      {"policy_sha256", facts.policy_sha256},
      {"policy_hash", fmt::format("{:016x}", config::leading_64_bits(facts.policy_sha256))},
      {"fallback_policy_hash", fmt::format("{:016x}", facts.fallback_hash)},
      {"realtime", is_realtime(facts.steps)},
      {"allow_non_realtime", facts.allow_non_realtime},
      {"recorder", facts.robot.record.recorder == config::Recorder::required ? "required" : "optional"},
      {"realtime_steps", std::move(steps)},
      {"buses", std::move(buses)},
      {"wake", facts.robot.control.wake == config::WakeMode::hybrid ? "hybrid" : "sleep"},
      {"period_ns", facts.robot.control.period.ns},
      {"cpu", facts.robot.control.cpu ? nlohmann::ordered_json(*facts.robot.control.cpu) : nlohmann::ordered_json()},
      {"started",
       {{"monotonic_ns", nanoseconds_of<std::chrono::steady_clock>()},
        {"realtime_ns", nanoseconds_of<std::chrono::system_clock>()}}}};
}

}  // namespace

std::expected<ExecutiveFile, std::string> ExecutiveFile::write(const std::string& runtime_directory,
                                                               const ExecutiveFacts& facts) {
  const std::string path = runtime_directory + "/executive.json";
  const std::string draft = path + ".new";
  std::ofstream file(draft, std::ios::trunc);
  file << json_of(facts).dump(2) << '\n';
  file.close();
  if (!file || rename(draft.c_str(), path.c_str()) != 0) {
    return std::unexpected(path + ": " + std::generic_category().message(errno) +
                           ": make the runtime directory writable for this user");
  }
  return ExecutiveFile(path);
}

ExecutiveFile::ExecutiveFile(ExecutiveFile&& other) noexcept : path_(std::exchange(other.path_, {})) {}

ExecutiveFile::~ExecutiveFile() {
  if (!path_.empty()) unlink(path_.c_str());
}

}  // namespace takt::runtime
