// SPDX-License-Identifier: Apache-2.0
// Goal: no setpoint leaves later than its tick or its command allows, wherever inside the tick the machine stood still;
// the drives are told to damp instead, and the record says so and replays. Method: the real loop in virtual time with
// drives that answer and a policy that answers every observation; the clock jumps inside a receive or behind a frame.
// Judged from the frame records' stamps and the tick records.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <iterator>
#include <map>
#include <optional>

#include "executive/pipeline/control_tick.hpp"
#include "tests/executive/runtime/loop_rig.hpp"

namespace takt::runtime::test {
namespace {

constexpr std::size_t kJoints = 4;
constexpr std::uint64_t kTicks = 300, kArmAt = 60, kStallAt = 200;

// The newest message of one of the executive's segments, as another process maps it.
class Outside {
 public:
  Outside(int descriptor, const ipc::RingShape& shape)
      : segment_(ipc::Segment::adopt_read_only(dup(descriptor), ipc::ring_bytes(shape)).value()),
        reader(ipc::SlotReader::attach(segment_.readable(), shape).value()) {}

 private:
  ipc::Segment segment_;

 public:
  ipc::SlotReader reader;
};

class LateDeparture : public testing::Test {
 protected:
  LateDeparture() {
    auto segment = ipc::Segment::create("test-command", ipc::ring_bytes(ipc::command_mailbox()), false).value();
    policy_side_ = ipc::Segment::adopt_writable(dup(segment.fd()), segment.size()).value();
    writer_.emplace(policy_side_->writable(), ipc::command_mailbox());
    rig_.mailboxes[Seat::policy].want(CommandMailbox::seal(std::move(segment), 1).value());
    for (FakeBus* bus : rig_.buses) {
      bus->on_sent = [this, bus](const drivers::CanFrame& frame) { reply(*bus, frame); };
    }
    rig_.buses[0]->on_receive = [this] { begin_tick(); };
  }

  void reply(FakeBus& bus, const drivers::CanFrame& frame) {
    drivers::ReceivedFrame received;
    received.frame.id = 0x100 + frame.id - 1;
    received.frame.length = 2;
    received.frame.data[1] = static_cast<std::uint8_t>(frame.data[0] != 0 ? DriveState::enabled : DriveState::disabled);
    received.received_at = rig_.clock.now();
    bus.arriving.push_back(received);
    if (on_frame) on_frame(tick_, frame);
  }
  void begin_tick() {
    ++tick_;
    if (tick_ == kArmAt) rig_.requests.arm();
    if (tick_ <= last_answer_at_) answer_newest();
    if (on_tick) on_tick(tick_);
  }
  void answer_newest() {
    Observation seen;
    const auto read = observations_.reader.read_latest(std::as_writable_bytes(std::span(&seen, 1)));
    if (read.status != ipc::ReadStatus::fresh) return;
    chunk_->header = {};
    CommandHeader& header = chunk_->header;
    header.sequence = ++sequence_;
    header.observation_id = seen.id;
    header.dequeued_at = header.infer_started_at = header.infer_ended_at = header.published_at = seen.published_at;
    header.step_period = milliseconds(10);
    header.step_count = 16;
    header.joint_count = kJoints;
    header.fields = static_cast<std::uint8_t>(CommandField::q);
    std::fill_n(chunk_->values, chunk_->value_count(), 0.2F);
    writer_->publish(std::as_bytes(std::span(chunk_.get(), 1)).first(chunk_->used_bytes()));
  }

  void run() {
    rig_.run(kTicks);
    for (const TickRecord& record : rig_.records()) records_[record.header.tick] = record;
    FrameRecord frame;
    while (frames_in_.reader.read_next(std::as_writable_bytes(std::span(&frame, 1))).status == ipc::ReadStatus::fresh)
      if (frame.direction == FrameDirection::sent && frames_seen_++ < kTicks * kJoints) frames_.push_back(frame);
    ASSERT_EQ(frames_.size(), kTicks * kJoints) << "one frame per joint and tick, the farewell aside";
    ASSERT_EQ(records_.at(kStallAt).header.mode, Mode::tracking);
  }
  // Of every frame that left: a setpoint is young enough in the instant of its write.
  void expect_nothing_late_was_sent() {
    for (const FrameRecord& frame : frames_) {
      if (!holds(frame)) continue;
      const TickRecordHeader& tick = records_.at(frame.tick).header;
      EXPECT_LE(frame.stamp - tick.now, rig_.config.period) << "tick " << frame.tick;
      if (frame.data[2] == 0) continue;
      EXPECT_LE(tick.age.total() + (frame.stamp - tick.now), rig_.config.freshness.max_age) << "tick " << frame.tick;
    }
  }
  // Enabled, told to hold or to follow: a setpoint, not damping.
  static bool holds(const FrameRecord& frame) { return frame.data[0] != 0 && frame.data[1] != 0; }
  [[nodiscard]] std::vector<FrameRecord> frames_of(std::uint64_t tick) const {
    std::vector<FrameRecord> found;
    std::ranges::copy_if(frames_, std::back_inserter(found), [tick](const FrameRecord& f) { return f.tick == tick; });
    return found;
  }
  // From the records and the recorded messages alone, every tick comes out bit for bit.
  void expect_replay() {
    std::map<std::uint64_t, std::vector<std::byte>> messages;
    std::vector<std::byte> payload(ipc::command_ring().payload_capacity);
    for (auto read = commands_.reader.read_next(payload); read.status == ipc::ReadStatus::fresh;
         read = commands_.reader.read_next(payload)) {
      CommandTag tag;
      std::memcpy(&tag, payload.data(), sizeof tag);
      messages[tag.tick].assign(payload.begin() + sizeof tag, payload.begin() + static_cast<std::ptrdiff_t>(read.size));
    }
    const auto state = pipeline::make_tick_state(rig_.config);
    const auto output = std::make_unique<pipeline::TickOutput>();
    for (const auto& [tick, record] : records_) {
      const auto message = messages.find(tick);
      const bool any = message != messages.end();
      if (any) std::memcpy(chunk_.get(), message->second.data(), message->second.size());
      const auto input = pipeline::input_of(record, any ? chunk_.get() : nullptr, any ? message->second.size() : 0);
      pipeline::control_tick(*state, input, rig_.config, *output);
      ASSERT_EQ(std::memcmp(&output->record, &record, record.used_bytes()), 0) << "tick " << tick;
    }
  }

  LoopRig rig_{kJoints, 2, {{}, {}, 100}};
  std::function<void(std::uint64_t tick)> on_tick;
  std::function<void(std::uint64_t tick, const drivers::CanFrame&)> on_frame;
  std::uint64_t last_answer_at_ = kTicks;
  std::map<std::uint64_t, TickRecord> records_;
  std::vector<FrameRecord> frames_;

 private:
  Outside observations_{rig_.published.observation_descriptor(), ipc::observation_mailbox()};
  Outside frames_in_{rig_.published.monitor_descriptors()[ipc::kFrameRingDescriptor], ipc::frame_ring()};
  Outside commands_{rig_.published.monitor_descriptors()[ipc::kCommandRingDescriptor], ipc::command_ring()};
  std::optional<ipc::Segment> policy_side_;
  std::optional<ipc::SlotWriter> writer_;
  std::unique_ptr<CommandChunk> chunk_ = std::make_unique<CommandChunk>();
  std::uint64_t sequence_ = 0, tick_ = 0, frames_seen_ = 0;
};

TEST_F(LateDeparture, AnUndisturbedRunDampsNothing) {
  run();
  expect_nothing_late_was_sent();
  for (const auto& [tick, record] : records_) {
    EXPECT_EQ(record.header.last_damped, 0U);
    if (tick == 1) continue;
    EXPECT_GT(record.header.last_sent_at, records_.at(tick - 1).header.now);
    EXPECT_LT(record.header.last_sent_at, frames_of(tick - 1).front().stamp);
  }
  for (const FrameRecord& frame : frames_of(kStallAt)) EXPECT_TRUE(holds(frame) && frame.data[2] != 0);
  expect_replay();
}

// The stall that put an enabled frame of an age of 920 ms on the wire, at a max_age of 150 ms.
TEST_F(LateDeparture, AfterAStallInsideTheTickTheDrivesAreDamped) {
  on_tick = [this](std::uint64_t tick) {
    if (tick == kStallAt) rig_.clock.pass(milliseconds(900));
  };
  int told_late = 0;
  rig_.guard->judge = [&](std::size_t, std::size_t, const drivers::GuardedMoment& moment, const JointRecord& decided) {
    if (moment.now - moment.decided_at <= rig_.config.period || !moment.enabled) return WireVerdict::allowed;
    ++told_late;
    EXPECT_EQ(decided.kp_command, 0.0F) << "the guard is told that the damping is what was decided";
    EXPECT_FALSE(moment.valid_until.is_set());
    return WireVerdict::allowed;
  };
  run();
  EXPECT_EQ(told_late, 4);
  expect_nothing_late_was_sent();
  for (const FrameRecord& frame : frames_of(kStallAt)) {
    EXPECT_EQ(frame.data[0], 1) << "still enabled: the robot is not dropped";
    EXPECT_EQ(frame.data[1], 0) << "but told to damp";
    EXPECT_EQ(frame.data[2], 0) << "on no command's behalf";
  }
  const TickRecordHeader& next = records_.at(kStallAt + 1).header;
  EXPECT_EQ(next.last_damped, 0b1111U);
  EXPECT_GT(next.last_sent_at - records_.at(kStallAt).header.now, milliseconds(900));
  EXPECT_EQ(records_.at(kStallAt + 2).header.last_damped, 0U) << "the next tick is in time again";
  expect_replay();
}

// Between two frames of one tick as well: what left before it is as it was decided, what comes after is damped.
TEST_F(LateDeparture, AStallBetweenTwoFramesDampsTheRest) {
  int sent = 0;
  on_frame = [this, &sent](std::uint64_t tick, const drivers::CanFrame&) {
    if (tick == kStallAt && ++sent == 1) rig_.clock.pass(milliseconds(3));
  };
  run();
  expect_nothing_late_was_sent();
  const auto frames = frames_of(kStallAt);
  EXPECT_TRUE(holds(frames.at(0)));
  for (std::size_t i = 1; i < frames.size(); ++i) EXPECT_FALSE(holds(frames[i]));
  EXPECT_EQ(records_.at(kStallAt + 1).header.last_damped, 0b1110U) << "joints 2 on the same bus, 1 and 3 on the other";
  expect_replay();
}

// Shorter than a period: only a command that dies in between is too late. The policy falls silent, and every tick
// decides 0.9 ms before it sends.
TEST_F(LateDeparture, ACommandThatDiesInsideItsTickStaysBehind) {
  rig_.config.freshness.epsilon = 1.0;
  last_answer_at_ = kStallAt - 100;
  on_tick = [this](std::uint64_t) { rig_.clock.pass(microseconds(900)); };
  run();
  expect_nothing_late_was_sent();
  std::vector<std::uint64_t> damped;
  for (const auto& [tick, record] : records_)
    if (record.header.last_damped != 0) damped.push_back(tick - 1);
  ASSERT_EQ(damped.size(), 1U);
  const TickRecordHeader& dying = records_.at(damped[0]).header;
  EXPECT_NE(dying.seats[Seat::policy].freshness, Freshness::stale) << "it still lived when the tick decided";
  EXPECT_LT(records_.at(damped[0] + 1).header.last_sent_at - dying.now, rig_.config.period);
  expect_replay();
}

// A stall in standby finds nothing to damp: the drives have no power, and the record does not say that they were
// damped.
TEST_F(LateDeparture, InStandbyNothingIsDamped) {
  on_tick = [this](std::uint64_t tick) {
    if (tick == 20) rig_.clock.pass(milliseconds(100));
  };
  run();
  EXPECT_EQ(records_.at(21).header.last_damped, 0U);
  for (const FrameRecord& frame : frames_of(20)) EXPECT_EQ(frame.data[0], 0);
}

}  // namespace
}  // namespace takt::runtime::test
