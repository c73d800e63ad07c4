#include "drivers/plant/arm_plant.hpp"

#include <cmath>
#include <iterator>

#include "drivers/plant/device_table.hpp"

namespace takt::plant {
namespace {

constexpr auto index(std::size_t joint) {
  return static_cast<Eigen::Index>(joint);
}

double ratio(const config::Drive& drive) {
  return drive.direction * drive.gear_ratio;
}

}  // namespace

std::expected<ArmPlant, std::string> ArmPlant::make(const config::RobotConfig& robot) {
  if (!robot.simulation) return std::unexpected(robot.file + ": no `simulation`: this robot has no simulated double");
  std::vector<std::unique_ptr<Device>> drives;
  for (const config::Joint& joint : robot.joints) {
    drives.push_back(make_device(joint.drive, robot.simulation->drive_watchdog));
    if (!drives.back())
      return std::unexpected(robot.file + ": joint " + joint.name + ": nobody simulates " +
                             std::string(config::name(joint.drive.protocol)) + " drives");
  }
  auto dynamics = ArmDynamics::make(robot);
  if (!dynamics) return std::unexpected(dynamics.error());
  return ArmPlant(robot, std::move(*dynamics), std::move(drives));
}

ArmPlant::ArmPlant(const config::RobotConfig& robot, std::unique_ptr<ArmDynamics> dynamics,
                   std::vector<std::unique_ptr<Device>> drives)
    : joints_(robot.joints),
      simulation_(*robot.simulation),
      step_(robot.simulation->step),
      dynamics_(std::move(dynamics)),
      drives_(std::move(drives)),
      said_(robot.buses.size()) {
  const auto count = index(joints_.size());
  state_ = {Eigen::VectorXd::Zero(count), Eigen::VectorXd::Zero(count)};
  for (std::size_t joint = 0; joint < joints_.size(); ++joint) {
    state_.q[index(joint)] = joints_[joint].home;
    drives_[joint]->update(read_encoder(joint), now_, Duration{0}, said_[joints_[joint].bus]);
  }
  const auto delay_steps = (simulation_.torque_delay.ns + step_.ns / 2) / step_.ns;
  for (std::int64_t i = 0; i < delay_steps; ++i) on_their_way_.push_back(Eigen::VectorXd::Zero(count));
}

bool ArmPlant::receive(std::size_t bus, const drivers::CanFrame& frame, Frames& answers) {
  const std::size_t before = answers.size();
  for (std::size_t joint = 0; joint < joints_.size(); ++joint)
    if (joints_[joint].bus == bus) drives_[joint]->receive(frame, now_, answers);
  return answers.size() != before;
}

void ArmPlant::collect(std::size_t bus, Frames& said) {
  said.insert(said.end(), said_[bus].begin(), said_[bus].end());
  said_[bus].clear();
}

MotorReading ArmPlant::read_encoder(std::size_t joint) const {
  const config::Drive& drive = joints_[joint].drive;
  const double grid = simulation_.encoder_step;
  const double q = state_.q[index(joint)];
  const double seen = grid > 0 ? std::round(q / grid) * grid : q;
  return {(seen - drive.offset) * ratio(drive), state_.dq[index(joint)] * ratio(drive)};
}

void ArmPlant::step() {
  Eigen::VectorXd torque(index(joints_.size()));
  std::vector<Friction> friction(joints_.size());
  for (std::size_t joint = 0; joint < joints_.size(); ++joint) {
    Device& drive = *drives_[joint];
    Frames& said = said_[joints_[joint].bus];
    torque[index(joint)] = drive.update(read_encoder(joint), now_, step_, said) * ratio(joints_[joint].drive);
    const double brake = drive.brake_engaged() ? joints_[joint].limits.torque : 0;
    friction[joint] = {simulation_.viscous, simulation_.coulomb + brake};
  }
  on_their_way_.push_back(std::move(torque));
  dynamics_->integrate(state_, on_their_way_.front(), friction, step_);
  on_their_way_.pop_front();
  now_ = now_ + step_;
}

}  // namespace takt::plant
