// SPDX-License-Identifier: Apache-2.0
// Goal: takt deploy puts a robot into use and proves it, brings the old one back when the new one breaks its contract
// or does not come up, and refuses what it should; takt rollback goes back by hand. Method: the real command with a
// store of its own and real processes, which a small script starts anew in systemd's place.
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>

#include "tests/cli/shell.hpp"
#include "tests/support/files.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;
using test::Ended;

class Deploy : public test::Shell {
 protected:
  Deploy() {
    // One robot at a time: `takt run` of whatever is in use, with the script's arguments; its process id stands in a
    // file.
    std::ofstream(in("restart.sh")) << "[ ! -e " << in("pid") << " ] || { kill $(cat " << in("pid")
                                    << "); while kill -0 $(cat " << in("pid")
                                    << ") 2>/dev/null; do sleep 0.05; done; }\n"
                                    << "timeout 120 " << TAKT_BIN_DIR << "/takt run " << in("store/robot/robot.yaml")
                                    << " --restart --to-the-end --allow-non-realtime --runtime-dir " << in("rt")
                                    << " \"$@\" >" << in("run.log") << " 2>&1 </dev/null &\necho $! >" << in("pid")
                                    << "\n";
    write_robot("good.yaml", {});
    fs::create_directory(in("interventions"));
  }
  ~Deploy() override {
    std::ifstream file(in("pid"));
    if (pid_t pid = 0; file >> pid && pid > 0) {
      kill(pid, SIGTERM);
      for (int i = 0; i < 400 && kill(pid, 0) == 0; ++i) usleep(50'000);
    }
  }
  // The demo arm with some of its lines replaced, for a machine that stalls now and then.
  void write_robot(const std::string& name, const std::vector<std::pair<std::string, std::string>>& changes) const {
    std::string text = takt::test::text_of("config/arm6.yaml");
    text = std::regex_replace(text, std::regex("cpu: 1 "), "cpu: none ");
    text = std::regex_replace(text, std::regex("timeout: 20 ms"), "timeout: 200 ms");
    text = std::regex_replace(text, std::regex("drive_watchdog: 100 ms"), "drive_watchdog: 500 ms");
    for (const auto& [from, to] : changes) {
      ASSERT_NE(text.find(from), std::string::npos) << from;
      text.replace(text.find(from), from.size(), to);
    }
    std::ofstream(in(name)) << text;
    fs::copy_file("config/arm6_reach.onnx", in("arm6_reach.onnx"), fs::copy_options::skip_existing);
  }
  [[nodiscard]] Ended deploy(const std::string& robot, const std::string& more) const {
    return takt("deploy " + in(robot) + " --store " + in("store") + " --runs " + in("runs") + " --runtime-dir " +
                in("rt") + " " + more);
  }
  [[nodiscard]] std::string live(const std::string& more) const {
    return "--restart 'sh " + in("restart.sh") + "' --arm --watch 2s --arm-within 40s " + more;
  }
  // The lines of the log: "deploy one -> two".
  [[nodiscard]] std::vector<std::string> interventions() const {
    std::vector<std::string> found;
    for (const auto& year : fs::directory_iterator(in("interventions"))) {
      std::ifstream log(year.path());
      for (std::string line; std::getline(log, line);) {
        const auto json = nlohmann::json::parse(line);
        const std::string before = json["deployment_before"];
        found.push_back(json["what"].get<std::string>() + (before.empty() ? "" : " " + before) + " -> " +
                        json["deployment"].get<std::string>());
        EXPECT_EQ(json["robot"], "arm6");
        EXPECT_EQ(json["config_sha256"].get<std::string>().size(), 64U);
      }
    }
    return found;
  }
  [[nodiscard]] std::string in_use() const { return fs::read_symlink(in("store/robot")).filename(); }
};

TEST_F(Deploy, AGoodRobotIsProvenAndABadOneGoesBack) {
  const Ended good = deploy("good.yaml", live("--name good --json"));
  ASSERT_EQ(good.exit_code, 0) << good.output << shell("cat " + in("run.log")).output;
  EXPECT_EQ(nlohmann::json::parse(good.output)["verdict"], "proven") << good.output;
  EXPECT_TRUE(fs::exists(in("store/robot/proven")));

  const Ended armed = deploy("good.yaml", live("--name again"));
  EXPECT_EQ(armed.exit_code, 1) << "the first one tracks";
  EXPECT_NE(armed.output.find("is armed"), std::string::npos) << armed.output;
  EXPECT_EQ(in_use(), "good");

  takt("stop --runtime-dir " + in("rt"));
  for (int i = 0; i < 200 && takt("reset --runtime-dir " + in("rt")).exit_code != 0; ++i) usleep(50'000);
  // What no smoke run sees: on the robot its policy host stands still for seconds, again and again.
  std::string freezes;
  for (int at = 8; at < 60; at += 8) freezes += " --at \"" + std::to_string(at) + "s: freeze policy 3s\"";
  const Ended bad =
      deploy("good.yaml", "--restart 'sh " + in("restart.sh") + freezes + "' --arm --watch 60s --name bad");
  EXPECT_EQ(bad.exit_code, 1) << bad.output;
  EXPECT_NE(bad.output.find("bad was rolled back"), std::string::npos) << bad.output;
  EXPECT_EQ(in_use(), "good");
}

TEST_F(Deploy, ARobotThatDoesNotComeUpGoesBack) {
  ASSERT_EQ(deploy("good.yaml", "--no-restart --name good").exit_code, 0);
  const Ended bad = deploy("good.yaml", "--restart 'echo no such unit; exit 5' --name bad");
  EXPECT_EQ(bad.exit_code, 1);
  EXPECT_NE(bad.output.find("ended with 5: no such unit"), std::string::npos) << bad.output;
  EXPECT_EQ(in_use(), "good");
}

TEST_F(Deploy, RefusalsChangeNothing) {
  EXPECT_EQ(deploy("absent.yaml", "--no-restart").exit_code, 65);
  EXPECT_EQ(deploy("good.yaml", "--watch soon").exit_code, 64);
  write_robot("impatient.yaml", {{"max_age: 150 ms", "max_age: 22 ms"}});
  const Ended smoke = deploy("impatient.yaml", "--no-restart");
  EXPECT_EQ(smoke.exit_code, 1);
  EXPECT_NE(smoke.output.find("smoke run failed, nothing was changed"), std::string::npos) << smoke.output;
  EXPECT_FALSE(fs::exists(in("store/robot")));
  if (!fs::exists("/run/systemd/system")) {
    EXPECT_EQ(deploy("good.yaml", "").exit_code, 69) << "nobody restarts it";
  }
  EXPECT_FALSE(fs::exists(in("store/robot")));
}

TEST_F(Deploy, RollbackGoesBackByHand) {
  const std::string store = " --no-restart --store " + in("store") + " --runtime-dir " + in("rt");
  EXPECT_NE(takt("rollback" + store).output.find("nothing was deployed to "), std::string::npos);
  for (const char* name : {"one", "two", "three"})
    ASSERT_EQ(deploy("good.yaml", "--no-restart --simulated --name " + std::string(name)).exit_code, 0);
  const Ended back = takt("rollback --json" + store);
  EXPECT_EQ(back.exit_code, 0) << back.output;
  EXPECT_EQ(nlohmann::json::parse(back.output)["to"], "two");
  EXPECT_EQ(in_use(), "two");
  const Ended later = takt("rollback --to three" + store);
  EXPECT_EQ(later.exit_code, 0);
  EXPECT_NE(later.output.find("three is in use from the next start on instead of two"), std::string::npos)
      << later.output;
  EXPECT_EQ(in_use(), "three");
  EXPECT_TRUE(fs::exists(in("store/robot/simulated")));
  EXPECT_EQ(takt("rollback --to nowhere" + store).exit_code, 1);
  EXPECT_EQ(in_use(), "three");
  EXPECT_EQ(interventions(), (std::vector<std::string>{"deploy -> one", "deploy one -> two", "deploy two -> three",
                                                       "rollback three -> two", "rollback two -> three"}));
  fs::remove_all(in("interventions"));
  EXPECT_NE(takt("rollback --to two" + store).output.find("not in a log of interventions: there is no folder"),
            std::string::npos);
  // A restart that says it went well, and no robot runs.
  const Ended silent =
      takt("rollback --restart true --store " + in("store") + " --runtime-dir " + in("rt") + " --to one");
  EXPECT_EQ(silent.exit_code, 1);
  EXPECT_NE(silent.output.find("one is in use again: restarted, but after 20 s no executive answers in " + in("rt") +
                               "; --runtime-dir names another directory"),
            std::string::npos)
      << silent.output;
}

}  // namespace
}  // namespace takt::cli
