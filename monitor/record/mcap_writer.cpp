// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/mcap_writer.hpp"

#include <zstd.h>

#include <algorithm>

#include "monitor/record/mcap_format.hpp"

namespace takt::monitor {
namespace {

using mcap::Builder;
using mcap::Opcode;

constexpr std::string_view kCompression = "zstd";
constexpr int kChunkCompressionLevel = 1;  // a recorder shares two cores with a robot

void put_definitions(Bytes& out, std::size_t& schema_bytes, const std::vector<McapTopic>& topics) {
  std::uint16_t id = 0;
  for (const McapTopic& topic : topics) {
    Builder(out).begin(Opcode::schema).put(++id).text(topic.schema_name).text("ros2msg").text(topic.schema).end();
  }
  schema_bytes = out.size();
  id = 0;
  for (const McapTopic& topic : topics) {
    ++id;
    Builder(out).begin(Opcode::channel).put(id).put(id).text(topic.topic).text("cdr").map({}).end();
  }
}

}  // namespace

std::expected<McapWriter, std::string> McapWriter::create(const std::string& path, std::uint64_t max_bytes,
                                                          const std::vector<McapTopic>& topics,
                                                          const std::map<std::string, std::string>& metadata) {
  auto file = BoundedFile::create(path, max_bytes);
  if (!file) return std::unexpected(file.error());
  McapWriter writer(std::move(*file));
  writer.topic_count_ = topics.size();
  put_definitions(writer.definitions_, writer.schema_bytes_, topics);

  Bytes start;
  Builder(start).raw(mcap::kMagic.data(), mcap::kMagic.size());
  Builder(start).begin(Opcode::header).text("ros2").text("takt-monitor").end();
  writer.metadata_offset_ = start.size();
  Builder(start).begin(Opcode::metadata).text("takt").map(metadata).end();
  writer.metadata_length_ = start.size() - writer.metadata_offset_;
  Builder(start).bytes(writer.definitions_);
  if (!writer.file_.append(start)) return std::unexpected(writer.file_.failure());
  if (!writer.file_.sync()) return std::unexpected(writer.file_.failure());
  return writer;
}

void McapWriter::write(std::uint16_t channel, std::uint64_t log_time, std::span<const std::byte> message) {
  if (pending_messages_ == 0) chunk_first_ = chunk_last_ = log_time;
  chunk_first_ = std::min(chunk_first_, log_time);
  chunk_last_ = std::max(chunk_last_, log_time);
  chunk_entries_[channel].push_back({log_time, chunk_.size()});
  Builder(chunk_)
      .begin(Opcode::message)
      .put(channel)
      .put(++sequences_[channel])
      .put(log_time)
      .put(log_time)
      .bytes(message)
      .end();
  ++pending_messages_;
}

// record_: the chunk record and the message indexes behind it, as one piece: on disk they appear together or not at
// all.
McapWriter::ChunkIndex McapWriter::fill_record(std::vector<TopicIndex>& topics) {
  packed_.resize(ZSTD_compressBound(chunk_.size()));
  packed_.resize(ZSTD_compress(packed_.data(), packed_.size(), chunk_.data(), chunk_.size(), kChunkCompressionLevel));
  record_.clear();
  Builder(record_)
      .begin(Opcode::chunk)
      .put(chunk_first_)
      .put(chunk_last_)
      .put(static_cast<std::uint64_t>(chunk_.size()))
      .put(mcap::crc32(chunk_))
      .text(kCompression)
      .put(static_cast<std::uint64_t>(packed_.size()))
      .bytes(packed_)
      .end();
  const auto length = static_cast<std::uint32_t>(record_.size());
  for (const auto& [channel, entries] : chunk_entries_) {
    topics.push_back({static_cast<std::uint32_t>(record_.size()), channel});
    const auto bytes = static_cast<std::uint32_t>(entries.size() * sizeof(IndexEntry));
    Builder(record_).begin(Opcode::message_index).put(channel).put(bytes).raw(entries.data(), bytes).end();
  }
  return {chunk_first_,
          chunk_last_,
          file_.size(),
          length,
          static_cast<std::uint32_t>(record_.size()) - length,
          static_cast<std::uint32_t>(packed_.size()),
          static_cast<std::uint32_t>(chunk_.size()),
          static_cast<std::uint32_t>(topics.size())};
}

bool McapWriter::flush() {
  if (pending_messages_ == 0) return file_.failure().empty();
  std::vector<TopicIndex> topics;
  const ChunkIndex index = fill_record(topics);
  const bool written = file_.append(record_) && file_.sync();
  if (written) {
    for (const auto& [channel, entries] : chunk_entries_) counts_[channel] += entries.size();
    chunks_.push_back(index);
    topics_.insert(topics_.end(), topics.begin(), topics.end());
  }
  discard_pending();
  return written;
}

void McapWriter::discard_pending() {
  chunk_.clear();
  chunk_entries_.clear();
  pending_messages_ = 0;
}

void McapWriter::put_statistics(Bytes& out) const {
  std::uint64_t messages = 0, first = 0, last = 0;
  for (const auto& [channel, count] : counts_) messages += count;
  for (const ChunkIndex& chunk : chunks_) {
    first = &chunk == &chunks_.front() ? chunk.first_time : std::min(first, chunk.first_time);
    last = std::max(last, chunk.last_time);
  }
  Builder builder(out);
  builder.begin(Opcode::statistics).put(messages).put(static_cast<std::uint16_t>(topic_count_));
  builder.put(static_cast<std::uint32_t>(topic_count_)).put(std::uint32_t{0}).put(std::uint32_t{1});
  builder.put(static_cast<std::uint32_t>(chunks_.size())).put(first).put(last);
  builder.put(static_cast<std::uint32_t>(counts_.size() * 10));
  for (const auto& [channel, count] : counts_) builder.put(channel).put(count);
  builder.end();
}

// Everything after the data: groups of equal records, an offset for each group, the footer, the closing magic.
Bytes McapWriter::summary(std::uint64_t start) const {
  Bytes out;
  struct Group {
    Opcode opcode;
    std::size_t first, last;
  };
  std::vector<Group> groups;
  const auto group = [&](Opcode opcode, auto&& fill) {
    const std::size_t first = out.size();
    fill();
    if (out.size() != first) groups.push_back({opcode, first, out.size()});
  };
  const std::span definitions(definitions_);
  group(Opcode::schema, [&] { Builder(out).bytes(definitions.first(schema_bytes_)); });
  group(Opcode::channel, [&] { Builder(out).bytes(definitions.subspan(schema_bytes_)); });
  group(Opcode::statistics, [&] { put_statistics(out); });
  group(Opcode::metadata_index, [&] {
    Builder(out).begin(Opcode::metadata_index).put(metadata_offset_).put(metadata_length_).text("takt").end();
  });
  group(Opcode::chunk_index, [&] {
    const auto wide = [](std::uint32_t bytes) { return std::uint64_t{bytes}; };
    auto topic = topics_.begin();
    for (const ChunkIndex& chunk : chunks_) {
      Builder builder(out);
      builder.begin(Opcode::chunk_index).put(chunk.first_time).put(chunk.last_time);
      builder.put(chunk.offset).put(wide(chunk.length)).put(chunk.topics * 10);
      for (std::uint32_t i = 0; i < chunk.topics; ++i, ++topic)
        builder.put(topic->channel).put(chunk.offset + topic->at);
      builder.put(wide(chunk.index_length)).text(kCompression);
      builder.put(wide(chunk.compressed)).put(wide(chunk.uncompressed)).end();
    }
  });
  const std::uint64_t offsets_start = start + out.size();
  for (const Group& each : groups) {
    Builder(out)
        .begin(Opcode::summary_offset)
        .put(static_cast<std::uint8_t>(each.opcode))
        .put(start + each.first)
        .put(static_cast<std::uint64_t>(each.last - each.first))
        .end();
  }
  const std::uint64_t footer_length = 20;
  Builder(out).put(static_cast<std::uint8_t>(Opcode::footer)).put(footer_length).put(start).put(offsets_start);
  Builder(out).put(mcap::crc32(out)).raw(mcap::kMagic.data(), mcap::kMagic.size());
  return out;
}

bool McapWriter::finish() {
  if (!flush()) return false;
  Bytes out;
  Builder(out).begin(Opcode::data_end).put(std::uint32_t{0}).end();
  const Bytes closing = summary(file_.size() + out.size());
  out.insert(out.end(), closing.begin(), closing.end());
  return file_.append(out) && file_.sync();
}

}  // namespace takt::monitor
