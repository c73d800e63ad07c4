// SPDX-License-Identifier: Apache-2.0
// Goal: `takt report` compares with the right run, refuses what it cannot read in one line, and then writes nothing.
// Method: the real program on recorded runs of the virtual robot.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/cli/shell.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/files.hpp"

namespace takt::cli::test {
namespace {

class ReportCli : public Shell {
 protected:
  ReportCli() {
    monitor::record_demo(in("run"));
    auto earlier = monitor::record_demo(in("earlier"));
    earlier.manifest.started_at = earlier.manifest.started_at - milliseconds(60'000);
    EXPECT_TRUE(earlier.folder.write_manifest(earlier.manifest));
  }
  [[nodiscard]] Ended report(const std::string& options) const { return takt("report " + in("run") + " " + options); }
  [[nodiscard]] bool page_exists() const { return std::filesystem::exists(in("run/report.html")); }
};

TEST_F(ReportCli, ComparesWithTheRunThatItIsToldAndWithNoOther) {
  const Ended plain = report("");
  EXPECT_EQ(plain.exit_code, 0) << plain.output;
  EXPECT_EQ(plain.output.find("against"), std::string::npos) << plain.output;
  EXPECT_TRUE(page_exists());
  const Ended compared = report("--against " + in("earlier"));
  EXPECT_NE(compared.output.find("against       virtual (2023-11-14T22:29:00.000Z)"), std::string::npos)
      << compared.output;
  const auto json = nlohmann::json::parse(report("--json --against " + in("earlier")).output);
  EXPECT_EQ(json.at("schema"), "takt.metrics/1");
  EXPECT_EQ(json.at("comparison").at("other_path"), in("earlier"));
  EXPECT_TRUE(nlohmann::json::parse(report("--json").output).at("comparison").is_null());
}

TEST_F(ReportCli, WhatCannotBeReadIsRefusedInOneLineAndNothingIsWritten) {
  for (const std::string option : {"--against ", "--truth "}) {
    const Ended ended = report(option + in("nowhere"));
    EXPECT_EQ(ended.exit_code, 1) << option;
    EXPECT_NE(ended.output.find("nowhere"), std::string::npos) << ended.output;
    EXPECT_EQ(std::count(ended.output.begin(), ended.output.end(), '\n'), 1) << ended.output;
    EXPECT_FALSE(page_exists()) << option;
  }
}

// What was judged reproduces, but ten ticks are gone: not the same as a run of which every tick reproduces.
TEST_F(ReportCli, ReplaySaysByItsExitCodeThatNotEveryTickCouldBeJudged) {
  EXPECT_EQ(takt("replay " + in("run")).exit_code, 0);
  const Ended beyond = takt("replay " + in("run") + " --from 99999999");
  EXPECT_EQ(beyond.exit_code, 1);
  EXPECT_NE(beyond.output.find("--from 99999999: the run's last tick is "), std::string::npos) << beyond.output;
  EXPECT_EQ(takt("replay " + in("run") + " --from -5").exit_code, 64);
  const auto gone = [](std::uint64_t tick) { return tick < 1'050 || tick > 1'060; };
  monitor::altered_copy(
      monitor::open_run(in("run")).value(), in("gap"), [](TickRecord&) {}, [](monitor::RecordedCommand&) {}, gone);
  const Ended ended = takt("replay " + in("gap"));
  EXPECT_EQ(ended.exit_code, 2) << ended.output;
  EXPECT_NE(ended.output.find("140 ticks could not be judged"), std::string::npos) << ended.output;
}

// What a simulator leaves that was ended early: an empty truth file, which was not requested.
TEST_F(ReportCli, ATruthFileWithoutATargetIsSaidAndTheReportGoesOn) {
  std::ofstream(in("run/truth.jsonl")).close();
  const Ended found = report("");
  EXPECT_EQ(found.exit_code, 0);
  EXPECT_NE(found.output.find("the playback shows no target: " + in("run/truth.jsonl") + ": holds no target"),
            std::string::npos)
      << found.output;
  EXPECT_NE(found.output.find("deadline misses"), std::string::npos) << found.output;
  EXPECT_TRUE(page_exists());
  EXPECT_EQ(report("--truth " + in("run/truth.jsonl")).exit_code, 1) << "asked for by name";
}

TEST_F(ReportCli, WhereThePageCannotBeWrittenTheNumbersAreSaidAllTheSame) {
  const Ended ended = report("--html " + in("run/config.yaml/page.html"));
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_NE(ended.output.find("deadline misses"), std::string::npos) << ended.output;
  EXPECT_EQ(ended.output.find("page   "), std::string::npos) << ended.output;
  EXPECT_NE(ended.output.find("Not a directory; --html FILE writes the page elsewhere"), std::string::npos)
      << ended.output;
}

// The page must not be able to fetch anything, whatever names the run's files carry.
TEST_F(ReportCli, ThePageForbidsRequestsAndKeepsTextText) {
  ASSERT_EQ(report("--html " + in("page.html")).exit_code, 0);
  EXPECT_FALSE(page_exists());
  const std::string page = takt::test::text_of(in("page.html"));
  EXPECT_NE(page.find("default-src 'none'"), std::string::npos);
  for (const char* slot : {"/*FACTS*/", "/*WHOLE*/", "/*MOMENTS*/", "/*PAGE_JS*/", "/*PAGE_CSS*/"}) {
    EXPECT_EQ(page.find(slot), std::string::npos) << slot;
  }
}

}  // namespace
}  // namespace takt::cli::test
