// SPDX-License-Identifier: Apache-2.0
// The executive's four record rings, merged back into the order of the loop.
//
// A tick is handed on once a later one has been seen: by then everything the loop published for it is in the rings, so
// its command, keyframe and the tick itself come out together, whatever the reader's pace. CAN frames come in their own
// order at once. What the loop overwrote before it was read, or what could not be read, is reported as a loss.
//
// Reads shared memory only; the executive never learns of it. Memory is bounded by the rings' own sizes.
// Thread rule: one thread.
#pragma once

#include <cstdint>
#include <deque>
#include <expected>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "executive/contract/tick_record.hpp"
#include "executive/ipc/slot_ring.hpp"
#include "monitor/record/bytes.hpp"
#include "monitor/record/image_message.hpp"
#include "monitor/record/policy_input_message.hpp"
#include "monitor/record/run_messages.hpp"

namespace takt::monitor {

struct RingMemories {
  std::span<const std::byte> ticks, commands, keyframes, frames;
};

struct RecordSink {
  std::function<void(const RecordedCommand&)> command;  // before its tick
  std::function<void(const TickRecord&)> tick;
  std::function<void(const RecordedKeyframe&)> keyframe;  // behind its tick
  std::function<void(const FrameRecord&)> frame;
  std::function<void(const Loss&)> loss;
  std::function<void(const RecordedPolicyInput&)> policy_input = {};  // of a PolicyInputStream
  std::function<void(const ShownImage&)> image = {};                  // of an ImageWatch
  std::function<void(const ShownPicture&)> picture = {};              // of an ImageWatch, behind its image
};

class RecordStream {
 public:
  // `joint_count` fixes the shape of the tick ring, `largest_command` that of the command ring. The error is one
  // sentence.
  static std::expected<RecordStream, std::string> attach(const RingMemories& rings, std::size_t joint_count,
                                                         std::size_t largest_command = sizeof(CommandChunk));

  // Hands on what can be handed on now. `all`: the newest tick too, because none will follow.
  void drain(const RecordSink& sink, bool all);

 private:
  struct Ring {
    std::string_view name;
    ipc::SlotReader reader;
    std::size_t slots;
    std::uint64_t last_tick = 0;   // of the newest entry; 0 none yet
    std::uint64_t lost = 0;        // since the last entry
    std::uint64_t unreadable = 0;  // since the last entry
  };
  RecordStream(const Ring& ticks, const Ring& commands, const Ring& keyframes, const Ring& frames);

  // Reads at most one ring's worth of entries.
  void read_all(Ring& ring, const RecordSink& sink, const std::function<void(std::span<const std::byte>)>& entry);
  // Declares what was lost up to an entry of `next_tick`; 0: up to nothing yet.
  static void report(Ring& ring, std::uint64_t next_tick, const RecordSink& sink);
  void read_ticks(const RecordSink& sink);
  void read_tagged(const RecordSink& sink);
  void hand_on(const RecordSink& sink, std::uint64_t up_to);

  Ring ticks_, commands_, keyframes_, frames_;
  Bytes buffer_;
  std::deque<TickRecord> pending_ticks_;
  std::deque<RecordedCommand> pending_commands_;
  std::deque<RecordedKeyframe> pending_keyframes_;
};

}  // namespace takt::monitor
