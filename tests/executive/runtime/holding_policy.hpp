// SPDX-License-Identifier: Apache-2.0
// A policy that asks the robot to stay where it is: answers every observation with its own positions, from a thread of
// the test. It speaks through the same mailboxes as a policy host.
#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include "executive/ipc/executive_segments.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"
#include "tests/executive/runtime/prompt_thread.hpp"

namespace takt::runtime::test {

class HoldingPolicy {
 public:
  // Descriptors as handed out to the policy role; they stay the caller's.
  HoldingPolicy(int observations, int commands, std::uint64_t policy_hash, std::uint16_t steps, Duration step_period)
      : observation_segment_(
            ipc::Segment::adopt_read_only(dup(observations), ipc::ring_bytes(ipc::observation_mailbox())).value()),
        command_segment_(ipc::Segment::adopt_writable(dup(commands), ipc::ring_bytes(ipc::command_mailbox())).value()),
        observations_(ipc::SlotReader::attach(observation_segment_.readable(), ipc::observation_mailbox()).value()),
        commands_(command_segment_.writable(), ipc::command_mailbox()),
        chunk_(std::make_unique<CommandChunk>()) {
    chunk_->header.policy_hash = policy_hash;
    chunk_->header.step_count = steps;
    chunk_->header.step_period = step_period;
    chunk_->header.fields = static_cast<std::uint8_t>(CommandField::q);
  }
  ~HoldingPolicy() { stop(); }
  HoldingPolicy(const HoldingPolicy&) = delete;
  HoldingPolicy& operator=(const HoldingPolicy&) = delete;

  // Once the executive has sealed the mailbox, or is about to.
  void start() {
    thread_ = std::thread([this] {
      make_this_thread_prompt();
      while (!done_) {
        answer();
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
      }
    });
  }
  void stop() {
    done_ = true;
    if (thread_.joinable()) thread_.join();
  }

 private:
  void answer() {
    Observation observation;
    if (observations_.read_latest(std::as_writable_bytes(std::span(&observation, 1))).status !=
        ipc::ReadStatus::fresh) {
      return;
    }
    CommandHeader& header = chunk_->header;
    header.observation_id = observation.id;
    ++header.sequence;
    header.outside_sensed_at = header.dequeued_at = header.infer_started_at = header.infer_ended_at =
        header.published_at = observation.published_at;
    header.joint_count = static_cast<std::uint16_t>(observation.joint_count);
    for (std::size_t step = 0; step < header.step_count; ++step) {
      for (std::size_t joint = 0; joint < header.joint_count; ++joint) {
        chunk_->values[value_index(header, CommandField::q, step, joint)] = observation.q[joint];
      }
    }
    commands_.publish(std::as_bytes(std::span(chunk_.get(), 1)).first(chunk_->used_bytes()));
  }

  ipc::Segment observation_segment_, command_segment_;
  ipc::SlotReader observations_;
  ipc::SlotWriter commands_;
  std::unique_ptr<CommandChunk> chunk_;
  std::atomic<bool> done_ = false;
  std::thread thread_;
};

}  // namespace takt::runtime::test
