// SPDX-License-Identifier: Apache-2.0
// Goal: what takes long says how far it is and how long it will still take, on a terminal in one line that is
// rewritten, elsewhere in few lines; what is short says nothing. Method: a clock and a terminal of the test's own.
#include "cli/lab/progress.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace takt::cli {
namespace {

class ProgressTest : public testing::Test {
 protected:
  ProgressPlace place(bool is_terminal) {
    return {.is_terminal = is_terminal,
            .now = [this] { return now_; },
            .write = [this](std::string_view text) { written_.emplace_back(text); }};
  }
  void pass(Duration span) { now_ = now_ + span; }
  MonoTime now_{1'000'000'000'000};
  std::vector<std::string> written_;
};

TEST_F(ProgressTest, WhatIsShortSaysNothing) {
  {
    Progress progress("rollouts", place(true));
    for (std::size_t done = 1; done <= 19; ++done) {
      pass(milliseconds(100));
      progress.show(done, 19);
    }
  }
  EXPECT_TRUE(written_.empty()) << written_.front();
}

TEST_F(ProgressTest, ATerminalHasOneLineWithTheTimeLeft) {
  {
    Progress progress("rollouts", place(true));
    pass(seconds(30));
    progress.show(1, 4, "publish_delay 40 ms");
    pass(milliseconds(99));
    progress.show(2, 4);
    ASSERT_EQ(written_.size(), 1U) << "not rewritten within 100 ms";
    EXPECT_EQ(written_[0],
              "\r\033[?7l[#####...............] 1/4 rollouts, 1:30 left: publish_delay 40 ms\033[K\033[?7h");
    pass(milliseconds(29'901));
    progress.show(4, 4);
  }
  ASSERT_EQ(written_.size(), 3U);
  EXPECT_EQ(written_[1], "\r\033[?7l[####################] 4/4 rollouts, 0:00 left\033[K\033[?7h");
  EXPECT_EQ(written_[2], "\r\033[K") << "leaves the line empty";
}

TEST_F(ProgressTest, ElsewhereALineEveryThirtySeconds) {
  {
    Progress progress("runs", place(false));
    for (std::size_t done = 1; done <= 70; ++done) {
      pass(seconds(1));
      progress.show(done, 140);
    }
  }
  EXPECT_EQ(written_, (std::vector<std::string>{"30/140 runs, 1:50 left\n", "60/140 runs, 1:20 left\n"}));
}

TEST_F(ProgressTest, WithoutAnythingDoneThereIsNoEstimate) {
  Progress progress("joints", place(false));
  pass(seconds(31));
  progress.show(0, 6);
  EXPECT_EQ(written_, (std::vector<std::string>{"0/6 joints\n"}));
}

}  // namespace
}  // namespace takt::cli
