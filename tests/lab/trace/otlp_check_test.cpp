// SPDX-License-Identifier: Apache-2.0
// Goal: an export that tells other ages than the records is found out. Method: traces exported by the exporter's own
// code from known records, read back; then one record is changed, one span taken away, one line cut.
#include "lab/trace/otlp_check.hpp"

#include <gtest/gtest.h>

#include <sstream>

#include "monitor/telemetry/otlp_json.hpp"

namespace takt::monitor {
namespace {

const OtlpSource kSource{"arm6", "run", "ab", "1", 5'000'000'000};

struct Exported {
  std::vector<lab::TickFacts> records;
  std::string lines;
};

Exported exported() {
  Exported made;
  std::vector<CommandTrace> traces;
  for (std::uint64_t i = 1; i <= 20; ++i) {
    lab::TickFacts record;
    record.tick = 20 * i;
    record.sequence = i;
    record.now = MonoTime{1'000'000'000} + milliseconds(static_cast<std::int64_t>(record.tick));
    record.age = {milliseconds(3), milliseconds(2), milliseconds(8), microseconds(700), {}};
    made.records.push_back(record);
    CommandTrace trace;
    trace.tick = record.tick;
    trace.sequence = i;
    trace.observation = i;
    trace.sensed_at = record.now - record.age.total();
    trace.observed_at = trace.sensed_at + record.age.sense;
    trace.infer_began_at = trace.observed_at + record.age.queue;
    trace.infer_ended_at = trace.infer_began_at + record.age.infer;
    trace.consumed_at = trace.actuating_at = trace.actuated_at = record.now;
    traces.push_back(trace);
  }
  made.lines = otlp_traces(kSource, std::span(traces).first(10)) + "\n" +
               otlp_traces(kSource, std::span(traces).subspan(10)) + "\n";
  return made;
}

std::vector<lab::ToldCommand> told_by(const std::string& lines) {
  std::istringstream stream(lines);
  auto told = lab::read_told_commands(stream);
  EXPECT_TRUE(told.has_value()) << told.error();
  return told.value_or(std::vector<lab::ToldCommand>{});
}

TEST(OtlpCheck, WhatWasExportedAgrees) {
  const Exported run = exported();
  const lab::OtlpCheck check = lab::check_told_commands(told_by(run.lines), run.records);
  EXPECT_EQ(check.commands, 20U);
  EXPECT_TRUE(check.agrees());
}

TEST(OtlpCheck, AnAgeThatDiffersByMoreThanTheAgreementIsNamed) {
  Exported run = exported();
  run.records[4].age.infer = run.records[4].age.infer + microseconds(25);
  const lab::OtlpCheck check = lab::check_told_commands(told_by(run.lines), run.records);
  EXPECT_FALSE(check.agrees());
  ASSERT_EQ(check.disagreements.size(), 2U) << "the age and its part";
  EXPECT_EQ(check.disagreements[0].tick, 100U);
  EXPECT_EQ(check.disagreements[1].what, "infer");
  EXPECT_NE(lab::otlp_text(check).find("DISAGREE"), std::string::npos);
}

TEST(OtlpCheck, NothingComparedIsNoAgreement) {
  EXPECT_FALSE(lab::check_told_commands({}, exported().records).agrees());
  EXPECT_EQ(lab::check_told_commands(told_by(exported().lines), {}).unrecorded, 20U);
}

TEST(OtlpCheck, ACutLineAndAMissingSpanAreErrors) {
  const std::string lines = exported().lines;
  std::istringstream cut(lines.substr(0, lines.size() / 3));
  EXPECT_NE(lab::read_told_commands(cut).error().find("line 1"), std::string::npos);
  std::string without = lines;
  without.replace(without.find("\"infer\""), 7, "\"other\"");
  std::istringstream stream(without);
  EXPECT_NE(lab::read_told_commands(stream).error().find("no span infer"), std::string::npos);
}

}  // namespace
}  // namespace takt::monitor
