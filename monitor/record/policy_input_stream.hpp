// What one policy's host says of its network's inputs, read from its ring into a RecordSink. The ring belongs to one
// session of the host, who formats it when it comes: until then there is nothing in it.
//
// The writer is untrusted and waits for nobody: what it overwrote before it was read, and what is no policy input, is
// reported as a loss of the ring `policy_input`, `fallback_input` or `candidate_input`. Reads shared memory only.
// Thread rule: one thread.
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

namespace takt::monitor {

class PolicyInputStream {
 public:
  // `memory`: ring_bytes(policy_input_ring(largest_input)), outlives this. `of`: policy or fallback.
  PolicyInputStream(std::span<const std::byte> memory, std::size_t largest_input, Player of);
  // At most one ring's worth.
  void drain(const RecordSink& sink);

 private:
  void read(const RecordSink& sink);
  void report(std::string_view reason, std::uint64_t count, const RecordSink& sink) const;

  std::span<const std::byte> memory_;
  ipc::RingShape shape_;
  Player of_;
  std::optional<ipc::SlotReader> reader_;
  bool seen_any_ = false;
  Bytes buffer_;
};

}  // namespace takt::monitor
