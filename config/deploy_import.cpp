#include "config/deploy_import.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "config/reader.hpp"
#include "config/units.hpp"

namespace takt::config {
namespace {

// A policy of one step a period: how many periods its target may be played before the next one must have come.
constexpr std::int64_t kTargetLastsPeriods = 3;

std::string joint_name(const ImportOptions& options, std::size_t index) {
  return options.joint_names.empty() ? fmt::format("joint_{:02}", index) : options.joint_names[index];
}

std::string one_or_list(const std::vector<double>& values) {
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
  return term.name == "velocity_commands" && deploy.command_ranges.size() == term.scale.size();
}

std::string header_text(const DeployFile& deploy, const ImportOptions& options) {
  std::string text = fmt::format(
      "# Imported from {}. A deploy.yaml says nothing about drives, limits and the contract: replace every FILL_IN by\n"
      "# what is true of your robot; `takt config check` names those that are left.\n",
      options.source);
  for (const std::string& note : deploy.notes) text += fmt::format("# Not carried over: {}\n", note);
  return text + fmt::format(
                    "schema: takt.robot/1\nrobot: {}\n\n"
                    "freshness:\n"
                    "  max_age: FILL_IN            # above policy.period {}\n"
                    "  epsilon: FILL_IN            # contract: Pr(age > max_age) <= epsilon\n"
                    "  window: 1 s\n"
                    "  recover_after: FILL_IN\n"
                    "  stop_after: FILL_IN         # no usable command for this long: damped stop\n"
                    "degraded: {{ behaviour: FILL_IN }}   # hold | slow | fallback\n"
                    "feedback: {{ timeout: FILL_IN }}\n\n"
                    "buses:\n  - {{ name: FILL_IN, interface: FILL_IN }}\n\n",
                    options.robot, format_duration(deploy.step_dt));
}

std::string joints_text(const DeployFile& deploy, const ImportOptions& options) {
  std::vector<double> home(deploy.robot_joint.size());
  for (std::size_t k = 0; k < home.size(); ++k) home[deploy.robot_joint[k]] = deploy.default_position[k];
  std::string text = "joints:   # in the robot's order; kp and kd limits are the deployed gains\n";
  for (std::size_t j = 0; j < home.size(); ++j)
    text += fmt::format(
        "  - name: {0}\n"
        "    bus: FILL_IN\n"
        "    drive: {{ protocol: FILL_IN, variant: FILL_IN, model: FILL_IN, id: FILL_IN, reply_id: FILL_IN }}\n"
        "    limits:\n"
        "      position: [FILL_IN, FILL_IN]\n"
        "      position_margin: FILL_IN\n"
        "      velocity: FILL_IN\n"
        "      velocity_hard: FILL_IN\n"
        "      acceleration: FILL_IN\n"
        "      torque: FILL_IN\n"
        "      torque_rate: FILL_IN\n"
        "      kp: {1} Nm/rad\n"
        "      kd: {2} Nms/rad\n"
        "    gains: {{ kp: {1} Nm/rad, kd: {2} Nms/rad, damping: {2} Nms/rad }}\n"
        "    inertia: FILL_IN\n"
        "    home: {3} rad\n",
        joint_name(options, j), deploy.stiffness[j], deploy.damping[j], home[j]);
  return text;
}

bool reads_imu(const DeployFile& deploy) {
  return std::ranges::any_of(deploy.terms, [](const DeployTerm& term) {
    return term.name == "base_ang_vel" || term.name == "projected_gravity";
  });
}

// Limits as the deploy file has them; nobody speaking means: stand still, as near as they allow.
std::string command_sensor_text(const DeployFile& deploy) {
  std::vector<double> low, high, absent;
  std::vector<std::string> names;
  for (const auto& [name, range] : deploy.command_ranges) {
    names.push_back(name);
    low.push_back(range.first);
    high.push_back(range.second);
    absent.push_back(std::clamp(0.0, range.first, range.second));
  }
  return fmt::format(
      "  - name: velocity_command   # {}\n"
      "    values: {}\n"
      "    timeout: FILL_IN          # of a person who says no more\n"
      "    command: {{ minimum: [{}], maximum: [{}], when_absent: [{}] }}\n",
      fmt::join(names, ", "), names.size(), fmt::join(low, ", "), fmt::join(high, ", "), fmt::join(absent, ", "));
}

// Its thresholds are those of unitree_rl_lab's own deployment (terminations.hpp).
std::string imu_text(const DeployFile& deploy) {
  if (!reads_imu(deploy)) return {};
  return "\nimu: { sensor: imu, tilt: 1 rad, angular_velocity: 6 rad/s }   # as unitree_rl_lab's deployment stops\n";
}

std::string sensors_text(const DeployFile& deploy) {
  std::string text;
  for (const DeployTerm& term : deploy.terms)
    if (takt_term(term.name).empty() && !is_command(deploy, term))
      text += fmt::format("  - {{ name: {}, values: {}, timeout: FILL_IN }}\n", term.name, term.scale.size());
  for (const DeployTerm& term : deploy.terms)
    if (is_command(deploy, term)) text += command_sensor_text(deploy);
  if (reads_imu(deploy)) text += "  - { name: imu, values: 10, timeout: FILL_IN }   # see imu below\n";
  return text.empty()
             ? ""
             : "\nsensors:   # each served by a process of yours on sensor-NAME.sock\n" + text + imu_text(deploy);
}

// What stands behind `term:`.
std::string source_of(const DeployFile& deploy, const DeployTerm& term) {
  if (is_command(deploy, term)) return "command, sensor: velocity_command";
  const std::string_view known = takt_term(term.name);
  if (known.empty()) return fmt::format("sensor, sensor: {}", term.name);
  return known == "gait_phase" ? "gait_phase, gait_period: FILL_IN" : std::string(known);
}

std::string terms_text(const DeployFile& deploy) {
  std::string text;
  for (const DeployTerm& term : deploy.terms)
    text += fmt::format("    - {{ term: {}, scale: {}, history: {} }}\n", source_of(deploy, term),
                        one_or_list(term.scale), term.history);
  return text;
}

std::string policy_text(const DeployFile& deploy, const ImportOptions& options) {
  std::vector<std::string> order;
  for (const std::size_t joint : deploy.robot_joint) order.push_back(joint_name(options, joint));
  const bool offset_is_home = deploy.action_offset == deploy.default_position;
  std::vector<std::string> offsets;
  for (const double offset : deploy.action_offset) offsets.push_back(fmt::format("{} rad", offset));
  return fmt::format(
      "\npolicy:\n"
      "  file: \"{}\"\n"
      "  period: {}\n"
      "  step_period: {}          # one step a period: its target stays playable this long\n"
      "  steps: 1\n"
      "  joint_order: [{}]\n"
      "  history_layout: by_term\n"
      "  observation:\n{}"
      "  action: {{ kind: joint_position, interpolation: hold, scale: {}, offset: {} }}   # as trained: no velocity "
      "target\n",
      options.policy_file, format_duration(deploy.step_dt), format_duration(deploy.step_dt * kTargetLastsPeriods),
      fmt::join(order, ", "), terms_text(deploy), one_or_list(deploy.action_scale),
      offset_is_home ? "home" : fmt::format("[{}]", fmt::join(offsets, ", ")));
}

}  // namespace

std::expected<std::string, std::string> import_deploy_file(const DeployFile& deploy, const ImportOptions& options) {
  const std::vector<std::string>& names = options.joint_names;
  const std::size_t joints = deploy.robot_joint.size();
  if (!names.empty() && names.size() != joints)
    return std::unexpected(
        fmt::format("{} joint names for {} joints; name every joint, in the robot's order", names.size(), joints));
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size())
    return std::unexpected("a joint name is given twice; name each joint once");
  for (const std::string& name : names)
    if (!is_identifier(name))
      return std::unexpected(fmt::format("`{}` is no joint name; use letters, digits, _ and -", name));
  if (!is_identifier(options.robot))
    return std::unexpected(fmt::format("`{}` is no robot name; use letters, digits, _ and -", options.robot));
  return header_text(deploy, options) + joints_text(deploy, options) + sensors_text(deploy) +
         policy_text(deploy, options);
}

}  // namespace takt::config
