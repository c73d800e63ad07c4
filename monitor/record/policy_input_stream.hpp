// SPDX-License-Identifier: Apache-2.0
// What one policy's host says of its network's inputs, read from its ring into a RecordSink. The ring belongs to one
// session of the host, who formats it when it comes: until then there is nothing in it.
//
// The writer is untrusted and never waits: what it overwrote before it was read, what is no policy input, and what
// is more than a policy can have answered (`bucket`), is reported as a loss of the ring `policy_input`,
// `fallback_input` or `candidate_input`. Reads shared memory only. Thread rule: one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "executive/contract/tick_record.hpp"
#include "executive/ipc/slot_ring.hpp"
#include "monitor/record/bytes.hpp"
#include "monitor/record/record_stream.hpp"
#include "monitor/record/token_bucket.hpp"

namespace takt::monitor {

class PolicyInputStream {
 public:
  // `memory`: ring_bytes(policy_input_ring(largest_input)), outlives this. `of`: policy or fallback.
  PolicyInputStream(std::span<const std::byte> memory, std::size_t largest_input, Player of);
  // At most one ring's worth, of which `bucket` says how much is kept: it outlives the sessions of a host, who would
  // begin anew otherwise.
  void drain(const RecordSink& sink, TokenBucket& bucket);

 private:
  void read(const RecordSink& sink, TokenBucket& bucket);
  void report(std::string_view reason, std::uint64_t count, const RecordSink& sink) const;

  std::span<const std::byte> memory_;
  ipc::RingShape shape_;
  Player of_;
  std::optional<ipc::SlotReader> reader_;
  bool seen_any_ = false;
  Bytes buffer_;
};

}  // namespace takt::monitor
