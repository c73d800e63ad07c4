// SPDX-License-Identifier: Apache-2.0
// Goal: the shell around the tick: phase, order on the wire, bounded receiving, records, requests, the last frames.
// Method: the real loop in virtual time between fake buses.
#include "executive/runtime/cyclic_loop.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "executive/ipc/crc32c.hpp"
#include "tests/executive/runtime/loop_rig.hpp"

namespace takt::runtime::test {
namespace {

TEST(CyclicLoop, EveryTickIsRecordedOnAGridOfOnePeriod) {
  LoopRig rig;
  rig.run(50);
  const auto records = rig.records();
  ASSERT_EQ(records.size(), 50U);
  for (std::size_t i = 0; i < records.size(); ++i) {
    const TickRecordHeader& tick = records[i].header;
    EXPECT_EQ(tick.tick, i + 1);
    EXPECT_EQ(tick.overrun_cause, OverrunCause::none);
    const MonoTime due = tick.now - tick.lateness;
    EXPECT_EQ((due - (records[0].header.now - records[0].header.lateness)).ns,
              milliseconds(1).ns * static_cast<std::int64_t>(i));
  }
}

TEST(CyclicLoop, AnOverrunSkipsPeriodsKeepsPhaseAndIsCountedOnce) {
  LoopRig rig;
  int frames = 0;
  rig.buses[0]->on_send = [&] {
    if (++frames == 20) rig.clock.pass(microseconds(3'400));  // in some tick, the work takes 3.4 ms longer
  };
  rig.run(40);
  const auto records = rig.records();
  const auto late =
      std::ranges::find_if(records, [](const TickRecord& r) { return r.header.overrun_cause != OverrunCause::none; });
  ASSERT_NE(late, records.end());
  EXPECT_EQ(late->header.skipped_periods, 3U);
  EXPECT_EQ(late->header.tick, (late - 1)->header.tick + 1) << "skipped periods have no tick";
  EXPECT_EQ((late->header.now - late->header.lateness) - ((late - 1)->header.now - (late - 1)->header.lateness),
            milliseconds(4));
  EXPECT_GT(late->header.last_duration, milliseconds(3));
  EXPECT_EQ(records.back().header.skipped_periods, 3U);
  const auto blamed =
      std::ranges::count_if(records, [](const TickRecord& r) { return r.header.overrun_cause != OverrunCause::none; });
  EXPECT_EQ(blamed, 1);
  const StatusSnapshot& status = rig.board.read();
  EXPECT_EQ(status.overruns[static_cast<std::size_t>(late->header.overrun_cause)], 1U);
}

TEST(CyclicLoop, ALateWakeUpIsSeenByTheTick) {
  LoopRig rig;
  rig.clock.wake_delay = microseconds(137);
  rig.run(3);
  for (const TickRecord& record : rig.records()) EXPECT_GE(record.header.lateness, microseconds(137));
}

// Goal: every age counts from the instant the loop woke, however late that is; one that counted from when it was due
// would call everything younger than it is. Method: wake-ups that are 137 us late, against the clock's own book.
TEST(CyclicLoop, ATickHappensWhenTheLoopWokeNotWhenItWasDue) {
  LoopRig rig;
  rig.clock.wake_delay = microseconds(137);
  rig.run(20);
  const auto records = rig.records();
  ASSERT_EQ(records.size(), 20U);
  for (std::size_t i = 0; i < records.size(); ++i) {
    const MonoTime due = rig.clock.sleeps_until.at(i);
    EXPECT_GE(records[i].header.now, due + rig.clock.wake_delay);
    EXPECT_EQ(records[i].header.lateness, records[i].header.now - due);
  }
}

// Goal: the tick learns of a suspend once, in the first tick after it. Method: the boot clock leaps ahead of the other.
TEST(CyclicLoop, ASuspendIsToldToTheNextTickOnce) {
  LoopRig rig;
  int frames = 0;
  rig.buses[0]->on_send = [&] {
    if (++frames == 20) rig.clock.slept_in_all = seconds(7) + microseconds(100);
  };
  rig.run(40);
  const auto records = rig.records();
  const auto asleep = [](const TickRecord& record) { return record.header.slept_ms != 0; };
  ASSERT_EQ(std::ranges::count_if(records, asleep), 1);
  const auto told = std::ranges::find_if(records, asleep);
  EXPECT_EQ(told->header.slept_ms, 7'001U) << "rounded up";
  EXPECT_EQ(told->header.tick, 11U) << "two frames a tick";
}

// Goal: no frame of a tick in which the computer was suspended leaves after it: its age is not known. Method: the boot
// clock leaps while the first of a tick's three frames is written.
TEST(CyclicLoop, WhatASuspendOvertookIsNotSent) {
  LoopRig rig;
  int frames = 0;
  rig.buses[0]->on_send = [&] {
    if (++frames == 19) rig.clock.slept_in_all = seconds(7);
  };
  rig.run(40);
  const auto records = rig.records();
  const auto told = std::ranges::find_if(records, [](const TickRecord& r) { return r.header.slept_ms != 0; });
  ASSERT_NE(told, records.end());
  EXPECT_EQ(told->header.tick, 11U);
  EXPECT_EQ(rig.sent.size(), 3U * (40 + kFarewellTicks) - 2) << "all but the second and third frame of tick 10";
}

TEST(CyclicLoop, FramesLeaveBusByBusAndInJointOrder) {
  LoopRig rig(5, 2);  // bus 0: joints 0, 2, 4; bus 1: joints 1, 3
  rig.run(2);
  ASSERT_GE(rig.sent.size(), 10U);
  const std::uint32_t order[] = {1, 3, 5, 2, 4};
  for (std::size_t i = 0; i < 10; ++i) {
    EXPECT_EQ(rig.sent[i].frame.id, order[i % 5]);
    EXPECT_EQ(rig.sent[i].bus, i % 5 < 3 ? 0U : 1U);
  }
}

TEST(CyclicLoop, FeedbackReachesTheTickAndForeignFramesAreCounted) {
  LoopRig rig;
  drivers::ReceivedFrame reply;
  reply.frame.id = 0x102;  // joint 2, on bus 0
  reply.frame.length = 1;
  reply.frame.data[0] = 1;
  reply.received_at = MonoTime{123};
  drivers::ReceivedFrame foreign = reply;
  foreign.frame.id = 0x555;
  rig.buses[0]->arriving = {foreign, reply};
  rig.buses[1]->arriving = {reply};  // joint 2 is not on bus 1
  rig.run(1);
  const TickRecord record = rig.records().at(0);
  EXPECT_EQ(record.joints[2].feedback.received_at, MonoTime{123});
  EXPECT_EQ(record.joints[2].feedback.q, 1.0F);
  EXPECT_FALSE(record.joints[1].feedback.received_at.is_set());
  EXPECT_EQ(record.header.buses[0].foreign_frames, 1U);
  EXPECT_EQ(record.header.buses[1].foreign_frames, 1U);
}

TEST(CyclicLoop, AFloodedBusDelaysNothingBeyondItsBound) {
  LoopRig rig;
  rig.buses[0]->arriving.resize(3 * kMaxFramesPerBus);
  rig.run(2);
  EXPECT_EQ(rig.buses[0]->arriving.size(), 0U) << "two ticks and the farewell took three portions";
  EXPECT_EQ(rig.records().at(1).header.buses[0].foreign_frames, 2 * kMaxFramesPerBus);
}

TEST(CyclicLoop, EveryFrameThatCrossesIsRecordedAndARefusedOneIsNot) {
  LoopRig rig(2, 2);
  rig.buses[0]->arriving.resize(1);
  rig.buses[0]->arriving[0].frame.id = 0x123;
  rig.buses[1]->refuses = true;
  rig.run(1);
  const std::vector<FrameRecord> frames = rig.frames();
  ASSERT_EQ(frames.size(), 1U + 1U + kFarewellTicks);
  EXPECT_EQ(frames[0].direction, FrameDirection::received);
  EXPECT_EQ(frames[0].can_id, 0x123U);
  for (std::size_t i = 1; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i].direction, FrameDirection::sent);
    EXPECT_EQ(frames[i].bus, 0);
    EXPECT_EQ(frames[i].can_id, 1U);
    EXPECT_EQ(frames[i].tick, 1U);
  }
}

// Goal: what the last guard refuses never reaches the bus, is kept as evidence beside what left instead, and is the
// next tick's reason to latch. Method: a guard that refuses one joint's frame in the third tick.
TEST(CyclicLoop, ARefusedFrameIsReplacedRecordedAndReachesTheNextTick) {
  LoopRig rig(3, 2);
  rig.guard->judge = [&rig](std::size_t joint, std::size_t bus, const drivers::GuardedMoment& moment,
                            const JointRecord& record) {
    EXPECT_EQ(bus, joint % 2);
    EXPECT_GE(moment.now, moment.decided_at);
    EXPECT_EQ(moment.shift, static_cast<float>(joint) / 8) << "what its drive is off";
    EXPECT_EQ(record.q_command, 0.0F);
    return rig.sent.size() == 6 && joint == 0 ? WireVerdict::slew : WireVerdict::allowed;
  };
  rig.run(5);
  for (std::size_t i = 0; i < rig.sent.size(); ++i) EXPECT_EQ(rig.sent[i].frame.length, i == 6 ? 2 : 3) << i;
  const std::vector<TickRecord> records = rig.records();
  for (const TickRecord& record : records) {
    const bool after = record.header.tick == 4;
    EXPECT_EQ(record.joints[0].feedback.refused, after ? WireVerdict::slew : WireVerdict::allowed);
    EXPECT_EQ((record.header.causes_active >> static_cast<unsigned>(Cause::internal_error) & 1U) != 0, after);
    EXPECT_EQ(record.joints[1].feedback.refused, WireVerdict::allowed);
  }
  std::vector<FrameRecord> frames = rig.frames();
  ASSERT_GT(frames.size(), 7U);
  EXPECT_EQ(frames[6].direction, FrameDirection::refused);
  EXPECT_EQ(frames[6].length, 3);
  EXPECT_EQ(frames[7].direction, FrameDirection::sent);
  EXPECT_EQ(frames[7].length, 2);
}

TEST(CyclicLoop, TheLastFramesDisableTheDrives) {
  LoopRig rig(3, 2);
  rig.run(5);
  ASSERT_EQ(rig.sent.size(), 3U * (5 + kFarewellTicks));
  EXPECT_EQ(rig.records().size(), 5U);
  for (auto frame = rig.sent.end() - 3 * kFarewellTicks; frame != rig.sent.end(); ++frame) {
    EXPECT_EQ(frame->frame.data[0], 0);
  }
}

TEST(CyclicLoop, FinishEndsIt) {
  LoopRig rig;
  int frames = 0;
  rig.buses[0]->on_send = [&] {
    if (++frames == 10) rig.loop.finish();
  };
  rig.run(1'000'000);
  EXPECT_LT(rig.records().size(), 20U);
}

TEST(CyclicLoop, ARequestIsReadOnceAndStopWinsOverArm) {
  LoopRig rig;
  rig.requests.arm();
  rig.requests.stop(MonoTime{5});
  rig.run(3);
  const auto records = rig.records();
  EXPECT_EQ(records.at(0).header.operator_request, OperatorRequest::stop);
  EXPECT_EQ(records.at(0).header.asked_at, MonoTime{5});
  EXPECT_EQ(records.at(1).header.operator_request, OperatorRequest::none);
}

// De-energising comes first, then a person's press, and neither is lost behind a shutdown or behind each other.
TEST(CyclicLoop, StopsAreReadInTheOrderOfTheirWeight) {
  LoopRig rig;
  rig.requests.stop(MonoTime{4});
  rig.requests.shut_down(MonoTime{3});
  rig.requests.press_stop(MonoTime{2});
  rig.requests.press_stop(MonoTime{9});
  rig.requests.deenergise(MonoTime{1});
  rig.requests.arm();
  rig.run(4);
  const OperatorRequest order[] = {OperatorRequest::deenergise, OperatorRequest::press_stop, OperatorRequest::shutdown,
                                   OperatorRequest::shutdown};
  const auto records = rig.records();
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(records.at(i).header.operator_request, order[i]);
    EXPECT_EQ(records.at(i).header.asked_at, MonoTime{static_cast<std::int64_t>(std::min<std::size_t>(i + 1, 3))});
  }
}

TEST(CyclicLoop, AMarkWaitsForATickOfItsOwnAndIsReadOnce) {
  LoopRig rig;
  rig.requests.mark();
  rig.requests.arm();
  rig.run(3);
  const auto records = rig.records();
  EXPECT_EQ(records.at(0).header.operator_request, OperatorRequest::arm);
  EXPECT_EQ(records.at(1).header.operator_request, OperatorRequest::mark);
  EXPECT_EQ(records.at(1).header.mode, records.at(0).header.mode) << "a mark decides nothing";
  EXPECT_EQ(records.at(2).header.operator_request, OperatorRequest::none);
}

TEST(CyclicLoop, AShutdownRequestStays) {
  LoopRig rig;
  rig.requests.shut_down(MonoTime{5});
  rig.requests.arm();
  rig.run(3);
  for (const TickRecord& record : rig.records()) {
    EXPECT_EQ(record.header.operator_request, OperatorRequest::shutdown);
  }
}

TEST(CyclicLoop, AMessageFromThePolicyIsReadRecordedAndJudged) {
  LoopRig rig;
  auto segment = ipc::Segment::create("test-command", ipc::ring_bytes(ipc::command_mailbox()), false).value();
  auto policy_side = ipc::Segment::adopt_writable(dup(segment.fd()), segment.size()).value();
  ipc::SlotWriter writer(policy_side.writable(), ipc::command_mailbox());
  rig.mailboxes[Seat::policy].want(CommandMailbox::seal(std::move(segment), 7).value());
  CommandHeader header;  // answers nothing: to be refused, and recorded all the same
  header.sequence = 41;
  writer.publish(std::as_bytes(std::span(&header, 1)));
  rig.run(2);

  const auto records = rig.records();
  EXPECT_EQ(records.at(0).header.seats[Seat::policy].mailbox, Arrival::accepted);
  EXPECT_EQ(records.at(0).header.seats[Seat::policy].command_sequence_seen, 41U);
  EXPECT_EQ(records.at(0).header.seats[Seat::policy].session, 7);
  EXPECT_NE(records.at(0).header.seats[Seat::policy].arrival, Arrival::accepted);
  EXPECT_EQ(records.at(1).header.seats[Seat::policy].mailbox, Arrival::none);
  auto ring = ipc::Segment::adopt_read_only(dup(rig.published.monitor_descriptors()[ipc::kCommandRingDescriptor]),
                                            ipc::ring_bytes(ipc::command_ring()))
                  .value();
  auto reader = ipc::SlotReader::attach(ring.readable(), ipc::command_ring()).value();
  std::vector<std::byte> payload(ipc::command_ring().payload_capacity);
  const auto result = reader.read_next(payload);
  ASSERT_EQ(result.status, ipc::ReadStatus::fresh);
  ASSERT_EQ(result.size, sizeof(CommandTag) + sizeof(CommandHeader));
  EXPECT_EQ(std::memcmp(payload.data() + sizeof(CommandTag), &header, sizeof header), 0);
}

// One message after the other, refused for a value, or for being longer than any legal one: the first are recorded
// whole, then every tick has the header, the size and the checksum of its message, and no long one is recorded whole.
TEST(CyclicLoop, WhatIsRefusedInMassesLeavesItsHeader) {
  LoopRig rig;
  rig.config.largest_command = static_cast<std::uint32_t>(largest_command_bytes(3, 64));
  rig.config.interpolation = pipeline::Interpolation::cubic;
  auto segment = ipc::Segment::create("test-command", ipc::ring_bytes(ipc::command_mailbox()), false).value();
  auto policy_side = ipc::Segment::adopt_writable(dup(segment.fd()), segment.size()).value();
  ipc::SlotWriter writer(policy_side.writable(), ipc::command_mailbox());
  rig.mailboxes[Seat::policy].want(CommandMailbox::seal(std::move(segment), 1).value());
  auto ring = ipc::Segment::adopt_read_only(dup(rig.published.monitor_descriptors()[ipc::kCommandRingDescriptor]),
                                            ipc::ring_bytes(ipc::command_ring()))
                  .value();
  auto reader = ipc::SlotReader::attach(ring.readable(), ipc::command_ring()).value();
  std::vector<std::byte> payload(ipc::command_ring().payload_capacity);
  const auto chunk = std::make_unique<CommandChunk>();
  chunk->header.sequence = 1;
  chunk->header.step_count = 64;
  chunk->header.joint_count = 3;
  chunk->header.fields = kAllCommandFields;
  chunk->header.step_period = milliseconds(10);
  const auto longest = std::as_bytes(std::span(chunk.get(), 1));
  const auto legal = longest.first(rig.config.largest_command);
  ASSERT_EQ(chunk->used_bytes(), legal.size());

  std::size_t whole = 0, cut = 0, recorded = 0;
  for (std::uint64_t tick = 1; tick <= 200; ++tick) {
    const bool is_legal = tick % 2 == 0;
    writer.publish(is_legal ? legal : longest);
    rig.run(tick);
    const auto result = reader.read_next(payload);
    ASSERT_EQ(result.status, ipc::ReadStatus::fresh) << tick;
    CommandTag tag;
    std::memcpy(&tag, payload.data(), sizeof tag);
    EXPECT_EQ(tag.tick, tick);
    EXPECT_EQ(tag.bytes, is_legal ? legal.size() : longest.size());
    const std::size_t kept = result.size - sizeof tag;
    EXPECT_TRUE(kept == sizeof(CommandHeader) || (is_legal && kept == legal.size())) << tick << ": " << kept;
    EXPECT_EQ(std::memcmp(payload.data() + sizeof tag, longest.data(), kept), 0);
    if (is_legal && kept != legal.size()) {
      EXPECT_EQ(tag.crc, ipc::crc32c(legal)) << tick;
    }
    ++(kept == legal.size() ? whole : cut);
    recorded += kept;
  }
  const auto records = rig.records();
  ASSERT_EQ(records.size(), 200U);
  for (const TickRecord& record : records)
    EXPECT_EQ(record.header.seats[Seat::policy].arrival,
              record.header.tick % 2 == 0 ? Arrival::unknown_observation : Arrival::wrong_shape);
  EXPECT_GT(whole, 10U);
  EXPECT_GT(cut, 150U);
  EXPECT_LE(recorded, kRefusedBytesAtOnce + 200 * (kRefusedBytesPerTick + sizeof(CommandHeader)));
}

// Goal: of what a policy publishes at once the newest message alone counts. Method: three messages before the first
// tick, and the sequences that each tick says it read.
TEST(CyclicLoop, OfSeveralMessagesTheNewestIsRead) {
  LoopRig rig;
  auto segment = ipc::Segment::create("test-command", ipc::ring_bytes(ipc::command_mailbox()), false).value();
  auto policy_side = ipc::Segment::adopt_writable(dup(segment.fd()), segment.size()).value();
  ipc::SlotWriter writer(policy_side.writable(), ipc::command_mailbox());
  rig.mailboxes[Seat::policy].want(CommandMailbox::seal(std::move(segment), 1).value());
  const auto chunk = std::make_unique<CommandChunk>();
  chunk->header.step_count = 1;
  chunk->header.joint_count = 3;
  chunk->header.fields = static_cast<std::uint8_t>(CommandField::q);
  for (std::uint64_t sequence = 1; sequence <= 3; ++sequence) {
    chunk->header.sequence = sequence;
    writer.publish(std::as_bytes(std::span(chunk.get(), 1)).first(chunk->used_bytes()));
  }
  rig.run(4);
  std::vector<std::uint64_t> seen;
  for (const TickRecord& record : rig.records())
    seen.push_back(record.header.seats[Seat::policy].command_sequence_seen);
  EXPECT_EQ(seen, (std::vector<std::uint64_t>{3, 0, 0, 0}));
}

TEST(CyclicLoop, AKeyframeFollowsEveryPeriodOfIts) {
  LoopRig rig(3, 2, {{}, {}, 25});
  rig.run(60);
  auto ring = ipc::Segment::adopt_read_only(dup(rig.published.monitor_descriptors()[ipc::kKeyframeRingDescriptor]),
                                            ipc::ring_bytes(ipc::keyframe_ring()))
                  .value();
  auto reader = ipc::SlotReader::attach(ring.readable(), ipc::keyframe_ring()).value();
  std::vector<std::byte> payload(ipc::kMaxKeyframeBytes);
  for (const std::uint64_t expected : {25U, 50U}) {
    ASSERT_EQ(reader.read_next(payload).status, ipc::ReadStatus::fresh);
    TickTag tag;
    std::memcpy(&tag, payload.data(), sizeof tag);
    EXPECT_EQ(tag.tick, expected);
  }
  EXPECT_EQ(reader.read_next(payload).status, ipc::ReadStatus::nothing_new);
}

}  // namespace
}  // namespace takt::runtime::test
