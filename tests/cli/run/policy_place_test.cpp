// SPDX-License-Identifier: Apache-2.0
// Goal: a program that is a policy, whatever it is written in, cannot get at the control loop: it is started off the
// executive's processor, cannot go back there, and its libraries start as many threads as the robot file says. Method:
// programs that say where they may run and ask for another place, started as `takt run` and `takt policy shadow` do.
#include <gtest/gtest.h>
#include <sched.h>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "cli/run/child_process.hpp"
#include "cli/run/robot_processes.hpp"
#include "config/load.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;

using test::text_of;

std::vector<int> allowed_here() {
  cpu_set_t mask;
  std::vector<int> cpus;
  if (sched_getaffinity(0, sizeof mask, &mask) != 0) return cpus;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu)
    if (CPU_ISSET(static_cast<unsigned>(cpu), &mask)) cpus.push_back(cpu);
  return cpus;
}

// Asks for processor `cpu`, and says how that went, and what its pools are told.
constexpr const char* kAsks = R"(#!/usr/bin/python3
import os, sys
cpu = int(os.environ["TAKT_TEST_CPU"])
print("allowed", cpu in os.sched_getaffinity(0))
try:
    os.sched_setaffinity(0, {cpu})
    print("moved")
except OSError as error:
    print("refused", error.errno)
print("pool", os.environ.get("OMP_NUM_THREADS"), os.environ.get("OPENBLAS_NUM_THREADS"))
sys.exit(3)
)";

class PolicyPlaceTest : public testing::Test {
 protected:
  PolicyPlaceTest() {
    std::ofstream(in("policy.py")) << kAsks;
    fs::permissions(in("policy.py"), fs::perms::owner_all);
    for (const char* const name : {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"}) unsetenv(name);
  }
  [[nodiscard]] std::string in(const std::string& name) const { return directory_.path(name); }

  static int code_of(ChildProcess& child) {
    for (int poll = 0; poll < 1500 && child.alive(); ++poll) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    return child.exit_code().value_or(-1);
  }
  // Exit code of a policy that is to be kept off `cpu`.
  int started(int cpu, unsigned threads) {
    setenv("TAKT_TEST_CPU", std::to_string(cpu).c_str(), 1);
    auto child = ChildProcess::start({.name = "policy",
                                      .arguments = {in("policy.py")},
                                      .log_path = in("log"),
                                      .parent_death_signal = 9,
                                      .place = PolicyPlace{cpu, threads}});
    return child ? code_of(*child) : -1;
  }

  const test::TemporaryDirectory directory_;
};

TEST_F(PolicyPlaceTest, IsOffTheExecutivesProcessorAndStaysOff) {
  const auto cpus = allowed_here();
  if (cpus.size() < 2) GTEST_SKIP() << "NOT TESTED: needs two processors";
  EXPECT_EQ(started(cpus.back(), 2), 3) << text_of(in("log"));
  EXPECT_EQ(text_of(in("log")), "allowed False\nrefused 1\npool 2 2\n");
}

TEST_F(PolicyPlaceTest, WhatTheUserSetsOfItsPoolsStays) {
  const auto cpus = allowed_here();
  setenv("OMP_NUM_THREADS", "7", 1);
  EXPECT_EQ(started(cpus.back(), 1), 3) << text_of(in("log"));
  EXPECT_NE(text_of(in("log")).find("pool 7 1"), std::string::npos) << text_of(in("log"));
  unsetenv("OMP_NUM_THREADS");
}

// As takt-policy-host: better no policy than one beside the control loop.
TEST_F(PolicyPlaceTest, IsNotStartedWhereItCouldOnlyRunThere) {
  const auto cpus = allowed_here();
  if (cpus.size() < 2) GTEST_SKIP() << "NOT TESTED: needs two processors";
  cpu_set_t before, only;
  ASSERT_EQ(sched_getaffinity(0, sizeof before, &before), 0);
  CPU_ZERO(&only);
  CPU_SET(static_cast<unsigned>(cpus.back()), &only);
  ASSERT_EQ(sched_setaffinity(0, sizeof only, &only), 0);
  const int code = started(cpus.back(), 1);
  sched_setaffinity(0, sizeof before, &before);
  EXPECT_EQ(code, 65);
  EXPECT_NE(text_of(in("log")).find("is the executive's (control.cpu), and the only one that this process may use"),
            std::string::npos)
      << text_of(in("log"));
}

// Threat: policy-log
TEST_F(PolicyPlaceTest, ItsLogHasABudgetAndSaysWhatWasDropped) {
  constexpr std::uintmax_t kSaid_bytes = 20'000'000;
  std::ofstream(in("policy.py")) << "#!/bin/sh\nhead -c " << kSaid_bytes << " /dev/zero | tr '\\0' x\nexit 3\n";
  EXPECT_EQ(started(allowed_here().back(), 1), 3);
  const std::string log = text_of(in("log"));
  const std::string last = log.substr(log.rfind('\n', log.size() - 2) + 1);
  std::uintmax_t dropped_bytes = 0;
  ASSERT_EQ(std::sscanf(last.c_str(), "policy: at least %ju bytes beyond 8 MiB of log were dropped", &dropped_bytes), 1)
      << last;
  EXPECT_GT(dropped_bytes, 0U);
  EXPECT_LE(dropped_bytes, kSaid_bytes - ChildProcess::kLogBudget_bytes);
  EXPECT_EQ(log.size(), ChildProcess::kLogBudget_bytes + 1 + last.size());
}

TEST_F(PolicyPlaceTest, IsGivenToEveryPolicyThatTaktRunStarts) {
  const auto cpus = allowed_here();
  if (cpus.size() < 2) GTEST_SKIP() << "NOT TESTED: needs two processors";
  auto robot = config::load("config/arm6.yaml");
  ASSERT_TRUE(robot);
  robot->control.cpu = cpus.back();
  robot->policy->engine = config::Engine{};
  robot->policy->engine->threads = 3;
  setenv("TAKT_TEST_CPU", std::to_string(cpus.back()).c_str(), 1);
  const RobotPlace place{.robot_file = "config/arm6.yaml",
                         .runtime_directory = in("rt"),
                         .run_directory = in("run"),
                         .policy_host = in("policy.py")};
  for (const ProcessName process : {ProcessName::policy, ProcessName::fallback}) {
    RobotProcesses processes(*robot, place);
    ASSERT_TRUE(processes.start(process));
    EXPECT_EQ(code_of(*processes.find(process)), 3);
    EXPECT_EQ(text_of(in("rt/logs/" + label(process) + ".log")), "allowed False\nrefused 1\npool 3 3\n");
  }
}

}  // namespace
}  // namespace takt::cli
