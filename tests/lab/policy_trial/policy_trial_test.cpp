// SPDX-License-Identifier: Apache-2.0
// Goal: every operator in its edge cases, and every published policy, gives what ONNX Runtime gives, over 16
// observations in sequence. Method: models of one operator made by operator_models.py, and the policies of
// ../shared/policies, run by both engines where ONNX Runtime is installed (tests/node's npm packages); by the built-in
// one against ONNX Runtime's committed numbers everywhere. Where both are there, the committed numbers are judged too.
#include "lab/policy_trial/policy_trial.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "lab/policy_trial/agreement.hpp"
#include "lab/policy_trial/judging_network.hpp"
#include "policy_host/onnx_policy.hpp"
#include "tests/policy_host/installed_onnx_runtime.hpp"
#include "tests/support/shared_files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host {
namespace {

namespace fs = std::filesystem;

constexpr double kTolerance = 1e-5;
const fs::path kVectors = "tests/policy_host/onnx_runtime_vectors.json";
const fs::path kShared = "../shared/policies";

std::optional<onnx_runtime::OnnxRuntime> peer() {
  const auto library = installed_onnx_runtime();
  if (!library) return std::nullopt;
  auto opened = onnx_runtime::OnnxRuntime::open(*library);
  EXPECT_TRUE(opened) << opened.error();
  return opened ? std::optional(*std::move(opened)) : std::nullopt;
}

class TrialTest : public testing::Test {
 protected:
  void SetUp() override {
    std::ifstream file(kVectors);
    if (file) vectors_ = nlohmann::json::parse(file);
  }

  // Whether the script ran; 77 or no Python: it could not.
  bool make(const std::string& command) {
    const int status = std::system(("/usr/bin/python3 tests/policy_host/" + command + " >/dev/null 2>&1").c_str());
    if (WEXITSTATUS(status) == 77 || WEXITSTATUS(status) == 127) return false;
    EXPECT_EQ(status, 0) << command;
    return true;
  }

  void judge(const fs::path& file, const std::optional<onnx_runtime::OnnxRuntime>& runtime) {
    SCOPED_TRACE(file.filename().string());
    const auto built_in = policy_trial::load_whole_policy(file.string(), load_onnx_network);
    ASSERT_TRUE(built_in) << built_in.error();
    const std::string name = file.stem().string();
    ++judged_;
    const std::vector<float> own = policy_trial::last_outputs(*built_in->policy);
    ASSERT_TRUE(vectors_.contains(name)) << "no numbers of ONNX Runtime in " << kVectors;
    const auto committed = vectors_[name].get<std::vector<float>>();
    ASSERT_EQ(committed.size(), own.size());
    for (std::size_t i = 0; i < own.size(); ++i) {
      EXPECT_NEAR(own[i], committed[i], kTolerance * std::max(1.0F, std::abs(committed[i]))) << "at " << i;
    }
    if (!runtime) return;
    const auto known = load_onnx_network(file);
    const auto judge = policy_trial::load_whole_policy(file.string(), [&](const fs::path& path) {
      return policy_trial::load_judging_network(*runtime, path, known->get());
    });
    ASSERT_TRUE(judge) << judge.error();
    const policy_trial::Agreement agreement = policy_trial::compare(*built_in->policy, *judge->policy, 0);
    EXPECT_LE(agreement.error, kTolerance);
    worst_ = std::max(worst_, agreement.error);
  }

  void report(const std::optional<onnx_runtime::OnnxRuntime>& runtime) const {
    std::printf(
        "%d models; %s\n", judged_,
        runtime
            ? ("ONNX Runtime " + runtime->version() + ", largest difference " + std::to_string(worst_ * 1e6) + "e-6")
                  .c_str()
            : "NOT TESTED against a running ONNX Runtime (./dev test installs it), only its committed numbers");
  }

  const test::TemporaryDirectory folder_;
  nlohmann::json vectors_;
  int judged_ = 0;
  double worst_ = 0;
};

TEST_F(TrialTest, EveryOperatorAgreesWithOnnxRuntime) {
  if (!make("onnx/operator_models.py " + folder_.path())) {
    GTEST_SKIP() << "NOT TESTED: /usr/bin/python3 with onnx is not installed";
  }
  const auto runtime = peer();
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_.path())) {
    if (entry.path().extension() == ".onnx") judge(entry.path(), runtime);
  }
  EXPECT_GE(judged_, 120);
  report(runtime);
}

TEST_F(TrialTest, PublishedPoliciesAgreeWithOnnxRuntime) {
  TAKT_NEEDS_SHARED(kShared);
  const auto runtime = peer();
  for (const char* name :
       {"g1_velocity/policy.onnx", "mujoco_playground/go1_policy.onnx", "mujoco_playground/apollo_policy.onnx"}) {
    // The vectors go by one name a policy.
    const fs::path copy = folder_.path(std::string(name).substr(0, std::string(name).find('/')) + "-" +
                                       fs::path(name).filename().string());
    fs::copy_file(kShared / name, copy);
    judge(copy, runtime);
  }
  if (make("onnx/published_policies.py " + kShared.string() + " " + folder_.path())) {
    for (const char* name : {"b2.onnx", "himloco.onnx", "g1_lstm.onnx"}) judge(folder_.path(name), runtime);
    const auto lost = policy_trial::load_whole_policy(folder_.path("g1_lstm_without_state.onnx"), load_onnx_network);
    ASSERT_FALSE(lost) << "a recurrent policy without its state was accepted";
    EXPECT_NE(lost.error().find("LSTM node"), std::string::npos) << lost.error();
    EXPECT_NE(lost.error().find("memory is lost"), std::string::npos) << lost.error();
  } else {
    std::puts("NOT TESTED: the TorchScript policies, /usr/bin/python3 has no PyTorch");
  }
  report(runtime);
}

// A NaN that is followed by good values is not forgotten.
TEST(Agreement, NaNAgainstANumberIsApartForGood) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  EXPECT_EQ(policy_trial::distance_of(1.0F, 1.0F), 0.0);
  EXPECT_NEAR(policy_trial::distance_of(1.5F, 1.0F), 0.5, 1e-12);
  const std::vector<std::pair<float, float>> pairs{{nan, 1.0F},      {1.0F, nan},      {nan, infinity},
                                                   {infinity, 1.0F}, {1.0F, infinity}, {infinity, -infinity}};
  for (const auto& [own, judge] : pairs) {
    const double apart = policy_trial::distance_of(own, judge);
    EXPECT_TRUE(std::isinf(apart)) << own << " against " << judge;
    EXPECT_TRUE(std::isinf(std::max(apart, policy_trial::distance_of(1.0F, 1.0F)))) << "and stays so";
  }
  EXPECT_EQ(policy_trial::distance_of(nan, nan), 0.0) << "counted apart (Agreement::both_nan)";
  EXPECT_EQ(policy_trial::distance_of(infinity, infinity), 0.0);
}

}  // namespace
}  // namespace takt::policy_host
