// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/perturbation.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace takt::evidence {
namespace {

constexpr std::array<PerturbationKind, kTroubleCount> kKinds{{
    {Trouble::none, "none", "nothing: the nominal rollout", "", 0, 0, 0},
    {Trouble::sensor_burst, "sensor_burst", "samples are held back and delivered together, once per dose", "ms", 120, 1,
     1000},
    {Trouble::sensor_dropout, "sensor_dropout", "each sample is lost with this probability", "share", 0.7, 0, 1},
    {Trouble::camera_freeze, "camera_freeze",
     "for this long out of every second samples repeat an old value under fresh stamps", "ms", 500, 1, 1000},
    {Trouble::sensor_lies, "sensor_lies",
     "each sample says the opposite with this probability: values negated, images in negative", "share", 0.3, 0, 1},
    {Trouble::estimator_delay, "estimator_delay",
     "replies of the drives are decoded this much later, stamped when they arrived", "ms", 10, 0, 1000},
    {Trouble::inference_stall, "inference_stall", "once per second one inference takes this much longer", "ms", 400, 1,
     10'000},
    {Trouble::inference_mean_shift, "inference_mean_shift", "every inference takes this many times as long", "factor",
     6, 0.01, 1000},
    {Trouble::gpu_contention, "gpu_contention",
     "the inference device is shared with this many other loads: an inference takes, drawn evenly, from 1 to 1 + 2 "
     "dose "
     "times as long",
     "loads", 8, 1, 64},
    {Trouble::queue_growth, "queue_growth",
     "observations queue up instead of replacing one another, and once per second this many callbacks of 2 ms each "
     "queue up before them",
     "callbacks", 150, 1, 10'000},
    {Trouble::publish_delay, "publish_delay", "commands arrive this much later", "ms", 100, 0, 10'000},
    {Trouble::policy_crash, "policy_crash",
     "the policy process dies at the start of the window; another one takes its place after this long", "ms", 2000, 1,
     600'000},
    {Trouble::policy_freeze, "policy_freeze", "the policy process stands still for this long, then goes on", "ms", 400,
     1, 600'000},
    {Trouble::bad_actions_nan, "bad_actions_nan", "a command holds a NaN with this probability", "share", 0.5, 0, 1},
    {Trouble::bad_actions_range, "bad_actions_range",
     "a command asks one joint for 10 rad (a slide for 10 m) more with this probability", "share", 0.5, 0, 1},
    {Trouble::wrong_joint_order, "wrong_joint_order", "the policy's outputs go to joints this many places further on",
     "places", 1, 1, 63},
    {Trouble::scheduler_preemption, "scheduler_preemption",
     "ten times per second, at random, the control thread wakes this much later and loses periods", "ms", 8, 0.1, 1000},
    {Trouble::cpu_hog, "cpu_hog",
     "every 100 ms, from an instant drawn once, a process above the control thread's priority has its core for this "
     "long",
     "ms", 20, 0.1, 99},
    {Trouble::rt_throttling, "rt_throttling",
     "the real-time budget of the control thread's core is used up: the kernel stops the thread for this long out of "
     "every second, from an instant drawn once",
     "ms", 50, 1, 999},
    {Trouble::can_loss, "can_loss", "each frame, in either direction, is lost with this probability", "share", 0.1, 0,
     1},
    {Trouble::can_delay, "can_delay", "replies arrive, and are stamped, this much later", "ms", 4, 0, 1000},
    {Trouble::bus_off, "bus_off", "the first bus carries nothing for this long, and its controller says bus-off", "ms",
     100, 1, 600'000},
    {Trouble::feedback_frozen, "feedback_frozen",
     "of one joint, drawn once, the drive says the position that it had; the rest is true", "times", 1, 1, 1},
    {Trouble::feedback_repeated, "feedback_repeated",
     "of one joint, drawn once, the drive says the position, velocity and torque that it had", "times", 1, 1, 1},
    {Trouble::feedback_reversed, "feedback_reversed",
     "of one joint, drawn once, the position that the drive says goes the other way", "times", 1, 1, 1},
    {Trouble::feedback_jump, "feedback_jump",
     "of one joint, drawn once, the position that the drive says is off by this (6.2832: an encoder that wraps)", "rad",
     0.3, 0.001, 100},
    {Trouble::feedback_scale, "feedback_scale",
     "of one joint, drawn once, the position that the drive says goes this many times as far", "factor", 3, 0.01, 100},
    {Trouble::push, "push", "a force in a random direction at the tool, for 100 ms of every second", "N", 30, 0,
     10'000},
    {Trouble::payload, "payload", "a point mass sits at the tool", "kg", 1, 0, 1000},
    {Trouble::friction, "friction", "joint friction is multiplied", "factor", 4, 0.01, 1000},
    {Trouble::operator_stop, "operator_stop", "a person stops the robot at the start of the window", "times", 1, 1, 1},
}};

constexpr bool rows_are_in_order() {
  for (std::size_t i = 0; i < kKinds.size(); ++i)
    if (static_cast<std::size_t>(kKinds[i].trouble) != i) return false;
  return true;
}
static_assert(rows_are_in_order());

Duration milliseconds_of(double dose) {
  return {std::llround(dose * 1e6)};
}

bool lasts_as_long_as_its_dose(Trouble trouble) {
  return trouble == Trouble::policy_crash || trouble == Trouble::policy_freeze || trouble == Trouble::bus_off;
}

}  // namespace

std::span<const PerturbationKind> perturbation_kinds() {
  return kKinds;
}

const PerturbationKind* find_perturbation(std::string_view name) {
  const auto* const found = std::ranges::find(kKinds, name, &PerturbationKind::name);
  return found == kKinds.end() ? nullptr : found;
}

Disturbance::Disturbance(const Perturbation& perturbation, MonoTime rollout_started) {
  add(perturbation, rollout_started);
  for (const Perturbation& besides : perturbation.with) add(besides, rollout_started);
}

void Disturbance::add(const Perturbation& perturbation, MonoTime rollout_started) {
  const MonoTime begins = rollout_started + perturbation.from;
  const bool by_dose = lasts_as_long_as_its_dose(perturbation.trouble);
  const MonoTime ends = begins + (by_dose ? milliseconds_of(perturbation.dose) : perturbation.length);
  strikes_[static_cast<std::size_t>(perturbation.trouble)] = {true, perturbation.dose, begins, ends, perturbation.body};
  begins_ = begins_.is_set() ? std::min(begins_, begins) : begins;
  ends_ = std::max(ends_, ends);
}

Duration Disturbance::delay(Trouble trouble, MonoTime at) const {
  const double ms = dose(trouble, at);
  return ms == 0 ? Duration{} : milliseconds_of(ms);
}

std::int64_t Disturbance::turn(Trouble trouble, MonoTime at) const {
  if (dose(trouble, at) == 0) return 0;
  return (at - begins(trouble)).ns / kRepeat.ns + 1;
}

bool Disturbance::in_first_part(Trouble trouble, MonoTime at) const {
  const std::int64_t turn_now = turn(trouble, at);
  return turn_now != 0 && at - begins(trouble) - kRepeat * (turn_now - 1) < delay(trouble, at);
}

}  // namespace takt::evidence
