// SPDX-License-Identifier: Apache-2.0
#include "monitor/executive_session.hpp"

#include <fmt/format.h>
#include <sys/socket.h>

#include <cstring>
#include <utility>

#include "config/cautions.hpp"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/contract_layout.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/run_folder.hpp"

namespace takt::monitor {
namespace {

pid_t pid_behind(int socket) {
  ucred credentials{};
  socklen_t size = sizeof credentials;
  return ::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &credentials, &size) == 0 ? credentials.pid : 0;
}

// Both clocks as the executive read them together when it started; else as this process reads them now.
ClockOffset clock_offset(const nlohmann::ordered_json& executive, MonoTime now, std::int64_t unix_ns) {
  if (executive.is_object() && executive.contains("started")) {
    const auto& started = executive.at("started");
    if (started.contains("monotonic_ns") && started.contains("realtime_ns")) {
      const std::int64_t monotonic = started.at("monotonic_ns");
      return {started.at("realtime_ns").get<std::int64_t>() - monotonic, "executive.json"};
    }
  }
  return {unix_ns - now.ns, "monitor"};
}

}  // namespace

Hello hello_of(Role role, std::string_view program, const config::RobotConfig& robot) {
  Hello hello;
  hello.role = role;
  hello.layout = contract_layout();
  hello.config_hash = robot.hash;
  program.copy(hello.program, sizeof hello.program - 1);
  return hello;
}

std::expected<ExecutiveSession, std::string> ExecutiveSession::attach(Role role, std::string_view program,
                                                                      const std::string& runtime_directory,
                                                                      const config::RobotConfig& robot,
                                                                      std::chrono::milliseconds timeout) {
  auto lease = ipc::attach(config::executive_socket(runtime_directory), hello_of(role, program, robot), timeout);
  if (!lease) return std::unexpected(lease.error());
  constexpr std::size_t rings = 4;
  if (lease->descriptors.size() != rings) {
    return std::unexpected(
        fmt::format("the executive handed out {} segments instead of {}: use programs of one version",
                    lease->descriptors.size(), rings));
  }
  const ipc::RingShape shapes[rings] = {ipc::tick_ring(robot.joints.size()),
                                        ipc::command_ring(config::largest_command_of(robot)), ipc::keyframe_ring(),
                                        ipc::frame_ring()};
  ExecutiveSession session;
  for (std::size_t ring = 0; ring < rings; ++ring) {
    auto segment = ipc::Segment::adopt_read_only(lease->descriptors[ring].release(), ipc::ring_bytes(shapes[ring]));
    if (!segment) return std::unexpected(segment.error());
    session.segments_.push_back(std::move(*segment));
  }
  session.pid_ = pid_behind(lease->connection.get());
  session.lease_ = std::move(*lease);
  return session;
}

RingMemories ExecutiveSession::rings() const {
  return {segments_[ipc::kTickRingDescriptor].readable(), segments_[ipc::kCommandRingDescriptor].readable(),
          segments_[ipc::kKeyframeRingDescriptor].readable(), segments_[ipc::kFrameRingDescriptor].readable()};
}

RunManifest describe(const ExecutiveSession& session, const config::RobotConfig& robot,
                     const std::string& runtime_directory, MonoTime now, std::int64_t unix_ns) {
  RunManifest manifest;
  manifest.run_id = new_run_id(robot.robot, unix_ns);
  manifest.robot = robot.robot;
  for (const config::Joint& joint : robot.joints) manifest.joints.push_back(joint.name);
  for (const config::Bus& bus : robot.buses) manifest.buses.push_back(bus.interface);
  manifest.cautions = config::cautions_about(robot);
  manifest.watchdog_waivers = config::watchdog_waivers(robot);
  manifest.config_sha256 = robot.sha256;
  if (robot.policy) manifest.policy_file = robot.policy->file;
  manifest.executive_pid = session.pid();
  if (const auto text = read_file(runtime_directory + "/executive.json")) {
    auto json = nlohmann::ordered_json::parse(*text, nullptr, false);
    if (json.is_object()) {
      if (const auto hash = json.find("binary_sha256"); hash != json.end() && hash->is_string())
        manifest.executive_sha256 = hash->get<std::string>();
      // What it admits, whatever lies under that name by now.
      if (const auto hash = json.find("policy_sha256"); hash != json.end() && hash->is_string())
        manifest.policy_sha256 = hash->get<std::string>();
      manifest.executive = std::move(json);
    }
  }
  manifest.host = host_facts();
  if (const auto text = read_file(config::doctor_verdict(robot.record.directory)))
    if (auto json = nlohmann::ordered_json::parse(*text, nullptr, false); json.is_object())
      manifest.doctor = std::move(json);
  manifest.clock = clock_offset(manifest.executive, now, unix_ns);
  manifest.started_at = now;
  return manifest;
}

}  // namespace takt::monitor
