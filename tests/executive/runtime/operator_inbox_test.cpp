// SPDX-License-Identifier: Apache-2.0
// Goal: what a person asks reaches the tick once, in the order of what hurts more, and nothing that gets a robot going
// outlives a stop. Method: requests that are pending together, taken tick by tick.
#include "executive/runtime/operator_inbox.hpp"

#include <gtest/gtest.h>

namespace takt::runtime {
namespace {

constexpr MonoTime kFirst{1'000}, kSecond{2'000};

void expect(OperatorInbox& inbox, OperatorRequest request, MonoTime at = {}) {
  const OperatorInbox::Asked asked = inbox.take();
  EXPECT_EQ(asked.request, request);
  EXPECT_EQ(asked.at, at);
}

TEST(OperatorInbox, EachRequestIsTakenOnce) {
  OperatorInbox inbox;
  inbox.arm();
  expect(inbox, OperatorRequest::arm);
  inbox.reset();
  expect(inbox, OperatorRequest::reset);
  inbox.mark();
  expect(inbox, OperatorRequest::mark);
  inbox.stop(kFirst);
  inbox.stop(kSecond);
  expect(inbox, OperatorRequest::stop, kFirst);
  inbox.press_stop(kFirst);
  expect(inbox, OperatorRequest::press_stop, kFirst);
  inbox.deenergise(kFirst);
  expect(inbox, OperatorRequest::deenergise, kFirst);
  expect(inbox, OperatorRequest::none);
}

TEST(OperatorInbox, ASwapNamesThePolicyAndAStopDiscardsIt) {
  OperatorInbox inbox;
  inbox.swap(0xCA11);
  const OperatorInbox::Asked asked = inbox.take();
  EXPECT_EQ(asked.request, OperatorRequest::swap);
  EXPECT_EQ(asked.policy, 0xCA11U);
  inbox.back();
  expect(inbox, OperatorRequest::back);
  inbox.swap(0xCA11);
  inbox.stop(kFirst);
  expect(inbox, OperatorRequest::stop, kFirst);
  expect(inbox, OperatorRequest::none);
}

TEST(OperatorInbox, WhatHurtsMoreComesFirst) {
  OperatorInbox inbox;
  inbox.mark();
  inbox.stop(kFirst);
  inbox.press_stop(kFirst);
  inbox.deenergise(kSecond);
  expect(inbox, OperatorRequest::deenergise, kSecond);
  expect(inbox, OperatorRequest::press_stop, kFirst);
  expect(inbox, OperatorRequest::stop, kFirst);
  expect(inbox, OperatorRequest::mark);
  expect(inbox, OperatorRequest::none);
}

TEST(OperatorInbox, AStopDiscardsWhatWouldGetTheRobotGoing) {
  OperatorInbox inbox;
  void (OperatorInbox::*const stops[])(MonoTime) noexcept = {&OperatorInbox::stop, &OperatorInbox::press_stop,
                                                             &OperatorInbox::deenergise};
  for (const auto stop : stops) {
    inbox.arm();
    (inbox.*stop)(kFirst);
    EXPECT_NE(inbox.take().request, OperatorRequest::arm);
    expect(inbox, OperatorRequest::none);
  }
}

TEST(OperatorInbox, AShutdownIsRepeatedAndHearsAPress) {
  OperatorInbox inbox;
  inbox.shut_down(kFirst);
  expect(inbox, OperatorRequest::shutdown, kFirst);
  inbox.press_stop(kSecond);
  expect(inbox, OperatorRequest::press_stop, kSecond);
  inbox.arm();
  expect(inbox, OperatorRequest::shutdown, kFirst);
}

}  // namespace
}  // namespace takt::runtime
