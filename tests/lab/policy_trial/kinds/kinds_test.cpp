// SPDX-License-Identifier: Apache-2.0
// Goal: policies in the forms in which they are published load by the engine that the table says (make_kinds.py), and
// say what ONNX Runtime says over 16 observations in sequence; the one whose memory is lost is refused. Method: the
// small ones, with random weights, as `takt policy try` tries a folder of them.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include "lab/policy_trial/agreement.hpp"
#include "lab/policy_trial/policy_trial.hpp"
#include "tests/policy_host/installed_onnx_runtime.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host {
namespace {

namespace fs = std::filesystem;

constexpr double kTolerance = 1e-5;
// libtorch keeps what it allocates, and is not built for a sanitizer's eyes.
#if defined(__SANITIZE_ADDRESS__)
constexpr bool kWithTorch = false;
#else
constexpr bool kWithTorch = true;
#endif

class KindsTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!library_) GTEST_SKIP() << "NOT TESTED: ONNX Runtime is not installed (./dev test installs it)";
    // NOLINTNEXTLINE(concurrency-mt-unsafe): one thread
    const int status = std::system(
        ("/usr/bin/python3 tests/lab/policy_trial/kinds/make_kinds.py " + folder_.path() + " small").c_str());
    if (WEXITSTATUS(status) == 77 || WEXITSTATUS(status) == 127)
      GTEST_SKIP() << "NOT TESTED: /usr/bin/python3 with PyTorch and onnx is not installed";
    ASSERT_EQ(status, 0);
  }

  void expect_agreement(policy_trial::Trial& trial) {
    if (!trial.judge) {
      EXPECT_TRUE(trial.unjudged.starts_with("no ") && trial.unjudged.ends_with(" beside it to judge by"))
          << trial.unjudged;
      return;
    }
    ++judged_;
    const policy_trial::Agreement agreement = policy_trial::compare(*trial.own, *trial.judge, 0);
    EXPECT_LE(agreement.error, kTolerance);
    worst_ = std::max(worst_, agreement.error);
  }

  const test::TemporaryDirectory folder_;
  std::optional<fs::path> library_ = installed_onnx_runtime();
  int judged_ = 0;
  double worst_ = 0;
};

TEST_F(KindsTest, EachRunsByTheEngineThatTheTableSaysAsInOnnxRuntime) {
  const auto judge = onnx_runtime::OnnxRuntime::open(*library_);
  ASSERT_TRUE(judge) << judge.error();
  const policy_trial::TrialSetup setup{fs::absolute(*library_), &*judge};
  const bool torch = kWithTorch && fs::exists(TAKT_ENGINES_FOLDER "/takt-engine-torchscript.so");
  std::ifstream table(folder_.path("kinds.txt"));
  int kinds = 0;
  for (std::string name, engine; table >> name >> engine;) {
    SCOPED_TRACE(name);
    if (engine == "torchscript" && !torch) continue;
    ++kinds;
    policy_trial::Trial trial = policy_trial::try_policy(folder_.path(name), setup);
    if (engine == "refused") {
      EXPECT_TRUE(trial.refusal.contains("its memory is lost between observations")) << trial.refusal;
      continue;
    }
    EXPECT_EQ(trial.refusal, "");
    EXPECT_EQ(trial.engine, engine) << trial.why;
    if (trial.own) expect_agreement(trial);
  }
  EXPECT_GE(kinds, 30);
  EXPECT_GE(judged_, 28);
  std::printf("%d kinds, %d of them judged by ONNX Runtime %s, largest difference %.1e%s\n", kinds, judged_,
              judge->version().c_str(), worst_,
              torch ? "" : "; NOT TESTED: TorchScript, without libtorch-dev or with a sanitizer");
}

}  // namespace
}  // namespace takt::policy_host
