// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/standby_thinner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

namespace takt::monitor {
namespace {

constexpr Duration kQuietFor = seconds(5);
// Frames are told before the ticks they belong to, by one drain of the rings at most.
constexpr std::size_t kMostFrames = 65'536;

}  // namespace

bool StandbyThinner::is_quiet(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  const bool quiet = header.mode == Mode::standby && header.previous_mode == Mode::standby &&
                     header.operator_request == OperatorRequest::none && header.causes_active == causes_;
  causes_ = header.causes_active;
  newest_at_ = header.now;
  if (!quiet || !loud_at_.is_set()) loud_at_ = header.now;
  return quiet;
}

void StandbyThinner::command(const RecordedCommand& command) {
  if (!holds_back()) return kept_.command(command);
  held_.emplace_back(command);
}

void StandbyThinner::policy_input(const RecordedPolicyInput& input) {
  if (!holds_back()) return kept_.policy_input(input);
  held_.emplace_back(input);
}

void StandbyThinner::tick(const TickRecord& record) {
  const bool quiet = is_quiet(record);
  if (thins_ && (!quiet || held_ticks_ >= kMostHeld)) let_go();
  if (!holds_back()) {
    last_kept_ = record.header.tick;
    ++ticks_;
    return kept_.tick(record);
  }
  ++ticks_;
  ++held_ticks_;
  const auto bytes = bytes_of(record).first(record.used_bytes());
  held_.emplace_back(HeldTick{Bytes(bytes.begin(), bytes.end())});
}

void StandbyThinner::frame(const FrameRecord& frame) {
  const bool is_kept = !thins_ || frame.tick <= keyframe_tick_ + window_;
  if (is_kept && frames_.empty()) return kept_.frame(frame);
  frames_.push_back(frame);
  if (frames_.size() > kMostFrames) let_go();
}

void StandbyThinner::keyframe(const RecordedKeyframe& keyframe) {
  if (thins_) leave_out(keyframe.tick);
  const std::uint64_t period = keyframe.tick - std::exchange(keyframe_tick_, keyframe.tick);
  kept_.keyframe(keyframe);
  ticks_ = 0;
  window_ = std::max<std::uint64_t>(period / kOneIn, 1);
  thins_ = thins_ || (loud_at_.is_set() && newest_at_ - loud_at_ >= kQuietFor);
  std::deque<FrameRecord> later;
  later.swap(frames_);
  for (const FrameRecord& one : later) frame(one);
}

void StandbyThinner::let_go() {
  thins_ = false;
  for (const FrameRecord& one : std::exchange(frames_, {})) kept_.frame(one);
  for (const Held& held : std::exchange(held_, {})) {
    if (const auto* const command = std::get_if<RecordedCommand>(&held)) kept_.command(*command);
    if (const auto* const input = std::get_if<RecordedPolicyInput>(&held)) kept_.policy_input(*input);
    if (const auto* const tick = std::get_if<HeldTick>(&held)) {
      TickRecord record{};
      std::memcpy(&record, tick->bytes.data(), tick->bytes.size());
      last_kept_ = record.header.tick;
      kept_.tick(record);
    }
  }
  held_ticks_ = 0;
}

void StandbyThinner::leave_out(std::uint64_t through_tick) {
  std::map<std::string, std::uint64_t> inputs;
  for (const Held& held : held_)
    if (const auto* const input = std::get_if<RecordedPolicyInput>(&held))
      ++inputs[fmt::format("{}_input", name(input->sender))];
  if (held_ticks_ != 0) kept_.loss({"tick", std::string(kStoodBy), held_ticks_, last_kept_, through_tick + 1});
  for (const auto& [ring, count] : inputs)
    kept_.loss({ring, std::string(kStoodBy), count, last_kept_, through_tick + 1});
  held_.clear();
  held_ticks_ = 0;
  std::erase_if(
      frames_, [&](const FrameRecord& one) { return one.tick > keyframe_tick_ + window_ && one.tick <= through_tick; });
}

}  // namespace takt::monitor
