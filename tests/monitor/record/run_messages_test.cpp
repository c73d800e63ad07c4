// SPDX-License-Identifier: Apache-2.0
// Goal: messages of a policy are kept byte for byte, whatever they are. Method: payloads of every length and shape
// through encode and decode; single bits flipped and named.
#include "monitor/record/run_messages.hpp"

#include <gtest/gtest.h>

#include <random>

#include "executive/ipc/crc32c.hpp"

namespace takt::monitor {
namespace {

RecordedCommand random_command(std::size_t bytes, std::uint32_t seed) {
  std::mt19937 random(seed);
  RecordedCommand command{seed, Bytes(bytes), 0};
  for (std::byte& byte : command.payload) byte = static_cast<std::byte>(random());
  command.crc = ipc::crc32c(command.payload);
  return command;
}

TEST(RunMessages, CommandsOfAnyLengthComeBackByteForByte) {
  CdrWriter out;
  for (std::size_t bytes = 0; bytes < 300; ++bytes) {
    const RecordedCommand command = random_command(bytes, static_cast<std::uint32_t>(bytes));
    encode_command(command, out);
    RecordedCommand back;
    ASSERT_TRUE(decode_command(out.bytes(), back)) << bytes;
    EXPECT_EQ(back.cut_from, 0U);
    EXPECT_EQ(back.tick, command.tick);
    EXPECT_EQ(back.payload, command.payload);
    EXPECT_EQ(back.crc, command.crc);
  }
  const RecordedCommand largest = random_command(sizeof(CommandChunk), 1);
  encode_command(largest, out);
  RecordedCommand back;
  ASSERT_TRUE(decode_command(out.bytes(), back));
  EXPECT_EQ(back.payload, largest.payload);
}

TEST(RunMessages, ARefusedCommandMayBeCutToItsHeader) {
  RecordedCommand command = random_command(sizeof(CommandHeader), 3);
  command.cut_from = sizeof(CommandChunk);
  command.whole_crc = 0x1234'5678;
  command.crc = crc_of(command);
  CdrWriter out;
  encode_command(command, out);
  RecordedCommand back;
  ASSERT_TRUE(decode_command(out.bytes(), back));
  EXPECT_EQ(back.payload, command.payload);
  EXPECT_EQ(back.cut_from, command.cut_from);
  EXPECT_EQ(back.whole_crc, command.whole_crc);
  EXPECT_EQ(crc_of(back), command.crc);
  --back.cut_from;
  EXPECT_NE(crc_of(back), command.crc) << "what stands for the rest is covered too";
}

TEST(RunMessages, AFlippedBitInACommandIsNamedAndMended) {
  const RecordedCommand original = random_command(sizeof(CommandHeader) + 40, 5);
  RecordedCommand command = original;
  command.payload[offsetof(CommandHeader, infer_ended_at) + 3] ^= std::byte{4};
  EXPECT_EQ(mend_flipped_bit(command), "infer_ended_at");
  EXPECT_EQ(command.payload, original.payload);
  command.payload[sizeof(CommandHeader) + 13] ^= std::byte{128};
  EXPECT_EQ(mend_flipped_bit(command), "values[3]");
  EXPECT_EQ(command.payload, original.payload);
  command.payload[0] ^= std::byte{1};
  command.payload[70] ^= std::byte{1};
  EXPECT_EQ(mend_flipped_bit(command), std::nullopt) << "no single bit explains two";
}

TEST(RunMessages, AnAlteredKeyframeIsRefused) {
  CdrWriter out;
  encode_keyframe({12, Bytes(1000, std::byte{7})}, out);
  RecordedKeyframe back;
  ASSERT_TRUE(decode_keyframe(out.bytes(), back));
  EXPECT_EQ(back.tick, 12U);
  EXPECT_EQ(back.state.size(), 1000U);
  Bytes altered = out.bytes();
  altered[500] ^= std::byte{1};
  EXPECT_FALSE(decode_keyframe(altered, back));
}

TEST(RunMessages, LossesComeBack) {
  CdrWriter out;
  encode_loss({"tick", "overwritten", 17, 100, 118}, out);
  Loss back;
  ASSERT_TRUE(decode_loss(out.bytes(), back));
  EXPECT_EQ(back.ring, "tick");
  EXPECT_EQ(back.reason, "overwritten");
  EXPECT_EQ(back.count, 17U);
  EXPECT_EQ(back.after_tick, 100U);
  EXPECT_EQ(back.before_tick, 118U);
}

TEST(RunMessages, ChannelIdsAreTopicValues) {
  const auto topics = run_topics();
  ASSERT_EQ(topics.size(), static_cast<std::size_t>(Topic::transforms));
  for (std::size_t index = 0; index < topics.size(); ++index) {
    EXPECT_EQ(topics[index].topic, topic_name(static_cast<Topic>(index + 1)));
  }
}

}  // namespace
}  // namespace takt::monitor
