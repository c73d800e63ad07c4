// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/arm_world.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "evidence/rollout/random.hpp"

namespace takt::evidence {
namespace {

constexpr std::uint64_t kTargetStream = 501;
constexpr double kLatestEntry_s = 100;

double distance(const config::Vector3& a, const config::Vector3& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

config::Simulation with_seed(config::Simulation simulation, std::uint64_t seed) {
  simulation.seed = seed;
  return simulation;
}

}  // namespace

Duration target_entry(std::uint64_t seed) {
  Random random(seed, kTargetStream);
  return {std::llround(random.between(0, kLatestEntry_s) * 1e9)};
}

std::expected<std::unique_ptr<ArmWorld>, std::string> ArmWorld::make(
    const config::RobotConfig& robot, const Disturbance& disturbance, MonoTime started, std::uint64_t seed,
    std::unique_ptr<simulation::OutsideMechanics> outside) {
  if (!robot.simulation || robot.simulation->camera_sensor.empty())
    return std::unexpected(robot.file + ": task arm_tracking needs `simulation` with a `camera` and its `target`");
  if (outside && !outside->link().gives(TAKT_WORLD_POINT))
    return std::unexpected("world " + outside->link().world() +
                           " does not give the tool's place, which task arm_tracking is judged by");
  auto body = TroubledRobot::make(robot, disturbance, started, seed, std::move(outside));
  if (!body) return std::unexpected(body.error());
  const Duration entered = target_entry(seed);
  const std::uint64_t camera_seed = simulation::seed_for(seed, kTargetStream + 1);
  return std::unique_ptr<ArmWorld>(new ArmWorld(robot, std::move(*body), started - entered, camera_seed));
}

ArmWorld::ArmWorld(const config::RobotConfig& robot, TroubledRobot body, MonoTime camera_started,
                   std::uint64_t camera_seed)
    : robot_(robot),
      plant_(std::move(body.plant)),
      dynamics_(body.dynamics),
      simulation_(with_seed(*robot.simulation, camera_seed)),
      camera_started_(camera_started),
      camera_(simulation_, camera_started) {}

double ArmWorld::error_m(MonoTime now) {
  const Eigen::VectorXd& q = plant_.state().q;
  const config::Vector3 tool = dynamics_.tool_position(q);
  const bool too_fast = seen_at_.is_set() && distance(tool, tool_) > kToolSpeedLimit * (now - seen_at_).seconds();
  violated_ = too_fast || is_beyond_limits(robot_, q);
  tool_ = tool;
  seen_at_ = now;
  return distance(tool, simulation::target_at(simulation_, now - camera_started_));
}

}  // namespace takt::evidence
