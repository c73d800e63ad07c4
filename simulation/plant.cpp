// SPDX-License-Identifier: Apache-2.0
#include "simulation/plant.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "simulation/chance.hpp"
#include "simulation/device_table.hpp"
#include "simulation/free_inertias.hpp"

namespace takt::simulation {
namespace {

constexpr auto index(std::size_t joint) {
  return static_cast<Eigen::Index>(joint);
}

// What holds a pole upright until the robot has taken over: as good as rigid.
constexpr double kHoldingHand = 1000;  // Nm

double ratio(const config::Drive& drive) {
  return drive.direction * drive.gear_ratio;
}

}  // namespace

Friction friction_of(const config::Simulation& simulation, const config::Joint& joint) {
  const double per_rad = config::per_rad(joint);
  return {simulation.viscous / (per_rad * per_rad), simulation.coulomb / per_rad};
}

std::expected<Plant, std::string> Plant::make(const config::RobotConfig& robot, std::unique_ptr<Dynamics> dynamics) {
  if (!robot.simulation) return std::unexpected(robot.file + ": no `simulation`: this robot has no simulated double");
  std::vector<PlantJoint> joints;
  for (const config::Joint& joint : robot.joints) {
    std::unique_ptr<Device> device = make_device(joint.drive, robot.simulation->drive_watchdog);
    if (!device)
      return std::unexpected(robot.file + ": joint " + joint.name + ": the plant does not simulate " +
                             std::string(config::name(joint.drive.protocol)) + " drives");
    joints.push_back({joint, std::move(device), ReplyPath(seed_for(robot.simulation->seed, joints.size()))});
  }
  return Plant(*robot.simulation, std::move(joints), std::move(dynamics));
}

std::expected<Plant, std::string> Plant::on_free_inertias(const config::RobotConfig& robot) {
  std::vector<double> inertia;
  for (const config::Joint& joint : robot.joints) inertia.push_back(joint.inertia);
  return make(robot, std::make_unique<FreeInertias>(std::move(inertia)));
}

Plant::Plant(const config::Simulation& simulation, std::vector<PlantJoint> joints, std::unique_ptr<Dynamics> dynamics)
    : simulation_(simulation), joints_(std::move(joints)), dynamics_(std::move(dynamics)) {
  const auto count = index(joints_.size());
  state_ = {Eigen::VectorXd::Zero(count), Eigen::VectorXd::Zero(count)};
  for (std::size_t joint = 0; joint < joints_.size(); ++joint) {
    const config::Joint& settings = joints_[joint].settings;
    gearing_.push_back({ratio(settings.drive), settings.drive.offset, settings.limits.torque,
                        simulation.encoder_step * config::per_rad(settings), friction_of(simulation, settings),
                        settings.passive});
    state_.q[index(joint)] = settings.home;
    on_bus_.resize(std::max(on_bus_.size(), settings.bus + 1));
    on_bus_[settings.bus].push_back(joint);
    update_drive(joint, Duration{0});
  }
  friction_.resize(joints_.size());
  const Duration step = simulation_.step;
  const auto delay_steps = (simulation_.torque_delay.ns + step.ns / 2) / step.ns;
  for (std::int64_t i = 0; i < delay_steps; ++i) on_their_way_.push_back(Eigen::VectorXd::Zero(count));
}

bool Plant::receive(std::size_t bus, const drivers::CanFrame& frame, Frames& answers) {
  bool answered = false;
  if (bus >= on_bus_.size()) return false;
  for (const std::size_t hearer : on_bus_[bus]) {
    PlantJoint& joint = joints_[hearer];
    if (joint.replies.is_clear()) {
      const std::size_t before = answers.size();
      joint.device->receive(frame, now_, answers);
      answered |= answers.size() != before;
      continue;
    }
    if (joint.replies.faults().deaf) continue;
    said_.clear();
    joint.device->receive(frame, now_, said_);
    answered |= !said_.empty();
    joint.replies.take(said_, now_);
    joint.replies.deliver(now_, answers);
  }
  return answered;
}

void Plant::collect(std::size_t bus, Frames& said) {
  if (bus >= on_bus_.size()) return;
  for (const std::size_t joint : on_bus_[bus])
    if (!joints_[joint].replies.is_empty()) joints_[joint].replies.deliver(now_, said);
}

void Plant::set_line(std::size_t joint, const LineFaults& faults) {
  joints_[joint].replies.set(faults);
  FeedbackFaults feedback = faults.feedback;
  feedback.offset *= gearing_[joint].ratio * config::per_rad(joints_[joint].settings);
  joints_[joint].device->set(feedback);
}

MotorReading Plant::read_encoder(std::size_t joint) const {
  const Gearing& gearing = gearing_[joint];
  const double grid = gearing.encoder_step;
  const double q = state_.q[index(joint)];
  const double seen = grid > 0 ? std::round(q / grid) * grid : q;
  return {(seen - gearing.offset) * gearing.ratio, state_.dq[index(joint)] * gearing.ratio};
}

double Plant::update_drive(std::size_t joint, Duration step) {
  said_.clear();
  const double torque = joints_[joint].device->update(read_encoder(joint), now_, step, said_);
  if (!said_.empty()) joints_[joint].replies.take(said_, now_);
  return torque;
}

// A hoist that takes hold again with the first drive that is lost would catch every robot that is about to fall.
void Plant::attend_hoist(std::size_t disabled) {
  if (disabled < joints_.size())
    disabled_since_ = {};
  else if (!disabled_since_.is_set())
    disabled_since_ = now_;
  if (disabled == 0)
    hangs_ = false;
  else if (disabled_since_.is_set() && now_ - disabled_since_ >= kTakenUpAfter)
    hangs_ = true;
  dynamics_->hoist(hangs_);
}

void Plant::step() {
  std::size_t disabled = 0;
  Eigen::VectorXd torque = std::move(spare_);
  torque.resize(index(joints_.size()));
  for (std::size_t joint = 0; joint < joints_.size(); ++joint) {
    const Gearing& gearing = gearing_[joint];
    torque[index(joint)] = update_drive(joint, simulation_.step) * gearing.ratio;
    const bool held = joints_[joint].device->brake_engaged();
    disabled += held ? 1U : 0U;
    if (gearing.passive) {
      torque[index(joint)] = 0;
      friction_[joint] = {0, held ? kHoldingHand : 0};
    } else {
      friction_[joint] = {gearing.friction.viscous, gearing.friction.coulomb + (held ? gearing.braking_torque : 0)};
    }
  }
  on_their_way_.push_back(std::move(torque));
  attend_hoist(disabled);
  dynamics_->integrate(state_, on_their_way_.front(), friction_, simulation_.step);
  spare_ = std::move(on_their_way_.front());
  on_their_way_.pop_front();
  now_ = now_ + simulation_.step;
}

}  // namespace takt::simulation
