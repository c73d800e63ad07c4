// SPDX-License-Identifier: Apache-2.0
// Any bytes from an IMU's serial line: samples are found among them, or none; what waits for its end is bounded.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "sensors/imu/mtdata2.hpp"
#include "tests/fuzz/refused_with_a_sentence.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace takt::sensors;
  takt::fuzz::judge(parse_mtdata2({data, size}));
  MtStream stream;
  std::uint64_t bytes = 0;
  for (std::span<const std::uint8_t> left(data, size); !left.empty();) {
    const std::size_t piece = std::min<std::size_t>(left.size(), 1 + left[0] % 64);
    for (const MtMessage& message : stream.take(left.first(piece), Heard(takt::MonoTime{1}))) {
      bytes += message.data.size();
      if (message.id == kMtData2) takt::fuzz::judge(parse_mtdata2(message.data));
    }
    left = left.subspan(piece);
  }
  if (bytes + stream.counts().skipped > size) std::abort();  // no byte counts twice
  return 0;
}
