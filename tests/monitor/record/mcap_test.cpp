// SPDX-License-Identifier: Apache-2.0
// Goal: what was written is read back, whatever happened to the file in between. Method: a small recording, cut off at
// every length, damaged at every byte, and stopped by a size limit.
#include <gtest/gtest.h>
#include <malloc.h>
#include <sys/stat.h>
#include <zstd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <tuple>

#include "monitor/record/mcap_format.hpp"
#include "monitor/record/mcap_reader.hpp"
#include "monitor/record/mcap_writer.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

constexpr std::uint64_t kMessages = 30;
constexpr std::uint64_t kPerChunk = 10;

class McapTest : public test::TemporaryFolder {
 protected:
  const std::string file_ = path("ticks.mcap");
  std::vector<std::uint64_t> ends_;  // file size after each chunk

  void record(std::uint64_t max_bytes = 1U << 20U) {
    auto writer = McapWriter::create(file_, max_bytes, {{"/a", "pkg/msg/A", "uint64 a\n"}, {"/b", "pkg/msg/B", ""}},
                                     {{"run_id", "r1"}});
    ASSERT_TRUE(writer) << writer.error();
    ends_.push_back(writer->file().size());
    for (std::uint64_t message = 0; message < kMessages; ++message) {
      writer->write(static_cast<std::uint16_t>(1 + message % 2), 100 + message, bytes_of(message));
      if (message % kPerChunk == kPerChunk - 1 && writer->flush()) ends_.push_back(writer->file().size());
    }
    finished_ = writer->finish();
  }

  // Number of messages given back, after checking that they are the first ones, in order and unharmed.
  static std::uint64_t read(const std::string& file, McapReport* report = nullptr) {
    const auto reader = McapReader::open(file);
    if (!reader) return 0;
    std::uint64_t count = 0;
    const McapReport result = reader->scan([&](const McapMessage& message) {
      std::uint64_t value = 0;
      EXPECT_EQ(message.data.size(), sizeof value);
      std::memcpy(&value, message.data.data(), sizeof value);
      EXPECT_EQ(value, count);
      EXPECT_EQ(message.log_time, 100 + count);
      EXPECT_EQ(message.topic, count % 2 == 0 ? "/a" : "/b");
      EXPECT_EQ(message.schema_name, count % 2 == 0 ? "pkg/msg/A" : "pkg/msg/B");
      ++count;
      return true;
    });
    if (report != nullptr) *report = result;
    return count;
  }
  bool finished_ = false;

  static Bytes chunk_of(const std::vector<char>& plain) {
    Bytes whole;
    std::vector<char> packed(ZSTD_compressBound(plain.size()));
    packed.resize(ZSTD_compress(packed.data(), packed.size(), plain.data(), plain.size(), 3));
    mcap::Builder chunk(whole);
    chunk.begin(mcap::Opcode::chunk).put(std::uint64_t{0}).put(std::uint64_t{0}).put(std::uint64_t{plain.size()});
    chunk.put(std::uint32_t{0}).text("zstd").put(std::uint64_t{packed.size()}).raw(packed.data(), packed.size()).end();
    return whole;
  }
};

TEST_F(McapTest, GivesBackWhatWasWritten) {
  record();
  McapReport report;
  EXPECT_TRUE(finished_);
  EXPECT_EQ(read(file_, &report), kMessages);
  EXPECT_TRUE(report.finished);
  EXPECT_EQ(report.metadata.at("run_id"), "r1");
  EXPECT_EQ(report.damaged_chunks, 0U);
}

TEST_F(McapTest, CutAnywhereItGivesBackEveryWholeChunk) {
  record();
  for (std::uint64_t length = std::filesystem::file_size(file_) - 1; length > 0; --length) {
    std::filesystem::resize_file(file_, length);
    const auto whole = static_cast<std::uint64_t>(
        std::count_if(ends_.begin() + 1, ends_.end(), [&](std::uint64_t end) { return end <= length; }));
    const std::uint64_t count = read(file_);
    // A chunk's messages are there as soon as the chunk is, even when the index behind it is cut.
    ASSERT_GE(count, whole * kPerChunk) << length;
    ASSERT_LE(count, (whole + 1) * kPerChunk) << length;
    ASSERT_EQ(count % kPerChunk, 0U) << length;
  }
}

// Whatever byte is wrong, no message comes back altered: the checks inside read() would see it.
// Threat: run-damaged
TEST_F(McapTest, ADamagedByteNeverAltersAMessage) {
  record();
  const auto size = std::filesystem::file_size(file_);
  for (std::uint64_t at = ends_.front(); at < size; ++at) {
    std::fstream file(file_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(static_cast<std::streamoff>(at));
    const auto byte = static_cast<char>(file.get() ^ 0x10);
    file.seekp(static_cast<std::streamoff>(at));
    file.put(byte);
    file.close();
    const auto reader = McapReader::open(file_);
    ASSERT_TRUE(reader);
    std::uint64_t count = 0;
    (void)reader->scan([&](const McapMessage& message) {
      std::uint64_t value = 0;
      std::memcpy(&value, message.data.data(), std::min(message.data.size(), sizeof value));
      EXPECT_EQ(value + 100, message.log_time);
      return ++count <= kMessages;
    });
    EXPECT_LE(count, kMessages);
    std::fstream mend(file_, std::ios::in | std::ios::out | std::ios::binary);
    mend.seekp(static_cast<std::streamoff>(at));
    mend.put(static_cast<char>(byte ^ 0x10));
  }
}

// The size limit keeps whole chunks and says why; what is there can be read.
TEST_F(McapTest, ASizeLimitKeepsWholeChunks) {
  record();
  const std::uint64_t limit = ends_[2] + 5;
  std::filesystem::remove(file_);
  ends_.clear();
  record(limit);
  EXPECT_FALSE(finished_);
  EXPECT_EQ(std::filesystem::file_size(file_), ends_.back());
  EXPECT_EQ(read(file_), 2 * kPerChunk);
}

// Goal: a recorder that runs for hours keeps little of what it wrote. Method: the heap before and after chunks of ten
// topics each; what a sanitizer's allocator holds is not seen.
TEST_F(McapTest, AWrittenChunkCostsLittleMemory) {
  constexpr std::uint64_t kTopics = 10, kChunks = 400, kMostBytes = 200;
  const std::vector<McapTopic> topics(kTopics, {"/a", "pkg/msg/A", "uint64 a\n"});
  auto writer = McapWriter::create(file_, 1U << 24U, topics, {});
  ASSERT_TRUE(writer) << writer.error();
  const auto write_chunk = [&](std::uint64_t number) {
    for (std::uint64_t topic = 1; topic <= kTopics; ++topic)
      writer->write(static_cast<std::uint16_t>(topic), number, bytes_of(number));
    ASSERT_TRUE(writer->flush());
  };
  write_chunk(0);
  const std::size_t before = ::mallinfo2().uordblks;
  for (std::uint64_t number = 1; number <= kChunks; ++number) write_chunk(number);
  EXPECT_LE(::mallinfo2().uordblks, before + kChunks * kMostBytes);
  EXPECT_TRUE(writer->finish());
  std::uint64_t read = 0;
  EXPECT_TRUE(McapReader::open(file_)->scan([&](const McapMessage&) { return ++read > 0; }).finished);
  EXPECT_EQ(read, (kChunks + 1) * kTopics);
}

// Goal: a file costs what its bytes can pay for. Method: chunks of zeros, which zstd makes 10,000 times smaller, among
// sound ones.
// Threat: run-bomb
TEST_F(McapTest, AChunkThatClaimsMoreThanItsBytesCanPayIsLeftOut) {
  record();
  const Bytes bomb = chunk_of(std::vector<char>(8U << 20U));
  ASSERT_LT(bomb.size() * 1000, 8U << 20U);
  std::string content = test::text_of(file_);
  constexpr std::size_t kBombs = 20;
  for (std::size_t i = 0; i < kBombs; ++i)
    content.insert(static_cast<std::size_t>(ends_[1]), reinterpret_cast<const char*>(bomb.data()), bomb.size());
  std::ofstream(path("bombs"), std::ios::binary) << content;
  McapReport report;
  EXPECT_EQ(read(path("bombs"), &report), kMessages);
  EXPECT_EQ(report.damaged_chunks, kBombs);
}

// Each alone stays below the limit of one chunk: 600 to 900 bytes for a byte of the file.
// Threat: run-bombs
TEST_F(McapTest, WhatAllChunksTogetherMayCostIsBounded) {
  record();
  std::mt19937 random(7);
  const auto noise = [&random](std::vector<char> plain) {
    for (std::size_t i = 0; i < plain.size() / 900; ++i) plain.push_back(static_cast<char>(random()));
    return plain;
  };
  // As one message, of a record that no version knows, and as records without content, nine zeros each.
  std::vector<char> one(8U << 20U), many(4U << 20U);
  one[0] = 99;
  const std::uint64_t length = one.size() - mcap::kRecordHead;
  std::memcpy(&one[1], &length, sizeof length);
  for (const auto& [plain, count, most_read] : {std::tuple(noise(one), 40U, 6U), std::tuple(noise(many), 20U, 1U)}) {
    std::filesystem::copy_file(file_, path("bombs"), std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(path("bombs"), static_cast<std::uintmax_t>(ends_.back()));
    const Bytes chunk = chunk_of(plain);
    ASSERT_GT(chunk.size() * 1000, plain.size());
    std::ofstream out(path("bombs"), std::ios::binary | std::ios::app);
    for (unsigned i = 0; i < count; ++i)
      out.write(reinterpret_cast<const char*>(chunk.data()), static_cast<std::streamsize>(chunk.size()));
    out.close();
    McapReport report;
    EXPECT_EQ(read(path("bombs"), &report), kMessages);
    EXPECT_GE(report.damaged_chunks, count - most_read);
  }
}

TEST_F(McapTest, NoPipeKeepsAReaderWaiting) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  EXPECT_NE(McapReader::open(path("pipe")).error().find("is not a file"), std::string::npos);
}

TEST_F(McapTest, AnythingElseIsRefusedInOneSentence) {
  EXPECT_NE(McapReader::open(path("absent")).error().find("cannot open"), std::string::npos);
  std::ofstream(path("text")) << "this is not a recording";
  EXPECT_NE(McapReader::open(path("text")).error().find("not an MCAP file"), std::string::npos);
  record();
  std::filesystem::resize_file(file_, std::uint64_t{1} << 40U);
  EXPECT_NE(McapReader::open(file_).error().find("are holes"), std::string::npos);
  std::ofstream(path("empty"));
  EXPECT_NE(McapReader::open(path("empty")).error().find("too short"), std::string::npos);
}

TEST_F(McapTest, AnExistingFileIsNeverOverwritten) {
  record();
  EXPECT_FALSE(McapWriter::create(file_, 1U << 20U, {}, {}));
}

// Check value of CRC-32/ISO-HDLC.
TEST(McapFormat, ChecksumIsTheCommonCrc32) {
  const std::string_view text = "123456789";
  EXPECT_EQ(mcap::crc32(std::as_bytes(std::span(text))), 0xCBF4'3926U);
}

}  // namespace
}  // namespace takt::monitor
