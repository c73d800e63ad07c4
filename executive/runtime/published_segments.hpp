// SPDX-License-Identifier: Apache-2.0
// What the executive publishes: the observation mailbox for the policy and the four record rings for the monitor.
// Sealed against other writers and pre-faulted at construction; publishing never waits and knows no reader.
//
// Thread rules: the publishing functions belong to the control thread (no allocation, lock or system call); descriptors
// and readers are for the service thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <string>
#include <vector>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::runtime {

class PublishedSegments {
 public:
  // `largest_command`: bytes of the largest message that command() is given.
  static std::expected<PublishedSegments, std::string> create(std::size_t joint_count,
                                                              std::size_t largest_command = sizeof(CommandChunk));

  void observation(const Observation& observation) noexcept;
  void tick(const TickRecord& record) noexcept;
  // The message as it was read, or the part of it that is kept.
  void command(const CommandTag& tag, std::span<const std::byte> kept) noexcept;
  void keyframe(std::uint64_t tick, std::span<const std::byte> state) noexcept;
  void frame(const FrameRecord& frame) noexcept;

  [[nodiscard]] int observation_descriptor() const { return observations_.segment.fd(); }
  // In the order of ipc/executive_segments.hpp.
  [[nodiscard]] std::vector<int> monitor_descriptors() const;
  [[nodiscard]] ipc::SlotReader tick_reader() const;
  [[nodiscard]] ipc::SlotReader frame_reader() const;

 private:
  struct Ring {
    ipc::Segment segment;
    ipc::SlotWriter writer;
  };
  static std::expected<Ring, std::string> make(const char* name, const ipc::RingShape& shape);
  PublishedSegments(std::size_t joint_count, Ring observations, Ring ticks, Ring commands, Ring keyframes, Ring frames);

  std::size_t joint_count_;
  Ring observations_, ticks_, commands_, keyframes_, frames_;
};

}  // namespace takt::runtime
