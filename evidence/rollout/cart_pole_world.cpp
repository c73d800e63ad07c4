// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/cart_pole_world.hpp"

#include <cmath>
#include <utility>

#include "evidence/rollout/random.hpp"

namespace takt::evidence {
namespace {

constexpr std::uint64_t kCommandStream = 551;

config::Simulation seeded(config::Simulation simulation, std::uint64_t seed) {
  simulation.seed = seed;
  return simulation;
}

bool is_beyond(const config::Limits& limits, double q, double margin) {
  return q < limits.q_min - margin || q > limits.q_max + margin;
}

}  // namespace

std::expected<std::unique_ptr<CartPoleWorld>, std::string> CartPoleWorld::make(
    const config::RobotConfig& robot, const Disturbance& disturbance, MonoTime started, std::uint64_t seed,
    std::unique_ptr<simulation::OutsideMechanics> outside) {
  if (!robot.simulation || !robot.simulation->cart_pole || robot.simulation->camera_sensor.empty())
    return std::unexpected(robot.file +
                           ": task cart_pole_balance needs `simulation` with `cart_pole`, `camera`, `target`");
  if (outside && !outside->link().gives(TAKT_WORLD_POINT))
    return std::unexpected("world " + outside->link().world() +
                           " does not give the cart's place, which task cart_pole_balance is judged by");
  auto body = TroubledRobot::make(robot, disturbance, started, seed, std::move(outside));
  if (!body) return std::unexpected(body.error());
  Random random(seed, kCommandStream);
  // The first step comes within one period of the start.
  const Duration told_for{std::llround(random.between(0, static_cast<double>(robot.simulation->step_period.ns)))};
  return std::unique_ptr<CartPoleWorld>(
      new CartPoleWorld(robot, std::move(*body), started - told_for, simulation::seed_for(seed, kCommandStream + 1)));
}

CartPoleWorld::CartPoleWorld(const config::RobotConfig& robot, TroubledRobot body, MonoTime told_since,
                             std::uint64_t seed)
    : robot_(robot),
      plant_(std::move(body.plant)),
      dynamics_(body.dynamics),
      simulation_(seeded(*robot.simulation, seed)),
      told_since_(told_since),
      sensor_(simulation_, told_since) {}

double CartPoleWorld::error_m(MonoTime now) {
  const Eigen::VectorXd& q = plant_.state().q;
  const config::Limits& track = robot_.joints[0].limits;
  const config::Limits& pole = robot_.joints[1].limits;
  violated_ = is_beyond(track, q[0], 0) || is_beyond(pole, q[1], 0);
  lost_ |= is_beyond(pole, q[1], pole.position_margin);
  return std::abs(dynamics_.controlled_point(q)[0] - simulation::target_at(simulation_, now - told_since_)[0]);
}

}  // namespace takt::evidence
