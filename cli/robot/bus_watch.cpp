// SPDX-License-Identifier: Apache-2.0
#include "cli/robot/bus_watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "cli/json_line.hpp"
#include "config/drive_ids.hpp"
#include "config/joint_units.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "executive/contract/feedback_names.hpp"
#include "executive/contract/monotonic_clock.hpp"

namespace takt::cli {
namespace {

bool is_command(const config::RobotConfig& robot, std::size_t bus, const drivers::CanFrame& frame) {
  return std::ranges::any_of(robot.joints, [&](const config::Joint& joint) {
    const config::DriveIds ids = config::ids_of(joint.drive);
    const auto matches = [&frame](const config::IdPattern& one) { return one.matches(frame.id, frame.extended); };
    return joint.bus == bus &&
           (std::ranges::any_of(ids.commands, matches) || std::ranges::any_of(ids.broadcasts, matches));
  });
}

}  // namespace

BusWatch::BusWatch(const config::RobotConfig& robot, std::vector<std::unique_ptr<drivers::CanBus>> buses)
    : robot_(robot),
      buses_(std::move(buses)),
      received_(64),
      frames_(robot.buses.size()),
      strangers_(robot.buses.size()) {
  make_drivers(false);
}

void BusWatch::make_drivers(bool asks) {
  joints_.clear();
  for (std::size_t joint = 0; joint < robot_.joints.size(); ++joint) {
    auto driver = drivers::make_joint_driver(robot_, joint);
    if (!driver) throw std::runtime_error(driver.error());
    if (!asks) (*driver)->assume_set_up();
    joints_.push_back({std::move(*driver)});
  }
}

void BusWatch::begin_to_ask() {
  asks_ = true;
  make_drivers(true);
}

void BusWatch::ask() {
  std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out;
  for (std::size_t joint = 0; joint < joints_.size(); ++joint) {
    const std::size_t frames = joints_[joint].driver->encode(false, {}, monotonic_now(), {}, out);
    for (std::size_t i = 0; i < frames; ++i) buses_[robot_.joints[joint].bus]->send(out[i]);
  }
}

void BusWatch::listen() {
  if (asks_) ask();
  for (std::size_t bus = 0; bus < buses_.size(); ++bus) {
    const std::size_t count = buses_[bus]->receive(received_);
    frames_[bus] += count;
    for (std::size_t i = 0; i < count; ++i) {
      bool known = false;
      for (std::size_t joint = 0; joint < joints_.size() && !known; ++joint) {
        if (robot_.joints[joint].bus != bus) continue;
        drivers::JointDriver& driver = *joints_[joint].driver;
        const std::uint8_t before = driver.feedback().replies;
        known = driver.decode(received_[i]);
        joints_[joint].replies += static_cast<std::uint8_t>(driver.feedback().replies - before);
      }
      strangers_[bus] += known ? 0 : 1;
      heard_commands_ = heard_commands_ || (!known && is_command(robot_, bus, received_[i].frame));
    }
  }
}

void BusWatch::count(MonoTime now) {
  const double elapsed = counted_at_.is_set() ? (now - counted_at_).seconds() : 0;
  for (Watched& joint : joints_) {
    joint.per_second = elapsed > 0 ? static_cast<double>(joint.replies - joint.counted) / elapsed : 0;
    joint.counted = joint.replies;
  }
  counted_at_ = now;
}

std::string BusWatch::error_of(std::size_t joint) const {
  const drivers::JointDriver& driver = *joints_[joint].driver;
  const std::uint32_t error = driver.feedback().error_code, code = error != 0 ? error : driver.remark();
  return code == 0 ? "" : drivers::error_name(robot_.joints[joint].drive, code);
}

std::string BusWatch::table(MonoTime now) const {
  const bool slides = config::has_slides(robot_);
  std::string text = fmt::format("{:<20} {:<8} {:<9} {:<9} {:>9} {:>9} {:>6} {:>9} {:>9}  {}\n", "joint", "bus",
                                 "protocol", "state", slides ? "q [rad,m]" : "q [rad]",
                                 slides ? "tau[Nm,N]" : "tau [Nm]", "[C]", "age [ms]", "replies/s", "error");
  for (std::size_t joint = 0; joint < joints_.size(); ++joint) {
    const config::Joint& known = robot_.joints[joint];
    const JointFeedback& feedback = joints_[joint].driver->feedback();
    if (!feedback.received_at.is_set()) {
      const std::string error = error_of(joint);  // a drive may answer questions alone
      text += fmt::format("{:<20} {:<8} {:<9} {}\n", known.name, robot_.buses[known.bus].name,
                          config::name(known.drive.protocol), error.empty() ? "silent" : error);
      continue;
    }
    text += fmt::format("{:<20} {:<8} {:<9} {:<9} {:>9.4f} {:>9.3f} {:>6.0f} {:>9.1f} {:>9.0f}  {}\n", known.name,
                        robot_.buses[known.bus].name, config::name(known.drive.protocol), name(feedback.drive_state),
                        feedback.q, feedback.tau, feedback.temperature_C, (now - feedback.received_at).milliseconds(),
                        joints_[joint].per_second, error_of(joint));
  }
  for (std::size_t bus = 0; bus < buses_.size(); ++bus) {
    // Commands are heard too where a host drives the robot; they are not replies of a drive.
    text += fmt::format("{}: {} frames, {} of them no drive's word, {} lost on receive\n", robot_.buses[bus].name,
                        frames_[bus], strangers_[bus], buses_[bus]->health().rx_dropped);
  }
  return text;
}

std::string BusWatch::json(MonoTime now) const {
  nlohmann::ordered_json joints = nlohmann::ordered_json::array();
  for (std::size_t joint = 0; joint < joints_.size(); ++joint) {
    const JointFeedback& feedback = joints_[joint].driver->feedback();
    const config::JointKind kind = robot_.joints[joint].kind;
    const bool seen = feedback.received_at.is_set();
    joints.push_back(
        {{"joint", robot_.joints[joint].name},
         {"protocol", config::name(robot_.joints[joint].drive.protocol)},
         {"seen", seen},
         {"state", name(feedback.drive_state)},
         {fmt::format("q_{}", config::kJointPosition.unit(kind)), feedback.q},
         {fmt::format("tau_{}", config::kJointTorque.unit(kind)), feedback.tau},
         {"temperature_C", feedback.temperature_C},
         {"age_ns", seen ? nlohmann::ordered_json((now - feedback.received_at).ns) : nlohmann::ordered_json()},
         {"replies_per_s", joints_[joint].per_second},
         {"error", error_of(joint)}});
  }
  nlohmann::ordered_json buses = nlohmann::ordered_json::array();
  for (std::size_t bus = 0; bus < buses_.size(); ++bus)
    buses.push_back({{"bus", robot_.buses[bus].name}, {"frames", frames_[bus]}, {"no_drives_word", strangers_[bus]}});
  return json_line(nlohmann::ordered_json{{"asked", asks_}, {"joints", joints}, {"buses", buses}});
}

}  // namespace takt::cli
