// SPDX-License-Identifier: Apache-2.0
// Goal: a data set is written whole or not at all, and says what it is of. Method: small made-up episodes; folders that
// cannot be written. What the files hold is judged by readers of other hands (tests/node/lerobot_check.mjs).
#include "lab/data_set/lerobot_data_set.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/temporary_folder.hpp"

namespace takt::data_set {
namespace {

RunEpisodes small_run() {
  RunEpisodes run;
  run.run_id = "small";
  run.robot = {"cart", {"slide", "pivot"}, {"slide"}, milliseconds(67), config::ActionKind::joint_torque, {}};
  run.policy_sha256 = "1122334455667788" + std::string(48, 'a');
  run.episodes.push_back(
      {0x1122334455667788, 100, 234, 3, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}, {0.5F, 1.5F, 2.5F}});
  return run;
}

class LerobotDataSet : public test::TemporaryFolder {
 protected:
  [[nodiscard]] static std::expected<void, std::string> write(const std::string& folder) {
    const RunEpisodes run = small_run();
    return write_lerobot({&run, 1}, "balance", folder);
  }
};

TEST_F(LerobotDataSet, FeaturesAreNamedByJointWithUnits) {
  ASSERT_TRUE(write(path("deep/set/")));
  const auto info = nlohmann::json::parse(std::ifstream(path("deep/set/meta/info.json")));
  EXPECT_EQ(info.at("robot_type"), "cart");
  EXPECT_EQ(info.at("fps"), 15) << "67 ms are 14.93 per second: the format takes whole numbers";
  EXPECT_EQ(info.at("total_frames"), 3);
  const auto action = info.at("features").at("action");
  EXPECT_EQ(action.at("shape"), nlohmann::json::array({1}));
  EXPECT_EQ(action.at("names"), nlohmann::json::array({"slide.torque"}));
  EXPECT_EQ(action.at("units"), nlohmann::json::array({"Nm"}));
  const auto stats = nlohmann::json::parse(std::ifstream(path("deep/set/meta/stats.json")));
  EXPECT_EQ(stats.at("action").at("mean"), nlohmann::json::array({1.5}));
  EXPECT_EQ(stats.at("observation.state").at("max"), nlohmann::json::array({9, 10, 11, 12}));
  const auto origin = nlohmann::json::parse(std::ifstream(path("deep/set/meta/takt.json"))).at("episodes").at(0);
  EXPECT_EQ(origin.at("run_id"), "small");
  EXPECT_EQ(origin.at("last_tick"), 234);
}

// Goal: a joint that slides is in its own units. Method: the same run, of a robot whose file says that it does.
TEST_F(LerobotDataSet, ASlideIsInMetresAndNewtons) {
  RunEpisodes run = small_run();
  run.robot.slides = {"slide"};
  ASSERT_TRUE(write_lerobot({&run, 1}, "balance", path("set")));
  const auto features = nlohmann::json::parse(std::ifstream(path("set/meta/info.json"))).at("features");
  EXPECT_EQ(features.at("action").at("units"), nlohmann::json::array({"N"}));
  EXPECT_EQ(features.at("observation.state").at("units"), nlohmann::json::array({"m", "rad", "m/s", "rad/s"}));
}

// After a change of policy in the run, the manifest speaks of another policy.
TEST_F(LerobotDataSet, AnEpisodeNamesThePolicyThatMovedIt) {
  RunEpisodes run = small_run();
  run.episodes.push_back(run.episodes.front());
  run.episodes.back().policy = 0xFEDCBA9876543210;
  ASSERT_TRUE(write_lerobot({&run, 1}, "balance", path("set")));
  const auto episodes = nlohmann::json::parse(std::ifstream(path("set/meta/takt.json"))).at("episodes");
  EXPECT_EQ(episodes.at(0).at("policy_hash"), "1122334455667788");
  EXPECT_EQ(episodes.at(0).at("policy_sha256"), run.policy_sha256);
  EXPECT_EQ(episodes.at(1).at("policy_hash"), "fedcba9876543210");
  EXPECT_TRUE(episodes.at(1).at("policy_sha256").is_null());
}

TEST_F(LerobotDataSet, WhatIsThereIsLeftAsItIs) {
  std::filesystem::create_directory(path("set"));
  const auto written = write(path("set"));
  ASSERT_FALSE(written);
  EXPECT_NE(written.error().find("exists already"), std::string::npos) << written.error();
  EXPECT_TRUE(std::filesystem::is_empty(path("set")));
  std::filesystem::create_directory(path("other.partial"));
  ASSERT_FALSE(write(path("other")));
  EXPECT_FALSE(std::filesystem::exists(path("other")));
}

TEST_F(LerobotDataSet, WhatCannotBeWrittenLeavesNothing) {
  std::ofstream(path("file")).close();
  const auto written = write(path("file/set"));
  ASSERT_FALSE(written);
  EXPECT_NE(written.error().find("cannot make"), std::string::npos) << written.error();
  const auto entries = std::distance(std::filesystem::directory_iterator(path("")), {});
  EXPECT_EQ(entries, 1);
}

}  // namespace
}  // namespace takt::data_set
