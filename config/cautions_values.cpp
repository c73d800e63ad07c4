// SPDX-License-Identifier: Apache-2.0
// Values that a robot file may have and that hurt in silence. Thresholds are of the trade: a person who needs one of
// them knows it, and reads a line.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "config/cautions.hpp"
#include "config/joint_units.hpp"
#include "config/units.hpp"

namespace takt::config {
namespace {

using Lines = std::vector<std::string>;

constexpr double kCoasts_s = 2;         // a joint that is damped for longer before it rests
constexpr double kLeastDamping = 0.05;  // of a joint's position loop, 1: critical
constexpr double kTellsAll = 0.98;      // of the speed that a drive can tell
constexpr double kHeaviest_kg = 500, kLeastGravity = 1, kMostGravity = 20;
constexpr double kFallen = 1.3;          // rad, of a base
constexpr double kSlowestObserver = 10;  // rad/s
constexpr double kLeastInertia = 1e-7;   // kg m^2, of a small servo's rotor
constexpr double kHalf = 0.5;

class Cautions {
 public:
  Cautions(const RobotConfig& robot, Lines& lines) : robot_(robot), lines_(lines) {}

  void say_if(bool holds, std::string line) {
    if (holds) lines_.push_back(std::move(line));
  }
  // One line for all driven joints of which it holds.
  void of_joints(const std::function<bool(const Joint&)>& holds, std::string_view line) {
    constexpr std::size_t kMostNamed = 3;
    std::string names;
    std::size_t count = 0;
    for (const Joint& joint : robot_.joints) {
      if (joint.passive || !holds(joint)) continue;
      if (++count <= kMostNamed) names += (names.empty() ? "" : ", ") + joint.name;
    }
    if (count > kMostNamed) names += fmt::format(" and {} more", count - kMostNamed);
    if (count > 0) lines_.push_back(fmt::format("{}: {}", names, line));
  }

 private:
  const RobotConfig& robot_;
  Lines& lines_;
};

// --- vectors ---

using Matrix = std::array<Vector3, 3>;  // rows

Vector3 plus(const Vector3& a, const Vector3& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double dot(const Vector3& a, const Vector3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Vector3 times(double scale, const Vector3& a) {
  return {scale * a[0], scale * a[1], scale * a[2]};
}
double norm(const Vector3& a) {
  return std::sqrt(dot(a, a));
}
Vector3 turned(const Matrix& turn, const Vector3& a) {
  return {dot(turn[0], a), dot(turn[1], a), dot(turn[2], a)};
}
Matrix product(const Matrix& a, const Matrix& b) {
  Matrix out{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) out[i][j] += a[i][k] * b[k][j];
  return out;
}
// Rodrigues' formula; `axis` of any length but 0.
Matrix turn_about(const Vector3& axis, double angle) {
  const Vector3 n = times(1 / norm(axis), axis);
  const double s = std::sin(angle), c = std::cos(angle), v = 1 - c;
  return {{{c + n[0] * n[0] * v, n[0] * n[1] * v - n[2] * s, n[0] * n[2] * v + n[1] * s},
           {n[1] * n[0] * v + n[2] * s, c + n[1] * n[1] * v, n[1] * n[2] * v - n[0] * s},
           {n[2] * n[0] * v - n[1] * s, n[2] * n[1] * v + n[0] * s, c + n[2] * n[2] * v}}};
}
// Fixed axes x, y, z, as in URDF.
Matrix turn_of(const Vector3& rpy) {
  return product(turn_about({0, 0, 1}, rpy[2]), product(turn_about({0, 1, 0}, rpy[1]), turn_about({1, 0, 0}, rpy[0])));
}

struct Placed {
  Matrix turn;
  Vector3 origin, axis, com;
};

// Nm, of a slide N, that gravity asks of each joint with all joints at home. The links of a model come parents first.
std::vector<double> gravity_at_home(const RobotConfig& robot) {
  const Model& model = *robot.model;
  std::vector<Placed> placed;
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const Link& link = model.links[i];
    const bool on_base = link.parent < 0;
    const Matrix before = on_base ? turn_of({0, 0, 0}) : placed[static_cast<std::size_t>(link.parent)].turn;
    const Vector3 from = on_base ? Vector3{} : placed[static_cast<std::size_t>(link.parent)].origin;
    Placed here{};
    const Matrix frame = product(before, turn_of(link.origin_rpy));
    here.origin = plus(from, turned(before, link.origin_xyz));
    here.axis = turned(frame, times(1 / norm(link.axis), link.axis));
    const bool slides = robot.joints[i].kind == JointKind::slide;
    here.turn = slides ? frame : product(frame, turn_about(link.axis, robot.joints[i].home));
    if (slides) here.origin = plus(here.origin, times(robot.joints[i].home, here.axis));
    here.com = plus(here.origin, turned(here.turn, link.com));
    placed.push_back(here);
  }
  std::vector<double> torques(model.links.size());
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const Vector3 weight = times(model.links[i].mass, model.gravity);
    for (int joint = static_cast<int>(i); joint >= 0; joint = model.links[static_cast<std::size_t>(joint)].parent) {
      const Placed& at = placed[static_cast<std::size_t>(joint)];
      const Vector3 arm = plus(placed[i].com, times(-1, at.origin));
      const bool slides = robot.joints[static_cast<std::size_t>(joint)].kind == JointKind::slide;
      torques[static_cast<std::size_t>(joint)] -= dot(at.axis, slides ? weight : cross(arm, weight));
    }
  }
  return torques;
}

// --- one section of the file each ---

void of_gains(Cautions& cautions) {
  cautions.of_joints([](const Joint& joint) { return joint.kp > 0 && joint.kd == 0; },
                     "gains.kd 0: nothing damps the position loop; begin with 2 sqrt(kp inertia)");
  cautions.of_joints(
      [](const Joint& joint) {
        return joint.kp > 0 && joint.kd > 0 && joint.kd < 2 * kLeastDamping * std::sqrt(joint.kp * joint.inertia);
      },
      "gains.kd damps the position loop by less than 5 % of critical; it rings");
  cautions.of_joints([](const Joint& joint) { return joint.inertia < kLeastInertia && joint.kind == JointKind::hinge; },
                     "inertia below 1e-7 kgm2, less than any motor's: does its link weigh nothing?");
  cautions.of_joints([](const Joint& joint) { return joint.inertia > kCoasts_s * joint.damping; },
                     "gains.damping is so low that a damped joint coasts for seconds; raise it");
  cautions.of_joints([](const Joint& joint) { return joint.observer_bandwidth < kSlowestObserver; },
                     "observer_bandwidth below 10 rad/s: barriers and damping act on a speed of long ago; raise it");
}

void of_limits(const RobotConfig& robot, Cautions& cautions) {
  cautions.of_joints(
      [&](const Joint& joint) { return !robot.imu && joint.limits.acceleration * joint.inertia > joint.limits.torque; },
      "limits.torque cannot give limits.acceleration with this inertia; one of the three is wrong");
  cautions.of_joints(
      [](const Joint& joint) {
        const double told = joint.drive.velocity_range / joint.drive.gear_ratio;
        return has_packed_ranges(joint.drive.protocol) && joint.limits.velocity_hard >= kTellsAll * told;
      },
      "limits.velocity_hard is as fast as its drive can tell: a runaway beyond it is never seen; lower it");
  cautions.of_joints(
      [&](const Joint& joint) {
        return robot.imu ? false : joint.limits.torque_rate * robot.control.period.seconds() >= 2 * joint.limits.torque;
      },
      "limits.torque_rate lets torque reverse within one tick, so it bounds nothing; lower it");
  cautions.of_joints([](const Joint& joint) { return joint.limits.position_margin == 0; },
                     "limits.position_margin 0: the smallest overshoot at a limit is a stop");
  for (const auto& [kind, unit] : {std::pair{JointKind::hinge, "degrees"}, std::pair{JointKind::slide, "mm"}})
    cautions.of_joints(
        [kind](const Joint& joint) {
          return joint.kind == kind && joint.limits.position_margin > joint.limits.q_max - joint.limits.q_min;
        },
        fmt::format("limits.position_margin is wider than limits.position: was it meant in {}?", unit));
  cautions.of_joints(
      [](const Joint& joint) {
        return waives_watchdog(joint.drive) && joint.drive.watchdog_waiver.find(' ') == std::string::npos;
      },
      "drive.watchdog_waiver is a word and no reason: what stops this drive when this computer dies?");
}

void of_model(const RobotConfig& robot, Cautions& cautions) {
  if (!robot.model) return;
  const double gravity = norm(robot.model->gravity);
  cautions.say_if(gravity < kLeastGravity || gravity > kMostGravity,
                  fmt::format("model.gravity is {:.3g} m/s2: stops carry the links as if they weighed {}; write 9.81",
                              gravity, gravity < kLeastGravity ? "nothing" : "that much"));
  cautions.say_if(robot.model->gravity[2] > kHalf * gravity,
                  "model.gravity points along +z, up: right only for a robot that hangs; else write -9.81 m/s2");
  const double mass = std::accumulate(robot.model->links.begin(), robot.model->links.end(), 0.0,
                                      [](double sum, const Link& link) { return sum + link.mass; });
  cautions.say_if(mass > kHeaviest_kg,
                  fmt::format("model.links weigh {:.0f} kg together: are their masses in kg?", mass));
  cautions.say_if(mass <= 0, "model.links weigh nothing: stops carry no gravity; write their masses");
  if (robot.imu || robot.model->links.size() != robot.joints.size()) return;
  const std::vector<double> torques = gravity_at_home(robot);
  std::string asked;
  for (std::size_t j = 0; j < torques.size(); ++j)
    if (const double most = robot.joints[j].limits.torque; std::abs(torques[j]) > most)
      asked += fmt::format("{0}{1:.1f} {4} of {2} (limits.torque {3:.1f} {4})", asked.empty() ? "" : ", ",
                           std::abs(torques[j]), robot.joints[j].name, most, kJointTorque.unit(robot.joints[j].kind));
  cautions.say_if(!asked.empty(), "gravity asks for " + asked + " at home: it falls; correct model.links or the limit");
}

// Whose stop drops what it carries, may have reasons to go on.
bool is_held_by_motion(const RobotConfig& robot) {
  return std::ranges::any_of(robot.joints, &Joint::passive);
}

void of_contract(const RobotConfig& robot, Cautions& cautions) {
  const Freshness& contract = robot.freshness;
  cautions.say_if(contract.epsilon >= kHalf,
                  fmt::format("freshness.epsilon {:.2g}: the contract holds while half of all ticks have no fresh "
                              "command; lower it",
                              contract.epsilon));
  cautions.say_if(contract.max_age > seconds(1), fmt::format("freshness.max_age {}: a command that old still moves the "
                                                             "robot",
                                                             format_duration(contract.max_age)));
  cautions.say_if(contract.recover_after >= seconds(10),
                  fmt::format("freshness.recover_after {}: degraded mode goes on for that long after the policy is "
                              "back: was it meant in ms?",
                              format_duration(contract.recover_after)));
  const Duration resume = robot.degraded.resume_over;
  cautions.say_if(resume.ns > 0 && resume < milliseconds(10),
                  fmt::format("degraded.resume_over {}: velocity limits jump to the full ones: was it meant in s? "
                              "0 ms says it on purpose",
                              format_duration(resume)));
  if (is_held_by_motion(robot)) return;
  cautions.say_if(contract.stop_after > seconds(5),
                  fmt::format("freshness.stop_after {}: the robot goes on for that long without a usable command",
                              format_duration(contract.stop_after)));
  cautions.say_if(contract.clamped_share >= 1,
                  "freshness.clamped_share 1: targets out of range never stop the robot; lower it");
  const double messages = robot.policy ? contract.window.seconds() / robot.policy->period.seconds() : 0;
  cautions.say_if(robot.policy && contract.bad_command_limit > messages,
                  fmt::format("freshness.bad_command_limit {}: no more than {:.0f} commands come in a window, so "
                              "refused ones never stop the robot; lower it",
                              contract.bad_command_limit, messages));
}

void of_watches(const RobotConfig& robot, Cautions& cautions) {
  cautions.say_if(robot.control.late_share >= 1,
                  "control.late_share 1: a loop that is always late never stops the robot; lower it");
  cautions.say_if(robot.feedback.timeout > milliseconds(250),
                  fmt::format("feedback.timeout {}: a joint that says nothing is driven for that long",
                              format_duration(robot.feedback.timeout)));
  cautions.say_if(robot.feedback.jump == 0, "feedback.jump 0: a position that jumps is believed");
  cautions.say_if(robot.feedback.contradiction == 0, "feedback.contradiction 0: a wrong scale or sign is believed");
  cautions.say_if(robot.feedback.frozen_after.ns == 0, "feedback.frozen_after 0: a frozen encoder is believed");
  const BusFaults& faults = robot.bus_faults;
  const std::pair<const char*, double> shares[] = {{"replies_lost", faults.replies_lost},
                                                   {"replies_repeated", faults.replies_repeated},
                                                   {"replies_delayed", faults.replies_delayed},
                                                   {"transmit_drops", faults.transmit_drops},
                                                   {"receive_drops", faults.receive_drops},
                                                   {"foreign_frames", faults.foreign_frames},
                                                   {"babble", faults.babble},
                                                   {"error_passive", faults.error_passive}};
  std::string off;
  for (const auto& [key, share] : shares)
    if (share >= 1) off += fmt::format("{}{}", off.empty() ? "" : ", ", key);
  cautions.say_if(!off.empty(), fmt::format("bus_faults: {} at 1 never stops the robot", off));
  if (!robot.imu) return;
  cautions.say_if(robot.imu->tilt > kFallen, "imu.tilt beyond 75 degrees: the robot has fallen before it is noticed");
}

void of_evidence(const RobotConfig& robot, Cautions& cautions) {
  cautions.say_if(robot.record.recorder == Recorder::optional,
                  "record.recorder optional: the robot moves without evidence when the recorder is gone");
  cautions.say_if(robot.dds && robot.dds->allow_requests && robot.dds->interface != "lo",
                  "dds.allow_requests: every host that reaches the domain may arm the robot; interface: lo, or a "
                  "network of its own");
  cautions.say_if(robot.prometheus && robot.prometheus->address == "0.0.0.0",
                  "prometheus.address 0.0.0.0: every host reads the metrics; write 127.0.0.1 or one address");
}

void of_policy(const RobotConfig& robot, Cautions& cautions) {
  if (!robot.policy) return;
  const Action& action = robot.policy->action;
  if (action.kind != ActionKind::joint_position) return;
  const auto driven_by = [&](std::size_t output) {
    return action.joint_of_output.empty() ? output : action.joint_of_output[output];
  };
  const std::size_t outputs = action.joint_of_output.empty() ? robot.joints.size() : action.joint_of_output.size();
  std::string joints;
  bool slides = false;
  for (std::size_t i = 0; i < outputs && driven_by(i) < robot.joints.size(); ++i) {
    const Joint& joint = robot.joints[driven_by(i)];
    const double scale = action.scale.size() > i ? action.scale[i] : action.scale.empty() ? 1 : action.scale[0];
    if (std::abs(scale) <= 2 * (joint.limits.q_max - joint.limits.q_min)) continue;
    joints += (joints.empty() ? "" : ", ") + joint.name;
    slides |= joint.kind == JointKind::slide;
  }
  cautions.say_if(!joints.empty(), "policy.action.scale of " + joints +
                                       " is more than twice the joint's range: is it in " +
                                       (slides ? "degrees, or mm of a slide?" : "degrees?"));
}

}  // namespace

void add_cautions_of_values(const RobotConfig& robot, std::vector<std::string>& lines) {
  Cautions cautions(robot, lines);
  of_gains(cautions);
  of_limits(robot, cautions);
  of_model(robot, cautions);
  of_contract(robot, cautions);
  of_watches(robot, cautions);
  of_evidence(robot, cautions);
  of_policy(robot, cautions);
}

}  // namespace takt::config
