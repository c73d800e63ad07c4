// SPDX-License-Identifier: Apache-2.0
// Goal: `takt ablate` prints both tables, the same whatever the number of workers, and ends with its documented exit
// codes. Method: the real binary on the demo cart, two seeds.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/cli/shell.hpp"

namespace takt::cli {
namespace {

class AblateCli : public test::Shell {};

TEST_F(AblateCli, ShowsEveryProtectionWithAndWithoutAFault) {
  const test::Ended ended = takt("ablate config/cart_pole.yaml --seeds 2 --workers 2");
  ASSERT_EQ(ended.exit_code, 0) << ended.output;
  for (const char* part : {"without a fault\n", "the policy stands still for 300 ms\n", "\nplain ",
                           "\nwithout_brake_reserve ", "\nwithout_observer "})
    EXPECT_NE(ended.output.find(part), std::string::npos) << part << "\n" << ended.output;
  const auto json = nlohmann::json::parse(takt("ablate config/cart_pole.yaml --seeds 2 --json").output);
  EXPECT_EQ(json["nominal"].size(), 10U);
  EXPECT_EQ(json["nominal"][0]["name"], "takt");
  EXPECT_EQ(json["nominal"][0]["successes"], 2);
  EXPECT_EQ(json["nominal"][1]["marks_per_joint_tick"], 0.0);
}

TEST_F(AblateCli, BadInputEndsWithOneLine) {
  EXPECT_EQ(takt("ablate").exit_code, 64);
  EXPECT_EQ(takt("ablate config/arm6.yaml --seeds 0").exit_code, 64);
  EXPECT_EQ(takt("ablate no-such-robot.yaml").exit_code, 65);
}

}  // namespace
}  // namespace takt::cli
