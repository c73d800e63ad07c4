// SPDX-License-Identifier: Apache-2.0
// Goal: `takt ages` judges a list of ages as the worked example does, and refuses what is no age with its line. Method:
// the real binary; ages on standard input, one a line and as CSV.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/cli/shell.hpp"

namespace takt::cli {
namespace {

class AgesCli : public test::Shell {
 protected:
  static test::Ended judge(const std::string& ages, const std::string& command) {
    return shell("printf '" + ages + "' | " + TAKT_BIN_DIR + "/takt " + command + " -");
  }
};

TEST_F(AgesCli, JudgesTheWorkedExample) {
  const std::string ages = "28\\n32\\n35\\n31\\n40\\n29\\n36\\n34\\n52\\n33\\n";
  const test::Ended told = judge(ages, "ages --max-age 40ms --period 5ms");
  ASSERT_EQ(told.exit_code, 0) << told.output;
  for (const char* part : {"p95 57.4 ms", "control period 5 ms", "deadline miss rate 0.1: 1 of 10", "degraded: true",
                           "contract Pr(age > 40 ms) <= 0.01: undecided"})
    EXPECT_NE(told.output.find(part), std::string::npos) << part << "\n" << told.output;
  const auto json =
      nlohmann::json::parse(judge("28,32,35;31 40\\n29, 36,34,52,33", "ages --json --max-age 40 --period 5").output);
  EXPECT_EQ(json["ages"], 10);
  EXPECT_NEAR(json["policy_age_p95_ms"].get<double>(), 57.4, 1e-9);
  EXPECT_EQ(json["deadline_miss_rate"], 0.1);
  EXPECT_EQ(json["degraded_mode"], true);
}

// A stall of five commands among two hundred: one event, and less evidence than five.
TEST_F(AgesCli, CountsWhatDependsOnEachOtherForLess) {
  std::string ages;
  for (int i = 0; i < 200; ++i) ages += std::to_string(i >= 100 && i < 105 ? 90 : 20 + i * 7 % 11) + "\\n";
  const test::Ended told = judge(ages, "ages --max-age 40ms");
  EXPECT_NE(told.output.find("each age depends on the one before: 200 say as much as"), std::string::npos)
      << told.output;
  const auto json = nlohmann::json::parse(judge(ages, "ages --json --max-age 40ms").output);
  EXPECT_LT(json["effective_ages"].get<double>(), 100);
  EXPECT_GT(json["deadline_miss_rate_upper"].get<double>(), 0.06) << "0.052 of independent ones";
}

TEST_F(AgesCli, RefusesWhatIsNoAge) {
  const auto refusal = [](const std::string& ages) {
    const test::Ended ended = judge(ages, "ages --max-age 40ms");
    EXPECT_EQ(ended.exit_code, 1) << ages;
    return ended.output;
  };
  EXPECT_NE(refusal("28\\nlate\\n").find("line 2: `late` is no age"), std::string::npos);
  EXPECT_NE(refusal("28\\n-3\\n").find("line 2: `-3` is no age"), std::string::npos);
  EXPECT_NE(refusal("nan\\n").find("line 1: `nan` is no age"), std::string::npos);
  EXPECT_NE(refusal("12ms\\n").find("line 1: `12ms` is no age"), std::string::npos);
  EXPECT_NE(refusal(std::string(50, '0') + "1 2").find("line 1: `00000000000000000000` is no age"), std::string::npos);
  EXPECT_NE(refusal("").find("holds no age"), std::string::npos);
  EXPECT_EQ(takt("ages --max-age 40ms no-such-file").exit_code, 1);
  EXPECT_EQ(takt("ages -").exit_code, 64);
}

}  // namespace
}  // namespace takt::cli
