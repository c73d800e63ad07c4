#include "tests/evidence/rollout/g1_robot.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <fstream>
#include <iterator>
#include <regex>
#include <vector>

#include "config/deploy_file.hpp"

namespace takt::panel::test {
namespace {

constexpr std::size_t kDrivesPerBus = 6;

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

struct ModelJoint {
  std::string name, low, high;
  double torque = 0;
};

std::vector<ModelJoint> joints_of(const std::string& mjcf) {
  static const std::regex pattern(
      R"re(<joint name="(\w+)"[^>]*?range="([-\d.]+) ([-\d.]+)"\s*actuatorfrcrange="[-\d.]+ ([\d.]+)")re");
  std::vector<ModelJoint> joints;
  for (std::sregex_iterator at(mjcf.begin(), mjcf.end(), pattern), end; at != end; ++at)
    joints.push_back({(*at)[1], (*at)[2], (*at)[3], std::stod((*at)[4])});
  return joints;
}

constexpr const char* kHead = R"(schema: takt.robot/1
robot: g1
control: { period: 2 ms }
freshness: { max_age: 60 ms, epsilon: 0.05, window: 500 ms, recover_after: 100 ms, flap_memory: 0 ms, stop_after: 1 s, clamped_share: 1 }
degraded: { behaviour: hold, resume_over: 0 ms }
feedback: { timeout: 20 ms }
imu: { sensor: imu, tilt: 1 rad, angular_velocity: 30 rad/s, frozen_after: 100 ms }
sensors:
  - { name: imu, values: 10, timeout: 50 ms }
  - { name: velocity_command, values: 3, timeout: 500 ms, command: { minimum: [-0.5, -0.3, -0.2], maximum: [1, 0.3, 0.2], when_absent: [0, 0, 0] } }
)";

constexpr const char* kPolicy = R"(  period: 20 ms
  step_period: 60 ms
  steps: 1
  observation:
    - { term: base_angular_velocity, scale: 0.2, history: 5 }
    - { term: projected_gravity, scale: 1, history: 5 }
    - { term: command, sensor: velocity_command, scale: 1, history: 5 }
    - { term: joint_position_relative, scale: 1, history: 5 }
    - { term: joint_velocity, scale: 0.05, history: 5 }
    - { term: last_action, scale: 1, history: 5 }
  action: { kind: joint_position, interpolation: hold, scale: 0.25, offset: home }
)";

}  // namespace

std::optional<std::string> g1_robot_text(const std::filesystem::path& shared) {
  const auto root = std::filesystem::absolute(shared).lexically_normal();
  const auto model = root / "robots/g1/g1_29dof.xml", policy = root / "policies/g1_velocity/policy.onnx";
  const auto deploy = config::read_deploy_file(bytes_of(root / "policies/g1_velocity/deploy.yaml"), "deploy.yaml");
  if (!std::filesystem::exists(model) || !std::filesystem::exists(policy) || !deploy) return std::nullopt;
  const std::vector<ModelJoint> joints = joints_of(bytes_of(model));
  if (joints.size() != deploy->robot_joint.size()) return std::nullopt;
  std::vector<double> home(joints.size());
  for (std::size_t i = 0; i < home.size(); ++i) home.at(deploy->robot_joint[i]) = deploy->default_position[i];
  std::string text = kHead;
  text += "buses:\n";
  for (std::size_t bus = 0; bus * kDrivesPerBus < joints.size(); ++bus)
    text += fmt::format("  - {{ name: can{0}, interface: can{0}, when_missing: loopback }}\n", bus);
  text += "joints:\n";
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const ModelJoint& joint = joints[j];
    const double kp = deploy->stiffness[j], kd = deploy->damping[j];
    text += fmt::format(
        "  - name: {}\n    bus: can{}\n"
        "    drive: {{ protocol: mit, variant: damiao, id: {}, reply_id: {}, position_range: 12.5 rad, velocity_range: "
        "45 "
        "rad/s, torque_range: {:g} Nm, kp_range: 500 Nm/rad, kd_range: 20 Nms/rad }}\n"
        "    limits: {{ position: [{} rad, {} rad], position_margin: 0.5 rad, target_margin: 100 rad, velocity: 40 "
        "rad/s, "
        "velocity_hard: 44 rad/s, acceleration: 100000 rad/s2, torque: {:g} Nm, torque_rate: 1000000 Nm/s, kp: {:g} "
        "Nm/rad, kd: {:g} Nms/rad }}\n"
        "    gains: {{ kp: {:g} Nm/rad, kd: {:g} Nms/rad, damping: {:g} Nms/rad }}\n"
        "    inertia: 0.01 kgm2\n    observer_bandwidth: 1000 rad/s\n    home: {:g} rad\n",
        joint.name, j / kDrivesPerBus, j % kDrivesPerBus + 1, j % kDrivesPerBus + 17, joint.torque, joint.low,
        joint.high, joint.torque, kp, kd, kp, kd, kd, home[j]);
  }
  std::vector<std::string> order;
  for (const std::size_t j : deploy->robot_joint) order.push_back(joints[j].name);
  text += fmt::format("policy:\n  file: {}\n  joint_order: [{}]\n", policy.string(), fmt::join(order, ", "));
  text += kPolicy;
  text += fmt::format("simulation:\n  step: 1 ms\n  mujoco: {{ model: {}, imu: {{ site: imu }} }}\n", model.string());
  return text;
}

}  // namespace takt::panel::test
