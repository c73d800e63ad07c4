// SPDX-License-Identifier: Apache-2.0
#include "tests/docs/mode_robot.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>

namespace takt::docs {
namespace {

constexpr int kPatience = 3000;  // ticks

}  // namespace

void Robot::go(int ticks, OperatorRequest request) {
  for (int i = 0; i < ticks; ++i) {
    const bool due = newest_observation != 0 && out->observation_due;
    input.messages[Seat::fallback].mailbox = Arrival::none;
    input.messages[Seat::fallback].command = nullptr;
    if (due && fallback_speaks) {
      *second_ = answer(fallback_wants, config.fallback_policy.hash);
      input.messages[Seat::fallback] = {Arrival::accepted, 0, second_.get(), second_->used_bytes()};
    }
    if (config.imu.present) {
      ++input.imu.sequence;
      input.imu.sensed_at = now;
    }
    if (due && speaks) *first_ = answer(wants, config.policy.hash);
    tick(due && speaks ? first_.get() : nullptr, i == 0 ? request : OperatorRequest::none);
  }
}

void Robot::go_until(Mode wanted) {
  for (int i = 0; i < kPatience && mode() != wanted; ++i) go(1);
}

void Robot::go_until_unusable() {
  for (int i = 0; i < kPatience && is_usable(header().seats[Seat::policy].freshness); ++i) go(1);
}

void Robot::track() {
  go(40);
  go(1, OperatorRequest::arm);
  go(2500);
  wants = 1.2F;
  go(150);
}

void Robot::degrade() {
  track();
  speaks = false;
  go_until(Mode::degraded);
  go(50);
}

void Robot::stop() {
  track();
  go(20, OperatorRequest::stop);
}

CommandChunk Robot::answer(float q, std::uint64_t hash) {
  CommandChunk chunk =
      pipeline::testing::chunk_for(config, newest_observation, published_at[newest_observation], now, ++sequence, q);
  CommandHeader& head = chunk.header;
  head.policy_hash = hash;
  const std::array fields{std::pair{CommandField::q, q}, std::pair{CommandField::kp, kCommandStiffness},
                          std::pair{CommandField::kd, kCommandDamping},
                          std::pair{CommandField::tau_ff, kCommandTorque}};
  for (const auto& [field, value] : fields) head.fields |= static_cast<std::uint8_t>(field);
  for (std::size_t step = 0; step < head.step_count; ++step)
    for (std::size_t joint = 0; joint < config.joint_count; ++joint)
      for (const auto& [field, value] : fields) chunk.values[value_index(head, field, step, joint)] = value;
  return chunk;
}

std::string failed(std::string_view where, std::string_view when, std::string_view why) {
  return fmt::format("mode_page: {}, {}: {}", where, when, why);
}

}  // namespace takt::docs
