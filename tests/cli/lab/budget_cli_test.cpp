// SPDX-License-Identifier: Apache-2.0
// Goal: `takt budget` ends with its documented exit codes, and its picture is well-formed. Method: the real binary; the
// picture is read by Python's XML parser.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/cli/shell.hpp"

namespace takt::cli {
namespace {

class BudgetCli : public test::Shell {};

TEST_F(BudgetCli, RequiredRatesDecideTheExitCode) {
  EXPECT_EQ(takt("budget").exit_code, 0) << "drawing is no judgement";
  EXPECT_EQ(takt("budget --require 15Hz").exit_code, 0);
  EXPECT_EQ(takt("budget --require 50Hz").exit_code, 1);
  EXPECT_EQ(takt("budget --require 30Hz").exit_code, 0);
  EXPECT_EQ(takt("budget --require 30Hz --serial").exit_code, 1);
  EXPECT_EQ(takt("budget --require 15Hz --max-age 100ms").exit_code, 1) << "fits, but its commands grow too old";
}

TEST_F(BudgetCli, BadInputEndsWithOneLine) {
  EXPECT_EQ(takt("budget --stage inference=15").exit_code, 64) << "no unit";
  EXPECT_EQ(takt("budget --stage inference").exit_code, 64);
  EXPECT_EQ(takt("budget --stage inference=40ms/15ms").exit_code, 64);
  EXPECT_EQ(takt("budget --rate 0Hz").exit_code, 64);
  EXPECT_EQ(takt("budget --rate fast").exit_code, 64);
  const test::Ended nothing =
      takt("budget --stage perception=0ms --stage inference=0ms --stage planning=0ms --stage actuation=0ms");
  EXPECT_EQ(nothing.exit_code, 64);
  EXPECT_EQ(nothing.output, "takt budget: no stage takes any time; give one with --stage NAME=TIME\n");
  EXPECT_EQ(takt("budget no-such-robot.yaml").exit_code, 65);
  EXPECT_EQ(takt("budget " + directory()).exit_code, 1) << "a folder, but not of a run";
}

TEST_F(BudgetCli, CommandLineReplacesStagesOfTheRobotFile) {
  const auto json = nlohmann::json::parse(
      takt("budget config/arm6.yaml --stage inference=8ms/12ms --stage speech=2ms --rate 50Hz --json").output);
  EXPECT_EQ(json["stages"].size(), 5U);
  EXPECT_EQ(json["stages"][1]["worst_ms"], 12);
  EXPECT_EQ(json["stages"][4]["name"], "speech");
  EXPECT_EQ(json["rates"].size(), 1U);
}

TEST_F(BudgetCli, ThePictureIsWellFormed) {
  const std::string picture = in("budget.svg");
  ASSERT_EQ(takt("budget --stage 'a<b&\"c=7ms' --svg " + picture).exit_code, 0);
  const test::Ended parsed = shell(
      "python3 -c \"import sys, xml.dom.minidom as d; s = d.parse(sys.argv[1]); "
      "print(s.documentElement.tagName, len(s.getElementsByTagName('rect')) > 20)\" " +
      picture);
  EXPECT_EQ(parsed.exit_code, 0) << parsed.output;
  EXPECT_EQ(parsed.output, "svg True\n");
}

}  // namespace
}  // namespace takt::cli
