// SPDX-License-Identifier: Apache-2.0
#include "lab/study/holding_loop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "executive/setup/tick_config_of.hpp"

namespace takt::study {
namespace {

constexpr MonoTime kStart{1'000'000'000'000};
constexpr Duration kLateness = microseconds(20), kTickWork = microseconds(25);
constexpr Duration kMostArming = seconds(5), kSettling = seconds(1), kMostSettling = seconds(10);
constexpr double kAtRest = 0.01;  // rad/s: encoder steps keep a joint from resting altogether

}  // namespace

std::expected<std::unique_ptr<HoldingLoop>, std::string> HoldingLoop::make(
    const config::RobotConfig& robot, std::unique_ptr<simulation::Dynamics> dynamics, const Eigen::VectorXd& pose) {
  if (!robot.simulation) return std::unexpected(robot.file + ": no `simulation`: there is no plant to measure on");
  std::vector<simulation::Friction> friction;
  for (const config::Joint& joint : robot.joints) friction.push_back(simulation::friction_of(*robot.simulation, joint));
  auto probed = std::make_unique<ProbedDynamics>(std::move(dynamics), std::move(friction));
  ProbedDynamics& probe = *probed;
  auto plant = simulation::Plant::make(robot, std::move(probed));
  if (!plant) return std::unexpected(plant.error());
  std::unique_ptr<HoldingLoop> made(new HoldingLoop(robot, std::move(*plant), probe, pose));
  auto bus = evidence::VirtualBus::make(robot, made->undisturbed_, 1);
  if (!bus) return std::unexpected(bus.error());
  made->bus_ = std::make_unique<evidence::VirtualBus>(std::move(*bus));
  if (auto armed = made->arm(); !armed) return std::unexpected(robot.file + ": " + armed.error());
  return made;
}

HoldingLoop::HoldingLoop(const config::RobotConfig& robot, simulation::Plant plant, ProbedDynamics& probe,
                         const Eigen::VectorXd& pose)
    : robot_(robot),
      undisturbed_({}, kStart),
      config_(setup::tick_config_of(robot, 0)),
      state_(pipeline::make_tick_state(config_)),
      plant_(std::move(plant)),
      probe_(probe),
      due_(kStart),
      plant_at_(kStart) {
  // Whatever the contract says, the command here is always fresh.
  config_.freshness.max_age = seconds(10);
  config_.degraded = pipeline::DegradedBehaviour::hold;  // there is no fallback policy
  state_ = pipeline::make_tick_state(config_);
  plant_.set_state({pose, Eigen::VectorXd::Zero(pose.size())});
  input_.last_duration = kTickWork;
  input_.lateness = kLateness;
  input_.messages[Seat::policy].session = 1;
  CommandHeader& header = chunk_->header;
  header.step_period = milliseconds(100);
  header.step_count = 16;
  header.joint_count = static_cast<std::uint16_t>(robot.joints.size());
  header.fields = static_cast<std::uint8_t>(CommandField::q);
  if (config_.interpolation == pipeline::Interpolation::cubic)
    header.fields |= static_cast<std::uint8_t>(CommandField::dq);  // zeros: it stands
  for (std::size_t step = 0; step < header.step_count; ++step)
    for (std::size_t joint = 0; joint < header.joint_count; ++joint)
      chunk_->values[value_index(header, CommandField::q, step, joint)] =
          static_cast<float>(pose[static_cast<Eigen::Index>(joint)]);
}

void HoldingLoop::answer(const Observation& observation) {
  CommandHeader& header = chunk_->header;
  header.observation_id = observation.id;
  ++header.sequence;
  header.outside_sensed_at = header.dequeued_at = header.infer_started_at = header.infer_ended_at =
      header.published_at = observation.published_at;
  answered_ = true;
}

void HoldingLoop::tick() {
  const MonoTime now = due_ + kLateness;
  for (const Duration step = plant_.step_length(); plant_at_ + step <= now; plant_at_ = plant_at_ + step) plant_.step();
  ++input_.tick;
  input_.recorded_through = input_.tick;  // nothing here is lost
  input_.torque_output = TorqueOutputState::as_told;
  input_.now = now;
  bus_->receive(plant_, now, input_);
  input_.messages[Seat::policy].command = answered_ ? chunk_.get() : nullptr;
  input_.messages[Seat::policy].bytes = answered_ ? chunk_->used_bytes() : 0;
  input_.messages[Seat::policy].mailbox = answered_ ? Arrival::accepted : Arrival::none;
  pipeline::control_tick(*state_, input_, config_, *output_);
  answered_ = false;
  input_.operator_request = OperatorRequest::none;
  bus_->send(plant_, now, *output_);
  if (output_->observation_due) answer(output_->observation);
  due_ = due_ + config_.period;
  const TickRecord& record = output_->record;
  if (record.header.mode != Mode::tracking) trouble_ = "the robot left tracking";
  for (std::size_t joint = 0; joint < config_.joint_count; ++joint)
    if (record.joints[joint].interventions != 0) trouble_ = "a limit intervened at joint " + robot_.joints[joint].name;
}

void HoldingLoop::run(Duration span) {
  for (const MonoTime end = due_ + span; due_ < end;) tick();
}

std::string HoldingLoop::trouble() {
  return std::exchange(trouble_, {});
}

double HoldingLoop::fastest() const {
  double fastest = 0;
  for (std::size_t joint = 0; joint < robot_.joints.size(); ++joint)
    fastest = std::max(
        fastest, std::abs(plant_.state().dq[static_cast<Eigen::Index>(joint)]) / config::per_rad(robot_.joints[joint]));
  return fastest;
}

std::expected<void, std::string> HoldingLoop::arm() {
  std::array<pipeline::ArmingBlocker, 1> first;
  bool asked = false;
  while (due_ < kStart + kMostArming && output_->record.header.mode != Mode::tracking) {
    tick();
    if (asked || pipeline::arming_blockers(output_->record, config_, first) != 0) continue;
    input_.operator_request = OperatorRequest::arm;
    asked = true;
  }
  if (!asked) return std::unexpected(fmt::format("the simulated robot cannot be armed: {}", first[0].what));
  for (const MonoTime end = due_ + kMostSettling; due_ < end;) {
    run(kSettling);
    if (output_->record.header.mode != Mode::tracking) break;
    if (fastest() < kAtRest) {
      (void)trouble();
      return {};
    }
  }
  return std::unexpected(fmt::format(
      "holding its pose, the robot does not come to rest ({:.3g} rad/s): the inner loop is unstable", fastest()));
}

}  // namespace takt::study
