// SPDX-License-Identifier: Apache-2.0
// Goal: an engine that is none, is of another version, misbehaves while it is loaded or brings another network ends the
// host with one line and 65, before it attaches; a good one is waited with; and no thread of an engine gets onto the
// executive's processor. Method: the real program with a plugin that does wrong on request, and with ONNX Runtime's and
// TorchScript's.
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "executive/contract/monotonic_clock.hpp"
#include "tests/policy_host/installed_onnx_runtime.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host {
namespace {

using test::text_of;

class Engines : public testing::Test {
 protected:
  // The demo robot with this engine.
  void write_robot(const std::string& engine, const std::string& file = "arm6_reach.onnx") {
    std::string text = text_of("config/arm6.yaml");
    const std::string from = "  file: arm6_reach.onnx";
    text.replace(text.find(from), from.size(), "  file: " + file + "\n  engine: { " + engine + " }");
    std::filesystem::copy("config/arm6_reach.onnx", directory_.path("arm6_reach.onnx"),
                          std::filesystem::copy_options::overwrite_existing);
    std::ofstream(directory_.path("robot.yaml")) << text;
  }
  // For the host at `odd`.
  pid_t start(const std::string& engine, const std::string& odd = "", const std::string& file = "arm6_reach.onnx",
              const char* more = nullptr) {
    write_robot(engine, file);
    const pid_t pid = fork();
    if (pid != 0) return pid;
    if (freopen(said_.c_str(), "w", stderr) == nullptr) _exit(126);
    setenv("TAKT_ODD_ENGINE", odd.c_str(), 1);
    execl(TAKT_POLICY_HOST, "takt-policy-host", "--robot", directory_.path("robot.yaml").c_str(), "--runtime-dir",
          directory_.path().c_str(), more, nullptr);
    _exit(127);
  }
  static int wait_for(pid_t pid) {
    int status = 0;
    waitpid(pid, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  std::string refusal_of(const std::string& engine, const std::string& odd = "",
                         const std::string& file = "arm6_reach.onnx") {
    EXPECT_EQ(wait_for(start(engine, odd, file)), 65) << engine << " " << odd;
    std::string said = text_of(said_);
    EXPECT_EQ(std::ranges::count(said, '\n'), 1) << said;
    return said;
  }
  // Once it waits for the executive, all is loaded.
  bool waits(pid_t pid) {
    const MonoTime give_up = monotonic_now() + seconds(60);
    while (text_of(said_).find("waiting for the executive") == std::string::npos) {
      if (monotonic_now() > give_up || waitpid(pid, nullptr, WNOHANG) != 0) return false;
      sleep_until(monotonic_now() + milliseconds(10));
    }
    return true;
  }
  void ends(pid_t pid) {
    kill(pid, SIGTERM);
    EXPECT_EQ(wait_for(pid), 0) << text_of(said_);
  }

  test::TemporaryDirectory directory_;
  std::string said_ = directory_.path("said");
  const std::string odd_ = "name: " TAKT_ODD_ENGINE_FILE;
};

// Threat: policy-load
TEST_F(Engines, APluginThatDoesWrongIsRefusedInOneLine) {
  struct Case {
    const char *odd, *said;
  };
  for (const auto& [odd, said] :
       {Case{"other version", "speaks version 2 of takt/engine.h, this host 1"}, Case{"no table", "gives none"},
        Case{"no infer", "its table lacks a function"}, Case{"refuses", "no room for this network"},
        Case{"says nothing", "gives no reason"}, Case{"crashes", "crashed while it was loaded (SIGSEGV)"},
        Case{"aborts", "crashed while it was loaded (SIGABRT)"}, Case{"ends", "ended the process while it was loaded"},
        Case{"other shapes", "obs wants 25 values, the configuration's terms give 24"},
        Case{"open dimension", "tensor obs has a dimension of -1"},
        Case{"no memory", "tensor actions has no memory for its values"}})
    EXPECT_NE(refusal_of(odd_, odd).find(said), std::string::npos) << odd << ": " << text_of(said_);
  EXPECT_NE(refusal_of(odd_ + ", load_within: 300 ms", "hangs").find("was not loaded within 0.3 s"), std::string::npos);
  EXPECT_NE(refusal_of("name: " TAKT_THROWING_ENGINE_FILE).find("let an exception out while it was loaded: thrown"),
            std::string::npos)
      << text_of(said_);
}

TEST_F(Engines, WhatIsNoPluginIsRefused) {
  EXPECT_NE(refusal_of("name: /nowhere/engine.so").find("/nowhere/engine.so: cannot be loaded"), std::string::npos);
  EXPECT_NE(refusal_of("name: ./arm6_reach.onnx").find("arm6_reach.onnx: cannot be loaded"), std::string::npos);
  EXPECT_NE(refusal_of("name: tensorflow").find("policy.engine.name: knows no engine tensorflow"), std::string::npos)
      << text_of(said_);
  EXPECT_NE(refusal_of("name: builtin, provider: cuda").find("the built-in engine computes on the CPU only"),
            std::string::npos);
}

TEST_F(Engines, AGoodPluginIsWaitedWith) {
  const pid_t pid = start(odd_);
  ASSERT_TRUE(waits(pid)) << text_of(said_);
  ends(pid);
  EXPECT_NE(text_of(said_).find("engine: odd; 0 threads of its own"), std::string::npos) << text_of(said_);
}

// Goal: under systemd the host of a policy ends, reads and writes nothing of another host's, the fallback policy's,
// though both are one user's. Method: a plugin that tries, in a host as the units start it, and in one without.
// Threat: policy-fence
TEST_F(Engines, AFencedOneReachesNoOtherProcessOfItsUser) {
  const pid_t victim = fork();
  if (victim == 0) {
    pause();
    _exit(0);
  }
  setenv("TAKT_ODD_VICTIM", std::to_string(victim).c_str(), 1);
  const pid_t fenced = start(odd_, "attacks", "arm6_reach.onnx", "--fenced");
  EXPECT_TRUE(waits(fenced)) << text_of(said_);
  ends(fenced);
  EXPECT_NE(text_of(said_).find("signal refused, memory refused, file refused"), std::string::npos) << text_of(said_);
  std::filesystem::remove(said_);
  const pid_t open = start(odd_, "attacks");
  EXPECT_TRUE(waits(open)) << text_of(said_);
  ends(open);
  EXPECT_NE(text_of(said_).find("signal sent, memory open, file made"), std::string::npos) << text_of(said_);
  std::filesystem::remove("takt-odd-file");
  kill(victim, SIGKILL);
  waitpid(victim, nullptr, 0);
}

// Goal: no thread that an engine starts may run on the executive's processor, not even one that widens its own mask.
// Method: threads of the plugin ask for all processors; the kernel's own list of every thread is read from outside.
// Threat: policy-processor
TEST_F(Engines, NoThreadGetsOntoTheExecutivesProcessor) {
  constexpr int kControlCpu = 1;  // of the demo robot
  cpu_set_t mine;
  if (sched_getaffinity(0, sizeof mine, &mine) != 0 || CPU_COUNT(&mine) < 2 || !CPU_ISSET(kControlCpu, &mine))
    GTEST_SKIP() << "NOT TESTED: needs processor 1 and another";
  const pid_t pid = start(odd_, "spreads");
  ASSERT_TRUE(waits(pid)) << text_of(said_);
  const MonoTime give_up = monotonic_now() + seconds(20);
  while (text_of(said_).find("sched_setaffinity") == std::string::npos && monotonic_now() < give_up)
    sleep_until(monotonic_now() + milliseconds(10));
  EXPECT_EQ(text_of(said_).find("sched_setaffinity done"), std::string::npos) << text_of(said_);
  int threads = 0;
  for (const auto& task : std::filesystem::directory_iterator("/proc/" + std::to_string(pid) + "/task")) {
    cpu_set_t mask;
    const pid_t thread = std::stoi(task.path().filename());
    ASSERT_EQ(sched_getaffinity(thread, sizeof mask, &mask), 0);
    EXPECT_FALSE(CPU_ISSET(kControlCpu, &mask)) << text_of(task.path() / "comm");
    ++threads;
  }
  EXPECT_GE(threads, 3);
  ends(pid);
  EXPECT_NE(text_of(said_).find("kept off processor 1 by the kernel"), std::string::npos) << text_of(said_);
}

// Goal: what reads a policy only to judge it keeps its engine off the control loop as well, be it a robot's that moves
// meanwhile. Method: a plugin that asks for all processors while it is loaded, by each command that loads one.
TEST_F(Engines, NoCommandLetsAnEngineOntoTheExecutivesProcessor) {
  if (std::thread::hardware_concurrency() < 2) GTEST_SKIP() << "NOT TESTED: needs two processors";
  write_robot(odd_);
  const std::string robot = directory_.path("robot.yaml");
  const std::string file = directory_.path("arm6_reach.onnx");
  for (const std::string& command :
       {"config check " + robot, "policy check " + directory_.path("p.plan") + " --robot " + robot,
        "deploy " + robot + " --no-restart --store " + directory_.path("store") + " --runs " + directory_.path("runs") +
            " --runtime-dir " + directory_.path("rt"),
        "run " + robot + " --duration 100ms --runtime-dir " + directory_.path("rt") + " --run-dir " +
            directory_.path("run")}) {
    std::filesystem::copy(file, directory_.path("p.plan"), std::filesystem::copy_options::overwrite_existing);
    ASSERT_NE(
        std::system(("TAKT_ODD_ENGINE=asks timeout 60 " TAKT_PROGRAM " " + command + " >" + said_ + " 2>&1").c_str()),
        -1);
    EXPECT_NE(text_of(said_).find("sched_setaffinity refused"), std::string::npos) << command << "\n" << text_of(said_);
    EXPECT_EQ(text_of(said_).find("sched_setaffinity done"), std::string::npos) << command;
  }
}

// Goal: policy.engine.threads is a limit. Method: a plugin that starts more than it was told and than a driver would.
TEST_F(Engines, AnEngineThatStartsMoreThreadsThanItWasToldIsRefused) {
  EXPECT_NE(refusal_of(odd_, "crowds").find("started 12 threads, where policy.engine.threads allows 1, and 8 besides"),
            std::string::npos)
      << text_of(said_);
  for (const auto& [engine, odd] : {std::pair(odd_, "has a driver"), std::pair(odd_ + ", threads: 4", "crowds")}) {
    std::filesystem::remove(said_);
    const pid_t pid = start(engine, odd);
    EXPECT_TRUE(waits(pid)) << text_of(said_);
    ends(pid);
  }
}

// Goal: a host that could only run beside the control loop does not run. Method: it is started there and nowhere else.
TEST_F(Engines, AHostThatMayOnlyRunThereIsRefused) {
  cpu_set_t before, only;
  ASSERT_EQ(sched_getaffinity(0, sizeof before, &before), 0);
  CPU_ZERO(&only);
  CPU_SET(1, &only);
  if (sched_setaffinity(0, sizeof only, &only) != 0) GTEST_SKIP() << "NOT TESTED: needs processor 1";
  const std::string said = refusal_of("name: builtin");
  sched_setaffinity(0, sizeof before, &before);
  EXPECT_NE(said.find("processor 1 is the executive's (control.cpu), and the only one"), std::string::npos) << said;
}

TEST_F(Engines, OnnxRuntimeSaysWhatIsMissing) {
  EXPECT_NE(refusal_of("name: onnxruntime, library: /nowhere/libonnxruntime.so")
                .find("/nowhere/libonnxruntime.so: cannot be loaded"),
            std::string::npos);
  EXPECT_NE(refusal_of("name: onnxruntime, library: libc.so.6").find("libc.so.6: is not ONNX Runtime"),
            std::string::npos);
}

TEST_F(Engines, OnnxRuntimeWaitsForTheExecutive) {
  const auto installed = installed_onnx_runtime();
  if (!installed) GTEST_SKIP() << "NOT TESTED: ONNX Runtime is not installed (./dev test installs it)";
  const std::string library = "name: onnxruntime, library: " + std::filesystem::absolute(*installed).string();
  const pid_t pid = start(library + ", threads: 2");
  ASSERT_TRUE(waits(pid)) << text_of(said_);
  ends(pid);
  EXPECT_NE(text_of(said_).find("24 values in, 16 steps of 6 out"), std::string::npos) << text_of(said_);
  EXPECT_NE(text_of(said_).find(", cpu, 2 threads; "), std::string::npos) << text_of(said_);
  for (const char* const provider : {"cuda", "tensorrt"}) {
    const std::string said = refusal_of(library + ", provider: " + provider);
    EXPECT_NE(said.find(std::string(": has no provider ") + provider + " here ("), std::string::npos) << said;
  }
  std::ofstream(directory_.path("text.onnx")) << "no network";
  EXPECT_NE(refusal_of(library, "", "text.onnx").find("text.onnx: not an ONNX model"), std::string::npos);
}

TEST_F(Engines, TorchScriptSaysWhatIsWrong) {
  if (!std::filesystem::exists(TAKT_ENGINES_FOLDER "/takt-engine-torchscript.so"))
    GTEST_SKIP() << "NOT TESTED: libtorch-dev was not there when this was built";
  std::ofstream(directory_.path("text.pt")) << "no module";
  EXPECT_NE(refusal_of("name: auto", "", "text.pt").find("text.pt: is no TorchScript file ("), std::string::npos)
      << text_of(said_);
  EXPECT_NE(refusal_of("name: torchscript, provider: cuda").find("computes on the CPU only, not by cuda"),
            std::string::npos)
      << text_of(said_);
}

}  // namespace
}  // namespace takt::policy_host
