// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/record_stream.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "executive/ipc/crc32c.hpp"
#include "executive/ipc/executive_segments.hpp"

namespace takt::monitor {
namespace {

std::uint64_t tag_of(std::span<const std::byte> entry) {
  TickTag tag;
  std::memcpy(&tag, entry.data(), sizeof tag);
  return tag.tick;
}

}  // namespace

std::expected<RecordStream, std::string> RecordStream::attach(const RingMemories& rings, std::size_t joint_count,
                                                              std::size_t largest_command) {
  auto ticks = ipc::SlotReader::attach(rings.ticks, ipc::tick_ring(joint_count));
  auto commands = ipc::SlotReader::attach(rings.commands, ipc::command_ring(largest_command));
  auto keyframes = ipc::SlotReader::attach(rings.keyframes, ipc::keyframe_ring());
  auto frames = ipc::SlotReader::attach(rings.frames, ipc::frame_ring());
  for (const auto* ring : {&ticks, &commands, &keyframes, &frames}) {
    if (!*ring) return std::unexpected(ring->error());
  }
  return RecordStream({"tick", *ticks, ipc::tick_ring(joint_count).slot_count},
                      {"command", *commands, ipc::command_ring(largest_command).slot_count},
                      {"keyframe", *keyframes, ipc::keyframe_ring().slot_count},
                      {"frame", *frames, ipc::frame_ring().slot_count});
}

RecordStream::RecordStream(const Ring& ticks, const Ring& commands, const Ring& keyframes, const Ring& frames)
    : ticks_(ticks),
      commands_(commands),
      keyframes_(keyframes),
      frames_(frames),
      buffer_(std::max({sizeof(TickRecord), std::size_t{ipc::command_ring().payload_capacity},
                        std::size_t{ipc::keyframe_ring().payload_capacity}})) {}

void RecordStream::report(Ring& ring, std::uint64_t next_tick, const RecordSink& sink) {
  const std::string_view overwritten = ring.last_tick == 0 ? "before_attach" : "overwritten";
  if (ring.lost != 0) {
    sink.loss({std::string(ring.name), std::string(overwritten), ring.lost, ring.last_tick, next_tick});
  }
  if (ring.unreadable != 0) {
    sink.loss({std::string(ring.name), "unreadable", ring.unreadable, ring.last_tick, next_tick});
  }
  ring.lost = ring.unreadable = 0;
  if (next_tick != 0) ring.last_tick = next_tick;
}

void RecordStream::read_all(Ring& ring, const RecordSink& sink,
                            const std::function<void(std::span<const std::byte>)>& entry) {
  for (std::size_t count = 0; count < ring.slots; ++count) {
    const ipc::ReadResult result = ring.reader.read_next(buffer_);
    switch (result.status) {
      case ipc::ReadStatus::nothing_new:
        report(ring, 0, sink);
        return;
      case ipc::ReadStatus::contended:
        return;
      case ipc::ReadStatus::corrupt:
      case ipc::ReadStatus::cut:
        if (result.sequence == 0) return;  // the head itself makes no sense: nothing was consumed
        ring.lost += result.lost;
        ++ring.unreadable;
        break;
      case ipc::ReadStatus::fresh:
        ring.lost += result.lost;
        entry(std::span(buffer_).first(result.size));
        break;
    }
  }
}

void RecordStream::read_ticks(const RecordSink& sink) {
  read_all(ticks_, sink, [&](std::span<const std::byte> entry) {
    TickRecord record;
    if (entry.size() < sizeof(TickRecordHeader) || entry.size() > sizeof record) {
      ++ticks_.unreadable;
      return;
    }
    std::memcpy(&record, entry.data(), entry.size());
    if (record.header.joint_count > kMaxJoints || record.header.bus_count > kMaxBuses ||
        record.used_bytes() != entry.size()) {
      ++ticks_.unreadable;
      return;
    }
    report(ticks_, record.header.tick, sink);
    pending_ticks_.push_back(record);
  });
}

void RecordStream::read_tagged(const RecordSink& sink) {
  read_all(commands_, sink, [&](std::span<const std::byte> entry) {
    CommandTag tag;
    if (entry.size() < sizeof tag) {
      ++commands_.unreadable;
      return;
    }
    std::memcpy(&tag, entry.data(), sizeof tag);
    report(commands_, tag.tick, sink);
    const auto kept = entry.subspan(sizeof tag);
    RecordedCommand command{tag.tick, Bytes(kept.begin(), kept.end()), 0, {}, {}, tag.sender};
    if (kept.size() < tag.bytes) command.cut_from = tag.bytes, command.whole_crc = tag.crc;
    command.crc = crc_of(command);
    pending_commands_.push_back(std::move(command));
  });
  read_all(keyframes_, sink, [&](std::span<const std::byte> entry) {
    if (entry.size() < sizeof(TickTag)) {
      ++keyframes_.unreadable;
      return;
    }
    report(keyframes_, tag_of(entry), sink);
    const auto state = entry.subspan(sizeof(TickTag));
    pending_keyframes_.push_back({tag_of(entry), Bytes(state.begin(), state.end())});
  });
}

void RecordStream::hand_on(const RecordSink& sink, std::uint64_t up_to) {
  const auto commands_through = [&](std::uint64_t tick) {
    while (!pending_commands_.empty() && pending_commands_.front().tick <= tick) {
      sink.command(pending_commands_.front());
      pending_commands_.pop_front();
    }
  };
  const auto keyframes_through = [&](std::uint64_t tick) {
    while (!pending_keyframes_.empty() && pending_keyframes_.front().tick <= tick) {
      sink.keyframe(pending_keyframes_.front());
      pending_keyframes_.pop_front();
    }
  };
  while (!pending_ticks_.empty() && pending_ticks_.front().header.tick <= up_to) {
    const TickRecord& record = pending_ticks_.front();
    if (record.header.tick > 0) keyframes_through(record.header.tick - 1);  // of ticks that were lost
    commands_through(record.header.tick);
    sink.tick(record);
    keyframes_through(record.header.tick);
    pending_ticks_.pop_front();
  }
}

void RecordStream::drain(const RecordSink& sink, bool all) {
  // Frames first: theirs is the ring that fills fastest. Ticks before what is tied to them, see the header.
  read_all(frames_, sink, [&](std::span<const std::byte> entry) {
    FrameRecord frame;
    if (entry.size() != sizeof frame) {
      ++frames_.unreadable;
      return;
    }
    std::memcpy(&frame, entry.data(), sizeof frame);
    report(frames_, frame.tick, sink);
    sink.frame(frame);
  });
  read_ticks(sink);
  read_tagged(sink);
  if (ticks_.last_tick != 0) hand_on(sink, all ? ticks_.last_tick : ticks_.last_tick - 1);
}

}  // namespace takt::monitor
