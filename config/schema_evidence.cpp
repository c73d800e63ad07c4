// SPDX-License-Identifier: Apache-2.0
// Keys: record, dds, prometheus, otlp, simulation.
#include <array>

#include "config/schema.hpp"

namespace takt::config {
namespace {

constexpr std::array<std::string_view, 2> kRecorders{"required", "optional"};
constexpr std::array<std::string_view, 2> kTargetKinds{"lissajous", "steps"};

void describe_camera(Fields& fields, Simulation& simulation, Words sensors) {
  fields.one_of({"sensor", "an entry of sensors"}, simulation.camera_sensor, sensors, "sensor");
  fields.duration({"period", "between pictures"}, simulation.camera_period, milliseconds(1), seconds(10));
  fields.duration({"delay", "from shutter to sample", "0 ms"}, simulation.camera_delay, {}, seconds(10));
  fields.duration({"jitter", "delay varies by this", "0 ms"}, simulation.camera_jitter, {}, seconds(10));
}

void describe_target(Fields& fields, Simulation& simulation) {
  std::string kind(kTargetKinds[static_cast<std::size_t>(simulation.target)]);
  fields.one_of({"kind", "path of the target", "lissajous"}, kind, kTargetKinds, "path");
  simulation.target = kind == kTargetKinds[1] ? TargetKind::steps : TargetKind::lissajous;
  const auto is = [&](TargetKind one) { return simulation.target == one || fields.shows_all(); };
  if (is(TargetKind::lissajous)) {
    fields.vector3({"centre", "lissajous: in the base frame"}, simulation.target_centre, Dimension::length);
    fields.vector3({"amplitude", "lissajous: per axis"}, simulation.target_amplitude, Dimension::length, at_least(0));
    fields.vector3({"frequency", "lissajous: per axis"}, simulation.target_frequency, Dimension::frequency,
                   between(0, 100));
  }
  if (is(TargetKind::steps)) {
    fields.quantity({"reach", "steps: drawn within +- this"}, simulation.step_amplitude, Dimension::length,
                    above(0, 100));
    fields.duration({"every", "steps: time between two"}, simulation.step_period, milliseconds(10), seconds(600));
  }
}

void describe_cart_pole(Fields& fields, CartPole& machine) {
  fields.quantity({"pulley_radius", "cart travel per radian of its joint"}, machine.pulley_radius, Dimension::length,
                  above(0, 10));
  fields.quantity({"cart_mass", "without the pole"}, machine.cart_mass, Dimension::mass, above(0, 1e4));
  fields.quantity({"pole_mass", "of the pole"}, machine.pole_mass, Dimension::mass, above(0, 1e4));
  fields.quantity({"pole_com", "pivot to centre of mass"}, machine.pole_com, Dimension::length, above(0, 100));
  fields.quantity({"pole_inertia", "about its centre of mass"}, machine.pole_inertia, Dimension::inertia,
                  between(0, 1e4));
  fields.quantity({"pole_length", "pivot to tip"}, machine.pole_length, Dimension::length, above(0, 100));
  fields.quantity({"pivot_viscous", "friction of the pivot", "0 Nms/rad"}, machine.pivot_viscous, Dimension::damping,
                  between(0, 1e3));
}

void describe_mujoco(Fields& fields, MujocoWorld& world) {
  fields.text({"model", "MJCF with the robot's joint names"}, world.model);
  bool keyframe = !world.keyframe.empty();
  fields.optional_section({"begin", "initial state; absent: joints at home"}, keyframe, [&](Fields& f) {
    f.text({"keyframe", "its name in the model"}, world.keyframe);
  });
  bool imu = !world.imu_site.empty();
  fields.optional_section({"imu", "IMU on the robot"}, imu, [&](Fields& f) {
    f.text({"site", "its name in the model"}, world.imu_site);
  });
}

}  // namespace

void describe_physics(Fields& fields, Simulation& simulation) {
  fields.duration({"step", "integration step of the dynamics", "1 ms"}, simulation.step, microseconds(10),
                  milliseconds(10));
  fields.section({"joint_friction", "friction of driven joints", "{}"}, [&](Fields& f) {
    f.quantity({"viscous", "per speed", "0 Nms/rad"}, simulation.viscous, Dimension::damping, between(0, 1e3));
    f.quantity({"coulomb", "against motion", "0 Nm"}, simulation.coulomb, Dimension::torque, between(0, 1e3));
  });
  fields.quantity({"encoder_step", "resolution of encoders; 0 rad: exact", "0 rad"}, simulation.encoder_step,
                  Dimension::angle, between(0, 1));
  fields.duration({"torque_delay", "from command to torque", "0 ms"}, simulation.torque_delay, {}, seconds(1));
  fields.duration({"drive_watchdog", "time-out of drives without command", "100 ms"}, simulation.drive_watchdog,
                  milliseconds(1), seconds(10));
  fields.integer({"seed", "seed", "1"}, simulation.seed, 0, std::numeric_limits<std::int64_t>::max());
}

namespace {

void describe_simulation(Fields& fields, Simulation& simulation, const RobotConfig& robot) {
  std::vector<std::string_view> sensors;
  for (const Sensor& sensor : robot.sensors) sensors.emplace_back(sensor.name);
  describe_physics(fields, simulation);
  bool cart_pole = simulation.cart_pole.has_value();
  fields.optional_section({"cart_pole", "instead of `model` (docs/cart-pole.md)"}, cart_pole, [&](Fields& f) {
    if (!simulation.cart_pole) simulation.cart_pole.emplace();
    describe_cart_pole(f, *simulation.cart_pole);
  });
  bool mujoco = simulation.mujoco.has_value();
  fields.optional_section({"mujoco", "instead of `model` (docs/mujoco.md)"}, mujoco, [&](Fields& f) {
    if (!simulation.mujoco) simulation.mujoco.emplace();
    describe_mujoco(f, *simulation.mujoco);
  });
  bool camera = !simulation.camera_sensor.empty();
  fields.optional_section({"camera", "simulated camera of the target"}, camera,
                          [&](Fields& f) { describe_camera(f, simulation, sensors); });
  if (camera || fields.shows_all())
    fields.section({"target", "camera: what it sees"}, [&](Fields& f) { describe_target(f, simulation); });
}

constexpr std::size_t kMostDdsPeers = 32;

void describe_images(Fields& fields, ImageRecord& images) {
  fields.quantity({"budget_mib", "MiB per run; 0: no files", "4096"}, images.budget_mib, Dimension::none,
                  between(0, 1 << 30));
  fields.quantity({"rate_mib_per_s", "mean MiB per second", "32"}, images.rate_mib_per_s, Dimension::none,
                  above(0, 1 << 20));
}

void describe_keep(Fields& fields, RunKeep& keep) {
  fields.whole_or_none({"days", "delete older runs without incident or mark", "none"}, keep.days, 1, 36'500);
  fields.whole_or_none({"gib", "delete the oldest beyond, without incident or mark", "none"}, keep.gib, 1, 1'000'000);
}

void describe_dds(Fields& fields, Dds& dds) {
  fields.integer({"domain", "DDS domain, ROS_DOMAIN_ID", "0"}, dds.domain, 0, 232);
  fields.text({"interface", "network interface; lo: this machine alone", "lo"}, dds.interface);
  fields.flag({"multicast", "false: announced to peers only, on lo to this machine", "false"}, dds.multicast);
  fields.each({"peers", "hosts to announce to", "[]"}, dds.peers, kMostDdsPeers, [](Fields& f, DdsPeer& peer) {
    f.text({"address", "host or address"}, peer.address);
  });
  fields.quantity({"joint_state_rate", "of joint_states", "100 Hz"}, dds.joint_state_rate, Dimension::frequency,
                  between(0.1, 1000));
  fields.flag({"allow_requests", "true: every participant may arm and stop", "false"}, dds.allow_requests);
  std::string security = dds.security.empty() ? "none" : dds.security;
  fields.text(
      {"security", "folder of certificate and permissions (docs/ros2.md); none: every participant is heard", "none"},
      security);
  dds.security = security == "none" ? "" : security;
}

void describe_prometheus(Fields& fields, Prometheus& prometheus) {
  fields.text({"address", "address to listen on; 127.0.0.1: this machine alone", "127.0.0.1"}, prometheus.address);
  fields.integer({"port", "of GET /metrics", "9464"}, prometheus.port, 1, 65'535);
}

void describe_otlp(Fields& fields, Otlp& otlp) {
  std::string endpoint = otlp.endpoint.empty() ? "none" : otlp.endpoint;
  fields.flag({"file", "true: otlp_*.jsonl in the run folder", "true"}, otlp.file);
  fields.text({"endpoint", "OTLP/HTTP receiver, http://host:port or https://host:port", "none"}, endpoint);
  fields.duration({"metrics_period", "between exports", "10 s"}, otlp.metrics_period, milliseconds(100), seconds(3600));
  otlp.endpoint = endpoint == "none" ? "" : endpoint;
}

}  // namespace

void describe_evidence(Fields& fields, RobotConfig& robot) {
  fields.section({"record", "recording", "{}"}, [&](Fields& f) {
    f.text({"directory", "folder of run folders", "runs"}, robot.record.directory);
    f.choice({"recorder", "required: without recording, no arming, and a moving robot stops", "required"},
             robot.record.recorder, kRecorders);
    f.duration({"keyframe_period", "time between states to replay from", "1 s"}, robot.record.keyframe_period,
               milliseconds(10), seconds(600));
    f.flag({"policy_inputs", "true: keep policies' inputs and outputs (docs/policies.md)", "true"},
           robot.record.policy_inputs);
    f.section({"keep", "which runs stay; all without a limit (docs/run-folder.md)", "{}"},
              [&](Fields& keep) { describe_keep(keep, robot.record.keep); });
    f.section({"images", "files of images shown to policies", "{}"},
              [&](Fields& images) { describe_images(images, robot.record.images); });
  });
  bool exports = robot.dds.has_value();
  fields.optional_section({"dds", "ROS 2 topics by the monitor (docs/ros2.md)"}, exports, [&](Fields& f) {
    if (!robot.dds) robot.dds.emplace();
    describe_dds(f, *robot.dds);
  });
  bool serves = robot.prometheus.has_value();
  fields.optional_section({"prometheus", "metrics for Prometheus (docs/metrics.md)"}, serves, [&](Fields& f) {
    if (!robot.prometheus) robot.prometheus.emplace();
    describe_prometheus(f, *robot.prometheus);
  });
  bool traces = robot.otlp.has_value();
  fields.optional_section({"otlp", "traces and metrics for OpenTelemetry (docs/opentelemetry.md)"}, traces,
                          [&](Fields& f) {
                            if (!robot.otlp) robot.otlp.emplace();
                            describe_otlp(f, *robot.otlp);
                          });
  bool present = robot.simulation.has_value();
  fields.optional_section({"simulation", "how takt-plant behaves"}, present, [&](Fields& f) {
    if (!robot.simulation) robot.simulation.emplace();
    describe_simulation(f, *robot.simulation, robot);
  });
}

}  // namespace takt::config
