// SPDX-License-Identifier: Apache-2.0
// Any bytes as a ring that another process has written: the reader refuses it, or reads; never beyond the memory, never
// beyond its tries. Method: a ring as an honest writer leaves it, over which the input is laid.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <span>
#include <vector>

#include "executive/ipc/slot_ring.hpp"
#include "tests/fuzz/refused_with_a_sentence.hpp"

namespace {

using namespace takt::ipc;

constexpr RingShape kShape{.slot_count = 4, .payload_capacity = 96, .layout = 0x5EED};

struct alignas(64) Line {
  std::byte bytes[64];
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::size_t bytes = ring_bytes(kShape);
  std::vector<Line> lines((bytes + sizeof(Line) - 1) / sizeof(Line), Line{});
  const std::span<std::byte> memory(lines.front().bytes, bytes);
  SlotWriter writer(memory, kShape);
  std::vector<std::byte> payload(kShape.payload_capacity, std::byte{7});
  for (int i = 0; i < 6; ++i) writer.publish(payload);
  // Pairs of a place and what stands there then.
  for (; size >= 3; data += 3, size -= 3) memory[(data[0] + 256U * data[1]) % bytes] = std::byte{data[2]};
  auto reader = SlotReader::attach(memory, kShape);
  takt::fuzz::check_refusal(reader);
  if (!reader) return 0;
  std::vector<std::byte> out(kShape.payload_capacity / 2);
  for (int i = 0; i < 12; ++i) {
    const ReadResult result = i % 3 == 0 ? reader->read_latest(out) : reader->read_next(i % 3 == 1 ? out : payload);
    if (result.tries > kMaxTries) std::abort();
    if (result.status == ReadStatus::fresh && result.size > kShape.payload_capacity) std::abort();
  }
  reader->skip_to_newest();
  if (reader->has_news()) std::abort();  // all was skipped, and there is no writer
  return 0;
}
