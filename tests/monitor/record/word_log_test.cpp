// SPDX-License-Identifier: Apache-2.0
// Goal: what a policy's host says is in the run folder and reads as it was said, in each part of the run; more than
// fits is bounded, in the file and for a reader. Method: words by hand into a folder, read by the run's own reader.
#include "monitor/record/word_log.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "executive/contract/monotonic_clock.hpp"
#include "monitor/record/run_events.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

class WordLogTest : public test::TemporaryFolder {
 protected:
  static PolicyWord word(PolicyWordKind kind, const std::string& sentence, std::uint64_t first_sequence = 0) {
    PolicyWord word;
    word.kind = kind;
    word.heard_at = monotonic_now();
    word.first_sequence = first_sequence;
    sentence.copy(word.sentence, sizeof word.sentence - 1);
    return word;
  }
  RunFolder folder(const std::string& name) const {
    std::filesystem::create_directories(path(name));
    return RunFolder(path(name));
  }
};

TEST_F(WordLogTest, ReadsAsItWasSaid) {
  WordLog log(folder("run"));
  PolicyWord source = word(PolicyWordKind::source, "policy server \"far\" (01)", 71);
  source.superseded = 3;
  log.note(source);
  log.note(word(PolicyWordKind::problem, "its policy left"));
  log.note(word(PolicyWordKind::problem, ""));
  EXPECT_EQ(log.failure(), "");
  const auto events = read_run_events(folder("run"));
  ASSERT_EQ(events.size(), 3U);
  EXPECT_EQ(events[0].event, kPolicyEvent);
  EXPECT_EQ(events[0].role, "policy");
  EXPECT_EQ(events[0].kind, "source");
  EXPECT_EQ(events[0].what, "policy server \"far\" (01)");
  EXPECT_EQ(events[0].first_sequence, 71U);
  EXPECT_EQ(events[0].superseded, 3U);
  EXPECT_EQ(events[0].at, source.heard_at);
  EXPECT_EQ(events[1].what, "its policy left");
  EXPECT_EQ(events[2].what, "");
}

TEST_F(WordLogTest, EachPartSaysWhatStands) {
  WordLog log(folder("run"));
  log.note(word(PolicyWordKind::source, "policy server far", 1));
  log.note(word(PolicyWordKind::problem, "its policy left"));
  log.note(word(PolicyWordKind::problem, ""));
  log.go_on_in(folder("run.2"));
  const auto events = read_run_events(folder("run.2"));
  ASSERT_EQ(events.size(), 1U) << "a problem that is over is none";
  EXPECT_EQ(events[0].what, "policy server far");
}

TEST_F(WordLogTest, WhoAskedForWhatReadsAsItWasTold) {
  WordLog log(folder("run"));
  OperatorWord word;
  word.heard_at = monotonic_now();
  word.pid = 812;
  word.uid = 1000;
  word.verb = OperatorVerb::arm;
  std::string_view("takt").copy(word.program, sizeof word.program - 1);
  std::string_view("no fresh command").copy(word.answer, sizeof word.answer - 1);
  log.note(word);
  word.verb = OperatorVerb::deenergise;
  word.done = 1;
  log.note(word);
  const auto events = read_run_events(folder("run"));
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[0].event, kOperatorEvent);
  EXPECT_EQ(events[0].action, "arm");
  EXPECT_EQ(events[0].process, "takt");
  EXPECT_EQ(events[0].what, "no fresh command");
  EXPECT_EQ(events[0].pid, 812);
  EXPECT_EQ(events[0].uid, 1000);
  EXPECT_FALSE(events[0].done);
  EXPECT_EQ(events[1].action, "de-energise");
  EXPECT_TRUE(events[1].done);
}

TEST_F(WordLogTest, ALotIsBoundedAndLeavesRoomForTheScript) {
  WordLog log(folder("run"));
  for (std::size_t i = 0; i < kMostRunEvents + 10; ++i) log.note(word(PolicyWordKind::problem, std::to_string(i)));
  OperatorWord mark;
  mark.heard_at = monotonic_now();
  for (std::size_t i = 0; i < kMostRunEvents + 10; ++i) log.note(mark);
  std::ofstream(path("run") + "/events.jsonl", std::ios::app)
      << event_line("script", monotonic_now(), {{"given", "--at"}});
  const auto events = read_run_events(folder("run"));
  ASSERT_EQ(events.size(), 2 * kMostRunEvents + 1);
  EXPECT_EQ(events.back().event, "script");
}

TEST_F(WordLogTest, AFolderThatIsGoneIsSaid) {
  WordLog log(RunFolder(path("nowhere")));
  log.note(word(PolicyWordKind::problem, "its policy left"));
  EXPECT_NE(log.failure(), "");
}

}  // namespace
}  // namespace takt::monitor
