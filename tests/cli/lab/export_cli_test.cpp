// SPDX-License-Identifier: Apache-2.0
// Goal: `takt export lerobot` writes the runs it is given, says what became an episode, and refuses in one line, with
// the documented exit code and nothing written, what cannot be one data set. Method: the real program on recorded runs
// of the virtual robot. What the data set holds is judged by tests/node/lerobot_check.mjs.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "config/hash.hpp"
#include "config/load.hpp"
#include "monitor/record/bounded_file.hpp"
#include "tests/cli/shell.hpp"
#include "tests/monitor/record/recorded_demo.hpp"

namespace takt::cli::test {
namespace {

class ExportCli : public Shell {
 protected:
  ExportCli() { monitor::record_demo(in("run")); }
  [[nodiscard]] Ended lerobot(const std::string& options) const {
    return takt("export lerobot " + options + " --out " + in("set"));
  }
  void expect_refused(const std::string& options, int exit_code, const std::string& reason) const {
    const Ended ended = lerobot(options);
    EXPECT_EQ(ended.exit_code, exit_code) << ended.output;
    EXPECT_NE(ended.output.find(reason), std::string::npos) << ended.output;
    EXPECT_EQ(std::count(ended.output.begin(), ended.output.end(), '\n'), 1) << ended.output;
    EXPECT_FALSE(std::filesystem::exists(in("set")));
    EXPECT_FALSE(std::filesystem::exists(in("set.partial")));
  }
  // A copy of the run whose robot file has `from` replaced by `to`.
  void copy_with(const std::string& name, const std::string& from, const std::string& to) const {
    std::filesystem::copy(in("run"), in(name));
    std::string config = monitor::read_file(in(name + "/config.yaml")).value();
    ASSERT_NE(config.find(from), std::string::npos);
    config.replace(config.find(from), from.size(), to);
    ASSERT_TRUE(monitor::replace_file(in(name + "/config.yaml"), config));
    const monitor::RunFolder folder(in(name));
    auto manifest = folder.read_manifest().value();
    manifest.config_sha256 = config::sha256_hex(config);
    ASSERT_TRUE(folder.write_manifest(manifest));
  }
};

TEST_F(ExportCli, SaysWhatBecameAnEpisode) {
  monitor::VirtualRobot robot;
  monitor::record(robot, in("second"), 800, [](std::uint64_t) {});
  const Ended ended = lerobot(in("run") + " " + in("second") + " --task 'follow the target'");
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_NE(ended.output.find("run: episodes 0 to 1, "), std::string::npos) << ended.output;
  EXPECT_NE(ended.output.find("second: episodes 2 to 2, "), std::string::npos) << ended.output;
  EXPECT_NE(ended.output.find("set: 3 episodes, "), std::string::npos) << ended.output;
  EXPECT_NE(ended.output.find(" frames, 50 per second\n"), std::string::npos) << ended.output;
  const auto info = nlohmann::json::parse(std::ifstream(in("set/meta/info.json")));
  EXPECT_EQ(info.at("total_episodes"), 3);
}

TEST_F(ExportCli, AFolderThatExistsAndARunNamedTwiceAreMistypedCommands) {
  expect_refused(in("run") + " " + in("run/."), 64, "is named twice");
  std::filesystem::create_directory(in("set"));
  const Ended ended = lerobot(in("run"));
  EXPECT_EQ(ended.exit_code, 64) << ended.output;
  EXPECT_NE(ended.output.find("exists already; name a folder that does not"), std::string::npos) << ended.output;
  EXPECT_TRUE(std::filesystem::is_empty(in("set")));
  EXPECT_EQ(takt("export lerobot " + in("run")).exit_code, 64) << "--out is missing";
  EXPECT_EQ(takt("export").exit_code, 64);
}

TEST_F(ExportCli, WhatHoldsNothingToLearnIsRefused) {
  monitor::VirtualRobot robot;
  robot.policy_is_frozen = true;
  monitor::record(robot, in("idle"), 300, [](std::uint64_t) {});
  expect_refused(in("idle"), 1, "in no tick did the robot track a command of its policy");
  expect_refused(in("run") + " " + in("idle"), 1, "in no tick did the robot track a command of its policy");
  expect_refused(in("nowhere"), 1, "nowhere");
}

TEST_F(ExportCli, RunsOfDifferentRobotsAreRefused) {
  copy_with("other", "\nrobot: arm6\n", "\nrobot: arm7\n");
  expect_refused(in("run") + " " + in("other"), 1, "one is of robot arm6, the other of arm7; export them apart");
}

}  // namespace
}  // namespace takt::cli::test
