// SPDX-License-Identifier: Apache-2.0
#include "tests/cli/top/sample_picture.hpp"

#include <fmt/format.h>

namespace takt::monitor::top {
namespace {

Quantiles spread(double middle_ms) {
  return {.count = 500,
          .p50 = middle_ms * 1e6,
          .p95 = middle_ms * 1.4e6,
          .p99 = middle_ms * 1.6e6,
          .max = middle_ms * 3.9e6};
}

std::vector<Slice> stalled_history() {
  std::vector<Slice> history;
  for (int slice = 0; slice < 60; ++slice) {
    const bool stall = slice >= 40 && slice < 44;
    history.push_back({.ticks = 250,
                       .mode = slice < 2   ? Mode::standby
                               : slice < 4 ? Mode::arming
                               : stall     ? Mode::degraded
                                           : Mode::tracking,
                       .age = slice < 4 ? Duration{}
                              : stall   ? milliseconds(170)
                                        : milliseconds(30 + slice % 7 * 8),
                       .missed = stall,
                       .marked = slice == 50});
  }
  return history;
}

JointPicture joint_picture(std::size_t number) {
  JointPicture joint{.name = fmt::format("joint_{}", number + 1), .newest = {}};
  const auto offset = static_cast<float>(number) * 0.25F;
  joint.newest.q_estimate = offset - 1.0F;
  joint.newest.q_reference = offset - 0.98F;
  joint.newest.tau_total = 3.0F - offset;
  joint.newest.feedback.temperature_C = 31.0F + offset;
  if (number % 3 == 1) {
    joint.recent = bit(Intervention::velocity_limit);
    joint.ticks[2] = 17;
  }
  return joint;
}

}  // namespace

Picture sample_picture(std::size_t joints, std::size_t buses) {
  Picture picture{.link = Link::live, .robot = "arm6", .in_mode = seconds(4), .entered_by = Cause::contract_restored};
  picture.tick.tick = 15'000;
  picture.tick.mode = Mode::tracking;
  picture.tick.seats[Seat::policy].freshness = Freshness::fresh;
  picture.tick.age = {milliseconds(36), microseconds(240), microseconds(35), microseconds(722), milliseconds(7)};
  picture.tick.seats[Seat::policy].age = picture.tick.age.total();
  picture.tick.window_misses = 4;
  picture.tick.window_ticks = 1000;
  picture.max_age = milliseconds(150);
  picture.epsilon = 0.01;
  picture.confidence = 0.95;
  picture.history = stalled_history();
  picture.age = spread(44.5);
  picture.stages = {spread(35.5), spread(0.24), spread(12.0), spread(0.7)};
  picture.misses = miss_rate(810, 14'000, 0.01, 0.95);
  picture.ticks = 15'000;
  picture.overruns = {14'997, 0, 2, 0, 0, 1};
  picture.skipped_periods = 3;
  picture.arrivals[static_cast<std::size_t>(Arrival::accepted)] = 700;
  picture.tick.command_policy = 0x1122'3344'5566'7788;
  picture.policy_rate = 50;
  picture.planned_rate = 50;
  picture.policy_pid = 4711;
  picture.monitor_pid = 4712;
  picture.tick.recorded_through = 14'900;
  picture.realtime = false;
  for (std::size_t bus = 0; bus < buses; ++bus) {
    picture.buses.push_back({.name = fmt::format("can{}", bus), .health = {}, .load = 0.38, .planned = 0.41});
    if (bus == 1) picture.buses.back().health.tx_dropped = 12;
  }
  for (std::size_t joint = 0; joint < joints; ++joint) picture.joints.push_back(joint_picture(joint));
  return picture;
}

}  // namespace takt::monitor::top
