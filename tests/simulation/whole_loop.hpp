// SPDX-License-Identifier: Apache-2.0
// A whole robot in virtual time, one thread: the tick, the real drivers, the simulated drives and mechanics. Frames are
// handed over by function call and arrive within their millisecond; a policy without delay asks for one pose.
#pragma once

#include <array>
#include <memory>
#include <stdexcept>
#include <vector>

#include "drivers/protocol/protocol_table.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "simulation/plant.hpp"

namespace takt::test {

class WholeLoop {
 public:
  WholeLoop(const config::RobotConfig& robot, simulation::Plant& plant)
      : config(setup::tick_config_of(robot, 0)), plant_(plant), state_(pipeline::make_tick_state(config)) {
    for (std::size_t j = 0; j < robot.joints.size(); ++j) {
      auto made = drivers::make_joint_driver(robot, j);
      if (!made) throw std::runtime_error(made.error());
      drivers_.push_back(std::move(*made));
      pose.push_back(static_cast<float>(robot.joints[j].home));
    }
  }

  void tick(OperatorRequest request = OperatorRequest::none) {
    hear();
    input_.now = plant_.now();
    ++input_.tick;
    input_.recorded_through = input_.tick;  // nothing here is lost
    input_.operator_request = request;
    const bool answers = out->observation_due && has_policy;
    if (answers) answer();
    input_.messages[Seat::policy].command = answers ? chunk_.get() : nullptr;
    input_.messages[Seat::policy].mailbox = answers ? Arrival::accepted : Arrival::none;
    input_.messages[Seat::policy].bytes = answers ? chunk_->used_bytes() : 0;
    pipeline::control_tick(*state_, input_, config, *out);
    speak();
    plant_.step();
  }
  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
  }
  // Standby to tracking; false: not within five seconds.
  bool arm() {
    for (int i = 0; i < 5000 && mode() != Mode::tracking; ++i)
      tick(i > 1000 && mode() == Mode::standby ? OperatorRequest::arm : OperatorRequest::none);
    return mode() == Mode::tracking;
  }
  [[nodiscard]] Mode mode() const { return out->record.header.mode; }
  // What keeps it from being armed.
  [[nodiscard]] std::string blockers() const {
    std::array<pipeline::ArmingBlocker, 8> found;
    std::string all;
    const std::size_t count = pipeline::arming_blockers(out->record, config, found);
    for (std::size_t i = 0; i < std::min(count, found.size()); ++i) all += std::string(found[i].what) + "; ";
    return all;
  }
  [[nodiscard]] drivers::JointDriver& driver(std::size_t j) { return *drivers_[j]; }
  // No more than these torques, Nm at the joint, was asked for in the newest tick's frames: what the tick says of them.
  [[nodiscard]] const JointRecord& joint(std::size_t j) const { return out->record.joints[j]; }

  pipeline::TickConfig config;
  std::vector<float> pose;  // what the policy asks for
  bool has_policy = true;
  std::unique_ptr<pipeline::TickOutput> out = std::make_unique<pipeline::TickOutput>();

 private:
  void hear() {
    for (std::size_t bus = 0; bus < config.bus_count; ++bus) {
      said_.clear();
      plant_.collect(bus, said_);
      decode(bus);
    }
    for (std::size_t j = 0; j < drivers_.size(); ++j) input_.joints[j] = drivers_[j]->feedback();
  }
  void decode(std::size_t bus) {
    for (const drivers::CanFrame& frame : said_)
      for (std::size_t j = 0; j < drivers_.size(); ++j)
        if (plant_.bus_of(j) == bus && drivers_[j]->decode({frame, plant_.now()})) break;
  }
  void speak() {
    std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> frames;
    for (std::size_t j = 0; j < drivers_.size(); ++j) {
      const pipeline::JointSetpoint& s = out->setpoints[j];
      const std::size_t count = drivers_[j]->encode(out->drive_enabled[j], {s.q, s.dq, s.kp, s.kd, s.tau}, plant_.now(),
                                                    out->valid_until, frames);
      said_.clear();
      for (std::size_t i = 0; i < count; ++i) plant_.receive(plant_.bus_of(j), frames[i], said_);
      decode(plant_.bus_of(j));
    }
  }
  void answer() {
    CommandHeader& header = chunk_->header;
    header.observation_id = out->observation.id;
    ++header.sequence;
    header.outside_sensed_at = header.dequeued_at = header.infer_started_at = header.infer_ended_at =
        header.published_at = input_.now;
    header.step_period = milliseconds(10);
    header.step_count = 16;
    header.joint_count = static_cast<std::uint16_t>(pose.size());
    header.fields = static_cast<std::uint8_t>(CommandField::q);
    for (std::size_t i = 0; i < chunk_->value_count(); ++i) chunk_->values[i] = pose[i % pose.size()];
  }

  simulation::Plant& plant_;
  pipeline::TickStatePtr state_;
  pipeline::TickInput input_;
  std::vector<std::unique_ptr<drivers::JointDriver>> drivers_;
  std::unique_ptr<CommandChunk> chunk_ = std::make_unique<CommandChunk>();
  simulation::Frames said_;
};

}  // namespace takt::test
