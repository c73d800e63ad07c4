// SPDX-License-Identifier: Apache-2.0
// A policy by takt/client.h for policy_process_test: the demo arm's joints sway about home, further with every answer
// since it was told to forget. `WHAT` says what else it does; `--robot` and `--runtime-dir` come from its caller.
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "client/takt/client.h"

namespace {

constexpr std::int64_t kWait_ns = 100'000'000;

class Sway {
 public:
  Sway(takt_policy* policy, std::string what, std::uint64_t number)
      : policy_(policy), what_(std::move(what)), number_(number) {
    const takt_robot* const robot = takt_policy_robot(policy);
    q_.resize(std::size_t{robot->steps} * robot->joint_count);
  }

  int run() {
    for (int result = TAKT_OK; result == TAKT_OK || result == TAKT_NOTHING;) {
      result = takt_policy_next(policy_, kWait_ns);
      if (result == TAKT_OK) result = answer();
      if (result != TAKT_OK && result != TAKT_NOTHING) std::fprintf(stderr, "%s\n", takt_policy_sentence(policy_));
    }
    return 1;
  }

 private:
  int answer() {
    const takt_observation* const seen = takt_policy_observation(policy_);
    ++observations_;
    if (seen->reset != 0) answers_ = 0;
    if (what_ == "exits" && observations_ == number_) std::exit(3);
    if (what_ == "hangs" && observations_ == number_) pause();
    if (what_ == "skips" && seen->id % number_ == 0) return TAKT_OK;  // no answer to this one
    const takt_robot* const robot = takt_policy_robot(policy_);
    const auto reach = static_cast<float>(0.1 * std::sin(0.02 * static_cast<double>(++answers_)));
    for (std::size_t i = 0; i < q_.size(); ++i) q_[i] = robot->home[i % robot->joint_count] + reach;
    takt_chunk chunk{};
    chunk.size = sizeof chunk;
    chunk.q = q_.data();
    return takt_policy_publish(policy_, &chunk);
  }

  takt_policy* policy_;
  std::string what_;
  std::uint64_t number_, observations_ = 0, answers_ = 0;
  std::vector<float> q_;
};

}  // namespace

// client_policy [steps=N] WHAT NUMBER --robot FILE --runtime-dir FOLDER
int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.size() != 6) return 64;
  takt_term terms[2]{};
  terms[0].kind = TAKT_TERM_Q;
  terms[1].kind = TAKT_TERM_STREAM;
  terms[1].values = 3;
  terms[1].stream = "target";
  takt_policy_spec spec{};
  spec.size = sizeof spec;
  spec.term_count = 2;
  spec.terms = terms;
  spec.program = "client_policy";
  spec.step = "10 ms";
  spec.steps = arguments[0] == "steps" ? static_cast<std::uint32_t>(std::stoul(arguments[1])) : 16;
  spec.robot_file = arguments[3].c_str();
  spec.runtime_directory = arguments[5].c_str();
  char why[1024];
  takt_policy* policy = nullptr;
  if (const int refused = takt_policy_open(&spec, &policy, why, sizeof why); refused != TAKT_OK) {
    std::fprintf(stderr, "%s\n", why);
    return refused;
  }
  Sway sway(policy, arguments[0], std::stoull(arguments[1]));
  const int ended = sway.run();
  takt_policy_close(policy);
  return ended;
}
