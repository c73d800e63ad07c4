// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/mcap_reader.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>

#include "monitor/record/holes.hpp"
#include "monitor/record/mcap_format.hpp"

namespace takt::monitor {
namespace {

using mcap::Opcode;
using mcap::Parser;

// Uncompressed bytes: a lying header must not exhaust memory, nor a small file hours. Ticks of a robot at rest reach
// some 50 of them to one in the file.
constexpr std::uint64_t kLargestChunk = 64U << 20U, kLargestRatio = 1000;
constexpr std::uint64_t kFree = 8U << 20U, kLargestTotalRatio = 100;  // of all chunks together
constexpr std::uint64_t kRecord = 512;                                // what reading one costs, beside its bytes

struct Schema {
  std::string name, text;
};

struct Channel {
  std::string topic;
  std::shared_ptr<const Schema> schema;
};

// Pages of the mapping that were read need no memory any more.
void release(std::span<const std::byte> read) {
  constexpr std::size_t kPage = 4096;
  // madvise wants the pointer mmap gave, which was not const.
  auto* data = const_cast<std::byte*>(read.data());
  const std::size_t skipped = (kPage - reinterpret_cast<std::uintptr_t>(data) % kPage) % kPage;
  if (read.size() < skipped + kPage) return;
  (void)::madvise(data + skipped, (read.size() - skipped) / kPage * kPage, MADV_DONTNEED);
}

class FileScan {
 public:
  FileScan(const std::function<bool(const McapMessage&)>& on_message, std::uint64_t file_bytes)
      : on_message_(on_message), left_(kFree + kLargestTotalRatio * file_bytes) {}
  McapReport report;

  // Returns false when the scan is over: end of data, damage, or the caller has had enough.
  bool record(Opcode opcode, std::span<const std::byte> content) {
    Parser parser(content);
    switch (opcode) {
      case Opcode::schema: {
        const auto id = parser.get<std::uint16_t>();
        auto schema = std::make_shared<Schema>();
        schema->name = parser.text();
        (void)parser.text();  // its encoding
        schema->text = parser.text();
        if (!parser.ok()) return false;
        // One id, one schema: it stays where readers have seen it.
        const auto& kept = *schemas_.try_emplace(id, schema).first->second;
        return kept.name == schema->name && kept.text == schema->text ? true : damaged();
      }
      case Opcode::channel: {
        const auto id = parser.get<std::uint16_t>();
        const auto schema = parser.get<std::uint16_t>();
        const auto found = schemas_.find(schema);
        channels_[id] = {parser.text(), found == schemas_.end() ? std::make_shared<Schema>() : found->second};
        return parser.ok();
      }
      case Opcode::message:
        return message(parser);
      case Opcode::chunk:
        return chunk(parser);
      case Opcode::metadata:
        (void)parser.text();
        report.metadata.merge(parser.map());
        return true;
      case Opcode::footer:
        report.finished = true;
        return false;
      case Opcode::header:
      case Opcode::message_index:
      case Opcode::chunk_index:
      case Opcode::attachment:
      case Opcode::attachment_index:
      case Opcode::statistics:
      case Opcode::metadata_index:
      case Opcode::summary_offset:
      case Opcode::data_end:
        return true;
    }
    return true;  // opcodes of later versions are skipped, as the specification asks
  }

  // Walks whole records; returns what is left behind them.
  std::span<const std::byte> records(std::span<const std::byte> in) {
    while (in.size() >= mcap::kRecordHead) {
      Parser head(in);
      const auto opcode = static_cast<Opcode>(head.get<std::uint8_t>());
      const auto length = head.get<std::uint64_t>();
      if (length > in.size() - mcap::kRecordHead) break;
      if (in_chunk_ && !spend(kRecord)) {
        damaged();
        break;
      }
      const auto content = in.subspan(mcap::kRecordHead, static_cast<std::size_t>(length));
      in = in.subspan(mcap::kRecordHead + content.size());
      if (!record(opcode, content)) {
        stopped_ = true;
        break;
      }
    }
    return in;
  }
  [[nodiscard]] bool stopped() const { return stopped_; }

 private:
  bool message(Parser& parser) {
    const auto channel = channels_.find(parser.get<std::uint16_t>());
    (void)parser.get<std::uint32_t>();
    const auto log_time = parser.get<std::uint64_t>();
    (void)parser.get<std::uint64_t>();
    if (!parser.ok() || channel == channels_.end()) return true;
    const Schema& schema = *channel->second.schema;
    return on_message_({channel->second.topic, schema.name, schema.text, log_time, parser.rest()});
  }

  bool chunk(Parser& parser) {
    (void)parser.get<std::uint64_t>();
    (void)parser.get<std::uint64_t>();
    const auto size = parser.get<std::uint64_t>();
    const auto crc = parser.get<std::uint32_t>();
    const std::string compression = parser.text();
    const auto stored = parser.take(parser.get<std::uint64_t>());
    if (!parser.ok() || size > kLargestChunk || size > kLargestRatio * stored.size()) return damaged();
    if (in_chunk_) return damaged();  // no chunk lies in a chunk
    Bytes plain;
    std::span<const std::byte> content = stored;
    if (compression == "zstd") {
      if (!spend(size)) return damaged();
      plain.resize(static_cast<std::size_t>(size));
      if (ZSTD_decompress(plain.data(), plain.size(), stored.data(), stored.size()) != plain.size()) return damaged();
      content = plain;
    } else if (!compression.empty()) {
      return damaged();
    }
    if (crc != 0 && mcap::crc32(content) != crc) return damaged();
    in_chunk_ = true;
    records(content);
    in_chunk_ = false;
    release(stored);
    return !stopped_;
  }

  bool spend(std::uint64_t bytes) {
    if (bytes > left_) return false;
    left_ -= bytes;
    return true;
  }

  bool damaged() {
    ++report.damaged_chunks;
    return true;
  }

  const std::function<bool(const McapMessage&)>& on_message_;
  std::map<std::uint16_t, std::shared_ptr<const Schema>> schemas_;
  std::map<std::uint16_t, Channel> channels_;
  std::uint64_t left_;  // of what chunks may cost
  bool in_chunk_ = false;
  bool stopped_ = false;
};

}  // namespace

std::expected<McapReader, std::string> McapReader::open(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) return std::unexpected(fmt::format("cannot open {}: {}", path, std::strerror(errno)));
  struct stat status {};
  const bool is_file = ::fstat(fd, &status) == 0 && S_ISREG(status.st_mode);
  if (is_file && is_mostly_holes(path, status)) {
    ::close(fd);
    return std::unexpected(fmt::format("most of {} are holes", path));
  }
  const auto size = is_file ? static_cast<std::size_t>(status.st_size) : 0;
  void* data = size >= mcap::kMagic.size() ? ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, fd, 0) : MAP_FAILED;
  ::close(fd);
  if (data == MAP_FAILED) {
    const char* const why = is_file ? "is too short to be an MCAP file" : "is not a file";
    return std::unexpected(fmt::format("{} {}", path, why));
  }
  McapReader reader({static_cast<const std::byte*>(data), size});
  if (std::memcmp(data, mcap::kMagic.data(), mcap::kMagic.size()) != 0) {
    return std::unexpected(fmt::format("{} is not an MCAP file: its first bytes are wrong", path));
  }
  return reader;
}

McapReader::McapReader(McapReader&& other) noexcept : content_(std::exchange(other.content_, {})) {}

McapReader::~McapReader() {
  // munmap wants the pointer mmap gave, which was not const.
  if (!content_.empty()) ::munmap(const_cast<std::byte*>(content_.data()), content_.size());
}

McapReport McapReader::scan(const std::function<bool(const McapMessage&)>& on_message) const {
  FileScan scan(on_message, content_.size());
  const auto left = scan.records(content_.subspan(mcap::kMagic.size()));
  if (!scan.stopped()) scan.report.unread_bytes = left.size();
  return scan.report;
}

}  // namespace takt::monitor
