// SPDX-License-Identifier: Apache-2.0
// What a rollout in virtual time costs beside its physics: the share of its time spent outside MuJoCo, and how much of
// that are the networks, which is the floor of it. The linker puts a stopwatch around every function of MuJoCo that a
// step calls; two readings of it are a thousandth of a step. Another stands around every inference.
#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <CLI/CLI.hpp>

#include "config/load.hpp"
#include "evidence/rollout/rollout.hpp"
#include "policy_host/onnx_policy.hpp"
#include "tests/bench/bench.hpp"

namespace {
std::int64_t g_inside = 0, g_steps = 0, g_network = 0;  // ticks of the counter; calls of mj_step

class Inside {
 public:
  Inside() = default;
  Inside(const Inside&) = delete;
  Inside& operator=(const Inside&) = delete;
  ~Inside() { g_inside += takt::bench::ticks() - since_; }

 private:
  std::int64_t since_ = takt::bench::ticks();
};
}  // namespace

// NOLINTBEGIN(bugprone-reserved-identifier): the names that ld's --wrap prescribes
extern "C" {
void __real_mj_step(const mjModel*, mjData*);
void __real_mj_kinematics(const mjModel*, mjData*);
void __real_mj_comPos(const mjModel*, mjData*);
void __real_mj_comVel(const mjModel*, mjData*);
void __real_mj_rnePostConstraint(const mjModel*, mjData*);

void __wrap_mj_step(const mjModel* model, mjData* data) {
  const Inside inside;
  ++g_steps;
  __real_mj_step(model, data);
}
void __wrap_mj_kinematics(const mjModel* model, mjData* data) {
  const Inside inside;
  __real_mj_kinematics(model, data);
}
void __wrap_mj_comPos(const mjModel* model, mjData* data) {
  const Inside inside;
  __real_mj_comPos(model, data);
}
void __wrap_mj_comVel(const mjModel* model, mjData* data) {
  const Inside inside;
  __real_mj_comVel(model, data);
}
void __wrap_mj_rnePostConstraint(const mjModel* model, mjData* data) {
  const Inside inside;
  __real_mj_rnePostConstraint(model, data);
}
}
// NOLINTEND(bugprone-reserved-identifier)

namespace takt::bench {
namespace {

constexpr double kTarget = 0.15;  // share of the time outside the engine
constexpr int kRollouts = 5;
constexpr Duration kLength = seconds(8);

struct Cost {
  double wall_s = 0, outside = 0, network = 0, step_us = 0;
};

class Timed final : public policy_host::Policy {
 public:
  explicit Timed(std::unique_ptr<policy_host::Policy> policy) : policy_(std::move(policy)) {}
  [[nodiscard]] std::size_t input_size() const override { return policy_->input_size(); }
  [[nodiscard]] std::size_t output_size() const override { return policy_->output_size(); }
  [[nodiscard]] bool is_recurrent() const override { return policy_->is_recurrent(); }
  void reset() override { policy_->reset(); }
  void infer(std::span<const float> input, std::span<float> output) override {
    const std::int64_t begin = ticks();
    policy_->infer(input, output);
    g_network += ticks() - begin;
  }

 private:
  std::unique_ptr<policy_host::Policy> policy_;
};

std::expected<Cost, std::string> cost_of(const config::RobotConfig& robot, policy_host::Policy& policy,
                                         evidence::FallbackHost* fallback, std::uint64_t seed) {
  evidence::RolloutRow row;
  const evidence::RolloutSetup setup{.robot = robot,
                                     .policy = policy,
                                     .fallback = fallback,
                                     .task = evidence::Task::base_velocity,
                                     .timing = {.inference = milliseconds(2)},
                                     .perturbation = {},
                                     .seed = seed,
                                     .duration = kLength,
                                     .scored = seconds(2),
                                     .bound_m = 0.3};
  g_inside = g_steps = g_network = 0;
  const std::int64_t begin = ticks();
  if (const auto done = evidence::run_rollout(setup, row); !done) return std::unexpected(done.error());
  const double whole = static_cast<double>(ticks() - begin), inside = static_cast<double>(g_inside);
  if (!row.success) return std::unexpected(robot.file + ": the rollout failed: " + row.failure_label);
  return Cost{whole * ns_per_tick() * 1e-9, 1 - inside / whole, static_cast<double>(g_network) / whole,
              inside * ns_per_tick() * 1e-3 / static_cast<double>(g_steps)};
}

int refuse(const std::string& sentence) {
  fmt::print(stderr, "{}\n", sentence);
  return config::kExitBadConfiguration;
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  using namespace takt;
  using namespace takt::bench;
  CLI::App app{"Rollouts in virtual time of a robot that walks: how much of the time is not the physics."};
  std::string robot_file;
  bool as_json = false;
  app.add_option("ROBOT", robot_file, "robot file with `simulation.mujoco` and a policy that takes a velocity command")
      ->required();
  app.add_flag("--json", as_json, "one JSON row per figure");
  CLI11_PARSE(app, argc, argv);
  const auto robot = config::load(robot_file);
  if (!robot) return refuse(robot.error());
  if (!robot->policy) return refuse(robot_file + ": has no `policy`");
  auto policy = policy_host::load_onnx_policy(robot->policy->file, robot->policy->input, robot->policy->output);
  if (!policy) return refuse(policy.error());
  auto fallback = evidence::load_fallback_host(*robot);
  if (!fallback) return refuse(fallback.error());
  Timed timed(std::move(*policy));
  if (*fallback) (*fallback)->policy = std::make_unique<Timed>(std::move((*fallback)->policy));
  std::vector<double> outside, network, wall, step;
  for (std::uint64_t seed = 1; seed <= kRollouts; ++seed) {
    const auto cost = cost_of(*robot, timed, fallback->get(), seed);
    if (!cost) return refuse(cost.error());
    outside.push_back(cost->outside);
    network.push_back(cost->network);
    wall.push_back(cost->wall_s);
    step.push_back(cost->step_us);
  }
  const double share = median(outside);
  Report(as_json).figure(fmt::format("{:.1f} times real time; MuJoCo {:.1f} us per step, {:.1f} % of the time outside "
                                     "it, {:.1f} % in networks  {}",
                                     kLength.seconds() / median(wall), median(step), 100 * share, 100 * median(network),
                                     share <= kTarget ? "(target 15: met)" : "(target 15: MISSED)"),
                         {{"bench", "rollout"},
                          {"realtime_factor", kLength.seconds() / median(wall)},
                          {"engine_step_us", median(step)},
                          {"outside_share", share},
                          {"network_share", median(network)},
                          {"target_share", kTarget}});
  return 0;
}
