#include "simulation/outside_mechanics.hpp"

#include <algorithm>

namespace takt::plant {
namespace {

ArmState state_of(const takt_world_state& answer, std::size_t joint_count) {
  const auto count = static_cast<Eigen::Index>(joint_count);
  return {Eigen::Map<const Eigen::VectorXd>(answer.q, count), Eigen::Map<const Eigen::VectorXd>(answer.dq, count)};
}

config::Vector3 point_of(const takt_world_state& answer) {
  return {answer.point[0], answer.point[1], answer.point[2]};
}

std::optional<ImuReading> imu_of(const takt_world_state& answer, const WorldLink& link) {
  if (!link.gives(TAKT_WORLD_IMU)) return std::nullopt;
  ImuReading reading;
  std::ranges::copy(answer.orientation, reading.orientation.begin());
  std::ranges::copy(answer.angular_velocity, reading.angular_velocity.begin());
  std::ranges::copy(answer.acceleration, reading.acceleration.begin());
  return reading;
}

}  // namespace

OutsideMechanics::OutsideMechanics(WorldLink link, const takt_world_state& first, std::size_t joint_count)
    : link_(std::move(link)),
      begin_(state_of(first, joint_count)),
      point_(point_of(first)),
      imu_(imu_of(first, link_)),
      viscous_(joint_count),
      coulomb_(joint_count) {}

std::expected<std::unique_ptr<OutsideMechanics>, WorldEnd> OutsideMechanics::connect(
    const config::RobotConfig& robot, const std::string& path, const WorldLink::Patience& patience) {
  WorldLink::Robot played{robot.robot, {}, robot.simulation->step};
  std::vector<double> home;
  for (const config::Joint& joint : robot.joints) {
    played.joints.push_back(joint.name);
    home.push_back(joint.home);
  }
  auto link = WorldLink::connect(path, played, patience);
  if (!link) return std::unexpected(link.error());
  const auto first = link->reset(robot.simulation->seed, home);
  if (!first) return std::unexpected(first.error());
  return std::unique_ptr<OutsideMechanics>(new OutsideMechanics(std::move(*link), *first, home.size()));
}

void OutsideMechanics::integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                                 Duration /*step*/) {
  if (end_) return;
  for (std::size_t joint = 0; joint < friction.size(); ++joint) {
    viscous_[joint] = friction[joint].viscous;
    coulomb_[joint] = friction[joint].coulomb;
  }
  const auto answer = link_.step({{tau.data(), friction.size()}, viscous_, coulomb_});
  if (!answer) {
    end_ = answer.error();
    state.dq.setZero();
    return;
  }
  state = state_of(*answer, friction.size());
  point_ = point_of(*answer);
  imu_ = imu_of(*answer, link_);
}

config::Vector3 OutsideMechanics::tool_position(const Eigen::VectorXd& /*q*/) {
  return point_;
}

}  // namespace takt::plant
