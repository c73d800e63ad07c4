// SPDX-License-Identifier: Apache-2.0
// Goal: a line says one trouble, in any order of spelling that people write, or is refused with a sentence that says
// what is wrong and how to write it; what a stranger writes is bounded. Method: tables with the exact sentence; every
// kind told and read again; mutated lines.
#include "config/trouble/line.hpp"

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace takt::trouble {
namespace {

std::string refusal(std::string_view line, Place place) {
  const auto read = parse_line(line, place);
  return read ? "taken as " + text_of(*read) : read.error();
}

TEST(TroubleLine, SpellingsOfOneTrouble) {
  for (const char* line : {"8s: freeze policy 300ms", " 8 s :  freeze  policy for 300 ms ",
                           "8 s for 300 ms: freeze policy", "8000ms: freeze policy 0.3s"}) {
    const auto read = parse_line(line, Place::run);
    ASSERT_TRUE(read.has_value()) << line << ": " << read.error();
    EXPECT_EQ(read->row->as<ActionKind>(), ActionKind::freeze) << line;
    EXPECT_EQ(read->at, seconds(8)) << line;
    EXPECT_EQ(read->target, "policy") << line;
    EXPECT_EQ(read->length, milliseconds(300)) << line;
  }
  for (const char* line : {"3 s for 2 s: publish_delay 100 ms", "3s for 2s: publish_delay 100ms",
                           "3 s: publish_delay 100 ms for 2 s", "3 s: publish_delay 100 ms 2 s"}) {
    const auto read = parse_line(line, Place::policy_host);
    ASSERT_TRUE(read.has_value()) << line << ": " << read.error();
    EXPECT_EQ(read->row->as<HostFault>(), HostFault::publish_delay) << line;
    EXPECT_EQ(read->length, seconds(2)) << line;
    EXPECT_EQ(read->dose, 100e6) << line;
  }
  const auto load = parse_line("1s: load 2 400 ms ./burn --all", Place::run);
  ASSERT_TRUE(load.has_value()) << load.error();
  EXPECT_EQ(load->dose, 2);
  EXPECT_EQ(load->length, milliseconds(400));
  EXPECT_EQ(load->command, (std::vector<std::string>{"./burn", "--all"}));
}

TEST(TroubleLine, EveryKindIsTakenAsItIsTold) {
  for (const Place place : {Place::run, Place::policy_host})
    for (const Row& row : rows(place)) {
      Line line{.row = &row, .at = seconds(3)};
      if (row.longest.ns > 0) line.length = milliseconds(150);
      if (!row.strikes.words.empty()) line.target = row.strikes.words.back();
      if (!row.dose.unit.empty()) line.dose = row.dose.most * row.dose.in_base();
      if (row.takes_command) line.command = {"./burn", "--all"};
      const auto again = parse_line("3 s: " + text_of(line), place);
      ASSERT_TRUE(again.has_value()) << text_of(line) << ": " << again.error();
      EXPECT_EQ(text_of(*again), text_of(line));
      EXPECT_EQ(again->dose, line.dose) << row.name;
      EXPECT_NE(forms(place).find(form(row)), std::string::npos);
    }
}

TEST(TroubleLine, SaysWhatIsWrongAndHowToWriteIt) {
  const std::string actions =
      "freeze PROCESS DURATION; kill PROCESS; start PROCESS; hog control|policy DURATION; throttle control DURATION; "
      "crowd policy COPIES DURATION; load COPIES DURATION COMMAND; arm; stop; reset";
  const std::string freeze = "; write 'TIME: freeze PROCESS DURATION'";
  const std::string delay = "; write 'TIME for LENGTH: publish_delay TIME'";
  const std::string growth = "; write 'TIME for LENGTH: queue_growth CALLBACKS'";
  struct Refused {
    Place place;
    std::string line, sentence;
  };
  const Refused table[] = {
      {Place::run, "kill policy", "write 'TIME: KIND', KIND one of: " + actions},
      {Place::run, "8s:", "names no kind; write one of: " + actions},
      {Place::run, "8s: freez policy 1s",
       "`freez` is not known; did you mean `freeze`? write one of: freeze, kill, start, hog, throttle, crowd, load, "
       "arm, "
       "stop, reset"},
      {Place::run, "8s: publish_delay 100 ms",
       "`publish_delay` is written in --fault of takt-policy-host; here stands one of: freeze, kill, start, hog, "
       "throttle, crowd, load, arm, stop, reset"},
      {Place::policy_host, "3 s for 1 s: bus_off",
       "`bus_off` is written in a scenario of takt-plant; here stands one of: publish_delay, queue_growth, "
       "bad_actions_nan, bad_actions_range, wrong_joint_order"},
      {Place::run, "8: freeze policy 1s", "8 has no unit; write `8 ms` or `8 s`" + freeze},
      {Place::run, "soon: freeze policy 1s",
       "`soon` is not a time; write a number and ns or us or ms or s or min or h" + freeze},
      {Place::run, "-1s: freeze policy 1s", "-1 s is out of range; write a time up to 1000000000 s" + freeze},
      {Place::run, "1e12s: freeze policy 1s", "1e+12 s is out of range; write a time up to 1000000000 s" + freeze},
      {Place::run, "1e300s: freeze policy 1s", "1e300s is too large" + freeze},
      {Place::run, "nan s: freeze policy 1s", "nan is not finite; write a real number" + freeze},
      {Place::run, "8s 9s: freeze policy 1s", "`9s` does not belong there" + freeze},
      {Place::run, "8s: freeze camera 1s",
       "`freeze` strikes one of plant, executive, monitor, policy, fallback, not `camera`" + freeze},
      {Place::run, "8s: freeze policy", "`freeze` lacks its length" + freeze},
      {Place::run, "8s: freeze policy for", "`freeze` lacks its length" + freeze},
      {Place::run, "8s: freeze policy 3 kg",
       "3 kg is a mass, not a time; write it in ns or us or ms or s or min or h" + freeze},
      {Place::run, "8s: freeze policy 1s now", "`now` does not belong there" + freeze},
      {Place::run, "8s for 1s: freeze policy 1s", "`1s` does not belong there" + freeze},
      {Place::run, "8s for 1s: stop", "`stop` takes no length; write 'TIME: stop'"},
      {Place::run, "1s: hog control 2s", "a `hog` may last 1 s; write 'TIME: hog control|policy DURATION'"},
      {Place::run, "1s: crowd policy 65 2s",
       "65 copies is out of range; `crowd` takes 1 to 64 copies; write 'TIME: crowd policy COPIES DURATION'"},
      {Place::run, "1s: crowd policy 1.5 2s", "1.5 is not a whole number; write 'TIME: crowd policy COPIES DURATION'"},
      {Place::run, "1s: load 2 400ms", "`load` lacks its command; write 'TIME: load COPIES DURATION COMMAND'"},
      {Place::policy_host, "3 s for 2 s: publish_delay", "`publish_delay` lacks its dose" + delay},
      {Place::policy_host, "3 s: publish_delay 100 ms", "`publish_delay` lacks its length" + delay},
      {Place::policy_host, "3 s for 2 s: publish_delay 100", "100 has no unit; write `100 ms` or `100 s`" + delay},
      {Place::policy_host, "3 s for 2 s: publish_delay 0 ms",
       "0 ms is out of range; `publish_delay` takes more than 0 to 10000 ms" + delay},
      {Place::policy_host, "3 s for 2 s: publish_delay 100 N",
       "100 N is a force, not a time; write it in ns or us or ms or s or min or h" + delay},
      {Place::policy_host, "3 s for 2 s: queue_growth 201",
       "201 callbacks is out of range; `queue_growth` takes 1 to 200 callbacks" + growth},
      {Place::policy_host, "3 s for 2 s: queue_growth -1",
       "-1 callbacks is out of range; `queue_growth` takes 1 to 200 callbacks" + growth},
      {Place::policy_host, "3 s for 2 s: queue_growth nan", "nan is not finite; write a real number" + growth},
      {Place::policy_host, "3 s for 2 s: queue_growth 1e999", "1e999 is too large or too small" + growth},
      {Place::policy_host, "3 s for 2 s: queue_growth 1 ms", "`ms` does not belong there" + growth},
      {Place::policy_host, "3 s for 2 s: \x1b[2J 1",
       "`\\x1b[2J` is not known; write one of: publish_delay, queue_growth, bad_actions_nan, bad_actions_range, "
       "wrong_joint_order"},
  };
  for (const Refused& row : table) EXPECT_EQ(refusal(row.line, row.place), row.sentence) << row.line;
}

// Goal: no line makes the reader fail, grow or exceed a Duration. Method: long lines; good lines with bytes changed.
TEST(TroubleLine, WhatAStrangerWritesIsBounded) {
  EXPECT_EQ(refusal(std::string(5000, '8'), Place::run), "has 5000 characters; write at most 4096");
  const std::string full = "1s: load 2 400ms" + std::string(kMostCharacters - 16, ' ');
  EXPECT_EQ(refusal(full, Place::run).find("`load` lacks its command"), 0U);
  std::mt19937_64 random(1);
  const std::array<std::string, 4> good{"8 s: freeze policy 300 ms", "3 s for 2 s: publish_delay 100 ms",
                                        "1s: load 2 400ms ./burn", "1e9 s for 1e9 s: queue_growth 1e2"};
  std::size_t taken = 0;
  for (int i = 0; i < 20'000; ++i) {
    std::string line = good[random() % good.size()];
    for (std::uint64_t changes = random() % 3; changes > 0; --changes) {
      const auto at = static_cast<std::ptrdiff_t>(random() % line.size());
      const char byte = random() % 2 == 0 ? static_cast<char>(random()) : "0123456789.e-:s m"[random() % 17];
      if (random() % 2 == 0)
        line[static_cast<std::size_t>(at)] = byte;
      else
        line.insert(line.begin() + at, byte);
    }
    for (const Place place : {Place::run, Place::policy_host}) {
      const auto read = parse_line(line, place);
      if (!read) {
        EXPECT_FALSE(read.error().empty());
        EXPECT_LT(read.error().size(), 600U);
        continue;
      }
      ++taken;
      EXPECT_LE(read->at, kLongestTime);
      EXPECT_GE((read->at + read->length).ns, 0);
      EXPECT_TRUE(read->row->dose.unit.empty() || read->row->dose.range().contains(read->dose)) << line;
    }
  }
  EXPECT_GT(taken, 1000U) << "the mutations leave nothing to read";
}

TEST(TroubleLine, Times) {
  EXPECT_EQ(parse_time("20s"), seconds(20));
  EXPECT_EQ(parse_time(" 300 ms "), milliseconds(300));
  for (const char* text : {"", "20", "20 m", "-1s", "1e10 h", "20s 1s", "inf s"})
    EXPECT_FALSE(parse_time(text).has_value()) << text;
}

}  // namespace
}  // namespace takt::trouble
