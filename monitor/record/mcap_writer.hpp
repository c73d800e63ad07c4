// SPDX-License-Identifier: Apache-2.0
// Writes an MCAP file that survives being cut off: schemas and channels first, then zstd chunks that are each whole on
// disk, then, when finish() is reached, message counts, indexes and the footer that make it quick to open.
//
// Profile "ros2", schema encoding "ros2msg", message encoding "cdr". Times are nanoseconds of the caller's log clock.
// Memory is bounded by one chunk plus the index: 48 bytes for a chunk and 8 for each topic in it. Thread rule: one
// thread.
// Source: the MCAP specification, version 0 of the format (mcap.dev/spec).
#pragma once

#include <cstdint>
#include <deque>
#include <expected>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "monitor/record/bounded_file.hpp"
#include "monitor/record/bytes.hpp"

namespace takt::monitor {

struct McapTopic {
  std::string topic;        // "/takt/tick"
  std::string schema_name;  // "takt_msgs/msg/Tick"
  std::string schema;       // ros2msg text
};

class McapWriter {
 public:
  // Channel ids are 1, 2, ... in the order of `topics`; `metadata` becomes one metadata record called "takt".
  static std::expected<McapWriter, std::string> create(const std::string& path, std::uint64_t max_bytes,
                                                       const std::vector<McapTopic>& topics,
                                                       const std::map<std::string, std::string>& metadata);

  // Into the open chunk, in memory. The caller flushes when pending_bytes() has grown to what it likes for a chunk.
  void write(std::uint16_t channel, std::uint64_t log_time, std::span<const std::byte> message);
  [[nodiscard]] std::size_t pending_bytes() const { return chunk_.size(); }
  // Closes the chunk, if it holds anything, and hands it to the medium. False once the file takes no more;
  // file().failure() says why, and the chunk's messages are gone.
  bool flush();
  // Forgets the messages of the open chunk.
  void discard_pending();
  // Closes the last chunk and writes summary and footer.
  bool finish();

  [[nodiscard]] BoundedFile& file() { return file_; }
  [[nodiscard]] const BoundedFile& file() const { return file_; }

 private:
  struct IndexEntry {
    std::uint64_t log_time, offset;
  };
  // Kept until the file is closed, thousands of them in a part of a session: small.
  struct ChunkIndex {
    std::uint64_t first_time, last_time, offset;
    std::uint32_t length, index_length, compressed, uncompressed, topics;
  };
  // Of one topic in one chunk, in the order of the chunks.
  struct TopicIndex {
    std::uint32_t at;  // bytes behind the chunk's offset
    std::uint16_t channel;
  };

  explicit McapWriter(BoundedFile file) : file_(std::move(file)) {}
  ChunkIndex fill_record(std::vector<TopicIndex>& topics);
  Bytes summary(std::uint64_t start) const;
  void put_statistics(Bytes& out) const;

  BoundedFile file_;
  Bytes definitions_;  // schema and channel records, repeated in the summary
  std::size_t schema_bytes_ = 0;
  std::uint64_t metadata_offset_ = 0, metadata_length_ = 0;
  std::size_t topic_count_ = 0;

  Bytes chunk_;
  Bytes packed_, record_;  // of the newest chunk; kept, so that each takes the memory of the one before
  std::size_t pending_messages_ = 0;
  std::uint64_t chunk_first_ = 0, chunk_last_ = 0;
  std::map<std::uint16_t, std::vector<IndexEntry>> chunk_entries_;

  std::deque<ChunkIndex> chunks_;  // deques: they grow without a copy
  std::deque<TopicIndex> topics_;
  std::map<std::uint16_t, std::uint64_t> counts_;  // messages that reached the file
  std::map<std::uint16_t, std::uint32_t> sequences_;
};

}  // namespace takt::monitor
