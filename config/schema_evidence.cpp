// Keys: record, simulation.
#include <array>

#include "config/schema.hpp"

namespace takt::config {
namespace {

constexpr std::array<std::string_view, 1> kTargetKinds{"lissajous"};

void describe_camera(Fields& fields, Simulation& simulation, Words sensors) {
  fields.one_of({"sensor", "name of an entry in sensors"}, simulation.camera_sensor, sensors, "sensor");
  fields.duration({"period", "time between two pictures"}, simulation.camera_period, milliseconds(1), seconds(10));
  fields.duration({"delay", "from shutter to sample", "0 ms"}, simulation.camera_delay, {}, seconds(10));
  fields.duration({"jitter", "delay varies by up to this", "0 ms"}, simulation.camera_jitter, {}, seconds(10));
}

void describe_target(Fields& fields, Simulation& simulation) {
  std::string kind(kTargetKinds[0]);
  fields.one_of({"kind", "path of the target", "lissajous"}, kind, kTargetKinds, "path");
  fields.vector3({"centre", "in the base frame"}, simulation.target_centre, Dimension::length);
  fields.vector3({"amplitude", "along each axis"}, simulation.target_amplitude, Dimension::length, at_least(0));
  fields.vector3({"frequency", "along each axis"}, simulation.target_frequency, Dimension::frequency, between(0, 100));
}

}  // namespace

void describe_physics(Fields& fields, Simulation& simulation) {
  fields.duration({"step", "integration step of the dynamics", "1 ms"}, simulation.step, microseconds(10),
                  milliseconds(10));
  fields.section({"joint_friction", "of every joint", "{}"}, [&](Fields& f) {
    f.quantity({"viscous", "grows with speed", "0 Nms/rad"}, simulation.viscous, Dimension::damping, between(0, 1e3));
    f.quantity({"coulomb", "against any motion", "0 Nm"}, simulation.coulomb, Dimension::torque, between(0, 1e3));
  });
  fields.quantity({"encoder_step", "resolution of the simulated encoders; 0 rad: exact", "0 rad"},
                  simulation.encoder_step, Dimension::angle, between(0, 1));
  fields.duration({"torque_delay", "from command to torque", "0 ms"}, simulation.torque_delay, {}, seconds(1));
  fields.duration({"drive_watchdog", "a simulated drive without a command for this long disables itself", "100 ms"},
                  simulation.drive_watchdog, milliseconds(1), seconds(10));
  fields.integer({"seed", "of every random choice in the simulation", "1"}, simulation.seed, 0,
                 std::numeric_limits<std::int64_t>::max());
}

namespace {

void describe_simulation(Fields& fields, Simulation& simulation, const RobotConfig& robot) {
  std::vector<std::string_view> sensors;
  for (const Sensor& sensor : robot.sensors) sensors.emplace_back(sensor.name);
  describe_physics(fields, simulation);
  bool camera = !simulation.camera_sensor.empty();
  fields.optional_section({"camera", "simulated camera that sees the target"}, camera,
                          [&](Fields& f) { describe_camera(f, simulation, sensors); });
  if (camera || fields.shows_all())
    fields.section({"target", "what the camera sees"}, [&](Fields& f) { describe_target(f, simulation); });
}

}  // namespace

void describe_evidence(Fields& fields, RobotConfig& robot) {
  fields.section({"record", "what a run leaves behind", "{}"}, [&](Fields& f) {
    f.text({"directory", "run folders are made in it; a relative path starts at this file's folder", "runs"},
           robot.record.directory);
    f.duration({"keyframe_period", "time between two stored states that replay can start from", "1 s"},
               robot.record.keyframe_period, milliseconds(10), seconds(600));
  });
  bool present = robot.simulation.has_value();
  fields.optional_section({"simulation", "how takt-plant behaves"}, present, [&](Fields& f) {
    if (!robot.simulation) robot.simulation.emplace();
    describe_simulation(f, *robot.simulation, robot);
  });
}

}  // namespace takt::config
