// SPDX-License-Identifier: Apache-2.0
// The device side of a robot's loopback buses in a thread of the test: every Damiao drive answers each frame with
// position zero and its state, as the protocol says, before it obeys the frame, and questions about its settings with
// what the robot file says; what is written into them stays. No physics: takt-plant has that.
#pragma once

#include <atomic>
#include <bit>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "config/paths.hpp"
#include "config/robot_config.hpp"
#include "drivers/bus/loopback_hub.hpp"
#include "drivers/bus/open_bus.hpp"
#include "tests/executive/runtime/prompt_thread.hpp"

namespace takt::runtime::test {

class SimulatedDrives {
 public:
  SimulatedDrives(const config::RobotConfig& robot, const std::string& runtime_directory) {
    for (std::size_t bus = 0; bus < robot.buses.size(); ++bus) {
      const auto path = config::loopback_socket(runtime_directory, robot.buses[bus].interface);
      auto hub = drivers::LoopbackHub::listen(
          path, {robot.buses[bus].interface, robot.buses[bus].fd, drivers::device_ids(robot, bus)});
      hubs_.push_back(std::move(hub.value()));
    }
    for (const config::Joint& joint : robot.joints) {
      reply_id_[joint.drive.id] = joint.drive.reply_id;
      settings_[joint.drive.id] = {{13, 21},
                                   {14, 5013},
                                   {15, 70001},
                                   {9, 2000},  // time-out: 100 ms
                                   {10, 1},    // control mode: MIT
                                   {21, bits_of(joint.drive.position_range)},
                                   {22, bits_of(joint.drive.velocity_range)},
                                   {23, bits_of(joint.drive.torque_range)}};
    }
    thread_ = std::thread([this] { serve(); });
  }
  ~SimulatedDrives() { stop(); }
  SimulatedDrives(const SimulatedDrives&) = delete;
  SimulatedDrives& operator=(const SimulatedDrives&) = delete;

  // The robot loses its drives and buses.
  void stop() {
    done_ = true;
    if (thread_.joinable()) thread_.join();
    hubs_.clear();
  }
  [[nodiscard]] bool all_disabled() const { return enabled_count_ == 0; }
  [[nodiscard]] bool all_enabled() const { return enabled_count_ == reply_id_.size(); }
  [[nodiscard]] std::uint64_t frames() const { return frames_; }

 private:
  void serve() {
    make_this_thread_prompt();
    std::vector<drivers::ReceivedFrame> received(64);
    while (!done_) {
      for (const auto& hub : hubs_) {
        const std::size_t count = hub->receive(received);
        for (std::size_t i = 0; i < count; ++i) answer(*hub, received[i].frame);
      }
      std::this_thread::sleep_for(std::chrono::microseconds(300));
    }
  }
  static std::uint32_t bits_of(double value) { return std::bit_cast<std::uint32_t>(static_cast<float>(value)); }
  // Drives of one robot have numbers of their own, whatever their bus.
  void tell_setting(drivers::LoopbackHub& hub, const drivers::CanFrame& question) {
    const auto id = static_cast<std::uint32_t>(question.data[0] | question.data[1] << 8);
    const bool writes = question.data[2] == 0x55;
    if (question.length != 8 || (question.data[2] != 0x33 && !writes) || !settings_.contains(id)) return;
    drivers::CanFrame reply = question;
    reply.id = reply_id_.at(id);
    std::uint32_t& value = settings_.at(id).at(question.data[3]);
    if (writes)
      value = question.data[4] | std::uint32_t{question.data[5]} << 8U | std::uint32_t{question.data[6]} << 16U |
              std::uint32_t{question.data[7]} << 24U;
    for (unsigned i = 0; i < 4; ++i) reply.data[4 + i] = static_cast<std::uint8_t>(value >> 8 * i & 0xFFU);
    hub.send(reply);
  }
  void answer(drivers::LoopbackHub& hub, const drivers::CanFrame& command) {
    if (command.id == 0x7FF) return tell_setting(hub, command);
    bool& enabled = enabled_[command.id];
    drivers::CanFrame reply;
    reply.id = reply_id_.at(command.id);
    reply.length = 8;
    const std::uint8_t middle[] = {0x7F, 0xFF, 0x7F, 0xF7, 0xFF, 30, 30};  // p, v, t at zero; 30 degrees
    reply.data[0] = static_cast<std::uint8_t>(command.id | (enabled ? 0x10U : 0U));
    std::copy(std::begin(middle), std::end(middle), reply.data + 1);
    hub.send(reply);
    ++frames_;
    const bool special = std::all_of(command.data, command.data + 7, [](std::uint8_t byte) { return byte == 0xFF; });
    if (special && command.data[7] == 0xFC) enabled = true;
    if (special && command.data[7] == 0xFD) enabled = false;
    std::size_t count = 0;
    for (const auto& [id, is_enabled] : enabled_) count += is_enabled ? 1 : 0;
    enabled_count_ = count;
  }

  std::vector<std::unique_ptr<drivers::LoopbackHub>> hubs_;
  std::map<std::uint32_t, std::uint32_t> reply_id_;
  std::map<std::uint32_t, std::map<std::uint32_t, std::uint32_t>> settings_;  // by drive and register
  std::map<std::uint32_t, bool> enabled_;
  std::atomic<std::size_t> enabled_count_ = 0;
  std::atomic<std::uint64_t> frames_ = 0;
  std::atomic<bool> done_ = false;
  std::thread thread_;
};

}  // namespace takt::runtime::test
