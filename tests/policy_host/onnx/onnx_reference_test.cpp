// SPDX-License-Identifier: Apache-2.0
// Goal: whole networks, as exporters really write them, give what their makers' engines give.
// Method: PyTorch exports random networks and computes their outputs; a published walking policy comes with ONNX
// Runtime's.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vector>

#include "policy_host/onnx_engine/model.hpp"
#include "tests/support/shared_files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::onnx_engine {
namespace {

constexpr float tolerance = 1e-5F;

std::vector<float> numbers(std::istream& in) {
  std::string line;
  std::getline(in, line);
  std::istringstream fields(line);
  return {std::istream_iterator<float>(fields), {}};
}

// Writes `values` over all inputs in order, runs, and returns the largest distance of output 0 from `expected`.
float distance(Model& model, const std::vector<float>& values, const std::vector<float>& expected) {
  auto next = values.begin();
  for (std::size_t i = 0; i < model.inputs().size(); ++i) {
    const std::span<float> input = model.input(i);
    if (std::distance(next, values.end()) < std::ssize(input)) return INFINITY;
    std::copy_n(next, input.size(), input.begin());
    next += std::ssize(input);
  }
  model.run();
  const std::span<const float> output = model.output(0);
  if (output.size() != expected.size() || next != values.end()) return INFINITY;
  float largest = 0.0F;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    if (!std::isfinite(output[i]) || !std::isfinite(expected[i])) return INFINITY;
    largest = std::max(largest, std::abs(output[i] - expected[i]));
  }
  return largest;
}

TEST(OnnxReference, NetworksExportedByPyTorchAgree) {
  namespace fs = std::filesystem;
  const test::TemporaryDirectory folder;
  const std::string command =
      "/usr/bin/python3 tests/policy_host/onnx/onnx_reference_nets.py " + folder.path() + " >/dev/null";
  const int status = std::system(command.c_str());
  if (WEXITSTATUS(status) == 77 || WEXITSTATUS(status) == 127)
    GTEST_SKIP() << "NOT TESTED: /usr/bin/python3 with PyTorch and onnx is not installed";
  ASSERT_EQ(status, 0) << command;
  int networks = 0;
  float worst = 0.0F;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder.path())) {
    if (entry.path().extension() != ".onnx") continue;
    ++networks;
    auto model = load(entry.path());
    ASSERT_TRUE(model) << model.error();
    std::ifstream cases(fs::path(entry.path()).replace_extension(".txt"));
    const auto count = numbers(cases);
    ASSERT_EQ(count.size(), 1U);
    for (int i = 0; i < static_cast<int>(count[0]); ++i) {
      const std::vector<float> input = numbers(cases);
      const float apart = distance(*model, input, numbers(cases));
      EXPECT_LE(apart, tolerance) << entry.path().filename() << ", case " << i;
      worst = std::max(worst, apart);
    }
  }
  EXPECT_EQ(networks, 36);
  std::printf("%d networks, largest difference from PyTorch %.3g\n", networks, static_cast<double>(worst));
}

TEST(OnnxReference, PublishedWalkingPolicyAgreesWithOnnxRuntime) {
  const std::filesystem::path folder = "../shared/policies/g1_velocity";
  TAKT_NEEDS_SHARED(folder / "policy.onnx", folder / "reference.json");
  auto model = load(folder / "policy.onnx");
  ASSERT_TRUE(model) << model.error();
  const auto reference = nlohmann::json::parse(std::ifstream(folder / "reference.json"));
  ASSERT_EQ(reference["cases"].size(), 16U);
  float worst = 0.0F;
  for (const auto& one : reference["cases"]) {
    const float apart =
        distance(*model, one["obs"].get<std::vector<float>>(), one["actions"].get<std::vector<float>>());
    EXPECT_LE(apart, tolerance);
    worst = std::max(worst, apart);
  }
  std::printf("largest difference from ONNX Runtime %.3g\n", static_cast<double>(worst));
}

}  // namespace
}  // namespace takt::onnx_engine
