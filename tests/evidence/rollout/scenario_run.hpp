// SPDX-License-Identifier: Apache-2.0
// A robot of a file, its drives and a scenario in one thread and virtual time: the real decision, the real drivers, the
// simulated drives, a policy that holds the robot at home; buses and camera suffer what the scenario says of them.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "evidence/rollout/operator.hpp"
#include "evidence/rollout/virtual_bus.hpp"
#include "executive/incident/incident.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "simulation/robot_plant.hpp"
#include "simulation/scenario_player.hpp"

namespace takt::lab::test {

inline const config::RobotConfig& arm6() {
  static const config::RobotConfig loaded = config::load("config/arm6.yaml").value();
  return loaded;
}

// Drives of all five protocols.
inline const config::RobotConfig& dual_arm12() {
  static const config::RobotConfig loaded = config::load("config/dual_arm12.yaml").value();
  return loaded;
}

class ScenarioRun {
  static constexpr std::uint64_t kHash = 7;
  static constexpr std::uint64_t kAnswerTicks = 12;
  static constexpr MonoTime kStart{1'000'000'000'000};

 public:
  ScenarioRun(const config::RobotConfig& robot, const std::string& file) : ScenarioRun(robot, file, robot) {}
  // `known`: the same robot as the executive knows it.
  ScenarioRun(const config::RobotConfig& robot, const std::string& file, const config::RobotConfig& known)
      : robot_(robot),
        config_(setup::tick_config_of(known, kHash)),
        player_(simulation::load_scenario(file, robot).value(), robot, [](const std::string&) {}) {
    input_.now = kStart;
  }

  // Until the robot stops, ten seconds at most.
  std::optional<incident::Incident> run() {
    for (int tick = 0; tick < 10'000; ++tick)
      if (auto incident = step()) return incident;
    return std::nullopt;
  }

  // One tick; `request`: instead of what the operator of a rollout asks for.
  std::optional<incident::Incident> step(OperatorRequest request = OperatorRequest::none) {
    ++input_.tick;
    input_.now = input_.now + config_.period;
    for (; plant_at_ + plant_.step_length() <= input_.now; plant_at_ = plant_at_ + plant_.step_length()) {
      player_.advance(plant_);
      plant_.set_trouble(player_.on_body());
      plant_.step();
    }
    receive();
    deliver();
    input_.operator_request = request;
    if (request == OperatorRequest::none && input_.tick != 1)
      input_.operator_request = operator_.next(output_->record, config_);
    pipeline::control_tick(*state_, input_, config_, *output_);
    bus_.send(plant_, input_.now, *output_);
    if (output_->observation_due && player_.on_sensor(0).drop < 0.5) answer(output_->observation);
    return watch_.tick(output_->record);
  }

  [[nodiscard]] const TickRecord& record() const { return output_->record; }
  [[nodiscard]] const pipeline::TickOutput& output() const { return *output_; }
  [[nodiscard]] const pipeline::TickConfig& config() const { return config_; }
  // Where the joints really are, and how fast: rad, rad/s.
  [[nodiscard]] std::vector<double> positions() const { return {plant_.state().q.begin(), plant_.state().q.end()}; }
  [[nodiscard]] std::vector<double> speeds() const { return {plant_.state().dq.begin(), plant_.state().dq.end()}; }

 private:
  // What strangers and bad controllers do beyond what the virtual bus knows: as the edge would report it.
  void receive() {
    bus_.receive(plant_, input_.now, input_);
    for (std::size_t bus = 0; bus < robot_.buses.size(); ++bus) {
      const simulation::BusFaults& faults = player_.on_bus(bus);
      BusHealth& health = input_.buses[bus];
      health.state = faults.state;
      health.flooded = faults.babble ? 1 : 0;
      foreign_[bus] += static_cast<std::uint32_t>(faults.rivals_of.size());
      health.foreign_frames += foreign_[bus];
      const bool is_dead = faults.state == BusState::bus_off || faults.state == BusState::down;
      const bool loses = faults.drop > 0 && input_.tick % 5 == 0;
      for (std::size_t joint = 0; joint < robot_.joints.size(); ++joint)
        if (robot_.joints[joint].bus == bus && (is_dead || loses)) input_.joints[joint] = heard_[joint];
    }
    std::copy_n(input_.joints, robot_.joints.size(), heard_.begin());
  }

  void answer(const Observation& observation) {
    auto chunk = std::make_unique<CommandChunk>();
    CommandHeader& header = chunk->header;
    header.observation_id = observation.id;
    header.sequence = ++sequence_;
    header.policy_hash = kHash;
    header.outside_sensed_at = observation.published_at - milliseconds(25);
    header.dequeued_at = header.infer_started_at = observation.published_at + milliseconds(1);
    header.infer_ended_at = header.published_at = observation.published_at + milliseconds(9);
    header.step_period = milliseconds(10);
    header.step_count = 16;
    header.joint_count = static_cast<std::uint16_t>(config_.joint_count);
    header.fields = static_cast<std::uint8_t>(CommandField::q);
    for (std::size_t step = 0; step < header.step_count; ++step)
      for (std::size_t joint = 0; joint < config_.joint_count; ++joint)
        chunk->values[value_index(header, CommandField::q, step, joint)] = config_.joints[joint].home;
    answer_ = std::move(chunk);
    answer_due_ = input_.tick + kAnswerTicks;
  }

  void deliver() {
    const bool due = answer_ && input_.tick >= answer_due_;
    if (due) read_ = std::move(answer_);
    input_.messages[Seat::policy].command = due ? read_.get() : nullptr;
    input_.messages[Seat::policy].mailbox = due ? Arrival::accepted : Arrival::none;
    input_.messages[Seat::policy].bytes = due ? read_->used_bytes() : 0;
    input_.messages[Seat::policy].session = 1;
    input_.recorded_through = input_.tick;
  }

  const config::RobotConfig& robot_;
  pipeline::TickConfig config_;
  pipeline::TickStatePtr state_ = pipeline::make_tick_state(config_);
  simulation::RobotPlant plant_ = simulation::RobotPlant::make(robot_, std::array{1.0}).value();
  evidence::Disturbance calm_{{}, kStart};
  evidence::VirtualBus bus_ = evidence::VirtualBus::make(robot_, calm_, 1).value();
  simulation::ScenarioPlayer player_;
  evidence::Operator operator_{std::nullopt};
  incident::IncidentWatch watch_{robot_};
  pipeline::TickInput input_;
  std::unique_ptr<pipeline::TickOutput> output_ = std::make_unique<pipeline::TickOutput>();
  std::unique_ptr<CommandChunk> answer_, read_;
  std::uint64_t answer_due_ = 0, sequence_ = 0;
  std::array<std::uint32_t, kMaxBuses> foreign_{};
  std::array<JointFeedback, kMaxJoints> heard_{};
  MonoTime plant_at_ = kStart;
};

}  // namespace takt::lab::test
