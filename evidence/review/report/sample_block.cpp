// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/report/sample_block.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace takt::evidence {
namespace {

constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

std::vector<SampleColumn> columns_of(std::size_t joints, std::size_t buses, bool has_task_target) {
  std::vector<SampleColumn> columns;
  const auto add = [&](std::string name, bool whole = false) { columns.push_back({std::move(name), whole, {}}); };
  for (const char* name : {"age", "age.spread", "sense", "queue", "infer", "publish", "hold"}) add(name);
  add("interventions", true);
  add("lateness");
  add("work");
  for (std::size_t bus = 0; bus < buses; ++bus) {
    add(fmt::format("bus{}.state", bus), true);
    add(fmt::format("bus{}.errors", bus), true);
  }
  for (std::size_t joint = 0; joint < joints; ++joint) {
    for (const char* what : {"q", "reference"}) {
      add(fmt::format("{}{}", what, joint));
      add(fmt::format("{}{}.spread", what, joint));
    }
    for (const char* what : {"target", "dq", "tau", "temperature", "kp", "kd"}) add(fmt::format("{}{}", what, joint));
  }
  if (has_task_target) {
    for (const char* axis : {"x", "y", "z"}) add(fmt::format("task.{}", axis));
  }
  return columns;
}

std::uint32_t errors_of(const BusHealth& bus) {
  return bus.tx_dropped + bus.rx_dropped + bus.foreign_frames;
}

float ms(Duration duration) {
  return static_cast<float>(duration.milliseconds());
}

}  // namespace

SampleBlockBuilder::SampleBlockBuilder(std::size_t joints, std::size_t buses, bool has_task_target,
                                       std::uint64_t bucket_ticks, Duration period)
    : joints_(joints), buses_(buses), has_task_target_(has_task_target), period_s_(period.seconds()) {
  block_.bucket_ticks = bucket_ticks;
  block_.columns = columns_of(joints, buses, has_task_target);
}

std::size_t SampleBlockBuilder::row_bytes(std::size_t joints, std::size_t buses, bool has_task_target) {
  return sizeof(std::int32_t) + sizeof(std::int16_t) * columns_of(joints, buses, has_task_target).size();
}

void SampleBlockBuilder::Extremes::add(float value) {
  least = empty ? value : std::min(least, value);
  most = empty ? value : std::max(most, value);
  empty = false;
}

void SampleBlockBuilder::Strain::add(const JointRecord& joint) {
  if (std::abs(joint.dq_estimate) >= std::abs(dq)) dq = joint.dq_estimate;
  if (std::abs(joint.feedback.tau) >= std::abs(tau)) tau = joint.feedback.tau;
  temperature = std::max(temperature, joint.feedback.temperature_C);
  kp = joint.kp_command;
  kd = joint.kd_command;
}

void SampleBlockBuilder::tick(const TickRecord& record, double at_s, const TickContext& context) {
  if (last_tick_ != 0 && record.header.tick != last_tick_ + 1) {
    pause();
    put_gap(std::min(last_at_s_ + period_s_, at_s));  // a tick may come early: times never go back
  }
  last_tick_ = record.header.tick;
  last_at_s_ = at_s;
  if (bucket_.ticks == 0) begin(at_s, context);
  take(record);
  if (++bucket_.ticks == block_.bucket_ticks) flush();
}

void SampleBlockBuilder::pause() {
  flush();
  errors_before_.clear();
  last_tick_ = 0;
}

SampleBlock SampleBlockBuilder::finish() {
  flush();
  return std::move(block_);
}

void SampleBlockBuilder::begin(double at_s, const TickContext& context) {
  bucket_ = {};
  bucket_.at_s = at_s;
  bucket_.bus_state.resize(buses_);
  bucket_.bus_errors.resize(buses_);
  bucket_.q.resize(joints_);
  bucket_.reference.resize(joints_);
  bucket_.strain.resize(joints_);
  bucket_.policy_target.assign(context.policy_target.begin(), context.policy_target.end());
  bucket_.task_target = context.task_target;
}

void SampleBlockBuilder::take(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  if (header.seats[Seat::policy].freshness != Freshness::missing) {
    const float age = ms(header.age.total());
    if (bucket_.age.empty || age > bucket_.age.most) bucket_.oldest = header.age;
    bucket_.age.add(age);
  }
  bucket_.lateness_us = std::max(bucket_.lateness_us, 1000 * ms(header.lateness));
  bucket_.work_us = std::max(bucket_.work_us, 1000 * ms(header.last_duration));
  take_buses(header);
  for (std::size_t joint = 0; joint < std::min<std::size_t>(joints_, header.joint_count); ++joint) {
    const JointRecord& each = record.joints[joint];
    bucket_.interventions |= each.interventions;
    bucket_.q[joint].add(each.feedback.q);
    bucket_.reference[joint].add(each.q_reference);
    bucket_.strain[joint].add(each);
  }
}

void SampleBlockBuilder::take_buses(const TickRecordHeader& header) {
  const std::size_t count = std::min<std::size_t>(buses_, header.bus_count);
  const bool counted = errors_before_.size() == buses_;  // counters run since start, not since this tick
  errors_before_.resize(buses_);
  for (std::size_t bus = 0; bus < count; ++bus) {
    const std::uint32_t errors = errors_of(header.buses[bus]);
    bucket_.bus_state[bus] = std::max(bucket_.bus_state[bus], static_cast<unsigned>(header.buses[bus].state));
    if (counted) bucket_.bus_errors[bus] += errors - errors_before_[bus];
    errors_before_[bus] = errors;
  }
}

void SampleBlockBuilder::put(float value) {
  block_.columns[column_++].values.push_back(value);
}

void SampleBlockBuilder::put(const Extremes& extremes) {
  put(extremes.empty ? kNothing : extremes.least);
  put(extremes.empty ? kNothing : extremes.most - extremes.least);
}

void SampleBlockBuilder::put_gap(double at_s) {
  block_.at_s.push_back(at_s);
  for (SampleColumn& column : block_.columns) column.values.push_back(kNothing);
}

void SampleBlockBuilder::flush() {
  if (bucket_.ticks == 0) return;
  column_ = 0;
  block_.at_s.push_back(bucket_.at_s);
  put(bucket_.age);
  const AgeParts& parts = bucket_.oldest;
  for (const Duration part : {parts.sense, parts.queue, parts.infer, parts.publish, parts.hold}) {
    put(bucket_.age.empty ? kNothing : ms(part));
  }
  put(static_cast<float>(bucket_.interventions));
  put(bucket_.lateness_us);
  put(bucket_.work_us);
  for (std::size_t bus = 0; bus < buses_; ++bus) {
    put(static_cast<float>(bucket_.bus_state[bus]));
    put(static_cast<float>(bucket_.bus_errors[bus]));
  }
  for (std::size_t joint = 0; joint < joints_; ++joint) {
    put(bucket_.q[joint]);
    put(bucket_.reference[joint]);
    put(joint < bucket_.policy_target.size() ? bucket_.policy_target[joint] : kNothing);
    const Strain& strain = bucket_.strain[joint];
    for (const float value : {strain.dq, strain.tau, strain.temperature, strain.kp, strain.kd}) put(value);
  }
  for (std::size_t axis = 0; has_task_target_ && axis < 3; ++axis) {
    put(bucket_.task_target ? static_cast<float>((*bucket_.task_target)[axis]) : kNothing);
  }
  bucket_ = {};
}

}  // namespace takt::evidence
