// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/rollout.hpp"

#include <algorithm>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

#include "evidence/rollout/arm_world.hpp"
#include "evidence/rollout/cart_pole_world.hpp"
#include "evidence/rollout/operator.hpp"
#include "evidence/rollout/outside_world.hpp"
#include "evidence/rollout/plain_loop.hpp"
#include "evidence/rollout/real_perturbation.hpp"
#include "evidence/rollout/repeat_last.hpp"
#include "evidence/rollout/rollout_measures.hpp"
#include "evidence/rollout/sensor_feed.hpp"
#include "evidence/rollout/virtual_bus.hpp"
#include "evidence/rollout/wake_ups.hpp"
#include "executive/contract/imu_of_sample.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::evidence {
namespace {

constexpr MonoTime kStart{1'000'000'000'000};  // some 17 minutes after boot
constexpr const char* kNoSimulation = ": no `simulation`: a world needs its step";
constexpr Duration kTickWork = microseconds(25);
constexpr std::uint64_t kImuLossStream = 211;
constexpr Duration kSettle = seconds(2);  // from power-on to the task: arming, and the way to it

std::expected<std::unique_ptr<World>, std::string> make_world(const RolloutSetup& setup, const Disturbance& disturbance,
                                                              std::unique_ptr<simulation::OutsideMechanics> outside) {
  switch (setup.task) {
    case Task::arm_tracking:
      return ArmWorld::make(setup.robot, disturbance, kStart, setup.seed, std::move(outside));
    case Task::cart_pole_balance:
      return CartPoleWorld::make(setup.robot, disturbance, kStart, setup.seed, std::move(outside));
    case Task::base_velocity:
      return BaseVelocityWorld::make(setup.robot, setup.base_velocity, disturbance, kStart, setup.seed,
                                     std::move(outside));
    case Task::world:
      return OutsideWorld::make(setup.robot, disturbance, kStart, setup.seed, std::move(outside));
  }
  return std::unexpected("this build does not know the task");
}

std::size_t index_of(const config::RobotConfig& robot, const std::string& sensor) {
  return static_cast<std::size_t>(std::ranges::find(robot.sensors, sensor, &config::Sensor::name) -
                                  robot.sensors.begin());
}

// Sensors of images that the policy sees and no process plays. Empty: none.
std::string blindness(const config::RobotConfig& robot, const simulation::OutsideMechanics* outside) {
  for (const std::size_t sensor : policy_host::sensors_in_use(robot)) {
    if (!robot.sensors[sensor].image || (outside != nullptr && outside->films(sensor))) continue;
    const std::string& name = robot.sensors[sensor].name;
    return robot.file + ": its policy sees images of " + name + ", which " +
           (outside == nullptr
                ? "are not rendered in virtual time: give it a world that does (--world), or try it in real "
                  "time, with `takt run`"
                : "world " + outside->link().world() + " does not give");
  }
  return {};
}

Score score_of(const RolloutSetup& setup, const World& world) {
  const simulation::OutsideMechanics* const outside = setup.task == Task::world ? world.outside() : nullptr;
  return {.settled = kStart + kSettle,
          .begins = kStart + (setup.duration - setup.scored),
          .bound_m = setup.bound_m,
          .has_to_be_done = outside != nullptr && outside->link().gives(TAKT_WORLD_DONE)};
}

pipeline::TickConfig config_of(const RolloutSetup& setup) {
  pipeline::TickConfig config = setup::tick_config_of(setup.robot, setup.policy_hash,
                                                      setup.fallback != nullptr ? setup.fallback->policy_hash : 0);
  apply(setup.method, config);
  return config;
}

class Rollout {
 public:
  Rollout(const RolloutSetup& setup, const Disturbance& disturbance, World& world, VirtualBus bus)
      : setup_(setup),
        config_(config_of(setup)),
        state_(pipeline::make_tick_state(config_)),
        world_(world),
        sensor_(index_of(setup.robot, world.sensor())),
        disturbance_(disturbance),
        bus_(std::move(bus)),
        liar_(lying_joint(setup.robot, setup.seed)),
        imu_(disturbance, setup.seed, kImuLossStream),
        policy_(setup.robot, setup.policy_hash, setup.policy, setup.timing, disturbance, disturbance, setup.seed),
        repeats_(setup.repeat_last || repeats_last(setup.method)),
        repeater_(config_.interpolation == pipeline::Interpolation::hold),
        operator_(setup.rearm_after),
        wakes_(disturbance, config_.period, setup.seed),
        measures_(score_of(setup, world), disturbance, setup.robot) {
    input_.last_duration = kTickWork;
    policy_.on_shown(setup.on_shown);
    if (setup.method.built_in == BuiltIn::plain) plain_ = std::make_unique<PlainLoop>(config_);
    if (setup.fallback != nullptr)
      fallback_.emplace(setup.fallback->robot, setup.fallback->policy_hash, *setup.fallback->policy, setup.timing,
                        untroubled_, disturbance, setup.seed);
  }

  void run(RolloutRow& row) {
    MonoTime end = kStart + setup_.duration;
    for (MonoTime due = kStart; due < end;) {
      const MonoTime woken = wakes_.after(due);
      step_plant(woken);
      if (world_.ended() != nullptr) {
        measures_.world_ended(world_.ended()->kind);
        break;
      }
      tick(woken, woken - due);
      if (const auto aftermath = world_.ends_after_loss(); aftermath && world_.is_lost() && !lost_at_.is_set()) {
        lost_at_ = woken;
        end = std::min(end, woken + *aftermath);
      }
      due = next_due(due, woken + kTickWork);
    }
    measures_.finish(setup_.robot.freshness.epsilon, setup_.robot.freshness.confidence, row);
  }

 private:
  static simulation::FeedbackFaults feedback_faults(const Disturbance& disturbance, MonoTime at) {
    simulation::FeedbackFaults lies;
    lies.frozen_position = disturbance.dose(Trouble::feedback_frozen, at) > 0;
    lies.freeze = disturbance.dose(Trouble::feedback_repeated, at) > 0;
    lies.reversed = disturbance.dose(Trouble::feedback_reversed, at) > 0;
    lies.offset = disturbance.dose(Trouble::feedback_jump, at);
    if (const double scale = disturbance.dose(Trouble::feedback_scale, at); scale > 0) lies.scale = scale;
    return lies;
  }

  // As runtime/pace: instants of the grid that have passed are skipped.
  MonoTime next_due(MonoTime due, MonoTime ended) {
    const MonoTime next = due + config_.period;
    input_.overrun_cause = OverrunCause::none;
    if (ended <= next) return next;
    const std::int64_t missed = ((ended - next).ns + config_.period.ns - 1) / config_.period.ns;
    input_.overrun_cause = OverrunCause::preempted;
    input_.skipped_periods += static_cast<std::uint64_t>(missed);
    return next + config_.period * missed;
  }

  void step_plant(MonoTime until) {
    const Duration step = world_.plant().step_length();
    for (; plant_at_ + step <= until && world_.ended() == nullptr; plant_at_ = plant_at_ + step) {
      if (const simulation::FeedbackFaults lies = feedback_faults(disturbance_, plant_at_); lies != lies_) {
        lies_ = lies;
        world_.plant().set_line(liar_, {.feedback = lies});
      }
      world_.plant().step();
    }
  }

  void tick(MonoTime now, Duration late) {
    ++input_.tick;
    input_.recorded_through = input_.tick;  // nothing here is lost
    input_.torque_output = TorqueOutputState::as_told;
    input_.now = now;
    input_.lateness = late;
    if (const auto sample = world_.sample(now)) sense(sensor_, {*sample});
    if (simulation::OutsideMechanics* const outside = world_.outside())
      for (const auto& [sensor, sensed] : outside->images(now)) sense(sensor, sensed);
    if (const auto sample = world_.imu(now)) imu_.take({*sample});
    input_.imu = imu_of(imu_.newest(now).sample);
    policy_.run_until(now);
    if (fallback_) fallback_->run_until(now);
    bus_.receive(world_.plant(), now, input_);
    read_commands(now);
    input_.operator_request = asked(now);
    if (plain_)
      plain_->tick(input_, *output_);
    else
      pipeline::control_tick(*state_, input_, config_, *output_);
    bus_.send(world_.plant(), now, *output_);
    if (output_->observation_due) publish(output_->observation);
    TruthOfTick truth{.error_m = world_.error_m(now)};
    truth.violated = world_.is_violated();
    truth.lost = world_.is_lost();
    measures_.tick(output_->record, truth);
    if (setup_.on_tick) setup_.on_tick(output_->record);
  }

  void sense(std::size_t sensor, const simulation::Sensed& sensed) {
    policy_.sense(sensor, sensed);
    if (fallback_) fallback_->sense(sensor, sensed);
  }

  // A panel's person stops the robot once; what is asked else is the operator's affair.
  OperatorRequest asked(MonoTime now) {
    if (input_.tick == 1) return OperatorRequest::none;
    if (!is_stopped_ && disturbance_.dose(Trouble::operator_stop, now) > 0) {
      is_stopped_ = true;
      return OperatorRequest::stop;
    }
    return operator_.next(output_->record, config_);
  }

  void publish(const Observation& observation) {
    policy_.observe(observation);
    if (fallback_) fallback_->observe(observation);
    if (repeats_) repeater_.observe(observation);
  }

  static pipeline::PolicyMessage message_of(const CommandChunk* chunk, std::uint8_t session) {
    if (chunk == nullptr) return {.session = session};
    return {.mailbox = Arrival::accepted, .session = session, .command = chunk, .bytes = chunk->used_bytes()};
  }

  void read_commands(MonoTime now) {
    const ArrivedCommand* const arrived = policy_.read(now);
    if (repeats_ && arrived != nullptr) repeater_.pass(*arrived);
    const CommandChunk* const chunk = arrived != nullptr ? arrived->chunk.get() : nullptr;
    input_.messages[Seat::policy] = repeats_ && chunk == nullptr ? message_of(repeater_.read(), 1)
                                                                 : message_of(chunk, repeats_ ? 1 : policy_.session());
    if (input_.messages[Seat::policy].command != nullptr && setup_.on_command)
      setup_.on_command(*input_.messages[Seat::policy].command);
    if (!fallback_) return;
    const ArrivedCommand* const of_fallback = fallback_->read(now);
    input_.messages[Seat::fallback] =
        message_of(of_fallback != nullptr ? of_fallback->chunk.get() : nullptr, fallback_->session());
  }

  const RolloutSetup& setup_;
  pipeline::TickConfig config_;
  pipeline::TickStatePtr state_;
  std::unique_ptr<PlainLoop> plain_;  // decides instead of control_tick; null: control_tick does
  World& world_;
  std::size_t sensor_;  // that world_.sample() is of; none: as many as there are
  const Disturbance& disturbance_;
  VirtualBus bus_;
  std::size_t liar_;                 // the joint whose drive may say what is not so
  simulation::FeedbackFaults lies_;  // that it says now
  SensorFeed imu_;
  Disturbance untroubled_{{}, kStart};
  VirtualPolicy policy_;
  std::optional<VirtualPolicy> fallback_;
  bool repeats_;
  RepeatLast repeater_;
  Operator operator_;
  WakeUps wakes_;
  RolloutMeasures measures_;
  pipeline::TickInput input_;
  std::unique_ptr<pipeline::TickOutput> output_ = std::make_unique<pipeline::TickOutput>();
  MonoTime plant_at_ = kStart, lost_at_;
  bool is_stopped_ = false;
};

}  // namespace

Task task_of(const config::RobotConfig& robot) {
  if (!robot.simulation) return Task::arm_tracking;
  if (robot.simulation->cart_pole) return Task::cart_pole_balance;
  if (robot.simulation->mujoco && robot.imu && takes_velocity_command(robot)) return Task::base_velocity;
  return robot.simulation->camera_sensor.empty() ? Task::world : Task::arm_tracking;
}

std::expected<Task, std::string> task_of(const config::RobotConfig& robot, WorldProcess* world) {
  if (world == nullptr) return task_of(robot);
  if (!robot.simulation) return std::unexpected(robot.file + kNoSimulation);
  const auto facts = world->ask(robot);
  if (!facts) return std::unexpected(facts.error().sentence);
  return (facts->gives & (TAKT_WORLD_ERROR | TAKT_WORLD_DONE)) != 0 ? Task::world : task_of(robot);
}

namespace {

// Set up wrongly, so that every other rollout would end as this one.
bool is_for_good(simulation::WorldEndKind kind) {
  return kind == simulation::WorldEndKind::absent || kind == simulation::WorldEndKind::refused;
}

void tell_end(const RolloutSetup& setup, const simulation::WorldEnd& end) {
  if (setup.on_world_end) setup.on_world_end(end);
  // What has spoilt one simulation does not play the next.
  if (end.kind != simulation::WorldEndKind::succeeded && end.kind != simulation::WorldEndKind::failed)
    setup.world->give_up();
}

// Ended before the first tick.
void fill_without_ticks(const RolloutSetup& setup, const Disturbance& disturbance, const simulation::WorldEnd& end,
                        RolloutRow& row) {
  RolloutMeasures measures({.settled = kStart, .begins = kStart, .bound_m = setup.bound_m}, disturbance, setup.robot);
  measures.world_ended(end.kind);
  measures.finish(setup.robot.freshness.epsilon, setup.robot.freshness.confidence, row);
}

}  // namespace

std::expected<void, std::string> run_rollout(const RolloutSetup& setup, RolloutRow& row) {
  const Disturbance disturbance(setup.perturbation, kStart);
  if (config::fallback_policy_of(setup.robot) != nullptr && setup.fallback == nullptr)
    return std::unexpected(setup.robot.file + ": its fallback policy was not given to the rollout");
  std::unique_ptr<simulation::OutsideMechanics> outside;
  if (setup.world != nullptr) {
    if (!setup.robot.simulation) return std::unexpected(setup.robot.file + kNoSimulation);
    auto begun = setup.world->begin(setup.robot, setup.seed);
    if (!begun) {
      tell_end(setup, begun.error());
      if (is_for_good(begun.error().kind)) return std::unexpected(begun.error().sentence);
      fill_without_ticks(setup, disturbance, begun.error(), row);
      return {};
    }
    outside = std::move(*begun);
  }
  if (const std::string why = blindness(setup.robot, outside.get()); !why.empty()) return std::unexpected(why);
  auto world = make_world(setup, disturbance, std::move(outside));
  if (!world) return std::unexpected(world.error());
  const bool guarded = setup.method.built_in != BuiltIn::plain;
  auto bus = VirtualBus::make(setup.robot, disturbance, setup.seed, guarded);
  if (!bus) return std::unexpected(bus.error());
  if (setup.policy.network != nullptr) setup.policy.network->reset();
  if (setup.policy.program != nullptr)
    if (auto begun = setup.policy.program->begin(setup.robot, setup.policy_hash); !begun) return begun;
  if (setup.fallback != nullptr) setup.fallback->policy->reset();
  Rollout rollout(setup, disturbance, **world, std::move(*bus));
  try {
    rollout.run(row);
  } catch (const std::runtime_error& diverged) {
    return std::unexpected(setup.robot.file + ": " + diverged.what());
  }
  if (const simulation::WorldEnd* const end = (*world)->ended()) tell_end(setup, *end);
  if (setup.policy.program != nullptr && !setup.policy.program->silence().empty() && setup.on_silence)
    setup.on_silence(setup.policy.program->silence());
  return {};
}

}  // namespace takt::evidence
