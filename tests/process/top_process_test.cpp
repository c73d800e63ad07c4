// SPDX-License-Identifier: Apache-2.0
// Goal: `takt top` in a real terminal shows a real robot, its keys really arm, stop and mark, it lives through an
// executive that comes and goes, and gives the terminal back however it ends. Method: the robot's real processes and a
// tmux window whose screen is read; `lttng` is a stand-in, so that no trace of another test is disturbed.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>

#include "config/hash.hpp"
#include "config/load.hpp"
#include "tests/process/running_robot.hpp"
#include "tests/process/tmux.hpp"

namespace takt::test {
namespace {

namespace fs = std::filesystem;

const std::string kTakt = std::string(TAKT_BIN_DIR) + "/takt";

class TopTest : public testing::Test {
 protected:
  TopTest() {
    fs::create_directories(tools());
    // Answers like lttng with a flight recorder while the file `trace` is there, else like one without a trace.
    std::ofstream(tools() + "/lttng") << "#!/bin/sh\n[ -e " << robot_.directory() << "/trace ] || exit 1\n"
                                      << "echo '<path>/traces/one</path>'\n";
    fs::permissions(tools() + "/lttng", fs::perms::owner_all);
  }
  void SetUp() override {
    if (!has_tmux()) GTEST_SKIP() << "tmux is not installed (apt-get install tmux): NO TERMINAL WAS TESTED";
    tmux_.emplace(robot_.directory(), tools());
  }
  [[nodiscard]] std::string tools() const { return robot_.directory() + "/tools"; }
  [[nodiscard]] std::string place() const {
    return " --robot " + robot_.robot_file() + " --runtime-dir " + robot_.directory();
  }
  void start_top(const std::string& more = {}) const { tmux_->type(kTakt + " top" + place() + more); }
  // The process in the window's foreground, child of its shell.
  [[nodiscard]] pid_t top() const {
    const std::string shell = tmux_->ask("#{pane_pid}");
    std::ifstream children("/proc/" + shell + "/task/" + shell + "/children");
    pid_t pid = 0;
    children >> pid;
    return pid;
  }
  void expect_terminal_as_before() const {
    EXPECT_TRUE(tmux_->shows("before-top")) << tmux_->screen();
    EXPECT_EQ(tmux_->ask("#{alternate_on} #{cursor_flag}"), "0 1");
    tmux_->type("echo switched-off-$(stty -a | grep -o -e -echo$ -e -icanon -e -ixon | wc -l)-of-$((1+2))");
    EXPECT_TRUE(tmux_->shows("-of-3")) << tmux_->screen();
    EXPECT_NE(tmux_->screen().find("switched-off-0-of-3"), std::string::npos) << tmux_->screen();
  }
  // Presses the two keys until the robot is armed; what is missing may take a moment to come.
  void arm() const {
    for (int attempt = 0; attempt < 20; ++attempt) {
      tmux_->press("a");
      ASSERT_TRUE(tmux_->shows("ARM: enable the drives")) << tmux_->screen();
      tmux_->press("y");
      ASSERT_TRUE(tmux_->hides("ARM: enable the drives"));
      if (tmux_->screen().find("refused") == std::string::npos) break;
    }
    ASSERT_TRUE(robot_.wait_for_mode(Mode::tracking)) << tmux_->screen() << robot_.logs();
  }

  RunningRobot robot_;
  std::optional<Tmux> tmux_;
};

TEST_F(TopTest, ItsKeysArmMarkAndStop) {
  start_top();
  ASSERT_TRUE(tmux_->shows("arm6  STANDBY")) << tmux_->screen() << robot_.logs();
  tmux_->press("a");
  ASSERT_TRUE(tmux_->shows("ARM: enable the drives"));
  tmux_->press("n");
  ASSERT_TRUE(tmux_->hides("ARM: enable the drives"));
  tmux_->press("y");
  EXPECT_EQ(robot_.status()->status.tick.mode, Mode::standby) << "not confirmed";

  const Child policy = robot_.start_policy_host();
  ASSERT_TRUE(robot_.wait_until([](const StatusSnapshot& status) { return status.policy_pids[Seat::policy] != 0; }));
  arm();
  EXPECT_TRUE(tmux_->shows("arm6  TRACKING")) << tmux_->screen();
  const auto robot = config::load("config/arm6.yaml").value();
  char hash[17];
  std::snprintf(hash, sizeof hash, "%016llx",
                static_cast<unsigned long long>(config::policy_hash(robot.policy->file).value()));
  EXPECT_TRUE(tmux_->shows(hash)) << tmux_->screen();
  EXPECT_NE(tmux_->screen().find("base_yaw"), std::string::npos);

  tmux_->press("m");
  ASSERT_TRUE(tmux_->shows("marked tick ")) << tmux_->screen();
  std::smatch found;
  const std::string screen = tmux_->screen();
  ASSERT_TRUE(std::regex_search(screen, found, std::regex("marked tick ([0-9]+)")));
  tmux_->press("s");
  EXPECT_TRUE(robot_.wait_for_mode(Mode::damped_stop));
  EXPECT_TRUE(tmux_->shows("DAMPED_STOP")) << tmux_->screen();

  ASSERT_TRUE(robot_.finish()) << robot_.logs();
  EXPECT_TRUE(tmux_->shows("WAITING for the executive")) << tmux_->screen();
  std::ifstream metrics(robot_.run_directory() + "/metrics.json");
  const auto marks = nlohmann::json::parse(metrics).at("marks");
  ASSERT_EQ(marks.size(), 1U);
  EXPECT_EQ(std::to_string(marks[0].at("tick").get<std::uint64_t>()), found[1]) << "the run knows the mark";
}

TEST_F(TopTest, ASnapshotIsTakenOrItSaysWhyNot) {
  start_top();
  ASSERT_TRUE(tmux_->shows("STANDBY")) << tmux_->screen();
  tmux_->press("p");
  EXPECT_TRUE(tmux_->shows("no trace runs: takt trace start")) << tmux_->screen();
  std::ofstream(robot_.directory() + "/trace") << "on";
  tmux_->press("p");
  EXPECT_TRUE(tmux_->shows("snapshot in /traces/one")) << tmux_->screen();
}

TEST_F(TopTest, AnExecutiveThatGoesAndComesIsFoundAgain) {
  start_top();
  ASSERT_TRUE(tmux_->shows("STANDBY")) << tmux_->screen();
  robot_.executive().signal(SIGKILL);
  ASSERT_TRUE(tmux_->shows("WAITING for the executive")) << tmux_->screen();
  const Child again(
      {"takt-executive", "--robot", robot_.robot_file(), "--runtime-dir", robot_.directory(), "--allow-non-realtime"},
      robot_.directory() + "/again.log");
  EXPECT_TRUE(tmux_->shows("STANDBY")) << tmux_->screen() << robot_.logs();
  EXPECT_TRUE(tmux_->hides("WAITING"));
}

TEST_F(TopTest, TheTerminalIsGivenBack) {
  tmux_->type("echo before-top");
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) {
    start_top();
    ASSERT_TRUE(tmux_->shows("STANDBY")) << tmux_->screen();
    EXPECT_EQ(tmux_->ask("#{alternate_on}"), "1");
    kill(top(), signal);
    expect_terminal_as_before();
  }
  start_top();
  ASSERT_TRUE(tmux_->shows("STANDBY")) << tmux_->screen();
  tmux_->press("q");
  expect_terminal_as_before();
}

TEST_F(TopTest, CtrlZSuspendsAndFgBringsItBack) {
  tmux_->type("echo before-top");
  start_top();
  ASSERT_TRUE(tmux_->shows("STANDBY")) << tmux_->screen();
  tmux_->press("C-z");
  expect_terminal_as_before();
  tmux_->type("fg");
  EXPECT_TRUE(tmux_->shows("STANDBY")) << tmux_->screen();
  tmux_->press("q");
  EXPECT_TRUE(tmux_->hides("STANDBY"));
}

TEST_F(TopTest, ItFollowsTheWindowsSize) {
  start_top(" --ascii");
  ASSERT_TRUE(tmux_->shows("STANDBY")) << tmux_->screen();
  tmux_->resize(40, 10);
  EXPECT_TRUE(tmux_->shows("too small: 72x16 needed")) << tmux_->screen();
  tmux_->resize(100, 16);
  EXPECT_TRUE(tmux_->shows("1-5 of 6 (j k)")) << tmux_->screen();
  tmux_->press("Down");
  EXPECT_TRUE(tmux_->shows("2-6 of 6 (j k)")) << tmux_->screen();
  for (const char c : tmux_->screen()) EXPECT_LT(static_cast<unsigned char>(c), 0x80U);
}

TEST_F(TopTest, OnceIsForScripts) {
  ASSERT_TRUE(robot_.wait_until([](const StatusSnapshot& status) { return status.ticks > 100; }));
  const std::string frame = output_of(kTakt + " top --once --ascii" + place());
  EXPECT_EQ(std::count(frame.begin(), frame.end(), '\n'), 24) << frame;
  EXPECT_NE(frame.find("arm6  STANDBY"), std::string::npos) << frame;
  EXPECT_EQ(frame.find('\x1b'), std::string::npos) << "no colours where no terminal is";
  const auto json = nlohmann::json::parse(output_of(kTakt + " top --once --json" + place()));
  EXPECT_EQ(json.at("mode"), "standby");
  EXPECT_EQ(json.at("joints").size(), 6U);
  EXPECT_GT(json.at("buses").at(0).at("load"), 0.01) << "drives are polled in standby";

  const auto code = [](const std::string& arguments) {
    return WEXITSTATUS(std::system((kTakt + " top " + arguments + " >/dev/null 2>&1 </dev/null").c_str()));
  };
  EXPECT_EQ(code(place()), 64) << "no terminal";
  EXPECT_EQ(code("--json" + place()), 64) << "--json needs --once";
  EXPECT_EQ(code("--once --robot /nowhere.yaml"), 65);
  EXPECT_EQ(code("--once --robot config/arm6.yaml --runtime-dir /tmp/nobody-runs-here"), 69);
}

}  // namespace
}  // namespace takt::test
