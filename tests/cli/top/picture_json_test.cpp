// SPDX-License-Identifier: Apache-2.0
// Goal: a script finds every number of the screen under a stable name. Method: the sample picture, field by field.
#include "cli/top/picture_json.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/cli/top/sample_picture.hpp"

namespace takt::monitor::top {
namespace {

TEST(PictureJson, NamesWhatTheScreenShows) {
  const auto json = to_json(sample_picture(3, 2));
  EXPECT_EQ(json.at("link"), "live");
  EXPECT_EQ(json.at("mode"), "tracking");
  EXPECT_EQ(json.at("age_ns"), 43'997'000);
  EXPECT_EQ(json.at("contract").at("max_age_ns"), 150'000'000);
  EXPECT_EQ(json.at("recent_age_ns").at("p50"), 44.5e6);
  EXPECT_EQ(json.at("recent_stages_ns").at("infer").at("p50"), 12e6);
  EXPECT_EQ(json.at("window_misses"), 4);
  EXPECT_EQ(json.at("since_attached").at("deadline_misses").at("misses"), 810);
  EXPECT_EQ(json.at("since_attached").at("overruns").at("preempted"), 2);
  EXPECT_EQ(json.at("command_policy"), "1122334455667788");
  EXPECT_EQ(json.at("buses").at(1).at("tx_dropped"), 12);
  EXPECT_EQ(json.at("joints").at(1).at("intervention_ticks").at("velocity_limit"), 17);
}

TEST(PictureJson, WhatIsUnknownIsNull) {
  const auto json = to_json(Picture{.robot = "arm6"});
  EXPECT_TRUE(json.at("realtime").is_null());
  EXPECT_TRUE(json.at("age_ns").is_null());
  EXPECT_TRUE(json.at("command_policy").is_null());
}

}  // namespace
}  // namespace takt::monitor::top
