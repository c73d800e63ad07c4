// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/segment_seal.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <utility>

namespace takt::monitor {

void SegmentSeal::add(std::span<const std::byte> piece) {
  sha_.add(piece);
  open_bytes_ += piece.size();
}

void SegmentSeal::close(std::int64_t until_unix_ns) {
  if (open_bytes_ == 0) return;
  closed_.push_back({open_bytes_, until_unix_ns, sha_.hex()});
  closed_bytes_ += std::exchange(open_bytes_, 0);
}

void SegmentSeal::cut_back(const std::string& path, std::uint64_t size) {
  (void)sha_.hex();
  open_bytes_ = 0;
  std::ifstream in(path, std::ios::binary);
  in.seekg(static_cast<std::streamoff>(closed_bytes_));
  std::array<char, 65536> buffer{};
  std::uint64_t left = size > closed_bytes_ ? size - closed_bytes_ : 0;
  while (left > 0 && in) {
    in.read(buffer.data(), static_cast<std::streamsize>(std::min<std::uint64_t>(left, buffer.size())));
    const auto got = static_cast<std::size_t>(in.gcount());
    add(std::as_bytes(std::span(buffer).first(got)));
    left -= got;
  }
}

}  // namespace takt::monitor
