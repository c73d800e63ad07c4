// SPDX-License-Identifier: Apache-2.0
// Goal: a mailbox is freed only after the control thread let go of it, and no request to change is lost. Method: the
// interleavings step by step on one thread, then two threads racing under ThreadSanitizer.
#include "executive/runtime/mailbox_handover.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "executive/ipc/executive_segments.hpp"

namespace takt::runtime {
namespace {

std::unique_ptr<CommandMailbox> mailbox(std::uint8_t session) {
  auto segment = ipc::Segment::create("test-command", ipc::ring_bytes(ipc::command_mailbox()), false).value();
  auto writer_side = ipc::Segment::adopt_writable(dup(segment.fd()), segment.size()).value();
  ipc::SlotWriter writer(writer_side.writable(), ipc::command_mailbox());
  return CommandMailbox::seal(std::move(segment), session).value();
}

TEST(MailboxHandover, StartsWithNone) {
  MailboxHandover handover;
  EXPECT_EQ(handover.current(), nullptr);
  EXPECT_TRUE(handover.is_settled());
}

TEST(MailboxHandover, KeepsTheOldOneWhileTheControlThreadMayReadIt) {
  MailboxHandover handover;
  handover.want(mailbox(1));
  CommandMailbox* const first = handover.current();
  ASSERT_NE(first, nullptr);
  handover.want(nullptr);
  handover.settle();
  EXPECT_FALSE(handover.is_settled()) << "the control thread has not come by: the tick that reads it may still run";
  EXPECT_EQ(first->session, 1) << "AddressSanitizer would see it freed";
  EXPECT_EQ(handover.current(), nullptr);
  handover.settle();
  EXPECT_TRUE(handover.is_settled());
}

TEST(MailboxHandover, AChangeIsNotMadeBeforeTheLastOneWasSeen) {
  // none -> A -> none, all before the control thread comes by: were `wanted` changed back at once, "in use: none" would
  // look like an acknowledgement while the control thread, delayed between its load and its store, is about to read A.
  MailboxHandover handover;
  handover.want(mailbox(1));
  handover.want(nullptr);
  handover.settle();
  CommandMailbox* const seen = handover.current();
  ASSERT_NE(seen, nullptr) << "the first change must be seen before the second is made";
  EXPECT_EQ(seen->session, 1);
  handover.settle();
  EXPECT_EQ(handover.current(), nullptr);
}

TEST(MailboxHandover, OnlyTheLastOfSeveralWaitingRequestsCounts) {
  MailboxHandover handover;
  handover.want(mailbox(1));
  handover.want(mailbox(2));
  handover.want(mailbox(3));
  EXPECT_EQ(handover.current()->session, 1);
  handover.settle();
  EXPECT_EQ(handover.current()->session, 3);
}

TEST(MailboxHandover, TwoThreads) {
  MailboxHandover handover;
  std::atomic<bool> done = false;
  std::atomic<std::uint64_t> reads = 0;
  std::thread control([&] {
    std::vector<std::byte> out(sizeof(CommandChunk));
    while (!done.load(std::memory_order_relaxed)) {
      if (CommandMailbox* const current = handover.current()) {
        current->reader.read_latest(out);
        reads.fetch_add(1, std::memory_order_relaxed);
      }
    }
  });
  for (int session = 1; session <= 60; ++session) {
    handover.want(mailbox(static_cast<std::uint8_t>(session)));
    if (session % 3 == 0) handover.want(nullptr);
    const std::uint64_t before = reads.load(std::memory_order_relaxed);
    while (session % 3 == 1 && reads.load(std::memory_order_relaxed) < before + 2) handover.settle();
  }
  handover.want(nullptr);
  while (!handover.is_settled()) handover.settle();
  done = true;
  control.join();
  EXPECT_GT(reads.load(), 0U);
}

}  // namespace
}  // namespace takt::runtime
