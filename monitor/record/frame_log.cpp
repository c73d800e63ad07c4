// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/frame_log.hpp"

#include <zstd.h>

#include <array>
#include <filesystem>
#include <memory>

#include "monitor/record/bounded_file.hpp"

namespace takt::monitor {
namespace {

constexpr int kFrameCompressionLevel = 1;  // a recorder shares two cores with a robot

}  // namespace

Bytes compressed_frames(std::string_view lines) {
  Bytes out(ZSTD_compressBound(lines.size()));
  out.resize(ZSTD_compress(out.data(), out.size(), lines.data(), lines.size(), kFrameCompressionLevel));
  return out;
}

std::expected<std::string, std::string> read_frame_log(const RunFolder& folder) {
  std::error_code error;
  if (!std::filesystem::exists(folder.frames(), error)) return read_file(folder.path() + "/can.log");
  const auto packed = read_file(folder.frames());
  if (!packed) return std::unexpected(packed.error());
  const std::unique_ptr<ZSTD_DStream, std::size_t (*)(ZSTD_DStream*)> stream(ZSTD_createDStream(), &ZSTD_freeDStream);
  std::string lines;
  std::array<char, 65536> piece{};
  ZSTD_inBuffer in{packed->data(), packed->size(), 0};
  for (bool is_full = false; in.pos < in.size || is_full;) {
    ZSTD_outBuffer out{piece.data(), piece.size(), 0};
    if (ZSTD_isError(ZSTD_decompressStream(stream.get(), &out, &in)) != 0U) break;
    lines.append(piece.data(), out.pos);
    is_full = out.pos == piece.size();
  }
  return lines;
}

}  // namespace takt::monitor
