// SPDX-License-Identifier: Apache-2.0
// takt-engine-answers ROBOT OBSERVATIONS RESETS ANSWERS: the policy of a robot file, by its engine, without a robot.
// OBSERVATIONS: float32, one after the other; ANSWERS likewise; RESETS: indices, separated by commas, before which it
// forgets. Prints what engine it was, and how many threads there are.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "config/load.hpp"
#include "policy_host/engines/load_policy.hpp"
#include "policy_host/policy_fit.hpp"
#include "tests/support/files.hpp"

int main(int argc, char** argv) {
  using namespace takt;
  if (argc != 5) return 64;
  const auto robot = config::load(argv[1]);
  const auto policy = robot ? policy_host::load_policy(*robot) : std::unexpected(robot.error());
  const auto fits = policy ? policy_host::check_fit(*robot, **policy) : std::unexpected(policy.error());
  if (!fits) {
    fmt::print(stderr, "{}\n", fits.error());
    return config::kExitBadConfiguration;
  }
  const std::string bytes = takt::test::text_of(argv[2]);
  std::vector<float> observations(bytes.size() / sizeof(float));
  std::copy_n(bytes.data(), observations.size() * sizeof(float), reinterpret_cast<char*>(observations.data()));
  const std::string resets = fmt::format(",{},", argv[3]);
  std::vector<float> answer((*policy)->output_size());
  std::ofstream answers(argv[4], std::ios::binary);
  const std::size_t width = (*policy)->input_size();
  for (std::size_t i = 0; i < observations.size() / width; ++i) {
    if (resets.contains(fmt::format(",{},", i))) (*policy)->reset();
    (*policy)->infer(std::span(observations).subspan(i * width, width), answer);
    answers.write(reinterpret_cast<const char*>(answer.data()),
                  static_cast<std::streamsize>(answer.size() * sizeof(float)));
  }
  const auto threads = std::filesystem::directory_iterator("/proc/self/task");
  fmt::print("{}\nthreads: {}\n", (*policy)->description(), std::distance(begin(threads), end(threads)));
  return 0;
}
