// SPDX-License-Identifier: Apache-2.0
// Reads an MCAP file from front to back without needing its summary, so that a file cut off anywhere still gives back
// every message of every chunk that is whole. Understands zstd and uncompressed chunks, and messages outside chunks.
//
// Nothing in the file is trusted: lengths are checked against what is there, chunks against their CRC and size limits,
// and damage ends up in report(), never in a crash. Thread rule: one thread. Errors of open() are one sentence.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <functional>
#include <map>
#include <string>
#include <string_view>

#include "monitor/record/bytes.hpp"

namespace takt::monitor {

struct McapMessage {
  std::string_view topic;
  std::string_view schema_name, schema;  // `schema`: its text; the same object for all messages of a channel
  std::uint64_t log_time = 0;            // ns
  std::span<const std::byte> data;
};

struct McapReport {
  bool finished = false;             // closed properly: footer and closing magic are there
  std::uint64_t unread_bytes = 0;    // at the end of the file, after the last whole record
  std::uint64_t damaged_chunks = 0;  // whole, but CRC or content wrong; skipped
  std::map<std::string, std::string> metadata;
};

class McapReader {
 public:
  // The content is mapped; the file must not be truncated meanwhile.
  static std::expected<McapReader, std::string> open(const std::string& path);
  McapReader(McapReader&& other) noexcept;
  McapReader& operator=(McapReader&&) = delete;
  McapReader(const McapReader&) = delete;
  McapReader& operator=(const McapReader&) = delete;
  ~McapReader();

  // Calls `on_message` for each message in file order, until it returns false.
  McapReport scan(const std::function<bool(const McapMessage&)>& on_message) const;

 private:
  explicit McapReader(std::span<const std::byte> content) : content_(content) {}
  std::span<const std::byte> content_;
};

}  // namespace takt::monitor
