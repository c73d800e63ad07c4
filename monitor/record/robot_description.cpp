// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/robot_description.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/xml_text.hpp"

namespace takt::monitor {
namespace {

using config::Vector3;

constexpr std::string_view kBase = "base";
constexpr double kThickness = 0.05;  // of a drawn cylinder's radius, by the longest one's length

double length_of(const Vector3& v) {
  return std::hypot(v[0], v[1], v[2]);
}

Vector3 unit(const Vector3& v) {
  const double length = length_of(v);
  return {v[0] / length, v[1] / length, v[2] / length};
}

std::string link_name(const std::string& joint) {
  return joint + "_link";
}

std::string parent_name(const config::Model& model, const config::Link& link) {
  return link.parent < 0 ? std::string(kBase) : link_name(model.links[static_cast<std::size_t>(link.parent)].joint);
}

std::string text(const Vector3& v) {
  return fmt::format("{} {} {}", v[0], v[1], v[2]);
}

// The ends of what is drawn of the link with this index, in its frame; -1: the base.
std::vector<Vector3> drawn_ends(const config::Model& model, int index) {
  std::vector<Vector3> ends;
  for (const config::Link& link : model.links)
    if (link.parent == index) ends.push_back(link.origin_xyz);
  if (index >= 0 && model.tool_link == index) ends.push_back(model.tool_xyz);
  std::erase_if(ends, [](const Vector3& end) { return length_of(end) < 1e-6; });
  return ends;
}

double drawn_radius(const config::Model& model) {
  double longest = 0;
  for (int link = -1; link < static_cast<int>(model.links.size()); ++link)
    for (const Vector3& end : drawn_ends(model, link)) longest = std::max(longest, length_of(end));
  return longest > 0 ? kThickness * longest : kThickness;
}

// A ball at the joint, and a cylinder to each end. URDF's cylinder stands on its middle, along z.
std::string visuals(const config::Model& model, int index, double radius) {
  std::string out = fmt::format("    <visual><geometry><sphere radius=\"{}\"/></geometry></visual>\n", 1.3 * radius);
  for (const Vector3& end : drawn_ends(model, index)) {
    const Vector3 middle{end[0] / 2, end[1] / 2, end[2] / 2};
    const Vector3 rpy{0, std::atan2(std::hypot(end[0], end[1]), end[2]), std::atan2(end[1], end[0])};
    out += fmt::format(
        "    <visual><origin xyz=\"{}\" rpy=\"{}\"/><geometry><cylinder radius=\"{}\" length=\"{}\"/></geometry>"
        "</visual>\n",
        text(middle), text(rpy), radius, length_of(end));
  }
  return out;
}

std::string inertial(const config::Link& link) {
  if (link.mass <= 0) return "";
  return fmt::format(
      "    <inertial><origin xyz=\"{}\"/><mass value=\"{}\"/>"
      "<inertia ixx=\"{}\" ixy=\"0\" ixz=\"0\" iyy=\"{}\" iyz=\"0\" izz=\"{}\"/></inertial>\n",
      text(link.com), link.mass, link.inertia[0], link.inertia[1], link.inertia[2]);
}

// w x y z
using Quaternion = std::array<double, 4>;

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

Quaternion turn_about(const Vector3& axis, double angle) {
  const double s = std::sin(angle / 2);
  return {std::cos(angle / 2), s * axis[0], s * axis[1], s * axis[2]};
}

Quaternion turn_of(const Vector3& rpy) {
  return product(turn_about({0, 0, 1}, rpy[2]), product(turn_about({0, 1, 0}, rpy[1]), turn_about({1, 0, 0}, rpy[0])));
}

Vector3 turned(const Quaternion& by, const Vector3& v) {
  const Quaternion out = product(product(by, {0, v[0], v[1], v[2]}), Quaternion{by[0], -by[1], -by[2], -by[3]});
  return {out[1], out[2], out[3]};
}

}  // namespace

std::string robot_description(const config::RobotConfig& robot) {
  const config::Model& model = *robot.model;
  const double radius = drawn_radius(model);
  std::string out = fmt::format("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n  <link name=\"{}\">\n{}  </link>\n",
                                config::xml_text(robot.robot), kBase, visuals(model, -1, radius));
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const config::Link& link = model.links[i];
    const config::Joint& joint = robot.joints[i];
    out += fmt::format("  <link name=\"{}\">\n{}{}  </link>\n", config::xml_text(link_name(link.joint)), inertial(link),
                       visuals(model, static_cast<int>(i), radius));
    out += fmt::format(
        "  <joint name=\"{}\" type=\"{}\">\n    <parent link=\"{}\"/><child link=\"{}\"/>\n"
        "    <origin xyz=\"{}\" rpy=\"{}\"/><axis xyz=\"{}\"/>\n"
        "    <limit lower=\"{}\" upper=\"{}\" effort=\"{}\" velocity=\"{}\"/>\n  </joint>\n",
        config::xml_text(link.joint), joint.kind == config::JointKind::slide ? "prismatic" : "revolute",
        config::xml_text(parent_name(model, link)), config::xml_text(link_name(link.joint)), text(link.origin_xyz),
        text(link.origin_rpy), text(unit(link.axis)), joint.limits.q_min, joint.limits.q_max, joint.limits.torque,
        joint.limits.velocity);
  }
  return out + "</robot>\n";
}

std::vector<FrameTransform> frame_transforms(const config::RobotConfig& robot, const TickRecord& record) {
  const config::Model& model = *robot.model;
  std::vector<FrameTransform> transforms;
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const config::Link& link = model.links[i];
    const auto q = static_cast<double>(record.joints[i].feedback.q);
    if (!std::isfinite(q)) continue;
    FrameTransform& here =
        transforms.emplace_back(FrameTransform{parent_name(model, link), link_name(link.joint), link.origin_xyz, {}});
    Quaternion turn = turn_of(link.origin_rpy);
    const Vector3 axis = unit(link.axis);
    if (robot.joints[i].kind == config::JointKind::slide) {
      const Vector3 way = turned(turn, axis);
      for (std::size_t k = 0; k < 3; ++k) here.translation[k] += q * way[k];
    } else {
      turn = product(turn, turn_about(axis, q));
    }
    here.rotation = {turn[1], turn[2], turn[3], turn[0]};
  }
  return transforms;
}

}  // namespace takt::monitor
