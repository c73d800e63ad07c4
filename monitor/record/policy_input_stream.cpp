// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/policy_input_stream.hpp"

#include <fmt/format.h>

#include "executive/ipc/executive_segments.hpp"
#include "monitor/record/policy_input_message.hpp"
#include "monitor/record/run_messages.hpp"

namespace takt::monitor {

PolicyInputStream::PolicyInputStream(std::span<const std::byte> memory, std::size_t largest_input, Player of)
    : memory_(memory), shape_(ipc::policy_input_ring(largest_input)), of_(of), buffer_(largest_input) {}

void PolicyInputStream::report(std::string_view reason, std::uint64_t count, const RecordSink& sink) const {
  if (count != 0) sink.loss({fmt::format("{}_input", name(of_)), std::string(reason), count, 0, 0});
}

void PolicyInputStream::drain(const RecordSink& sink, TokenBucket& bucket) {
  if (!reader_) {
    auto reader = ipc::SlotReader::attach(memory_, shape_);
    if (!reader) return;  // it is not formatted yet
    reader_ = *reader;
  }
  read(sink, bucket);
}

void PolicyInputStream::read(const RecordSink& sink, TokenBucket& bucket) {
  std::uint64_t unreadable = 0, too_many = 0;
  for (std::uint32_t count = 0; count < shape_.slot_count; ++count) {
    const ipc::ReadResult result = reader_->read_next(buffer_);
    if (result.status == ipc::ReadStatus::nothing_new || result.status == ipc::ReadStatus::contended) break;
    if (result.sequence == 0) break;  // the head itself makes no sense: nothing was consumed
    report(seen_any_ ? "overwritten" : "before_attach", result.lost, sink);
    seen_any_ = true;
    const bool is_fresh = result.status == ipc::ReadStatus::fresh;
    auto input = is_fresh ? read_policy_input(std::span(buffer_).first(result.size)) : std::nullopt;
    if (!input) {
      ++unreadable;
      continue;
    }
    if (!bucket.take()) {
      ++too_many;
      continue;
    }
    RecordedPolicyInput recorded{of_, std::move(*input), 0};
    recorded.crc = crc_of(recorded.input);
    sink.policy_input(recorded);
  }
  report("unreadable", unreadable, sink);
  report(kTooMany, too_many, sink);
}

}  // namespace takt::monitor
