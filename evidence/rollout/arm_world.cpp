#include "evidence/rollout/arm_world.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "evidence/rollout/random.hpp"

namespace takt::panel {
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

std::expected<std::unique_ptr<ArmWorld>, std::string> ArmWorld::make(const config::RobotConfig& robot,
                                                                     const Disturbance& disturbance, MonoTime started,
                                                                     std::uint64_t seed) {
  if (!robot.simulation || robot.simulation->camera_sensor.empty())
    return std::unexpected(robot.file + ": task arm_tracking needs `simulation` with a `camera` and its `target`");
  auto dynamics = TroubledDynamics::make(robot, disturbance, started, seed);
  if (!dynamics) return std::unexpected(dynamics.error());
  TroubledDynamics& mechanics = **dynamics;
  auto plant = plant::Plant::make(robot, std::move(*dynamics));
  if (!plant) return std::unexpected(plant.error());
  const Duration entered = target_entry(seed);
  const std::uint64_t camera_seed = plant::seed_for(seed, kTargetStream + 1);
  return std::unique_ptr<ArmWorld>(new ArmWorld(robot, std::move(*plant), mechanics, started - entered, camera_seed));
}

ArmWorld::ArmWorld(const config::RobotConfig& robot, plant::Plant plant, TroubledDynamics& dynamics,
                   MonoTime camera_started, std::uint64_t camera_seed)
    : robot_(robot),
      plant_(std::move(plant)),
      dynamics_(dynamics),
      simulation_(with_seed(*robot.simulation, camera_seed)),
      camera_started_(camera_started),
      camera_(simulation_, camera_started) {}

double ArmWorld::error_m(MonoTime now) {
  const Eigen::VectorXd& q = plant_.state().q;
  const config::Vector3 tool = dynamics_.tool_position(q);
  const bool too_fast = seen_at_.is_set() && distance(tool, tool_) > kToolSpeedLimit * (now - seen_at_).seconds();
  bool outside = false;
  for (std::size_t joint = 0; joint < robot_.joints.size(); ++joint) {
    const config::Limits& limits = robot_.joints[joint].limits;
    const double at = q[static_cast<Eigen::Index>(joint)];
    outside |= at < limits.q_min || at > limits.q_max;
  }
  violated_ = too_fast || outside;
  tool_ = tool;
  seen_at_ = now;
  return distance(tool, plant::target_at(simulation_, now - camera_started_));
}

}  // namespace takt::panel
