// SPDX-License-Identifier: Apache-2.0
// Keys: buses, joints, model, safety.
#include <array>
#include <cmath>

#include "config/joint_defaults.hpp"
#include "config/joint_keys.hpp"
#include "config/schema.hpp"
#include "executive/contract/joints.hpp"

namespace takt::config {
namespace {

constexpr std::array<std::string_view, 2> kWhenMissing{"refuse", "loopback"};
constexpr std::array<std::string_view, 2> kTorqueOutputs{"gpio", "file"};
constexpr std::array<std::string_view, 2> kLevels{"high", "low"};
constexpr std::array<std::string_view, 2> kOnJointFault{"keep", "drop"};
constexpr std::array<std::string_view, 2> kJointKinds{"hinge", "slide"};

}  // namespace

void describe_bus(Fields& fields, Bus& bus) {
  fields.identifier({"name", "name of the bus"}, bus.name);
  fields.identifier({"interface", "CAN network interface"}, bus.interface);
  double bitrate = bus.bitrate;
  fields.quantity({"bitrate", "nominal bit rate", "1 Mbit/s"}, bitrate, Dimension::bit_rate, between(10e3, 1e6));
  bus.bitrate = static_cast<std::uint32_t>(std::lround(bitrate));
  constexpr std::string_view kKernelChooses = "0";
  fields.quantity({"sample_point", "share of a bit; 0: the kernel's choice", kKernelChooses}, bus.sample_point,
                  Dimension::none, between(0, 0.999));
  fields.integer({"sjw", "synchronisation jump width, time quanta; 0: the kernel's choice", kKernelChooses}, bus.sjw, 0,
                 128);
  fields.flag({"fd", "frames may be CAN FD", "false"}, bus.fd);
  if (bus.fd || fields.shows_all()) {
    double data_bitrate = bus.data_bitrate;
    fields.quantity({"data_bitrate", "fd: bit rate of the data phase", "5 Mbit/s"}, data_bitrate, Dimension::bit_rate,
                    between(10e3, 10e6));
    bus.data_bitrate = static_cast<std::uint32_t>(std::lround(data_bitrate));
    fields.quantity({"data_sample_point", "fd: sample_point of the data phase", kKernelChooses}, bus.data_sample_point,
                    Dimension::none, between(0, 0.999));
    fields.integer({"data_sjw", "fd: sjw of the data phase", kKernelChooses}, bus.data_sjw, 0, 128);
  }
  fields.choice({"when_missing", "refuse to start, or use the loopback bus", "refuse"}, bus.when_missing, kWhenMissing);
}

namespace {

void describe_temperature(Fields& fields, TemperatureLimits& limits) {
  const auto one = [&fields](std::string_view key, std::string_view doc, double& value) {
    fields.quantity({key, doc, "0 degC"}, value, Dimension::temperature, between(0, 250));
  };
  one("warning", "warning and degraded.by_temperature, of the hottest part; 0 degC: off", limits.warning);
  one("stop", "stop, of the hottest part; 0 degC: off", limits.stop);
  one("casing_warning", "mit (damiao), odrive, moteus: warning of casing or output stage", limits.casing_warning);
  one("casing_stop", "the same: stop", limits.casing_stop);
}

// Of a gear of many rad/m a slide's numbers become large: stiffness with its square.
constexpr JointRange kTorques{above(0, 1e5), above(0, 1e7)}, kTorqueRates{above(0, 1e8), above(0, 1e10)},
    kStiffnesses{between(0, 1e5), between(0, 1e11)}, kDampings{between(0, 1e4), between(0, 1e10)},
    kSomeDampings{above(0, 1e4), above(0, 1e10)}, kInertias{above(0, 1e4), above(0, 1e7)},
    kMostInertias{between(0, 1e4), between(0, 1e7)};

// A passive joint has the limits of what is measured only.
void describe_limits(Fields& fields, Limits& limits, JointKind kind, bool passive) {
  const bool commanded = !passive || fields.shows_all();
  const JointKeys keys(fields, kind);
  keys.interval({"position", "lowest and highest joint angle"}, limits.q_min, limits.q_max, kJointPosition,
                between(-1000, 1000));
  keys.quantity({"position_margin", "damped stop when a measured angle is further outside"}, limits.position_margin,
                kJointPosition, between(0, 10));
  keys.quantity({"velocity", "largest reference velocity; faster motion blocks arming"}, limits.velocity,
                kJointVelocity, above(0, 1000));
  keys.quantity({"velocity_hard", "damped stop above this measured velocity"}, limits.velocity_hard, kJointVelocity,
                above(0, 1000));
  bool looks_at_temperature = limits.temperature.has_value();
  fields.optional_section({"temperature", "of the drive; one that reports none is not armed"}, looks_at_temperature,
                          [&](Fields& f) {
                            if (!limits.temperature) limits.temperature.emplace();
                            describe_temperature(f, *limits.temperature);
                          });
  if (!commanded) return;
  keys.quantity({"target_margin",
                 "targets further outside count as out of range; all are clamped; slide: 0.005 m",
                 {{"0.1 rad", "0.005 m"}}},
                limits.target_margin, kJointPosition, between(0, 1000));
  keys.quantity({"acceleration", "largest acceleration and deceleration of the reference"}, limits.acceleration,
                kJointAcceleration, above(0, 1e5));
  keys.quantity({"following_error",
                 "largest distance from the reference; 0 rad: where stiffness asks for 90 % of limits.torque",
                 {{"0 rad", "0 m"}}},
                limits.following_error, kJointPosition, between(0, 1000));
  keys.quantity({"torque", "largest commanded torque"}, limits.torque, kJointTorque, kTorques);
  keys.quantity({"torque_rate", "largest rate of commanded torque"}, limits.torque_rate, kJointTorqueRate,
                kTorqueRates);
  keys.quantity({"kp", "highest stiffness of a policy"}, limits.kp, kJointStiffness, kStiffnesses);
  keys.quantity({"kd", "highest damping of a policy"}, limits.kd, kJointDamping, kDampings);
}

void describe_stiffness(Fields& fields, Joint& joint) {
  fields.section({"gains", "gains when the policy sends none"}, [&](Fields& f) {
    const JointKeys keys(f, joint.kind);
    keys.quantity({"kp", "stiffness"}, joint.kp, kJointStiffness, kStiffnesses);
    keys.quantity({"kd", "damping"}, joint.kd, kJointDamping, kDampings);
    keys.quantity({"damping", "damping in a stop or fault"}, joint.damping, kJointDamping, kSomeDampings);
  });
  const JointKeys keys(fields, joint.kind);
  keys.quantity({"inertia", "lower bound of the effective inertia, for torque barriers"}, joint.inertia, kJointInertia,
                kInertias);
  keys.quantity(
      {"inertia_max", "upper bound with load, for braking (docs/design.md); 0: as inertia", {{"0 kgm2", "0 kg"}}},
      joint.inertia_max, kJointInertia, kMostInertias);
}

void describe_joint(Fields& fields, Joint& joint, Words buses) {
  fields.identifier({"name", "unique name"}, joint.name);
  if (!fields.choice({"kind", "slide: moves along a line, keys in m and N", "hinge"}, joint.kind, kJointKinds))
    return fields.leave_the_rest();
  fields.reference({"bus", "bus of its drive"}, joint.bus, buses, "bus");
  fields.flag({"passive", "true: an encoder without gains and torque", "false"}, joint.passive);
  const bool commanded = !joint.passive || fields.shows_all();
  fields.section({"drive", "the drive behind the joint"},
                 [&](Fields& f) { describe_drive(f, joint.drive, joint.kind); });
  fields.section({"limits", "limits of the joint"},
                 [&](Fields& f) { describe_limits(f, joint.limits, joint.kind, joint.passive); });
  if (commanded) describe_stiffness(fields, joint);
  fields.quantity({"observer_bandwidth", "bandwidth of the velocity observer", "200 rad/s"}, joint.observer_bandwidth,
                  Dimension::angular_velocity, above(0, 1e4));
  JointKeys(fields, joint.kind)
      .quantity({"home", "zero of relative positions", {{"0 rad", "0 m"}}}, joint.home, kJointPosition,
                between(-1000, 1000));
}

// For the key table and the schema; a reader finds the joints filled already (config/joint_defaults.hpp).
void describe_joint_defaults(Fields& fields) {
  fields.sequence(
      {kJointDefaults, "shared keys; a joint's own wins, then the last block's", "[]"}, 0, kMaxJoints,
      [](std::size_t) {},
      [](Fields& f, std::size_t) {
        std::vector<std::string> patterns;
        f.names({"joints", "patterns of names; beside it any key of joints[] but name"}, patterns, {}, "joint");
      });
}

void describe_link(Fields& fields, Link& link, Words joints, Words earlier) {
  fields.one_of({"joint", "joint that moves it"}, link.joint, joints, "joint");
  std::string parent = link.parent < 0 ? "base" : std::string(earlier[static_cast<std::size_t>(link.parent) + 1]);
  fields.one_of({"parent", "base, or the joint of an earlier link"}, parent, earlier, "earlier link");
  link.parent = -1;
  for (std::size_t i = 1; i < earlier.size(); ++i)
    if (earlier[i] == parent) link.parent = static_cast<int>(i) - 1;
  fields.section({"origin", "joint frame in the parent's at zero angle"}, [&](Fields& f) {
    f.vector3({"xyz", "position"}, link.origin_xyz, Dimension::length);
    f.vector3({"rpy", "fixed-axis roll, pitch, yaw", "[0 rad, 0 rad, 0 rad]"}, link.origin_rpy, Dimension::angle);
  });
  fields.vector3({"axis", "joint axis in the joint frame"}, link.axis, Dimension::none);
  fields.quantity({"mass", "of the link"}, link.mass, Dimension::mass, between(0, 1e4));
  fields.vector3({"com", "centre of mass in the link frame"}, link.com, Dimension::length);
  fields.vector3({"inertia", "principal moments about com, along the link's axes"}, link.inertia, Dimension::inertia,
                 at_least(0));
}

void describe_model(Fields& fields, Model& model, Words joints) {
  fields.vector3({"gravity", "in the base frame", "[0 m/s2, 0 m/s2, -9.81 m/s2]"}, model.gravity,
                 Dimension::acceleration);
  fields.sequence(
      {"links", "one per joint, in the joints' order"}, model.links.size(), kMaxJoints,
      [&](std::size_t count) { model.links.resize(count); },
      [&](Fields& f, std::size_t i) {
        std::vector<std::string_view> earlier{"base"};
        for (std::size_t k = 0; k < i; ++k) earlier.emplace_back(model.links[k].joint);
        describe_link(f, model.links[i], joints, earlier);
      });
  std::vector<std::string_view> links{};
  for (const Link& link : model.links) links.emplace_back(link.joint);
  fields.section({"tool", "point the simulated task is about"}, [&](Fields& f) {
    f.reference({"link", "joint of its link"}, model.tool_link, links, "link");
    f.vector3({"xyz", "position in the link's frame"}, model.tool_xyz, Dimension::length);
  });
}

void describe_safe_torque_off(Fields& fields, SafeTorqueOff& output) {
  fields.choice({"output", "GPIO line, or, for simulated robots, a file's lock", "gpio"}, output.output,
                kTorqueOutputs);
  const auto is = [&](TorqueOutputKind one) { return output.output == one || fields.shows_all(); };
  if (is(TorqueOutputKind::gpio)) {
    fields.text({"chip", "gpio: the chip's device", "/dev/gpiochip0"}, output.chip);
    fields.integer({"line", "gpio: its line"}, output.line, 0, 65535);
    fields.choice({"active", "gpio: level at which torque is permitted", "high"}, output.active, kLevels);
  }
  if (is(TorqueOutputKind::file)) fields.text({"file", "file: its path"}, output.file);
  fields.choice({"on_joint_fault", "whether a joint's fault drops the whole robot's torque"}, output.on_joint_fault,
                kOnJointFault);
}

}  // namespace

void describe_machine(Fields& fields, RobotConfig& robot) {
  fields.each({"buses", "CAN buses", {}}, robot.buses, kMaxBuses, describe_bus);
  std::vector<std::string_view> buses;
  for (const Bus& bus : robot.buses) buses.emplace_back(bus.name);
  if (fields.shows_all()) describe_joint_defaults(fields);
  fields.each({"joints", "joints, in the order of every vector"}, robot.joints, kMaxJoints,
              [&](Fields& f, Joint& joint) { describe_joint(f, joint, buses); });
  bool present = robot.model.has_value();
  fields.optional_section({"model", "rigid bodies, for gravity and simulation"}, present, [&](Fields& f) {
    if (!robot.model) robot.model.emplace();
    describe_model(f, *robot.model, joint_names(robot));
  });
  bool is_safe = robot.safe_torque_off.has_value();
  fields.optional_section({"safety", "outputs for safety devices"}, is_safe, [&](Fields& f) {
    if (!robot.safe_torque_off) robot.safe_torque_off.emplace();
    f.section({"safe_torque_off", "the output that permits torque"},
              [&](Fields& g) { describe_safe_torque_off(g, *robot.safe_torque_off); });
  });
}

}  // namespace takt::config
