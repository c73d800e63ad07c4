// SPDX-License-Identifier: Apache-2.0
// Goal: what a policy's host says of its inputs is kept bit for bit, what it cannot have meant is counted and never
// believed, and what was not read in time is declared. Method: payloads of random shape through encode and decode; a
// ring written here, well and badly, read by the stream; one run folder.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>

#include "executive/ipc/executive_segments.hpp"
#include "executive/ipc/segment.hpp"
#include "monitor/record/policy_input_message.hpp"
#include "monitor/record/policy_input_stream.hpp"
#include "monitor/record/recorded_run.hpp"
#include "monitor/record/recorder.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

PolicyInput random_input(std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto floats = [&](std::size_t count) {
    std::vector<float> values(count);
    for (float& value : values) {
      const std::uint32_t bits = static_cast<std::uint32_t>(random());  // not-a-numbers of every kind among them
      std::memcpy(&value, &bits, sizeof value);
    }
    return values;
  };
  PolicyInput input;
  input.header.observation_id = random();
  input.header.sequence = random();
  input.header.inference = seed;
  input.header.policy_hash = random();
  input.header.after_reset = seed % 2;
  input.header.built_in = 1;
  std::size_t sample_values = 0;
  for (std::uint32_t i = 0; i < seed % 4; ++i) {
    input.samples.push_back({random(), MonoTime{static_cast<std::int64_t>(random())}, MonoTime{5}, i, seed % 7});
    sample_values += seed % 7;
  }
  input.header.following = random();
  input.header.committed_from = static_cast<std::uint32_t>(random());
  input.header.committed_count = seed;
  input.header.by_client = seed % 3 == 0 ? 1 : 0;
  input.header.joint_count = seed % 9;
  input.header.quantities = static_cast<std::uint8_t>(seed % 9 == 0 ? 0 : 1 + seed % 31);
  for (std::size_t i = 0; i < kShownQuantities; ++i)
    if ((input.header.quantities >> i & 1) != 0) input.joints[i] = floats(seed % 9);
  input.sample_values = floats(sample_values);
  input.input = floats(seed % 50);
  input.output = floats(seed % 30);
  input.header.sample_count = static_cast<std::uint32_t>(input.samples.size());
  input.header.input_count = static_cast<std::uint32_t>(input.input.size());
  input.header.output_count = static_cast<std::uint32_t>(input.output.size());
  return input;
}

TEST(PolicyInputMessage, InputsOfAnyShapeComeBackBitForBit) {
  CdrWriter out;
  for (std::uint32_t seed = 0; seed < 300; ++seed) {
    RecordedPolicyInput recorded{seed % 2 == 0 ? Player::policy : Player::fallback, random_input(seed), 0};
    recorded.crc = crc_of(recorded.input);
    const Bytes payload = packed(recorded.input);
    const auto read = read_policy_input(payload);
    ASSERT_TRUE(read) << seed;
    EXPECT_EQ(packed(*read), payload);
    encode_policy_input(recorded, out);
    RecordedPolicyInput back;
    ASSERT_TRUE(decode_policy_input(out.bytes(), back)) << seed;
    EXPECT_EQ(packed(back.input), payload) << seed;
    EXPECT_EQ(crc_of(back.input), back.crc) << seed;
    EXPECT_EQ(back.sender, recorded.sender);
  }
}

TEST(PolicyInputMessage, WhatDoesNotAddUpIsNoInput) {
  const Bytes whole = packed(random_input(23));
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_FALSE(read_policy_input(std::span(whole).first(size))) << size;
  Bytes longer = whole;
  longer.push_back(std::byte{0});
  EXPECT_FALSE(read_policy_input(longer));
  for (const std::size_t count_at :
       {offsetof(PolicyInputHeader, joint_count), offsetof(PolicyInputHeader, sample_count),
        offsetof(PolicyInputHeader, input_count), offsetof(PolicyInputHeader, output_count)}) {
    Bytes lying = whole;
    const std::uint32_t many = UINT32_MAX;
    std::memcpy(&lying[count_at], &many, sizeof many);
    EXPECT_FALSE(read_policy_input(lying)) << count_at;
  }
  Bytes reserved = whole;
  reserved[offsetof(PolicyInputHeader, reserved)] = std::byte{1};
  EXPECT_FALSE(read_policy_input(reserved)) << "would not come back from the file";
  for (const std::uint8_t quantities : {std::uint8_t{0}, std::uint8_t{32}}) {
    Bytes other = packed(PolicyInput{
        .header = {.joint_count = 6}, .samples = {}, .joints = {}, .sample_values = {}, .input = {}, .output = {}});
    other[offsetof(PolicyInputHeader, quantities)] = std::byte{quantities};
    EXPECT_FALSE(read_policy_input(other)) << "joints of no quantity, or of one that there is not";
  }
  CdrWriter out;
  RecordedPolicyInput uneven{Player::policy, random_input(23), 0}, back;
  uneven.input.joints[0] = {1, 2};
  uneven.input.joints[1] = {1, 2, 3};
  encode_policy_input(uneven, out);
  EXPECT_FALSE(decode_policy_input(out.bytes(), back)) << "the joints are as many in each quantity";
  encode_policy_input({Player::policy, random_input(23), 0}, out);
  for (std::size_t size = 0; size + 4 < out.bytes().size(); ++size)
    EXPECT_FALSE(decode_policy_input(std::span(out.bytes()).first(size), back)) << size;
}

constexpr std::size_t kLargest = 4096;

class PolicyInputStreamTest : public testing::Test {
 protected:
  ipc::SlotWriter format() { return ipc::SlotWriter(segment_.writable(), ipc::policy_input_ring(kLargest)); }
  RecordSink sink() {
    return {.command = {},
            .tick = {},
            .keyframe = {},
            .frame = {},
            .loss = [this](const Loss& loss) { losses_[loss.ring + " " + loss.reason] += loss.count; },
            .policy_input = [this](const RecordedPolicyInput& input) { read_.push_back(input); }};
  }
  static void publish(ipc::SlotWriter& writer, std::uint32_t seed) { writer.publish(packed(random_input(seed))); }

  ipc::Segment segment_ =
      ipc::Segment::create("inputs", ipc::ring_bytes(ipc::policy_input_ring(kLargest)), true).value();
  PolicyInputStream stream_{segment_.readable(), kLargest, Player::fallback};
  TokenBucket plenty_{nanoseconds(1), 1'000'000};
  std::vector<RecordedPolicyInput> read_;
  std::map<std::string, std::uint64_t> losses_;
};

TEST_F(PolicyInputStreamTest, WaitsForItsWriterAndReadsEverythingOnce) {
  stream_.drain(sink(), plenty_);
  EXPECT_TRUE(read_.empty() && losses_.empty()) << "nobody formatted it yet";
  ipc::SlotWriter writer = format();
  for (std::uint32_t seed = 1; seed <= 5; ++seed) publish(writer, seed);
  stream_.drain(sink(), plenty_);
  publish(writer, 6);
  stream_.drain(sink(), plenty_);
  stream_.drain(sink(), plenty_);
  ASSERT_EQ(read_.size(), 6U);
  for (std::uint32_t seed = 1; seed <= 6; ++seed) {
    EXPECT_EQ(packed(read_[seed - 1].input), packed(random_input(seed)));
    EXPECT_EQ(read_[seed - 1].sender, Player::fallback);
    EXPECT_EQ(read_[seed - 1].crc, crc_of(read_[seed - 1].input));
  }
  EXPECT_TRUE(losses_.empty());
}

TEST_F(PolicyInputStreamTest, WhatWasOverwrittenIsDeclared) {
  const std::uint32_t slots = ipc::policy_input_ring(kLargest).slot_count;
  ipc::SlotWriter writer = format();
  for (std::uint32_t seed = 1; seed <= slots + 10; ++seed) publish(writer, seed);
  stream_.drain(sink(), plenty_);
  EXPECT_EQ(losses_["fallback_input before_attach"] + read_.size(), slots + 10U);
  const std::size_t before = read_.size();
  for (std::uint32_t seed = 1; seed <= 2 * slots; ++seed) publish(writer, seed);
  stream_.drain(sink(), plenty_);
  EXPECT_GE(losses_["fallback_input overwritten"], slots);
  EXPECT_EQ(losses_["fallback_input overwritten"] + read_.size() - before, 2U * slots);
}

TEST_F(PolicyInputStreamTest, WhatIsNoInputIsCountedAndNotKept) {
  ipc::SlotWriter writer = format();
  publish(writer, 1);
  const char nonsense[] = "this is no input";
  writer.publish(std::as_bytes(std::span(nonsense)));
  publish(writer, 2);
  stream_.drain(sink(), plenty_);
  EXPECT_EQ(read_.size(), 2U);
  EXPECT_EQ(losses_["fallback_input unreadable"], 1U);
}

// A host that says more than one can be asked decides what else fits on the disk.
TEST_F(PolicyInputStreamTest, MoreThanAPolicyCanAnswerIsDeclaredNotKept) {
  ipc::SlotWriter writer = format();
  const std::uint32_t slots = ipc::policy_input_ring(kLargest).slot_count;
  TokenBucket bucket(milliseconds(10), slots);
  MonoTime now = MonoTime{} + seconds(5);
  std::uint32_t said = 0;
  for (int drain = 0; drain < 50; ++drain, now = now + milliseconds(20)) {
    for (std::uint32_t seed = 0; seed < slots / 2; ++seed, ++said) publish(writer, seed);
    bucket.refill(now);
    stream_.drain(sink(), bucket);
  }
  EXPECT_EQ(read_.size(), slots + 49U * 2U) << "a ring's worth at once, and one per 10 ms";
  EXPECT_EQ(losses_["fallback_input too_many"], said - read_.size());
  EXPECT_EQ(losses_.size(), 1U);
}

TEST_F(PolicyInputStreamTest, WhatAPolicyAnswersIsKeptWhateverTheDrainsDo) {
  ipc::SlotWriter writer = format();
  TokenBucket bucket(milliseconds(10), 4);
  std::mt19937 random(7);
  MonoTime drained = MonoTime{} + seconds(5);
  std::uint32_t said = 0;
  for (MonoTime now = drained; said < 1'000; now = now + milliseconds(20)) {  // half of what may be
    publish(writer, ++said);
    const MonoTime due = drained + milliseconds(static_cast<std::int64_t>(random() % 60));
    if (due > now) continue;
    drained = now;
    bucket.refill(now);
    stream_.drain(sink(), bucket);
  }
  EXPECT_TRUE(losses_.empty());
}

TEST(TokenBucket, HoldsNoMoreThanItMayAndFollowsNoClockBackwards) {
  const auto taken = [](TokenBucket& bucket) {
    int count = 0;
    while (bucket.take()) ++count;
    return count;
  };
  TokenBucket bucket(milliseconds(10), 3);
  EXPECT_EQ(taken(bucket), 3);
  const MonoTime start = MonoTime{} + seconds(9);
  bucket.refill(start);
  EXPECT_EQ(taken(bucket), 0) << "the first refill starts the clock";
  bucket.refill(start + milliseconds(15));
  EXPECT_EQ(taken(bucket), 1);
  bucket.refill(start + milliseconds(20));
  EXPECT_EQ(taken(bucket), 1) << "halves are not lost";
  bucket.refill(start + seconds(100));
  EXPECT_EQ(taken(bucket), 3);
  bucket.refill(start);
  EXPECT_EQ(taken(bucket), 0);
}

class RecordedInputTest : public test::TemporaryFolder {};

// Goal: an input that went through the recorder is in ticks.mcap, and a loss in the manifest.
TEST_F(RecordedInputTest, IsInTheRunFolder) {
  VirtualRobot robot;
  const RunFolder folder = RunFolder::create(path("run")).value();
  auto recorder = Recorder::start(folder, robot.manifest(), demo_robot()).value();
  auto stream = RecordStream::attach(robot.rings(), demo_robot().joints.size()).value();
  robot.run(50);
  stream.drain(recorder->sink(), false);
  RecordedPolicyInput input{Player::policy, random_input(41), 0};
  input.crc = crc_of(input.input);
  recorder->sink().policy_input(input);
  recorder->sink().loss({"policy_input", "overwritten", 3, 0, 0});
  stream.drain(recorder->sink(), true);
  ASSERT_TRUE(recorder->finish(robot.latest().header.now, "test over"));
  const auto run = open_run(path("run"));
  ASSERT_TRUE(run) << run.error();
  EXPECT_EQ(run->manifest.losses.at("policy_input overwritten"), 3U);
  std::vector<RecordedPolicyInput> found;
  const auto scan = scan_run(
      *run,
      {.tick = {}, .command = {}, .keyframe = {}, .loss = {}, .policy_input = [&](const RecordedPolicyInput& recorded) {
         found.push_back(recorded);
       }});
  ASSERT_TRUE(scan) << scan.error();
  EXPECT_EQ(scan->undecodable, 0U);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(packed(found[0].input), packed(input.input));
  EXPECT_EQ(found[0].crc, input.crc);
}

}  // namespace
}  // namespace takt::monitor
