// SPDX-License-Identifier: Apache-2.0
#include "monitor/dds/outbox.hpp"

#include <utility>

namespace takt::monitor::dds {

template <class Message>
void Outbox::put(std::deque<Message>& queue, std::size_t most, Channel channel, Message&& message) {
  {
    const std::lock_guard lock(mutex_);
    if (queue.size() >= most) {
      queue.pop_front();
      ++losses_[static_cast<std::size_t>(channel)];
    }
    queue.push_back(std::forward<Message>(message));
  }
  filled_.notify_one();
}

void Outbox::put(JointStates message) {
  put(waiting_.joint_states, kJointStates, Channel::joint_states, std::move(message));
}

void Outbox::put(Diagnostics message) {
  put(waiting_.diagnostics, kDiagnostics, Channel::diagnostics, std::move(message));
}

void Outbox::put(Status message) {
  put(waiting_.status, kStatus, Channel::status, std::move(message));
}

void Outbox::put(CommandAge message) {
  put(waiting_.command_ages, kCommandAges, Channel::command_age, std::move(message));
}

Outbox::Batch Outbox::take(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  filled_.wait_for(lock, patience, [this] {
    return closed_ || !waiting_.joint_states.empty() || !waiting_.diagnostics.empty() || !waiting_.status.empty() ||
           !waiting_.command_ages.empty();
  });
  return std::exchange(waiting_, {});
}

void Outbox::close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  filled_.notify_all();
}

bool Outbox::is_closed() const {
  const std::lock_guard lock(mutex_);
  return closed_;
}

void Outbox::count_unsent(Channel channel, std::uint64_t messages) {
  const std::lock_guard lock(mutex_);
  losses_[static_cast<std::size_t>(channel)] += messages;
}

Losses Outbox::losses() const {
  const std::lock_guard lock(mutex_);
  return losses_;
}

}  // namespace takt::monitor::dds
