// SPDX-License-Identifier: Apache-2.0
// Goal: a slow DDS costs the recording nothing but messages, and every lost one is counted. Method: fill beyond the
// bounds; then two threads at different paces, where what came out and what was lost must add up to what went in.
#include "monitor/dds/outbox.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace takt::monitor::dds {
namespace {

constexpr std::chrono::milliseconds kNoPatience{0};

std::uint64_t lost(const Outbox& outbox, Channel channel) {
  return outbox.losses()[static_cast<std::size_t>(channel)];
}

TEST(Outbox, TheNewestStayAndTheRestIsCounted) {
  Outbox outbox;
  for (std::uint64_t tick = 1; tick <= Outbox::kCommandAges + 3; ++tick) outbox.put(CommandAge{.tick = tick});
  for (std::int64_t at = 1; at <= 60; ++at) outbox.put(JointStates{.unix_ns = at});
  for (std::int64_t at = 1; at <= 5; ++at) outbox.put(Status{{}, at, true});
  for (std::int64_t at = 1; at <= 6; ++at) outbox.put(Diagnostics{.unix_ns = at});
  const Outbox::Batch batch = outbox.take(kNoPatience);
  ASSERT_EQ(batch.command_ages.size(), Outbox::kCommandAges);
  EXPECT_EQ(batch.command_ages.front().tick, 4U);
  EXPECT_EQ(batch.command_ages.back().tick, Outbox::kCommandAges + 3);
  EXPECT_EQ(batch.joint_states.front().unix_ns, 11);
  EXPECT_EQ(batch.status.front().unix_ns, 2);
  EXPECT_EQ(batch.diagnostics.front().unix_ns, 3);
  EXPECT_EQ(outbox.losses(), (Losses{10, 2, 1, 3}));
  EXPECT_TRUE(outbox.take(kNoPatience).joint_states.empty()) << "taken once";
}

TEST(Outbox, WhatCouldNotBeWrittenIsLostToo) {
  Outbox outbox;
  outbox.count_unsent(Channel::diagnostics, 2);
  EXPECT_EQ(lost(outbox, Channel::diagnostics), 2U);
}

TEST(Outbox, ClosingEndsTheWait) {
  Outbox outbox;
  std::thread closes([&] { outbox.close(); });
  (void)outbox.take(std::chrono::hours(1));
  closes.join();
  EXPECT_TRUE(outbox.is_closed());
}

TEST(Outbox, NothingVanishesBetweenTwoThreads) {
  constexpr std::uint64_t kPut = 20'000;
  Outbox outbox;
  std::thread fills([&] {
    for (std::uint64_t tick = 1; tick <= kPut; ++tick) outbox.put(CommandAge{.tick = tick});
    outbox.close();
  });
  std::uint64_t taken = 0, newest = 0;
  bool in_order = true;
  const auto read = [&] {
    for (const CommandAge& age : outbox.take(std::chrono::milliseconds(1)).command_ages) {
      in_order = in_order && age.tick > newest;
      newest = age.tick;
      ++taken;
    }
  };
  while (!outbox.is_closed()) read();
  fills.join();
  read();
  EXPECT_TRUE(in_order);
  EXPECT_EQ(newest, kPut) << "the newest always arrives";
  EXPECT_EQ(taken + lost(outbox, Channel::command_age), kPut);
}

}  // namespace
}  // namespace takt::monitor::dds
