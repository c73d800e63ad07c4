// SPDX-License-Identifier: Apache-2.0
#include "config/deploy_import.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>

#include "config/joint_units.hpp"
#include "config/reader.hpp"
#include "config/robot_text.hpp"
#include "config/units.hpp"
#include "executive/contract/joints.hpp"

namespace takt::config {
namespace {

// A policy of one step a period: how many periods its target may be played before the next one must have come.
constexpr std::int64_t kTargetLastsPeriods = 3;

constexpr double kHalfTurn = 3.14159;

std::string joint_name(const ImportOptions& options, std::size_t index) {
  if (options.joint_names.empty()) return fmt::format("joint_{:02}", index);
  return joint_names_of({options.joint_names[index]}).front();
}

constexpr const char* kUnfilled = "FILL_IN";
constexpr double kMadeUpTorque = 200;                             // Nm
constexpr double kMadeUpVelocity = 40, kMadeUpHardVelocity = 55;  // rad/s
constexpr double kMadeUpAcceleration = 20'000;                    // rad/s2
constexpr double kMadeUpForce = 100, kMadeUpWay = 1;              // N; m to both sides
constexpr double kFullTorqueIn_s = 0.02;
constexpr double kTorqueThatMoves = 0.9;  // of the whole
constexpr double kBrakesWithin = 0.25;    // of the way between the limits

// Of a made-up drive: what its packed fields span, and a pinion of 10 mm, or as large as the way asks for.
constexpr double kDriveReach = 12.5, kDriveSpeed = 60;  // rad, rad/s
constexpr double kMadeUpGear = 100;                     // rad/m
constexpr double kSlideMargin = 0.01;                   // m
constexpr double kRoom = 1.01;                          // of ranges over what is asked of them

std::string one_or_list(const std::vector<double>& values) {
  if (values.empty()) return kUnfilled;
  const bool equal = std::ranges::all_of(values, [&](double value) { return value == values.front(); });
  return equal ? fmt::format("{}", values.front()) : fmt::format("[{}]", fmt::join(values, ", "));
}

// The deploy file's name of a term, in Takt's words; empty: an outside sensor.
std::string_view takt_term(std::string_view name) {
  if (name == "joint_pos_rel") return "joint_position_relative";
  if (name == "joint_pos") return "joint_position";
  if (name == "joint_vel_rel" || name == "joint_vel") return "joint_velocity";
  if (name == "last_action" || name == "actions") return "last_action";
  if (name == "base_ang_vel") return "base_angular_velocity";
  if (name == "projected_gravity") return "projected_gravity";
  if (name == "gait_phase") return "gait_phase";
  return {};
}

bool is_command(const DeployFile& deploy, const DeployTerm& term) {
  const bool fits = term.is_unscaled || deploy.command_ranges.size() == term.scale.size();
  return term.name == "velocity_commands" && !term.is_only_named && !deploy.command_ranges.empty() && fits;
}

std::string duration_or_unfilled(Duration duration) {
  return duration.ns == 0 ? kUnfilled : format_duration(duration);
}

// A person's last word ages the policy's commands until it times out: well before they are too old to be played.
Duration command_lasts(const DeployFile& deploy) {
  return {deploy.step_dt.ns * kTargetLastsPeriods / 2};
}

// Of one joint: empty lists and values that are no numbers say nothing.
std::string listed_or_unfilled(const std::vector<double>& list, std::size_t joint, std::string_view unit) {
  if (joint >= list.size() || std::isnan(list[joint])) return kUnfilled;
  return fmt::format("{} {}", list[joint], unit);
}

std::string or_unfilled(const std::optional<double>& value, std::string_view unit) {
  return value ? fmt::format("{:.6g} {}", *value, unit) : kUnfilled;
}

// --- a simulated robot ---

// An MIT command and its reply are at most 135 bits each, and a bus is loaded to 90 %.
constexpr std::size_t kDrivesPerMillisecond = 3;
constexpr std::size_t kMostPerBus = 15;  // of 4 bits of id

struct SimulatedBuses {
  int period_ms;
  std::size_t drives_per_bus;
};

// The shortest control period at which the drives fit on the buses there may be.
SimulatedBuses buses_for(std::size_t joints) {
  for (int period = 1;; ++period) {
    const std::size_t each = std::min(kDrivesPerMillisecond * static_cast<std::size_t>(period), kMostPerBus);
    if (each * kMaxBuses >= joints || each == kMostPerBus) return {period, each};
  }
}

// A joint as the model has it, with its gains.
struct ImportedJoint {
  ModelJoint known;
  bool is_in_model = false;
  std::string name;  // here
  double stiffness = 0, damping = 0;
  [[nodiscard]] bool slides() const { return known.kind == JointKind::slide; }
};

double or_zero(const std::vector<double>& list, std::size_t joint) {
  return joint < list.size() && !std::isnan(list[joint]) ? list[joint] : 0;
}

// rad/m
double made_up_gear(const ModelJoint& slide) {
  const auto [low, high] = slide.position.value_or(std::pair{-kMadeUpWay, kMadeUpWay});
  const double farthest = std::max(std::abs(low), std::abs(high)) + kSlideMargin;
  return std::min(kMadeUpGear, std::floor(10 * kDriveReach / kRoom / farthest) / 10);
}

double made_up_torque(JointKind kind) {
  return kind == JointKind::slide ? kMadeUpForce : kMadeUpTorque;
}

// One drive for all hinges: its packed fields span what the strongest joint needs.
std::string simulated_drive_text(const std::vector<ImportedJoint>& joints, double without) {
  double torque = 0, stiffness = 500, damping = 5;
  for (const ImportedJoint& joint : joints) {
    if (joint.slides()) continue;
    torque = std::max(torque, joint.known.torque.value_or(without));
    stiffness = std::max(stiffness, joint.stiffness);
    damping = std::max(damping, joint.damping);
  }
  return fmt::format(
      "    drive: {{ protocol: mit, variant: damiao, position_range: {} rad, velocity_range: {} rad/s, torque_range: "
      "{} "
      "Nm, kp_range: {} Nm/rad, kd_range: {} Nms/rad }}\n",
      kDriveReach, kDriveSpeed, torque > 0 ? fmt::format("{:.6g}", torque) : "200", stiffness, damping);
}

// One for all slides, whose gears make much of little.
std::string simulated_slide_drive_text(const std::vector<ImportedJoint>& joints) {
  double torque = 0, stiffness = 0, damping = 0;
  for (const ImportedJoint& joint : joints) {
    if (!joint.slides()) continue;
    const double gear = made_up_gear(joint.known);
    torque = std::max(torque, joint.known.torque.value_or(kMadeUpForce) / gear);
    stiffness = std::max(stiffness, joint.stiffness / (gear * gear));
    damping = std::max(damping, joint.damping / (gear * gear));
  }
  return fmt::format(
      "    drive: {{ protocol: mit, variant: damiao, position_range: {} rad, velocity_range: {} rad/s, torque_range: "
      "{:.4g} Nm, kp_range: {:.4g} Nm/rad, kd_range: {:.4g} Nms/rad, position_after_power_up: absolute }}\n",
      kDriveReach, kDriveSpeed, kRoom * torque, std::max(kRoom * stiffness, 0.01), std::max(kRoom * damping, 1e-4));
}

// Who takes over when the policy is lost: where it takes a velocity command, the same network, told to stand.
std::string simulated_reaction_text(const DeployFile& deploy) {
  const auto commanded =
      std::ranges::find_if(deploy.terms, [&](const DeployTerm& term) { return is_command(deploy, term); });
  if (commanded == deploy.terms.end()) return "degraded: { behaviour: hold }\n";
  const std::vector<int> still(deploy.command_ranges.size(), 0);
  return fmt::format(
      "degraded: {{ behaviour: fallback, fallback: stand, after: 40 ms, resume_over: 0 ms }}\n"
      "fallbacks:\n"
      "  stand: {{ kind: policy, command: [{}], for: 0 s }}   # for ever\n"
      "stops:   # it stands on until a person holds it, where a damped stop lets it fall\n"
      "  operator_stop: {{ how: policy, for: 0 s }}\n"
      "  bad_commands: {{ how: policy, for: 0 s }}\n"
      "  overrun: {{ how: policy, for: 10 s }}\n",
      fmt::join(still, ", "));
}

std::string simulated_contract_text(const DeployFile& deploy, const SimulatedBuses& buses) {
  return fmt::format(
      "control: {{ period: {} ms }}\n"
      "freshness:\n"
      "  max_age: {}\n"
      "  epsilon: 0.05\n"
      "  window: 1 s\n"
      "  recover_after: {}\n"
      "  flap_memory: 0 ms\n"
      "  stop_after: 600 ms\n"
      "{}"
      "feedback: {{ timeout: 100 ms }}\n\n",
      buses.period_ms, format_duration(deploy.step_dt * kTargetLastsPeriods), format_duration(deploy.step_dt),
      simulated_reaction_text(deploy));
}

std::string simulated_buses_text(std::size_t joints, const SimulatedBuses& buses) {
  std::string text = "buses:   # virtual\n";
  for (std::size_t i = 0; i * buses.drives_per_bus < joints; ++i)
    text += fmt::format("  - {{ name: bus{0}, interface: takt_sim{0}, when_missing: loopback }}\n", i);
  return text + "\n";
}

std::string simulation_text(const ImportOptions& options) {
  std::string text =
      fmt::format("\nsimulation:\n  step: 1 ms\n  mujoco:\n    model: {}\n", in_quotes(options.model_file));
  if (!options.model->keyframe.empty())
    text += fmt::format("    begin: {{ keyframe: {} }}\n", plain_or_quoted(options.model->keyframe));
  if (!options.model->imu_site.empty() && !options.policy_file.empty())
    text += fmt::format("    imu: {{ site: {} }}\n", plain_or_quoted(options.model->imu_site));
  return text;
}

template <class Unit>
std::string vector_text(const Vector3& value, Unit unit) {
  return fmt::format("[{0}{3}, {1}{3}, {2}{3}]", value[0], value[1], value[2], unit);
}

// Rigid bodies by the names that joints have here.
std::string bodies_text(const std::vector<ImportedJoint>& joints, const ImportOptions& options) {
  if (!options.bodies || options.bodies->links.size() != joints.size()) return {};
  const Model& bodies = *options.bodies;
  std::string text = fmt::format(
      "\nmodel:   # rigid bodies of {}, without a load: a stop and a hold carry them\n  gravity: {}\n  links:\n",
      on_one_line(std::filesystem::path(options.model_file).filename().string()), vector_text(bodies.gravity, " m/s2"));
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const Link& link = bodies.links[i];
    text += fmt::format(
        "    - {{ joint: {}, parent: {}, origin: {{ xyz: {}, rpy: {} }}, axis: {}, mass: {} kg, com: {}, inertia: {} "
        "}}\n",
        joints[i].name, link.parent < 0 ? "base" : joints[static_cast<std::size_t>(link.parent)].name,
        vector_text(link.origin_xyz, " m"), vector_text(link.origin_rpy, " rad"), vector_text(link.axis, ""), link.mass,
        vector_text(link.com, " m"), vector_text(link.inertia, " kgm2"));
  }
  return text +
         fmt::format("  tool: {{ link: {}, xyz: {} }}\n", joints.back().name, vector_text(bodies.tool_xyz, " m"));
}

constexpr const char* kNoPolicy =
    "\n# It can be armed once the file has a policy, as of docs/configuration.md, \"Starting from a model alone\".\n";

constexpr const char* kBeforeARealRobot =
    "\n# Before a real robot: what a model and an export cannot know, and what is made up above for the simulator.\n"
    "#   buses[]: interface and bit rate of each; when_missing: refuse\n"
    "#   joint_defaults[0].drive, joints[].drive: protocol, model, id, direction, offset, gear ratio\n"
    "#   joint_defaults[0].limits: velocity, acceleration, torque rate, margins\n"
    "#   freshness, degraded: the contract, from `takt margin`\n"
    "#   sensors, imu: who publishes the IMU, its time-outs and limits\n";

// --- the parts ---

std::string header_text(const DeployFile& deploy, const ImportOptions& options,
                        const std::vector<std::string>& remarks) {
  std::string text = fmt::format("# {} {}.\n", options.policy_file.empty() ? "Made from" : "Imported from",
                                 on_one_line(options.source));
  if (!options.simulated)
    text +=
        "# An export says nothing about drives and the contract: replace every FILL_IN by what is true of your\n"
        "# robot; `takt config check` names those that are left.\n";
  for (const std::string& note : deploy.notes) text += fmt::format("# Not carried over: {}\n", on_one_line(note));
  for (const std::string& remark : remarks) text += fmt::format("# Note: {}\n", on_one_line(remark));
  text += fmt::format("schema: takt.robot/1\nrobot: {}\n\n", options.robot);
  if (options.simulated) {
    const SimulatedBuses buses = buses_for(deploy.robot_joint.size());
    return text + simulated_contract_text(deploy, buses) + simulated_buses_text(deploy.robot_joint.size(), buses);
  }
  return text + fmt::format(
                    "freshness:\n"
                    "  max_age: FILL_IN            # above policy.period {}\n"
                    "  epsilon: FILL_IN            # contract: Pr(age > max_age) <= epsilon\n"
                    "  window: 1 s\n"
                    "  recover_after: FILL_IN\n"
                    "  stop_after: FILL_IN         # no usable command for this long: damped stop\n"
                    "degraded: {{ behaviour: FILL_IN }}   # hold | slow | fallback\n"
                    "feedback: {{ timeout: FILL_IN }}\n\n"
                    "buses:\n  - {{ name: FILL_IN, interface: FILL_IN }}\n\n",
                    duration_or_unfilled(deploy.step_dt));
}

std::string names_in_quotes(const std::vector<ImportedJoint>& joints, bool slides) {
  std::vector<std::string> names;
  for (const ImportedJoint& joint : joints)
    if (joint.slides() == slides) names.push_back(in_quotes(joint.name));
  return fmt::format("{}", fmt::join(names, ", "));
}

std::string simulated_defaults_text(const std::vector<ImportedJoint>& joints, const ImportOptions& options) {
  const std::string hinges = names_in_quotes(joints, false), slides = names_in_quotes(joints, true);
  std::string text = "joint_defaults:\n";
  if (!hinges.empty())
    text += fmt::format("  - joints: [{}]\n", slides.empty() ? "\"*\"" : hinges) +
            simulated_drive_text(joints, options.policy_file.empty() ? kMadeUpTorque : 0) +
            fmt::format(
                "    limits: {{ position_margin: 0.3 rad, target_margin: 2 rad, velocity: {} rad/s, velocity_hard: {} "
                "rad/s, acceleration: {} rad/s2, torque_rate: 200000 Nm/s }}\n",
                kMadeUpVelocity, kMadeUpHardVelocity, kMadeUpAcceleration);
  if (!slides.empty())
    text += fmt::format(
        "  - joints: [{}]   # slides: in metres and newtons\n{}    limits: {{ position_margin: {} m, target_margin: {} "
        "m }}\n",
        slides, simulated_slide_drive_text(joints), kSlideMargin, kMadeUpWay);
  return text + "\n";
}

std::string defaults_text(const std::vector<ImportedJoint>& joints, const ImportOptions& options) {
  if (options.simulated) return simulated_defaults_text(joints, options);
  return "joint_defaults:   # what differs between joints goes to the joint\n"
         "  - joints: [\"*\"]\n"
         "    drive: { protocol: FILL_IN, variant: FILL_IN, model: FILL_IN }\n"
         "    limits:\n"
         "      position_margin: FILL_IN\n"
         "      velocity: FILL_IN\n"
         "      velocity_hard: FILL_IN\n"
         "      acceleration: FILL_IN\n"
         "      torque_rate: FILL_IN\n\n";
}

struct Wiring {
  std::string bus, id, reply_id;
};

Wiring wiring_of(std::size_t joint, std::size_t joints, bool simulated) {
  if (!simulated) return {kUnfilled, kUnfilled, kUnfilled};
  const std::size_t each = buses_for(joints).drives_per_bus;
  const std::size_t id = 1 + joint % each;
  return {fmt::format("bus{}", joint / each), fmt::format("{}", id), fmt::format("0x{:x}", 0x10 + id)};
}

const ModelJoint* find_in_model(const ImportOptions& options, const std::string& name) {
  if (!options.model) return nullptr;
  const auto found = std::ranges::find(options.model->joints, name, &ModelJoint::name);
  return found == options.model->joints.end() ? nullptr : &*found;
}

std::vector<ImportedJoint> joints_of(const DeployFile& deploy, const ImportOptions& options) {
  std::vector<ImportedJoint> joints;
  for (std::size_t j = 0; j < deploy.robot_joint.size(); ++j) {
    const std::string name = joint_name(options, j);
    const ModelJoint* const known = find_in_model(options, options.joint_names.empty() ? name : options.joint_names[j]);
    joints.push_back({.known = known == nullptr ? ModelJoint{} : *known,
                      .is_in_model = known != nullptr,
                      .name = name,
                      .stiffness = or_zero(deploy.stiffness, j),
                      .damping = or_zero(deploy.damping, j)});
  }
  return joints;
}

// A simulated robot without a policy needs none that is known.
std::string torque_text(const ModelJoint& joint, const DeployFile& deploy, std::size_t index,
                        const ImportOptions& options) {
  const std::string_view unit = kJointTorque.unit(joint.kind);
  if (!joint.torque && index < deploy.torque.size()) return listed_or_unfilled(deploy.torque, index, unit);
  const bool is_made_up = options.simulated && options.policy_file.empty() && !joint.torque;
  return or_unfilled(is_made_up ? std::optional(made_up_torque(joint.kind)) : joint.torque, unit);
}

// Where the model sets no limit a simulated robot has one all the same.
std::optional<double> end_of(const ModelJoint& joint, bool high, const ImportOptions& options) {
  if (joint.position) return high ? joint.position->second : joint.position->first;
  if (!options.simulated) return std::nullopt;
  const double far = joint.kind == JointKind::slide ? kMadeUpWay : 2 * kHalfTurn;
  return high ? far : -far;
}

// Of joints that a model lets turn or slide without end; empty: there are none.
std::string range_remark(const std::vector<ImportedJoint>& joints, const ImportOptions& options) {
  std::string without;
  for (const ImportedJoint& joint : joints)
    if (joint.is_in_model && !joint.known.position) without += (without.empty() ? "" : ", ") + joint.name;
  if (without.empty() || !options.simulated) return {};
  return fmt::format(
      "without a range in the model: {}. limits.position is made up, a turn to either side (a slide {} m); widen it, "
      "and drive.position_range, of a wheel",
      without, kMadeUpWay);
}

// Of joints of which a model says no torque; empty: there are none.
std::string torque_remark(const std::vector<ImportedJoint>& joints, const ImportOptions& options) {
  std::string without;
  for (const ImportedJoint& joint : joints)
    if (joint.is_in_model && !joint.known.torque) without += (without.empty() ? "" : ", ") + joint.name;
  if (without.empty() || !options.simulated || !options.policy_file.empty()) return {};
  return fmt::format("without a torque in the model: {}. limits.torque {:g} Nm is made up; write the drive's", without,
                     kMadeUpTorque);
}

// What a simulated robot's drive can do there.
struct MadeUpMotion {
  double velocity, acceleration;
};
MadeUpMotion made_up_motion(const ModelJoint& joint, const ImportOptions& options) {
  const double gear = joint.kind == JointKind::slide ? made_up_gear(joint) : 1;
  const double torque = joint.torque.value_or(made_up_torque(joint.kind));
  const double most = kMadeUpAcceleration / gear;
  const double acceleration = joint.inertia * most > torque ? kTorqueThatMoves * torque / joint.inertia : most;
  const double way = end_of(joint, true, options).value_or(0) - end_of(joint, false, options).value_or(0);
  return {std::min(kMadeUpVelocity / gear, std::sqrt(2 * acceleration * kBrakesWithin * way)), acceleration};
}

// Without a policy that was trained beyond them, a simulated robot has the model's speed, and what its torque can do.
// So has a slide always: what its made-up drive can do is its gear's.
std::string own_limits_text(const ModelJoint& joint, const ImportOptions& options) {
  const bool slides = joint.kind == JointKind::slide;
  if (options.simulated && !options.policy_file.empty() && !slides) return {};
  const std::string_view speed_unit = kJointVelocity.unit(joint.kind);
  if (!options.simulated)
    return joint.velocity ? fmt::format("velocity: {:.6g} {}, ", *joint.velocity, speed_unit) : "";
  const double gear = slides ? made_up_gear(joint) : 1;
  const MadeUpMotion motion = made_up_motion(joint, options);
  std::string text;
  if (joint.velocity && *joint.velocity < motion.velocity)
    text += fmt::format("velocity: {:.6g} {}, ", *joint.velocity, speed_unit);
  else if (slides || motion.velocity < kMadeUpVelocity)
    text += fmt::format("velocity: {:.3g} {}, ", motion.velocity, speed_unit);
  if (slides) text += fmt::format("velocity_hard: {:.3g} {}, ", kMadeUpHardVelocity / gear, speed_unit);
  if (slides || motion.acceleration < kMadeUpAcceleration)
    text += fmt::format("acceleration: {:.3g} {}, ", motion.acceleration, kJointAcceleration.unit(joint.kind));
  const double torque = joint.torque.value_or(made_up_torque(joint.kind));
  return text + fmt::format("torque_rate: {:.6g} {}, ", torque / kFullTorqueIn_s, kJointTorqueRate.unit(joint.kind));
}

std::string joints_text(const std::vector<ImportedJoint>& joints, const DeployFile& deploy,
                        const ImportOptions& options) {
  std::vector<double> home(deploy.default_position.size());
  for (std::size_t k = 0; k < home.size(); ++k) home[deploy.robot_joint[k]] = deploy.default_position[k];
  std::string text = fmt::format("joints:   # in the robot's order; kp and kd limits are the {} gains\n",
                                 options.policy_file.empty() ? "model's or made-up" : "deployed");
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const ModelJoint& known = joints[j].known;
    const Wiring wiring = wiring_of(j, joints.size(), options.simulated);
    const auto unit = [&](const JointQuantity& quantity) { return quantity.unit(known.kind); };
    const std::string gear = !joints[j].slides()
                                 ? ""
                                 : ", gear_ratio: " + (options.simulated ? fmt::format("{} rad/m", made_up_gear(known))
                                                                         : std::string(kUnfilled));
    text += fmt::format(
        "  - name: {0}\n"
        "{12}"
        "    bus: {1}\n"
        "    drive: {{ id: {2}, reply_id: {3}{13} }}\n"
        "    limits: {{ position: [{4}, {5}], {6}torque: {7}, kp: {8}, kd: {9} }}\n"
        "    gains: {{ kp: {8}, kd: {9}, damping: {9} }}\n"
        "    inertia: {10}\n"
        "    home: {11}\n",
        joints[j].name, wiring.bus, wiring.id, wiring.reply_id,
        or_unfilled(end_of(known, false, options), unit(kJointPosition)),
        or_unfilled(end_of(known, true, options), unit(kJointPosition)), own_limits_text(known, options),
        torque_text(known, deploy, j, options), listed_or_unfilled(deploy.stiffness, j, unit(kJointStiffness)),
        listed_or_unfilled(deploy.damping, j, unit(kJointDamping)),
        or_unfilled(joints[j].is_in_model ? std::optional(known.inertia) : std::nullopt, unit(kJointInertia)),
        listed_or_unfilled(home, j, unit(kJointPosition)), joints[j].slides() ? "    kind: slide\n" : "", gear);
  }
  return text;
}

bool reads_imu(const DeployFile& deploy) {
  return std::ranges::any_of(deploy.terms, [](const DeployTerm& term) {
    return !term.is_only_named && (term.name == "base_ang_vel" || term.name == "projected_gravity");
  });
}

// Limits as the deploy file has them; no command means: stand still, as near as they allow.
std::string command_sensor_text(const DeployFile& deploy, const std::string& timeout) {
  std::vector<std::string> names, low, high, absent;
  for (const auto& [name, range] : deploy.command_ranges) {
    const bool said = !std::isnan(range.first);
    names.push_back(on_one_line(name));
    low.push_back(said ? fmt::format("{}", range.first) : kUnfilled);
    high.push_back(said ? fmt::format("{}", range.second) : kUnfilled);
    absent.push_back(said ? fmt::format("{}", std::clamp(0.0, range.first, range.second)) : "0");
  }
  return fmt::format(
      "  - name: velocity_command   # {}\n"
      "    values: {}\n"
      "    timeout: {}          # of a person who says no more\n"
      "    command: {{ minimum: [{}], maximum: [{}], when_absent: [{}] }}\n",
      fmt::join(names, ", "), names.size(), timeout, fmt::join(low, ", "), fmt::join(high, ", "),
      fmt::join(absent, ", "));
}

// Its thresholds are those of unitree_rl_lab's own deployment (terminations.hpp).
std::string imu_text(const DeployFile& deploy) {
  if (deploy.tensors && deploy.tensors->needs_imu) return "\nimu: { sensor: imu, tilt: FILL_IN }\n";
  if (!reads_imu(deploy)) return {};
  return "\nimu: { sensor: imu, tilt: 1 rad, angular_velocity: 6 rad/s }   # as unitree_rl_lab's deployment stops\n";
}

std::string sensors_text(const DeployFile& deploy, bool simulated) {
  std::string text;
  const std::string timeout = simulated ? "100 ms" : kUnfilled;
  const std::string held = simulated ? format_duration(command_lasts(deploy)) : kUnfilled;
  for (const DeployTerm& term : deploy.terms)
    if (!term.is_only_named && term.text.empty() && takt_term(term.name).empty() && !is_command(deploy, term))
      text += fmt::format("  - {{ name: {}, values: {}, timeout: FILL_IN }}\n", plain_or_quoted(term.name),
                          term.is_unscaled ? kUnfilled : fmt::format("{}", term.scale.size()));
  for (const DeployTerm& term : deploy.terms)
    if (is_command(deploy, term)) text += command_sensor_text(deploy, held);
  if (deploy.tensors)
    for (const std::string& sensor : deploy.tensors->sensors) text += sensor;
  if (reads_imu(deploy) || (deploy.tensors && deploy.tensors->needs_imu))
    text += fmt::format("  - {{ name: imu, values: 10, timeout: {} }}   # see imu below\n", timeout);
  return text.empty()
             ? ""
             : "\nsensors:   # each served by a process of yours on sensor-NAME.sock\n" + text + imu_text(deploy);
}

// What stands behind `term:`.
std::string source_of(const DeployFile& deploy, const DeployTerm& term) {
  if (term.is_only_named) return kUnfilled;
  if (is_command(deploy, term)) return "command, sensor: velocity_command";
  const std::string_view known = takt_term(term.name);
  if (known.empty()) return fmt::format("sensor, sensor: {}", plain_or_quoted(term.name));
  return known == "gait_phase" ? "gait_phase, gait_period: " + duration_or_unfilled(term.gait_period)
                               : std::string(known);
}

std::string names_of(const std::vector<std::size_t>& joints, const ImportOptions& options) {
  std::vector<std::string> names;
  for (const std::size_t joint : joints) names.push_back(joint_name(options, joint));
  return fmt::format("[{}]", fmt::join(names, ", "));
}

std::string terms_text(const DeployFile& deploy, const ImportOptions& options) {
  std::string text;
  for (const DeployTerm& term : deploy.terms) {
    if (!term.text.empty()) {
      text += fmt::format("    - {{ term: {} }}{}\n", term.text,
                          term.comment.empty() ? "" : "   # " + on_one_line(term.comment));
      continue;
    }
    const std::string clip = term.clip.empty() ? "" : fmt::format(", clip: [{}]", fmt::join(term.clip, ", "));
    const bool is_of_joints = source_of(deploy, term).starts_with("joint_");
    const std::string joints =
        term.joints.empty() || !is_of_joints ? "" : ", joints: " + names_of(term.joints, options);
    text += fmt::format("    - {{ term: {}{}{}, scale: {}, history: {} }}{}\n", source_of(deploy, term), joints, clip,
                        term.is_unscaled ? "1" : one_or_list(term.scale),
                        term.history == 0 ? kUnfilled : fmt::format("{}", term.history),
                        term.is_only_named ? "   # called " + on_one_line(term.name) : "");
  }
  return text;
}

// As trained: one target, held, with no velocity. What a chunk's steps are to each other its author alone knows.
std::string action_text(const DeployFile& deploy, const std::vector<ImportedJoint>& joints,
                        const ImportOptions& options) {
  if (const auto& tensors = deploy.tensors) {
    std::vector<std::string> names, outputs;
    for (const std::size_t joint : tensors->action_joints) names.push_back(joint_name(options, joint));
    for (const auto& [key, name] : tensors->outputs) outputs.push_back(fmt::format("{}: {}", key, in_quotes(name)));
    return fmt::format("  action:\n    kind: {}\n    interpolation: {}\n    scale: 1\n    offset: zero\n{}{}",
                       tensors->action_kind, tensors->steps == 1 ? "hold" : kUnfilled,
                       names.empty() ? "" : fmt::format("    joints: [{}]\n", fmt::join(names, ", ")),
                       outputs.empty() ? "" : fmt::format("    outputs: {{ {} }}\n", fmt::join(outputs, ", ")));
  }
  const bool offset_is_home = deploy.action_joints.empty() && deploy.action_offset == deploy.default_position;
  std::vector<std::string> offsets;
  const auto& acting = deploy.action_joints.empty() ? deploy.robot_joint : deploy.action_joints;
  for (std::size_t i = 0; i < deploy.action_offset.size(); ++i)
    offsets.push_back(fmt::format("{} {}", deploy.action_offset[i], kJointPosition.unit(joints[acting[i]].known.kind)));
  const std::string offset = deploy.action_kind != "joint_position" ? "zero"
                             : offsets.empty()                      ? kUnfilled
                                                                    : fmt::format("[{}]", fmt::join(offsets, ", "));
  return fmt::format(
      "  action: {{ kind: {}, interpolation: hold, scale: {}, offset: {}{} }}   # as trained: no velocity target\n",
      deploy.action_kind, one_or_list(deploy.action_scale),
      offset_is_home && deploy.action_kind == "joint_position" ? "home" : offset,
      deploy.action_joints.empty() ? "" : ", joints: " + names_of(deploy.action_joints, options));
}

std::string steps_text(const DeployFile& deploy) {
  if (deploy.tensors && deploy.tensors->steps > 1)
    return fmt::format("  step_period: {}\n  steps: {}\n", duration_or_unfilled(deploy.tensors->step_period),
                       deploy.tensors->steps);
  return fmt::format(
      "  step_period: {}          # one step a period: its target stays playable this long\n  steps: 1\n",
      duration_or_unfilled(deploy.step_dt * kTargetLastsPeriods));
}

std::string policy_text(const DeployFile& deploy, const std::vector<ImportedJoint>& joints,
                        const ImportOptions& options) {
  std::vector<std::string> order;
  for (const std::size_t joint : deploy.robot_joint) order.push_back(joint_name(options, joint));
  const std::string input = deploy.tensors ? deploy.tensors->input : options.input;
  const std::string output = deploy.tensors ? deploy.tensors->output : options.output;
  const std::string names = (input.empty() ? "" : fmt::format("  input: {}\n", in_quotes(input))) +
                            (output.empty() ? "" : fmt::format("  output: {}\n", in_quotes(output)));
  return fmt::format(
      "\npolicy:\n"
      "  file: {}\n"
      "  period: {}\n"
      "{}{}"
      "  joint_order: [{}]\n"
      "  history_layout: {}\n"
      "{}"
      "  observation:\n{}{}",
      in_quotes(options.policy_file), duration_or_unfilled(deploy.step_dt), steps_text(deploy), names,
      fmt::join(order, ", "), deploy.history_by_time ? "by_time" : "by_term",
      deploy.newest_first ? "  history_order: newest_first\n" : "", terms_text(deploy, options),
      action_text(deploy, joints, options));
}

std::string count_problem(std::size_t in_model, std::size_t moved) {
  if (in_model == moved) return {};
  return fmt::format(
      "the model has {} joints, the policy moves {}: take the model of the robot that it was trained for, or name "
      "the joints with --joint-names",
      in_model, moved);
}

}  // namespace

MotorOrder motor_order(const ModelFacts& model) {
  MotorOrder order;
  for (const ModelJoint& joint : model.joints) order.joints.push_back(joint.name);
  if (model.motors == order.joints || model.motors.empty()) return order;
  if (model.motors.size() != order.joints.size()) {
    order.remark = fmt::format(
        "motors are numbered as the model's bodies stand: {} of its {} joints have an actuator. If the maker numbers "
        "them otherwise, name the joints in that order with --joint-names",
        model.motors.size(), order.joints.size());
    return order;
  }
  order.joints = model.motors;
  order.remark = fmt::format(
      "motors are numbered as the model's actuators stand ({}, ...), not as its bodies do ({}, ...). If the maker "
      "numbers them otherwise, name the joints in that order with --joint-names",
      model.motors.front(), model.joints.front().name);
  return order;
}

std::expected<std::string, std::string> import_deploy_file(const DeployFile& deploy, const ImportOptions& given) {
  ImportOptions options = given;
  std::vector<std::string> remarks = deploy.remarks;
  const std::size_t joints = deploy.robot_joint.size();
  if (options.joint_names.empty() && options.model) {
    if (const auto problem = count_problem(options.model->joints.size(), joints); !problem.empty())
      return std::unexpected(problem);
    MotorOrder order = motor_order(*options.model);
    options.joint_names = std::move(order.joints);
    if (!order.remark.empty()) remarks.push_back(std::move(order.remark));
  }
  const std::vector<std::string>& names = options.joint_names;
  if (!names.empty() && names.size() != joints)
    return std::unexpected(
        fmt::format("{} joint names for {} joints; name every joint, in the robot's order", names.size(), joints));
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size())
    return std::unexpected("a joint name is given twice; name each joint once");
  const std::vector<std::string> here = joint_names_of(names);
  if (std::set<std::string>(here.begin(), here.end()).size() != here.size())
    return std::unexpected("two joints have one name once it is written with letters, digits, _ and -; rename one");
  for (const std::string& name : names) {
    if (name.empty()) return std::unexpected("a joint has no name; name it in the model");
    if (options.model && find_in_model(options, name) == nullptr)
      return std::unexpected(
          fmt::format("the model has no joint `{}`; name its joints as the model does", on_one_line(name)));
  }
  if (!is_identifier(options.robot))
    return std::unexpected(
        fmt::format("`{}` is no robot name; use letters, digits, _ and -", on_one_line(options.robot)));
  if (options.simulated && !options.model)
    return std::unexpected("a simulated robot needs its model; name its MJCF file");
  if (options.simulated && deploy.tensors)
    return std::unexpected(
        "a simulated robot is made up of what a deploy.yaml says of its terms; leave --simulated out, and fill in");
  if (options.simulated && deploy.step_dt.ns == 0)
    return std::unexpected(
        "a simulated robot needs the policy's period, which this export does not say; name it by --period");
  const std::vector<ImportedJoint> imported = joints_of(deploy, options);
  for (std::string remark : {range_remark(imported, options), torque_remark(imported, options)})
    if (!remark.empty()) remarks.push_back(std::move(remark));
  return header_text(deploy, options, remarks) + defaults_text(imported, options) +
         joints_text(imported, deploy, options) +
         (options.policy_file.empty()
              ? ""
              : sensors_text(deploy, options.simulated) + policy_text(deploy, imported, options)) +
         bodies_text(imported, options) + (options.simulated ? simulation_text(options) + kBeforeARealRobot : "") +
         (options.policy_file.empty() ? kNoPolicy : "");
}

}  // namespace takt::config
