// SPDX-License-Identifier: Apache-2.0
// Between the thread that reads the executive's records and the thread that writes to DDS, where a write can take most
// of a second: per topic a few of the newest messages. What the writing thread does not fetch in time gives way to what
// is newer, and is counted. Bounded memory; put() takes a lock that is only ever held to move messages.
// Thread rule: any thread.
#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>

#include "monitor/dds/messages.hpp"

namespace takt::monitor::dds {

enum class Channel : std::uint8_t { joint_states, diagnostics, status, command_age };
inline constexpr std::size_t kChannelCount = 4;
using Losses = std::array<std::uint64_t, kChannelCount>;  // by Channel

class Outbox {
 public:
  // Two looks into the rings' worth at the highest rates.
  static constexpr std::size_t kJointStates = 50;
  static constexpr std::size_t kDiagnostics = 4;
  static constexpr std::size_t kStatus = 4;
  static constexpr std::size_t kCommandAges = 256;

  struct Batch {  // oldest first
    std::deque<JointStates> joint_states;
    std::deque<Diagnostics> diagnostics;
    std::deque<Status> status;
    std::deque<CommandAge> command_ages;
  };

  void put(JointStates message);
  void put(Diagnostics message);
  void put(Status message);
  void put(CommandAge message);

  // Everything that waits; waits for something at most `patience`, and not at all once closed.
  Batch take(std::chrono::milliseconds patience);
  void close();
  [[nodiscard]] bool is_closed() const;

  // Messages that were fetched but could not be written.
  void count_unsent(Channel channel, std::uint64_t messages);
  [[nodiscard]] Losses losses() const;

 private:
  template <class Message>
  void put(std::deque<Message>& queue, std::size_t most, Channel channel, Message&& message);

  mutable std::mutex mutex_;
  std::condition_variable filled_;
  Batch waiting_;
  Losses losses_{};
  bool closed_ = false;
};

}  // namespace takt::monitor::dds
