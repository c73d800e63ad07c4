// SPDX-License-Identifier: Apache-2.0
#include "monitor/judge/content_watch.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <utility>

#include "config/action_target.hpp"

namespace takt::monitor {
namespace {

constexpr std::uint64_t kLively = 20;      // samples that differ, in a row
constexpr std::uint64_t kHeldSamples = 5;  // that do not
constexpr double kFrozenJump = 3;          // usual steps
constexpr double kMirrorJump = 10;
constexpr std::size_t kMirrorings = 3;
constexpr Duration kMirrorWindow = milliseconds(1000);
constexpr float kMoved = 0.05F;  // rad or m
constexpr double kLearning = 0.05;
constexpr std::size_t kReordered = 3;     // joints
constexpr double kLeastReordering = 0.1;  // rad, rad/s or Nm between a joint's targets
constexpr double kReorderJump = 5;        // usual jumps
constexpr double kSlack = 0.02;           // of a match

double distance(std::span<const float> a, std::span<const float> b) {
  return std::sqrt(std::transform_reduce(a.begin(), a.end(), b.begin(), 0.0, std::plus{}, [](float x, float y) {
    return static_cast<double>(x - y) * static_cast<double>(x - y);
  }));
}

double norm(std::span<const float> values) {
  return std::sqrt(std::inner_product(values.begin(), values.end(), values.begin(), 0.0));
}

// Of a circle's two names for one turn.
bool has_an_equal_opposite(std::span<const float> values) {
  const double length = norm(values);
  return (values.size() == 4 && std::abs(length - 1) < 1e-2) ||
         (values.size() == 1 && std::abs(length - std::numbers::pi) < 0.2);
}

bool is_mirrored(std::span<const float> values, std::span<const float> before, double usual_step) {
  const double step = distance(values, before);
  const double apart = std::sqrt(
      std::transform_reduce(values.begin(), values.end(), before.begin(), 0.0, std::plus{},
                            [](float x, float y) { return static_cast<double>(x + y) * static_cast<double>(x + y); }));
  return step > kMirrorJump * usual_step && apart < 0.2 * norm(values) + 3 * usual_step &&
         !has_an_equal_opposite(values);
}

double largest_difference(std::span<const float> a, std::span<const float> b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(static_cast<double>(a[i] - b[i])));
  return largest;
}

// How many joints took one another's targets; 0: they did not. Sorted values are the nearest match of all orders.
std::uint64_t reordered_joints(const std::vector<float>& asked, const std::vector<float>& before, double usual_jump) {
  const double jump = largest_difference(asked, before);
  if (jump < kLeastReordering || jump < kReorderJump * usual_jump) return 0;
  std::vector<float> now = asked, then = before;
  std::ranges::sort(now);
  std::ranges::sort(then);
  const double apart = largest_difference(now, then);
  const double sums =
      std::abs(std::accumulate(now.begin(), now.end(), 0.0) - std::accumulate(then.begin(), then.end(), 0.0));
  if (apart > jump / 5 || apart > 5 * usual_jump + kSlack || sums > jump / 2) return 0;
  std::uint64_t moved = 0;
  for (std::size_t joint = 0; joint < asked.size(); ++joint)
    moved += std::abs(asked[joint] - before[joint]) > 2 * apart + kSlack ? 1U : 0U;
  return moved >= kReordered ? moved : 0;
}

std::array<float, 10> values_of(const ImuSample& imu) {
  std::array<float, 10> values{};
  auto* const behind = std::ranges::copy(imu.rotation, values.begin()).out;
  std::ranges::copy(imu.acceleration, std::ranges::copy(imu.angular_velocity, behind).out);
  return values;
}

void learn(double& usual, double step) {
  usual = usual == 0 ? step : usual + kLearning * (step - usual);
}

bool relies_on_policy(Mode mode) {
  return mode == Mode::tracking || mode == Mode::degraded;
}

}  // namespace

WatchedContent watched_content_of(const config::RobotConfig& robot) {
  WatchedContent watched;
  for (const config::Sensor& sensor : robot.sensors)
    watched.sensors.push_back({.name = sensor.name, .is_watched = !sensor.command});
  if (robot.imu) {
    const auto imu = std::ranges::find(robot.sensors, robot.imu->sensor, &config::Sensor::name);
    if (imu != robot.sensors.end()) watched.imu = static_cast<std::size_t>(imu - robot.sensors.begin());
  }
  if (robot.policy) watched.field = config::target_of(robot.policy->action.kind).field;
  return watched;
}

void WrongContent::take(const WrongContent& later) {
  frozen_samples += later.frozen_samples;
  mirrored_samples += later.mirrored_samples;
  if (later.frozen_samples + later.mirrored_samples != 0) sensor = later.sensor;
  if (later.reordered_joints != 0) reordered_joints = later.reordered_joints;
  is_trouble = is_trouble || later.is_trouble;
}

ContentWatch::ContentWatch(const WatchedContent& watched) : watched_(watched), sensors_(watched.sensors.size()) {}

ContentWatch::Sensor* ContentWatch::fresh(std::size_t sensor, std::uint64_t sequence, MonoTime sensed_at) {
  if (sensor >= sensors_.size() || !watched_.sensors[sensor].is_watched) return nullptr;
  Sensor& one = sensors_[sensor];
  if (one.sequence != 0 && sensed_at <= one.sensed_at) return nullptr;
  if (sequence < one.sequence) one = {};  // another process of it
  if (sequence == one.sequence) return nullptr;
  one.sequence = sequence;
  one.sensed_at = sensed_at;
  return &one;
}

void ContentWatch::note_mirrored(std::size_t sensor) {
  Sensor& one = sensors_[sensor];
  one.mirrored.push_back(one.sensed_at);
  std::erase_if(one.mirrored, [&](MonoTime at) { return one.sensed_at - at > kMirrorWindow; });
  ++found_.mirrored_samples;
  found_.sensor = sensor;
  found_.is_trouble = found_.is_trouble || one.mirrored.size() >= kMirrorings;
}

void ContentWatch::note_frozen(std::size_t sensor, std::uint64_t samples) {
  found_.frozen_samples += samples;
  found_.sensor = sensor;
  found_.is_trouble = true;
}

void ContentWatch::note_step(std::size_t sensor, std::span<const float> values) {
  Sensor& one = sensors_[sensor];
  const double step = distance(values, one.values);
  const bool was_lively = one.changes >= kLively, is_imu = sensor == watched_.imu;
  if (std::ranges::equal(values, one.values)) {
    ++one.same;
    if (was_lively && is_imu && one.same >= kHeldSamples)
      note_frozen(sensor, one.same == kHeldSamples ? kHeldSamples : 1);
    return;
  }
  const bool stood = one.same >= kHeldSamples;
  if (was_lively && !is_imu && stood && step > kFrozenJump * one.usual_step)
    note_frozen(sensor, one.same);
  else if (was_lively && is_mirrored(values, one.values, one.usual_step))
    note_mirrored(sensor);
  else if (!stood)
    learn(one.usual_step, step / static_cast<double>(one.same + 1));
  one.changes = one.same == 0 || was_lively ? one.changes + 1 : 0;
  one.same = 0;
}

void ContentWatch::sample(std::size_t sensor, std::uint64_t sequence, MonoTime sensed_at,
                          std::span<const float> values) {
  if (sensor != watched_.imu) note_sample(sensor, sequence, sensed_at, values);
}

void ContentWatch::note_sample(std::size_t sensor, std::uint64_t sequence, MonoTime sensed_at,
                               std::span<const float> values) {
  Sensor* const one = fresh(sensor, sequence, sensed_at);
  if (one == nullptr) return;
  if (one->values.size() == values.size()) note_step(sensor, values);
  one->values.assign(values.begin(), values.end());
}

bool ContentWatch::has_moved_since(const Sensor& sensor) const {
  return sensor.q.size() == q_.size() && !q_.empty() && largest_difference(sensor.q, q_) > kMoved;
}

void ContentWatch::image(std::size_t sensor, std::uint64_t sequence, MonoTime sensed_at, std::string_view content) {
  Sensor* const one = fresh(sensor, sequence, sensed_at);
  if (one == nullptr || content.empty()) return;
  if (one->image == content) {
    ++one->same;
    if (one->changes >= kLively && one->same >= kHeldSamples && has_moved_since(*one))
      note_frozen(sensor, one->same == kHeldSamples ? kHeldSamples : 1);
    return;
  }
  one->changes = one->same == 0 || one->changes >= kLively ? one->changes + 1 : 0;
  one->same = 0;
  one->image = content;
  one->q = q_;
}

void ContentWatch::command(const CommandHeader& header, std::span<const float> values) {
  asked_.clear();
  const bool has_field = (header.fields & static_cast<unsigned>(watched_.field)) != 0 && header.step_count != 0;
  const std::size_t first = has_field ? value_index(header, watched_.field, 0, 0) : values.size();
  if (first + header.joint_count > values.size()) return;
  const auto targets = values.subspan(first, header.joint_count);
  if (std::ranges::all_of(targets, [](float value) { return std::isfinite(value); }))
    asked_.assign(targets.begin(), targets.end());
}

WrongContent ContentWatch::tick(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  if (watched_.imu && header.imu.sequence != 0)
    note_sample(*watched_.imu, header.imu.sequence, header.imu.sensed_at, values_of(header.imu));
  const bool relies = relies_on_policy(header.mode);
  if (relies && (!relied_ || header.seats[Seat::policy].session != session_)) {
    before_ = watched_.field == CommandField::q ? q_ : std::vector<float>{};
    before_is_measured_ = true;
    usual_jump_ = 0;
    reordered_ = 0;
  }
  if (relies && header.seats[Seat::policy].arrival == Arrival::accepted && !asked_.empty()) {
    if (before_.size() == asked_.size()) {
      const std::uint64_t reordered = reordered_joints(asked_, before_, usual_jump_);
      const std::uint64_t stood = reordered_;
      if (reordered != 0)
        reordered_ = stood == 0 ? reordered : 0;
      else if (!before_is_measured_)
        learn(usual_jump_, largest_difference(asked_, before_));
      found_.reordered_joints = std::max(stood, reordered_);
      found_.is_trouble = found_.is_trouble || found_.reordered_joints != 0;
    }
    before_ = asked_;
    before_is_measured_ = false;
  }
  asked_.clear();
  relied_ = relies;
  session_ = header.seats[Seat::policy].session;
  q_.resize(header.joint_count);
  for (std::size_t joint = 0; joint < q_.size(); ++joint) q_[joint] = record.joints[joint].feedback.q;
  return std::exchange(found_, {});
}

}  // namespace takt::monitor
