// SPDX-License-Identifier: Apache-2.0
// Goal: what `takt trace review` concludes from a trace is right, whatever part of the story the trace holds.
// Method: events are constructed, as the reader would hand them out, for a robot whose every instant is known
// (trace_story.hpp). Then single events are left out, moved or falsified, and the review must say exactly that.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <vector>

#include "lab/trace/review.hpp"
#include "lab/trace/trace_folders.hpp"
#include "tests/lab/trace/trace_story.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

using namespace takt::monitor::testing;

lab::TraceReview review_of(const Story& story) {
  return lab::review_trace(story.timeline(), &story.records).value();
}

double p50(const lab::TraceReview& review, lab::Stage stage) {
  return review.stages[static_cast<std::size_t>(stage)].p50;
}

TEST(TraceReview, FollowsEachCommandThroughTheProcesses) {
  const lab::TraceReview review = review_of(whole_story());
  EXPECT_EQ(review.executive_pid, kExecutive);
  ASSERT_EQ(review.chains.accepted.size(), kCommands);
  EXPECT_EQ(review.period, milliseconds(1));
  EXPECT_EQ(p50(review, lab::Stage::sense), 15'100'000) << "the outside sensor is the older one";
  EXPECT_EQ(p50(review, lab::Stage::queue), 200'000);
  EXPECT_EQ(p50(review, lab::Stage::infer), 400'000);
  EXPECT_EQ(p50(review, lab::Stage::publish), 100'000);
  EXPECT_EQ(p50(review, lab::Stage::consume), 200'000);
  EXPECT_EQ(p50(review, lab::Stage::actuate), 60'000);
  EXPECT_EQ(p50(review, lab::Stage::total), 16'060'000);
  EXPECT_EQ(review.worst.size(), kCommands);
  ASSERT_TRUE(review.records.has_value());
  EXPECT_TRUE(review.records->agrees());
  EXPECT_EQ(review.records->ticks, kTicks);
  EXPECT_EQ(review.records->ages, kTicks - kEvery);
  EXPECT_EQ(review.records->commands, kCommands);
  EXPECT_EQ(review.records->largest, Duration{});
}

TEST(TraceReview, AMissingPublicationIsSaidAndItsStagesAreUnknown) {
  Story story = whole_story();
  ASSERT_EQ(story.drop([](const lab::TraceEvent& event) {
    return event.name == lab::EventName::publish_end && event.sequence == 2;
  }),
            1U);
  const lab::TraceReview review = review_of(story);
  EXPECT_EQ(review.chains.without_publish, 1U);
  EXPECT_EQ(review.chains.without_inference, 0U);
  EXPECT_EQ(review.stages[static_cast<std::size_t>(lab::Stage::publish)].count, kCommands - 1);
  EXPECT_EQ(review.stages[static_cast<std::size_t>(lab::Stage::consume)].count, kCommands - 1);
  EXPECT_EQ(review.records->commands, kCommands - 1);
  EXPECT_TRUE(review.records->agrees());
  EXPECT_NE(lab::review_text(review, {}, story.timeline()).find("1 without their publication"), std::string::npos);
}

TEST(TraceReview, WithoutAPolicyHostsEventsAgesAreNotMadeUp) {
  Story story = whole_story();
  story.drop([](const lab::TraceEvent& event) { return event.pid == kHost; });
  const lab::TraceReview review = review_of(story);
  EXPECT_EQ(review.chains.without_inference, kCommands);
  EXPECT_EQ(review.records->ages, 0U);
  EXPECT_EQ(review.records->underivable, kTicks - kEvery);
  EXPECT_TRUE(review.records->agrees()) << "the ages that the executive's own events state do";
}

TEST(TraceReview, ALostConsumptionLeavesItsAgesOpen) {
  Story story = whole_story();
  ASSERT_EQ(story.drop([](const lab::TraceEvent& event) {
    return event.name == lab::EventName::command_consumed && event.sequence == 2;
  }),
            1U);
  const lab::TraceReview review = review_of(story);
  EXPECT_EQ(review.records->underivable, kEvery) << "nobody knows which command those ticks had";
  EXPECT_EQ(review.records->ages, kTicks - 2 * kEvery);
  EXPECT_TRUE(review.records->agrees());
}

TEST(TraceReview, AWrappedTraceBeginsInTheMiddle) {
  Story story = whole_story();
  // As a flight recorder leaves it: each process's memory reaches back differently far.
  story.drop([](const lab::TraceEvent& event) { return event.pid == kExecutive && event.at < start_of(45); });
  story.drop(
      [](const lab::TraceEvent& event) { return event.pid == kHost && event.at < start_of(60) + microseconds(400); });
  const lab::TraceReview review = review_of(story);
  EXPECT_EQ(review.ticks, kTicks - 44);
  ASSERT_EQ(review.chains.accepted.size(), 2U);
  EXPECT_EQ(review.chains.without_observation, 0U);
  EXPECT_EQ(review.chains.without_inference, 1U) << "of the command whose inference began before the memory does";
  EXPECT_EQ(review.records->ages, 40U);
  EXPECT_TRUE(review.records->agrees());
}

TEST(TraceReview, AnAgeThatDisagreesBy25MicrosecondsIsAnError) {
  Story story = whole_story();
  story.records[49].age.sense = story.records[49].age.sense + microseconds(25);
  const lab::TraceReview review = review_of(story);
  EXPECT_FALSE(review.records->agrees());
  ASSERT_EQ(review.records->disagreement_count, 2U) << "the age that tick_end states, and the one put together";
  EXPECT_EQ(review.records->disagreements[0].tick, 50U);
  EXPECT_EQ(review.records->disagreements[0].recorded - review.records->disagreements[0].traced, 25'000);
  EXPECT_NE(lab::review_text(review, {}, story.timeline()).find("DISAGREE"), std::string::npos);
}

TEST(TraceReview, AnAgeWithin20MicrosecondsAgrees) {
  Story story = whole_story();
  story.records[49].age.sense = story.records[49].age.sense + microseconds(20);
  EXPECT_TRUE(review_of(story).records->agrees());
  EXPECT_EQ(review_of(story).records->largest, microseconds(20));
}

// Each falsifies one event by 25 us or by one, and must be found.
TEST(TraceReview, EveryInstantTakesPartInTheComparison) {
  const std::vector<std::pair<const char*, std::function<void(Story&)>>> faults{
      {"oldest sample",
       [](Story& s) { s.nth(lab::EventName::observation_published, 1).sensed = outside_for(40) - microseconds(25); }},
      {"outside sensor", [](Story& s) { s.nth(lab::EventName::publish_begin, 1).sensed.ns -= 25'000; }},
      {"observation", [](Story& s) { s.nth(lab::EventName::observation_published, 1).published.ns += 25'000; }},
      {"inference begin", [](Story& s) { s.nth(lab::EventName::infer_begin, 1).stamp.ns += 25'000; }},
      {"inference end", [](Story& s) { s.nth(lab::EventName::infer_end, 1).stamp.ns += 25'000; }},
      {"tick", [](Story& s) { s.nth(lab::EventName::tick_begin, 50).stamp.ns += 25'000; }},
      {"stated age", [](Story& s) { s.nth(lab::EventName::tick_end, 50).age_total.ns += 25'000; }},
      {"stated part", [](Story& s) { s.nth(lab::EventName::command_consumed, 1).age.infer.ns += 25'000; }},
      {"command", [](Story& s) { s.nth(lab::EventName::tick_end, 50).sequence += 1; }},
      {"mode", [](Story& s) { s.nth(lab::EventName::tick_end, 50).mode += 1; }},
      {"freshness", [](Story& s) { s.nth(lab::EventName::tick_end, 50).freshness += 1; }},
  };
  for (const auto& [what, falsify] : faults) {
    Story story = whole_story();
    falsify(story);
    if (std::string_view(what) == "oldest sample")
      story.nth(lab::EventName::observation_published, 1).sensed.ns -= 5'000'000;
    EXPECT_FALSE(review_of(story).records->agrees()) << what;
  }
}

TEST(TraceReview, ATracerOnAnotherClockIsNoticed) {
  Story story = whole_story();
  for (lab::TraceEvent& event : story.events) event.at = event.at + microseconds(30);
  EXPECT_FALSE(review_of(story).records->agrees());
}

TEST(TraceReview, TwoRobotsAreKeptApart) {
  Story story = whole_story();
  // The same ids and sequences, of another configuration and 20 us earlier.
  Story other;
  introduce(other, "takt-executive", 11, 0x77);
  introduce(other, "takt-policy-host", 21, 0x77);
  for (std::uint64_t tick = 1; tick <= kTicks; ++tick) {
    run_tick(other, 11, tick);
    if (tick % kEvery == 0) answer(other, 21, tick, tick / kEvery);
  }
  for (lab::TraceEvent event : other.events) {
    for (MonoTime* instant : {&event.at, &event.stamp, &event.published}) instant->ns -= instant->is_set() ? 20'000 : 0;
    story.events.push_back(event);
  }
  std::ranges::stable_sort(story.events, {}, &lab::TraceEvent::at);
  const lab::TraceReview review = review_of(story);
  EXPECT_EQ(review.executive_pid, kExecutive);
  for (const lab::CommandChain& chain : review.chains.accepted) EXPECT_EQ(chain.host_pid, kHost);
  EXPECT_EQ(review.chains.accepted.size(), kCommands);
  EXPECT_TRUE(review.records->agrees());
  const auto undecided = lab::review_trace(story.timeline(), nullptr);
  ASSERT_FALSE(undecided.has_value());
  EXPECT_NE(undecided.error().find("--run"), std::string::npos) << undecided.error();
}

TEST(TraceReview, ARunOfAnotherSessionIsRefused) {
  Story story = whole_story();
  for (lab::TickFacts& record : story.records) record.now = record.now + seconds(60);
  EXPECT_FALSE(lab::review_trace(story.timeline(), &story.records).has_value());
}

TEST(TraceReview, TheSlowestCommandsComeWithWhatHappenedMeanwhile) {
  Story story = whole_story();
  // The third command: a late wake-up, a change of mode and an overrun while it was under way, and slow inference.
  story.nth(lab::EventName::infer_begin, 2).stamp.ns -= 100'000;
  story.nth(lab::EventName::publish_begin, 2).sensed.ns -= 100'000;
  story.nth(lab::EventName::tick_begin, 54).lateness = microseconds(700);
  story.nth(lab::EventName::tick_end, 50).mode = static_cast<std::uint8_t>(Mode::degraded);
  story.records[53].overrun_cause = OverrunCause::page_fault;
  const lab::TraceReview review = review_of(story);
  const lab::WorstCommand& worst = review.worst.front();
  EXPECT_EQ(worst.chain.sequence, 3U);
  EXPECT_EQ(worst.longest, lab::Stage::sense);
  EXPECT_EQ(worst.context.first_tick, 44U);
  EXPECT_EQ(worst.context.last_tick, 61U);
  EXPECT_EQ(worst.context.late_wakeups, 1U);
  EXPECT_EQ(worst.context.worst_lateness, microseconds(700));
  EXPECT_EQ(worst.context.modes, (std::vector{Mode::tracking, Mode::degraded, Mode::tracking}));
  EXPECT_EQ(worst.context.overruns[static_cast<std::size_t>(OverrunCause::page_fault)], 1U);
  EXPECT_EQ(worst.context.untraced_ticks, 0U);
}

TEST(TraceReview, AnOverrunWithoutACauseThatExistsIsNotCounted) {
  Story story = whole_story();
  for (lab::TickFacts& record : story.records) record.overrun_cause = static_cast<OverrunCause>(kOverrunCauseCount);
  const lab::TraceReview review = review_of(story);
  for (const lab::WorstCommand& worst : review.worst) {
    for (const std::uint64_t count : worst.context.overruns) EXPECT_EQ(count, 0U);
    EXPECT_EQ(worst.context.refused_messages, 0U) << "what lies behind the counts is as it was";
  }
}

TEST(TraceReview, LostEventsAreNeverSilent) {
  const Story story = whole_story();
  lab::TraceReading reading;
  EXPECT_NE(lab::review_text(review_of(story), reading, story.timeline()).find("lost          none"),
            std::string::npos);
  reading.losses.push_back({lab::TraceLoss::What::events, 42, start_of(5), start_of(6)});
  reading.losses.push_back({lab::TraceLoss::What::packets, 0, {}, {}});
  const std::string text = lab::review_text(review_of(story), reading, story.timeline());
  EXPECT_NE(text.find("LOST          42 events"), std::string::npos) << text;
  EXPECT_NE(text.find("an unknown number of packets"), std::string::npos) << text;
  EXPECT_EQ(to_json(review_of(story), reading, story.timeline()).at("losses").size(), 2U);
}

using TraceFolders = test::TemporaryFolder;

TEST_F(TraceFolders, SeveralSnapshotsAreRefusedByName) {
  const std::string folder = path("trace");
  const auto make = [&folder](const std::string& name) {
    std::filesystem::create_directories(folder + "/" + name);
    std::ofstream(folder + "/" + name + "/metadata") << "x";
  };
  EXPECT_FALSE(lab::trace_folders(folder).has_value()) << "empty";
  make("snapshot-1-20261121-100000-0/ust/uid/0/64-bit");
  EXPECT_EQ(lab::trace_folders(folder).value().size(), 1U);
  make("snapshot-1-20261121-100000-0/kernel");
  EXPECT_EQ(lab::trace_folders(folder).value().size(), 2U) << "user space and kernel of one snapshot";
  make("snapshot-2-20261121-100001-0/ust/uid/0/64-bit");
  const auto refused = lab::trace_folders(folder);
  ASSERT_FALSE(refused.has_value());
  EXPECT_NE(refused.error().find("snapshot-2"), std::string::npos) << refused.error();
  EXPECT_EQ(lab::trace_folders(folder + "/snapshot-1-20261121-100000-0").value().size(), 2U);
}

}  // namespace
}  // namespace takt::monitor
