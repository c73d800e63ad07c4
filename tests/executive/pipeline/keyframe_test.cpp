// SPDX-License-Identifier: Apache-2.0
// Goal: replay starts from any keyframe and recomputes every record bit for bit; a damaged keyframe is refused.
// Method: random runs recorded through input_of, replayed from a random tick in a fresh state, compared with memcmp;
// every byte of a keyframe flipped once.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <vector>

#include "executive/ipc/executive_segments.hpp"
#include "executive/pipeline/tick_state.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::chunk_for;
using testing::Rig;
using testing::robot;

struct Recorded {
  TickRecord record;
  std::vector<std::byte> message;  // bytes read from the mailbox this tick
};

// A run with everything that can happen, from one seed.
class RandomRun {
 public:
  RandomRun(std::uint32_t seed, std::uint32_t joints) : random_(seed), rig_(configure(seed, joints)) {}

  const Recorded& tick() {
    shake();
    auto chunk = std::make_unique<CommandChunk>();
    const bool message = make_message(*chunk);
    rig_.tick(message ? chunk.get() : nullptr, request(), chance(100) ? Arrival::contended : Arrival::accepted);
    latest_.record = rig_.out->record;
    latest_.message.clear();
    if (message) {
      const auto bytes = std::as_bytes(std::span(chunk.get(), 1)).first(chunk->used_bytes());
      latest_.message.assign(bytes.begin(), bytes.end());
    }
    return latest_;
  }
  [[nodiscard]] const Rig& rig() const { return rig_; }

 private:
  static TickConfig configure(std::uint32_t seed, std::uint32_t joints) {
    TickConfig config = robot(joints);
    config.gravity_compensation = seed % 2 == 0;
    config.degraded = static_cast<DegradedBehaviour>(seed % 3);
    config.interpolation = static_cast<Interpolation>(seed / 3 % 3);
    config.observation_every_ticks = 1 + seed % 20;
    config.join = {.kind = static_cast<JoinKind>(seed / 9 % 3),
                   .over = milliseconds(1 + seed % 60),
                   .longest_delay = config.period * (seed % 20)};
    config.freshness.window_ticks = 100 + seed % 900;
    config.resume_over = milliseconds(seed % 5 * 100);
    config.unrecorded_limit = seed % 3 == 0 ? 0 : 20;
    config.late_share = 0.03;
    return config;
  }
  bool chance(std::uint32_t one_in) { return random_() % one_in == 0; }
  float spread(float width) { return std::uniform_real_distribution<float>(-width, width)(random_); }

  void shake() {
    if (chance(200)) policy_alive_ = !policy_alive_;
    if (chance(700)) rig_.drives[0].silent = !rig_.drives[0].silent;
    if (chance(50)) rig_.drives[random_() % rig_.config.joint_count].dq += spread(1.0F);
    if (chance(400)) {  // another policy host, counting from 1 again
      ++rig_.input.messages[Seat::policy].session;
      rig_.sequence = 0;
    }
    if (chance(300))
      extra_replies_ = static_cast<int>(random_() % 4) - 1;  // joint 0's replies: lost, as they should be, repeated
    std::uint8_t& replies = rig_.input.joints[0].replies;
    replies = static_cast<std::uint8_t>(replies + (chance(3) ? extra_replies_ : 0));
    rig_.input.buses[0].foreign_frames += chance(60) ? 1U : 0U;
    rig_.input.buses[0].tx_dropped += chance(30) ? 1U : 0U;
    rig_.input.buses[0].flooded = chance(15) ? 1 : 0;
    rig_.input.skipped_periods += chance(100) ? random_() % 5 : 0U;
    rig_.late = chance(20) ? random_() : 0U;
    if (!chance(200)) rig_.input.recorded_through = rig_.input.tick;
    if (chance(3000)) rig_.input.recorded_through = 0;
    rig_.input.slept_ms = chance(1500) ? 1 + static_cast<std::uint32_t>(random_() % 10'000) : 0;
    rig_.input.lateness = microseconds(static_cast<std::int64_t>(random_() % 300));
    rig_.input.overrun_cause = chance(40) ? OverrunCause::platform_stall : OverrunCause::none;
  }
  bool make_message(CommandChunk& chunk) {
    if (!policy_alive_ || rig_.newest_observation == 0 || !chance(15)) return false;
    const std::uint64_t id = rig_.newest_observation - (chance(5) ? random_() % 3 : 0);
    chunk = chunk_for(rig_.config, id, rig_.published_at[id], rig_.now, ++rig_.sequence, spread(2.0F), 12);
    const Interpolation meaning = rig_.config.interpolation;
    if (meaning == Interpolation::cubic || chance(3)) chunk.header.fields = kAllCommandFields;
    if (meaning == Interpolation::linear)
      chunk.header.fields = static_cast<std::uint8_t>(chunk.header.fields & ~static_cast<unsigned>(CommandField::dq));
    return true;
  }
  OperatorRequest request() {
    if (chance(60)) return OperatorRequest::arm;
    if (chance(400)) return OperatorRequest::stop;
    if (chance(400)) return OperatorRequest::press_stop;
    if (chance(4000)) return OperatorRequest::deenergise;
    return chance(60) ? OperatorRequest::reset : OperatorRequest::none;
  }

  std::mt19937 random_;
  bool policy_alive_ = true;
  int extra_replies_ = 0;
  Rig rig_;
  Recorded latest_;
};

bool same_bytes(const TickRecord& a, const TickRecord& b) {
  return a.header.joint_count == b.header.joint_count && std::memcmp(&a, &b, a.used_bytes()) == 0;
}

RC_GTEST_PROP(Replay, FromAnyKeyframeEveryRecordComesOutBitForBit, (std::uint32_t seed)) {
  constexpr int kTicks = 3000;
  const auto joints = static_cast<std::uint32_t>(*rc::gen::inRange(1, 13));
  const int keyframe_at = *rc::gen::inRange(0, kTicks - 500);
  RandomRun run(seed, joints);
  std::vector<std::byte> keyframe(ipc::kMaxKeyframeBytes);
  const TickStatePtr replayed = make_tick_state(run.rig().config);
  const auto output = std::make_unique<TickOutput>();
  const auto chunk = std::make_unique<CommandChunk>();
  std::vector<std::byte> original(ipc::kMaxKeyframeBytes), copy(ipc::kMaxKeyframeBytes);
  for (int i = 0; i < kTicks; ++i) {
    const Recorded& recorded = run.tick();
    if (i == keyframe_at) {
      const std::size_t size = save(*run.rig().state, keyframe);
      RC_ASSERT(size > 0U && size <= ipc::kMaxKeyframeBytes);
      RC_ASSERT(load(*replayed, run.rig().config, std::span(keyframe).first(size)).has_value());
    }
    if (i <= keyframe_at) continue;
    const bool message = !recorded.message.empty();
    if (message) std::memcpy(chunk.get(), recorded.message.data(), recorded.message.size());
    const TickInput input =
        input_of(recorded.record, message ? chunk.get() : nullptr, message ? recorded.message.size() : 0);
    control_tick(*replayed, input, run.rig().config, *output);
    RC_ASSERT(same_bytes(output->record, recorded.record));
    RC_ASSERT(std::memcmp(output->setpoints, run.rig().out->setpoints, joints * sizeof(JointSetpoint)) == 0);
    RC_ASSERT(std::memcmp(output->damping, run.rig().out->damping, joints * sizeof(JointSetpoint)) == 0);
    RC_ASSERT(output->valid_until == run.rig().out->valid_until);
    RC_ASSERT(output->send_by == run.rig().out->send_by);
  }
  const std::size_t size = save(*run.rig().state, original);
  RC_ASSERT(save(*replayed, copy) == size);
  RC_ASSERT(std::memcmp(original.data(), copy.data(), size) == 0);
}

struct Sample {
  Rig rig{robot(4)};
  std::vector<std::byte> keyframe = std::vector<std::byte>(ipc::kMaxKeyframeBytes);
  Sample() {
    rig.arm(0.3F);
    rig.run_with_policy(500, 0.3F);
    keyframe.resize(save(*rig.state, keyframe));
  }
};

TEST(Keyframe, AnyFlippedByteIsRefused) {
  const Sample sample;
  const TickStatePtr state = make_tick_state(sample.rig.config);
  ASSERT_TRUE(load(*state, sample.rig.config, sample.keyframe).has_value());
  for (std::size_t i = 0; i < sample.keyframe.size(); ++i) {
    auto damaged = sample.keyframe;
    damaged[i] ^= std::byte{0x10};
    ASSERT_FALSE(load(*state, sample.rig.config, damaged).has_value()) << "byte " << i;
  }
  for (const std::size_t size : {std::size_t{0}, std::size_t{47}, std::size_t{48}, sample.keyframe.size() - 1})
    EXPECT_FALSE(load(*state, sample.rig.config, std::span(sample.keyframe).first(size)).has_value());
}

// A checksum says that a keyframe is as it was written, not who wrote it: whatever is an index later is judged.
TEST(Keyframe, AStateThatNoTickLeavesIsRefusedThoughItsChecksumIsRight) {
  Sample sample;
  const TickStatePtr loaded = make_tick_state(sample.rig.config);
  const auto refusal = [&](auto alter) -> std::string {
    const TickStatePtr state = make_tick_state(sample.rig.config);
    *state = *sample.rig.state;
    alter(*state);
    std::vector<std::byte> keyframe(ipc::kMaxKeyframeBytes);
    keyframe.resize(save(*state, keyframe));
    const auto taken = load(*loaded, sample.rig.config, keyframe);
    return taken ? "" : taken.error();
  };
  const auto next_delay = [](DelayMemory& delays, std::uint32_t next) {
    static_assert(sizeof(DelayMemory) == 168 && std::is_trivially_copyable_v<DelayMemory>);
    std::memcpy(std::as_writable_bytes(std::span(&delays, 1)).data() + 160, &next, sizeof next);
  };
  EXPECT_EQ(refusal([&](TickState& state) { next_delay(state.seats[Seat::policy].join.delays, 9); }), "");
  for (const std::uint32_t next : {10U, 0x7FFF'FFFFU}) {
    EXPECT_NE(refusal([&](TickState& state) { next_delay(state.seats[Seat::policy].join.delays, next); }), "");
    EXPECT_NE(refusal([&](TickState& state) { next_delay(state.seats[Seat::fallback].join.delays, next); }), "");
    EXPECT_NE(refusal([&](TickState& state) { next_delay(state.seats[Seat::candidate].join.delays, next); }), "");
  }
  const auto beyond = [](std::size_t count) { return static_cast<std::uint8_t>(count); };
  EXPECT_NE(refusal([&](TickState& state) { state.mode.stop_cause = static_cast<Cause>(beyond(kCauseCount)); }), "");
  EXPECT_NE(refusal([&](TickState& state) { state.mode.stop_cause = static_cast<Cause>(200); }), "");
  EXPECT_NE(refusal([&](TickState& state) { state.mode.mode = static_cast<Mode>(beyond(kModeCount)); }), "");
  EXPECT_NE(refusal([&](TickState& state) { state.mode.player = Player::candidate; }), "");
  EXPECT_NE(refusal([&](TickState& state) { state.mode.last_player = Player::candidate; }), "");
  EXPECT_NE(refusal([&](TickState& state) { state.recovery.relapses = kMaxDoublings + 1; }), "");
  EXPECT_NE(refusal([&](TickState& state) { state.candidate.in_charge = 2; }), "");
}

TEST(Keyframe, AnotherRobotsIsRefusedWithASentence) {
  const Sample sample;
  const TickConfig other = robot(5);
  const TickStatePtr state = make_tick_state(other);
  const auto loaded = load(*state, other, sample.keyframe);
  ASSERT_FALSE(loaded.has_value());
  EXPECT_NE(loaded.error().find("joint count"), std::string::npos) << loaded.error();
}

TEST(Keyframe, AnotherMaxAgesIsRefusedWithASentence) {
  const Sample sample;
  TickConfig other = sample.rig.config;
  other.freshness.max_age = milliseconds(200);
  const TickStatePtr state = make_tick_state(other);
  const auto loaded = load(*state, other, sample.keyframe);
  ASSERT_FALSE(loaded.has_value());
  EXPECT_NE(loaded.error().find("max_age"), std::string::npos) << loaded.error();
}

TEST(Keyframe, TheLargestFitsAndASmallBufferIsRefused) {
  TickConfig config = robot(kMaxJoints);
  config.freshness.window_ticks = kMaxWindowTicks;
  config.interpolation = Interpolation::cubic;
  config.freshness.max_age = seconds(60);
  ASSERT_EQ(remembered_observations(config), kMaxRememberedObservations);
  Rig rig(config);
  rig.run(25);
  CommandChunk chunk = chunk_for(config, rig.newest_observation, rig.published_at[rig.newest_observation], rig.now, 1,
                                 0.0F, kMaxChunkValues / (kMaxJoints * kCommandFieldCount));
  chunk.header.fields = kAllCommandFields;
  rig.tick(&chunk);
  ASSERT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::accepted);
  std::vector<std::byte> out(ipc::kMaxKeyframeBytes - 8);
  const std::size_t size = save(*rig.state, out);
  EXPECT_GT(size, sizeof(CommandChunk));
  EXPECT_EQ(save(*rig.state, std::span(out).first(size - 1)), 0U);
  EXPECT_EQ(save(*rig.state, std::span(out).first(size)), size);
  std::ranges::fill(out, std::byte{0xA5});
  save(*rig.state, std::span(out).first(size));
  EXPECT_TRUE(std::ranges::all_of(std::span(out).subspan(size), [](std::byte one) { return one == std::byte{0xA5}; }))
      << "the pieces are more than the size that is said";
}

}  // namespace
}  // namespace takt::pipeline
