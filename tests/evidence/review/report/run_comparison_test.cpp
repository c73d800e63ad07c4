// SPDX-License-Identifier: Apache-2.0
// Goal: a run's numbers stand beside another's, and differences have the right sign. Method: copies of the recorded
// demo.
#include "evidence/review/report/run_comparison.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "monitor/judge/run_metrics.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

class RunComparisonTest : public test::TemporaryFolder {
 protected:
  // A copy of the demo under another id.
  RecordedRun copy(const std::string& name) {
    std::filesystem::copy(run_.folder.path(), path(name), std::filesystem::copy_options::recursive);
    RecordedRun run = *open_run(path(name));
    run.manifest.run_id = name;
    EXPECT_TRUE(run.folder.write_manifest(run.manifest));
    return *open_run(path(name));
  }
  static const evidence::ComparisonRow& row(const evidence::RunComparison& comparison, const std::string& label) {
    return *std::ranges::find(comparison.rows, label, &evidence::ComparisonRow::label);
  }
  const RecordedRun run_ = record_demo(path("run"));
};

TEST_F(RunComparisonTest, DifferencesAreThisRunsMinusTheOthers) {
  const RecordedRun shorter = altered_copy(
      run_, path("shorter"), [](TickRecord&) {}, [](RecordedCommand&) {},
      [](std::uint64_t tick) { return tick < 3'000; });
  const auto metrics = to_json(*metrics_of(run_), run_);
  const auto found = evidence::compare_with(metrics, path("shorter"));
  ASSERT_TRUE(found) << found.error();
  EXPECT_TRUE(found->same_contract);
  const evidence::ComparisonRow& recorded = row(*found, "recorded");
  EXPECT_NEAR(recorded.here.value(), 3.999, 1e-9);
  EXPECT_NEAR(recorded.other.value(), 2.998, 1e-9);
  EXPECT_EQ(row(*found, "age per command, p50").here, 37.0);
  EXPECT_GT(row(*found, "misses per tick").here, row(*found, "misses per tick").other) << "the second stall";
  EXPECT_NE(evidence::comparison_text(*found).find("+1.001 s"), std::string::npos) << evidence::comparison_text(*found);
}

// A run that never left standby has no ages and no misses, which is not the same as ages of 0 ms.
TEST_F(RunComparisonTest, WhatWasNotMeasuredIsNoZero) {
  const RecordedRun standby = altered_copy(
      run_, path("standby"), [](TickRecord&) {}, [](RecordedCommand&) {},
      [](std::uint64_t tick) { return tick < VirtualRobot::kArmAt; });
  const auto found = evidence::compare_with(to_json(*metrics_of(run_), run_), path("standby"));
  ASSERT_TRUE(found) << found.error();
  for (const char* label : {"age per command, p99", "infer, p99", "misses per command", "at most, per tick"}) {
    EXPECT_TRUE(row(*found, label).here) << label;
    EXPECT_FALSE(row(*found, label).other) << label;
  }
  EXPECT_EQ(row(*found, "in standby").other, 100.0);
  EXPECT_EQ(row(*found, "in tracking").other, 0.0) << "counted, and there was none";
  const std::string text = evidence::comparison_text(*found);
  EXPECT_NE(text.find("  age per command, p50               -      37.000           - ms\n"), std::string::npos)
      << text;
  const auto json = to_json(*found);
  EXPECT_EQ(json["rows"][0].dump(), R"(["age per command, p50","ms",null,37.0])");
  const auto alone = evidence::compare_with(to_json(*metrics_of(standby), standby), path("standby"));
  EXPECT_EQ(evidence::comparison_text(*alone).find("age"), std::string::npos) << evidence::comparison_text(*alone);
}

// metrics.json counts only where it is the run's own.
TEST_F(RunComparisonTest, ForeignMetricsAreNotBelieved) {
  const RecordedRun other = copy("other");
  auto foreign = to_json(*metrics_of(other), other);
  foreign["age_ns"]["per_command"]["total"]["p50"] = 1e9;
  std::ofstream(other.folder.metrics()) << foreign.dump();
  const auto metrics = to_json(*metrics_of(run_), run_);
  EXPECT_EQ(row(*evidence::compare_with(metrics, path("other")), "age per command, p50").other, 1000.0);
  foreign["run_id"] = "somebody else's";
  std::ofstream(other.folder.metrics()) << foreign.dump();
  EXPECT_EQ(row(*evidence::compare_with(metrics, path("other")), "age per command, p50").other, 37.0);
}

TEST_F(RunComparisonTest, WhatIsNoRunIsRefused) {
  const auto refused = evidence::compare_with(to_json(*metrics_of(run_), run_), path("nowhere"));
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().find("nowhere"), std::string::npos);
}

}  // namespace
}  // namespace takt::monitor
