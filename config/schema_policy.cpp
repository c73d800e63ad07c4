// SPDX-License-Identifier: Apache-2.0
// Keys: sensors, imu, policy, fallbacks, degraded, stops.
#include <algorithm>
#include <array>

#include "config/join_names.hpp"
#include "config/joint_units.hpp"
#include "config/observation_shape.hpp"
#include "config/schema.hpp"
#include "executive/contract/joints.hpp"

namespace takt::config {
namespace {

constexpr std::array<std::string_view, 2> kQuaternionOrders{"wxyz", "xyzw"};
constexpr std::array<std::string_view, 2> kImageLayouts{"chw", "hwc"};
constexpr std::array<std::string_view, 2> kHistoryOrders{"oldest_first", "newest_first"};
constexpr std::array<std::string_view, 3> kDegraded{"hold", "slow", "fallback"};
constexpr std::array<std::string_view, 4> kStopHow{"rest", "damping", "hold", "policy"};
constexpr std::array<std::string_view, 2> kLayouts{"by_term", "by_time"};
constexpr std::array<std::string_view, 3> kFallbackKinds{"pose", "state_feedback", "policy"};
constexpr std::array<std::string_view, 3> kActionKinds{"joint_position", "joint_velocity", "joint_torque"};
constexpr std::array<std::string_view, 3> kInterpolations{"hold", "linear", "cubic"};
constexpr std::array<std::string_view, 3> kPrefixUses{"none", "guided", "trained"};
constexpr std::array<std::string_view, 4> kPrefixSchedules{"ones", "zeros", "linear", "exponential"};
constexpr std::array<std::string_view, 3> kSampleChoices{"first", "coherent", "agreed"};
constexpr std::array<std::string_view, 4> kRosTypes{"sensor_msgs/msg/Image", "sensor_msgs/msg/Imu",
                                                    "sensor_msgs/msg/JointState", "geometry_msgs/msg/Twist"};
constexpr std::array<std::string_view, 5> kRosEncodings{"mono8", "rgb8", "bgr8", "rgba8", "bgra8"};
constexpr std::array<std::string_view, 3> kRosQuantities{"position", "velocity", "effort"};
constexpr std::array<std::string_view, 3> kProviders{"cpu", "cuda", "tensorrt"};
constexpr std::int64_t kMostEngineThreads = 64;
constexpr std::size_t kMaxTensorShapes = 16;
constexpr std::size_t kMaxTerms = 32;
constexpr std::size_t kMaxSensors = 16;
constexpr std::size_t kMostSamples = 64;

void describe_image(Fields& fields, Sensor& sensor) {
  if (!sensor.image) sensor.image.emplace();
  fields.integer({"height", "rows"}, sensor.image->height, 1, 4096);
  fields.integer({"width", "pixels of a row"}, sensor.image->width, 1, 4096);
  fields.integer({"channels", "bytes of a pixel", "3"}, sensor.image->channels, 1, 4);
}

void describe_command(Fields& fields, Sensor& sensor) {
  if (!sensor.command) sensor.command.emplace();
  CommandLimits& limits = *sensor.command;
  const Count one_each{.low = 1, .high = kMaxSensorValues};
  fields.quantities({"minimum", "of each value"}, limits.minimum, Dimension::none, any_value(), one_each);
  fields.quantities({"maximum", "of each value"}, limits.maximum, Dimension::none, any_value(), one_each);
  fields.quantities({"when_absent", "without a usable sample"}, limits.when_absent, Dimension::none, any_value(),
                    one_each);
}

void describe_ros(Fields& fields, Sensor& sensor) {
  if (!sensor.ros) sensor.ros.emplace();
  RosTopic& ros = *sensor.ros;
  fields.text({"topic", "its name"}, ros.topic);
  fields.choice({"type", "of its messages"}, ros.type, kRosTypes);
  if (ros.type == RosType::image || fields.shows_all())
    fields.choice({"encoding", "Image: encoding; another is refused"}, ros.encoding, kRosEncodings);
  if (ros.type != RosType::joint_state && !fields.shows_all()) return;
  fields.each({"joints", "JointState: a value each", "[]"}, ros.joints, kMaxSensorValues,
              [](Fields& f, RosJoint& joint) {
                f.text({"name", "as the messages have it"}, joint.name);
              });
  fields.choice({"quantity", "JointState: what of each joint", "position"}, ros.quantity, kRosQuantities);
}

void describe_sensor(Fields& fields, Sensor& sensor) {
  fields.identifier({"name", "name; its socket is sensor-NAME.sock"}, sensor.name);
  bool is_image = sensor.image.has_value();
  fields.optional_section({"image", "images of 8 bits, row by row, interleaved channels"}, is_image,
                          [&](Fields& f) { describe_image(f, sensor); });
  if (!is_image || fields.shows_all())
    fields.integer({"values", "numbers per sample; omitted for an image"}, sensor.values, 1, kMaxSensorValues);
  fields.duration({"timeout", "older samples are not used"}, sensor.timeout, milliseconds(1), seconds(60));
  fields.text({"unit", "unit; another is refused", "unstated"}, sensor.unit);
  fields.text({"frame", "frame, as the policy's exporter has it: base, world, a body's name", "unstated"},
              sensor.frame);
  if (!is_image || fields.shows_all())
    fields.integer({"queue", "Python or C: most samples per observation; 0: newest only", "0"}, sensor.queue, 0,
                   kMaxSensorQueue);
  bool is_command = sensor.command.has_value();
  fields.optional_section({"command", "operator input"}, is_command, [&](Fields& f) { describe_command(f, sensor); });
  bool is_from_ros = sensor.ros.has_value();
  fields.optional_section({"ros", "ROS 2 topic, by takt-ros-sensors, in the domain of `dds`"}, is_from_ros,
                          [&](Fields& f) { describe_ros(f, sensor); });
}

void describe_imu(Fields& fields, Imu& imu, Words sensors) {
  fields.one_of({"sensor",
                 "ten values: rotation wxyz (base in world); angular velocity (rad/s), specific force (m/s^2) xyz in "
                 "the base frame"},
                imu.sensor, sensors, "sensor");
  fields.quantity({"tilt", "damped stop beyond this angle from upright"}, imu.tilt, Dimension::angle, above(0, 3.2));
  fields.quantity({"angular_velocity", "damped stop above this rate of the base", "100 rad/s"}, imu.angular_velocity,
                  Dimension::angular_velocity, above(0, 1000));
  fields.duration({"frozen_after", "IMU lost when its values stay the same this long; 0 ms: off", "0 ms"},
                  imu.frozen_after, {}, seconds(60));
  fields.quantity(
      {"contradiction", "IMU lost when rotation and angular velocity differ by more within 0.5 s; 0 rad: off", "0 rad"},
      imu.contradiction, Dimension::angle, between(0, 3.2));
}

// What holds of a term of any kind.
void describe_scaling(Fields& fields, ObservationTerm& term) {
  const Count one_or_each{.low = 1, .high = kMaxSensorValues, .single_allowed = true};
  fields.quantities({"clip", "lowest and highest, before the scale; empty: none", "[]"}, term.clip, Dimension::none,
                    any_value(), {.low = 0, .high = 2});
  fields.quantities({"scale", "factor; images: per channel, as mean and std", "1"}, term.scale, Dimension::none,
                    any_value(), one_or_each);
  fields.quantities({"mean", "subtracted after the scale", "0"}, term.mean, Dimension::none, any_value(), one_or_each);
  fields.quantities({"std", "divides the rest", "1"}, term.standard_deviation, Dimension::none, above(0, 1e9),
                    one_or_each);
  fields.integer({"history", "instants, in history_order", "1"}, term.history, 1, kMostHistory);
}

void describe_term(Fields& fields, ObservationTerm& term, Words sensors, Words joints) {
  fields.choice({"term", "what is observed"}, term.kind, kTermNames);
  if (term.kind == TermKind::sensor || term.kind == TermKind::command || fields.shows_all())
    fields.one_of({"sensor", "sensor, command: an entry of sensors"}, term.sensor, sensors, "sensor");
  if (term.kind == TermKind::sensor || fields.shows_all())
    fields.choice(
        {"layout", "sensor, of images: chw: channel by channel; hwc: interleaved; a byte becomes 0 to 1", "chw"},
        term.layout, kImageLayouts);
  if (term.kind == TermKind::gait_phase || fields.shows_all())
    fields.duration({"gait_period", "gait_phase: a cycle, from the policy's last reset"}, term.gait_period,
                    milliseconds(1), seconds(60));
  if (term.kind == TermKind::constant || fields.shows_all())
    fields.quantities({"values", "constant: the numbers"}, term.constant, Dimension::none, any_value(),
                      {.low = 1, .high = kMaxSensorValues});
  if (is_of_joints(term.kind) || fields.shows_all())
    fields.references({"joints", "terms of joints: which; empty: joint_order", "[]"}, term.joints, joints, "joint");
  if (term.kind == TermKind::base_orientation || fields.shows_all())
    fields.choice({"order", "base_orientation: order of the quaternion"}, term.order, kQuaternionOrders);
  if (term.kind == TermKind::motion_reference || fields.shows_all()) {
    fields.text({"output", "motion_reference: output of the inference before"}, term.output);
    fields.integer({"count", "motion_reference: its values"}, term.values, 1, kMaxSensorValues);
  }
  describe_scaling(fields, term);
}

void describe_join(Fields& fields, Join& join) {
  fields.choice(
      {"kind",
       "replace: at once; cross_fade; blend: fixed mixture; ensemble: weighted predictions of an instant; align: the "
       "difference fades; quintic: align with smooth acceleration; prefix: the old path for as long as promised",
       "replace"},
      join.kind, kJoinNames);
  fields.duration({"over", "cross_fade, align, quintic: duration of a join", "100 ms"}, join.over, milliseconds(1),
                  seconds(10));
  fields.quantity({"new_share", "blend: the new chunk's share", "0.7"}, join.new_share, Dimension::none, above(0, 1));
  fields.quantity({"decay", "ensemble: m of the weights exp(-m i), i = 0 the oldest prediction", "0.01"}, join.decay,
                  Dimension::none, between(0, 10));
  fields.duration({"taper", "ensemble: time of a weight's fall to zero at its chunk's end", "0 ms"}, join.taper, {},
                  seconds(10));
  fields.duration({"longest", "prefix: longest promise, the longest delay trained for", "10 ms"}, join.longest,
                  microseconds(100), seconds(10));
}

// Of each output's offset, by its joint, which the file may name further down.
std::vector<Dimension> offset_dimensions(const Fields& fields, const Policy& policy, const RobotConfig& robot) {
  std::vector<Dimension> dimensions;
  const auto add = [&dimensions](const Joint& joint) { dimensions.push_back(kJointPosition.of(joint.kind)); };
  for (const std::string& name : fields.names_ahead("joints")) {
    const auto joint = std::ranges::find(robot.joints, name, &Joint::name);
    add(joint == robot.joints.end() ? Joint{} : *joint);
  }
  const auto& given = policy.action.joint_of_output;
  if (dimensions.empty())
    for (const std::size_t joint : given.empty() ? policy.joint_order : given) add(robot.joints[joint]);
  if (dimensions.empty())
    for (const Joint& joint : robot.joints) add(joint);
  return dimensions;
}

void describe_action(Fields& fields, Policy& policy, const RobotConfig& robot, Words joints) {
  Action& action = policy.action;
  constexpr std::array<std::string_view, 3> kOffsets{"zero", "home", "measured"};
  fields.choice({"kind", "target = offset + scale * output", "joint_position"}, action.kind, kActionKinds);
  fields.choice(
      {"interpolation",
       "hold: a step's target for its period, velocity setpoint only of joint_velocity; linear; cubic: smooth",
       "linear"},
      action.interpolation, kInterpolations);
  fields.section({"join", "how a new chunk takes over", "{}"}, [&](Fields& f) { describe_join(f, action.join); });
  fields.quantities({"scale", "factor in rad, rad/s or Nm; slide: m, m/s or N", "1"}, action.scale, Dimension::none,
                    any_value(), {.low = 1, .high = kMaxJoints, .single_allowed = true});
  const std::vector<Dimension> dimensions = offset_dimensions(fields, policy, robot);
  auto offset = static_cast<std::size_t>(action.offset);
  fields.word_or_quantities({.name = "offset",
                             .doc = "home, zero, measured (the observation's), or per output",
                             .otherwise = "home",
                             .other = Key::Other{Dimension::length, {}},
                             .each = dimensions},
                            offset, kOffsets, action.offset_values, Dimension::angle, any_value(),
                            {.low = 1, .high = kMaxJoints});
  action.offset = static_cast<OffsetKind>(offset);
  fields.references({"joints", "joint of each output; empty: joint_order", "[]"}, action.joint_of_output, joints,
                    "joint");
  fields.section({"outputs", "further outputs, of the action's shape, unscaled", "{}"}, [&](Fields& f) {
    f.text({"velocity", "joint_position: velocities, rad/s", "none"}, action.velocity);
    f.text({"torque", "torques added to the gains', Nm", "none"}, action.torque);
    f.text({"kp", "stiffness, Nm/rad; none: the joints'", "none"}, action.kp);
    f.text({"kd", "damping, Nms/rad; none: the joints'", "none"}, action.kd);
  });
}

void describe_monitors(Fields& fields, ChunkMonitors& monitors) {
  fields.integer({"votes", "answers above a threshold that make a catch", "20"}, monitors.votes, 1, 1000);
  fields.integer({"of", "of so many newest answers", "40"}, monitors.of, 1, 1000);
  fields.each({"thresholds", "as `takt policy calibrate` prints them", "[]"}, monitors.thresholds, kChunkScoreCount,
              [](Fields& f, ChunkThreshold& threshold) {
                f.choice({"score", "score of every answer (docs/policies.md)"}, threshold.score, kChunkScoreNames);
                f.quantity({"above", "largest usual value"}, threshold.above, Dimension::none, between(0, 1e9));
              });
}

void describe_sampler(Fields& fields, Sampler& sampler) {
  fields.text({"noisy", "input for what is denoised", "x_t"}, sampler.noisy);
  fields.text({"time", "input for time, 0 noise to 1 action: one number, or per step", "t"}, sampler.time);
  fields.integer({"steps", "denoising steps, of one size", "8"}, sampler.steps, 1, 1000);
  fields.integer({"seed", "seed of the noise, with the observation's id", "1"}, sampler.seed, 0, 1U << 30U);
  fields.choice(
      {"prefix", "guided: drawn towards the played path; trained: the network is shown the steps to be played", "none"},
      sampler.prefix, kPrefixUses);
  fields.choice({"schedule", "guided: fall of the pull from the promised steps to the path's end", "exponential"},
                sampler.schedule, kPrefixSchedules);
  fields.quantity({"limit", "guided: largest share of the error in the velocity", "5"}, sampler.limit, Dimension::none,
                  above(0, 1000));
  fields.integer({"samples", "per answer", "1"}, sampler.samples, 1, kMostSamples);
  fields.choice({"choice", "coherent: nearest to the played path; agreed: first, as far as all agree", "first"},
                sampler.choice, kSampleChoices);
  fields.quantity({"decay", "coherent: m of the weights exp(-m i), i = 0 the first step", "0.5"}, sampler.decay,
                  Dimension::none, between(0, 10));
  fields.quantity({"tolerance", "agreed: largest difference of outputs", "0.1"}, sampler.tolerance, Dimension::none,
                  above(0, 1e6));
}

void describe_speculation(Fields& fields, Speculation& speculation) {
  fields.quantity({"position", "largest distance of a joint from where it was assumed"}, speculation.position,
                  Dimension::angle, above(0, 1));
  fields.quantity({"velocity", "the same of velocity"}, speculation.velocity, Dimension::angular_velocity,
                  above(0, 100));
}

void describe_engine(Fields& fields, Engine& engine) {
  fields.text({"name",
               "builtin, onnxruntime, torchscript, a plugin's path (with a slash; docs/own-engine.md); auto: "
               "torchscript for .pt, else the quicker of the others",
               "auto"},
              engine.name);
  fields.integer({"threads", "of one inference", "1"}, engine.threads, 1, kMostEngineThreads);
  fields.one_of({"provider", "device; cuda, tensorrt: with a library that has them", "cpu"}, engine.provider,
                kProviders, "provider");
  std::string library = engine.library.empty() ? "none" : engine.library;
  fields.text({"library", "onnxruntime: libonnxruntime.so; none: the dynamic linker's", "none"}, library);
  engine.library = library == "none" ? "" : library;
  fields.duration({"load_within", "refuse a plugin that loads longer", "60 s"}, engine.load_within, milliseconds(100),
                  seconds(3600));
  fields.each(
      {"shapes", "of inputs, where the file lacks them (torchscript)", "[]"}, engine.shapes, kMaxTensorShapes,
      [](Fields& f, TensorShape& shape) {
        f.text({"tensor", "the input"}, shape.tensor);
        f.quantities({"shape", "its dimensions"}, shape.shape, Dimension::none, between(1, 1e6), {.low = 1, .high = 8});
      });
}

void describe_policy_section(Fields& fields, Policy& policy, const RobotConfig& robot) {
  const auto joints = joint_names(robot);
  std::vector<std::string_view> sensors;
  for (const Sensor& sensor : robot.sensors) sensors.emplace_back(sensor.name);
  fields.text({"file", "ONNX file, or another engine's"}, policy.file);
  fields.text(
      {"signed_by", "Ed25519 public key, PEM: only policies signed with it (FILE.sig) arm (docs/policies.md)", "none"},
      policy.signed_by);
  fields.duration({"period", "time between observations"}, policy.period, microseconds(100), seconds(10));
  fields.duration({"step_period", "time between steps of a chunk"}, policy.step_period, microseconds(100), seconds(10));
  fields.integer({"steps", "steps of an action chunk", "1"}, policy.steps, 1, kMaxChunkSteps);
  fields.text({"input", "the model's input", "obs"}, policy.input);
  fields.text({"output", "the model's output", "actions"}, policy.output);
  bool has_engine = policy.engine.has_value();
  fields.optional_section({"engine", "what runs the file (docs/policies.md)"}, has_engine, [&](Fields& f) {
    if (!policy.engine) policy.engine.emplace();
    describe_engine(f, *policy.engine);
  });
  fields.integer({"nice", "niceness of the policy host", "0"}, policy.nice, -20, 19);
  fields.integer({"requests_in_flight", "observations answered at a time, by a network each", "1"},
                 policy.requests_in_flight, 1, kMostRequests);
  fields.duration({"probation", "tracking time after a swap in which failure switches back (docs/policies.md)", "10 s"},
                  policy.probation, Duration{0}, seconds(3600));
  fields.references({"joint_order", "the policy's joint order; empty: this file's", "[]"}, policy.joint_order, joints,
                    "joint");
  fields.one_of({"history_layout", "each term's history together, or each instant's terms", "by_term"},
                policy.history_layout, kLayouts, "layout");
  fields.one_of({"history_order", "order of a history's instants", "oldest_first"}, policy.history_order,
                kHistoryOrders, "order");
  fields.each({"observation", "terms, in the input's order"}, policy.observation, kMaxTerms,
              [&](Fields& f, ObservationTerm& term) { describe_term(f, term, sensors, joints); });
  fields.section({"action", "how outputs become joint targets", "{}"},
                 [&](Fields& f) { describe_action(f, policy, robot, joints); });
  bool monitored = policy.monitors.has_value();
  fields.optional_section({"monitors", "scores of answers; a catch is recorded, no more"}, monitored, [&](Fields& f) {
    if (!policy.monitors) policy.monitors.emplace();
    describe_monitors(f, *policy.monitors);
  });
  bool samples = policy.sampler.has_value();
  fields.optional_section({"sampler", "the file is a flow's velocity network"}, samples, [&](Fields& f) {
    if (!policy.sampler) policy.sampler.emplace();
    describe_sampler(f, *policy.sampler);
  });
  bool speculates = policy.speculation.has_value();
  fields.optional_section({"speculation", "alternatives for future states (docs/policies.md)"}, speculates,
                          [&](Fields& f) {
                            if (!policy.speculation) policy.speculation.emplace();
                            describe_speculation(f, *policy.speculation);
                          });
}

constexpr std::array kMixedPosition{Dimension::torque_per_length, Dimension::force_per_angle};
constexpr std::array kMixedVelocity{Dimension::torque_per_velocity, Dimension::force_per_angular_velocity};

void describe_feedback_row(Fields& fields, FeedbackRow& row, const RobotConfig& robot, Words joints) {
  const Count one_each{.low = joints.size(), .high = joints.size(), .of = "joint"};
  fields.reference({"joint", "driven joint"}, row.joint, joints, "joint");
  const bool slides = !robot.joints.empty() && robot.joints[row.joint].kind == JointKind::slide;
  std::vector<Dimension> position, velocity;
  for (const Joint& joint : robot.joints) {
    position.push_back((slides ? kForcePerAngle : kTorquePerAngle).of(joint.kind));
    velocity.push_back((slides ? kForcePerVelocity : kTorquePerVelocity).of(joint.kind));
  }
  fields.quantities({.name = "position",
                     .doc = "gain on each angle beyond the pose",
                     .other = Key::Other{Dimension::linear_stiffness, {}},
                     .each = position,
                     .mixed = kMixedPosition},
                    row.position, Dimension::stiffness, between(-1e5, 1e5), one_each);
  fields.quantities({.name = "velocity",
                     .doc = "gain on each velocity",
                     .other = Key::Other{Dimension::linear_damping, {}},
                     .each = velocity,
                     .mixed = kMixedVelocity},
                    row.velocity, Dimension::damping, between(-1e5, 1e5), one_each);
}

void describe_fallback_policy(Fields& fields, Fallback& fallback) {
  fields.text({"file", "policy: another file, same observation and action; none: policy.file", "none"}, fallback.file);
  fields.quantities({"command", "policy: value of its terms `command`", "[]"}, fallback.command, Dimension::none,
                    any_value(), {.low = 0, .high = kMaxSensorValues});
  fields.duration({"for", "policy: damped stop after moving the robot this long; 0 s: never"}, fallback.longest, {},
                  seconds(3600));
}

void describe_fallback(Fields& fields, Fallback& fallback, const RobotConfig& robot) {
  const std::vector<std::string_view> joints = joint_names(robot);
  std::vector<Dimension> positions;
  for (const Joint& joint : robot.joints) positions.push_back(kJointPosition.of(joint.kind));
  const bool slides = std::ranges::find(positions, kJointPosition.slide) != positions.end();
  fields.choice({"kind",
                 "pose: move there; state_feedback: torque = -gains [q - pose; dq]; policy: a second policy "
                 "(takt-policy-host --fallback)"},
                fallback.kind, kFallbackKinds);
  if (fallback.kind != FallbackKind::policy || fields.shows_all())
    fields.quantities({.name = "pose",
                       .doc = "pose, state_feedback: one angle per joint",
                       .other = Key::Other{Dimension::length, {}},
                       .each = positions},
                      fallback.pose, Dimension::angle, between(-1000, 1000),
                      {.low = joints.size(), .high = joints.size(), .of = "joint"});
  if (fallback.kind == FallbackKind::pose || fields.shows_all())
    fields.quantity({"speed", "pose: joint speed on the way"}, fallback.speed, Dimension::angular_velocity,
                    above(0, 100));
  if ((fallback.kind == FallbackKind::pose && slides) || fields.shows_all())
    fields.quantity({"slide_speed", "pose: of joints that slide", "0.05 m/s"}, fallback.slide_speed,
                    Dimension::velocity, above(0, 100));
  if (fallback.kind == FallbackKind::state_feedback || fields.shows_all())
    fields.each({"gains", "state_feedback: one row per driven joint"}, fallback.gains, kMaxJoints,
                [&](Fields& f, FeedbackRow& row) { describe_feedback_row(f, row, robot, joints); });
  if (fallback.kind == FallbackKind::policy || fields.shows_all()) describe_fallback_policy(fields, fallback);
  fields.text({"shown_by", "attestation (`takt panel attest`) that a robot that can fall stands", "none"},
              fallback.shown_by);
}

void describe_degraded(Fields& fields, DegradedConfig& degraded, const std::vector<Fallback>& fallbacks) {
  std::vector<std::string_view> names;
  for (const Fallback& fallback : fallbacks) names.emplace_back(fallback.name);
  fields.choice({"behaviour",
                 "hold: brake and stay; slow: the policy at speed_scale, without usable command as hold; fallback: by "
                 "degraded.fallback"},
                degraded.behaviour, kDegraded);
  fields.quantity({"speed_scale", "slow: factor of velocity limits; resume_over begins there", "0.3"},
                  degraded.speed_scale, Dimension::none, above(0, 1));
  fields.duration({"resume_over", "back in tracking, ramp from speed_scale to full velocity limits", "2 s"},
                  degraded.resume_over, {}, seconds(60));
  fields.duration(
      {"after",
       "degrade without usable command for this long, or epsilon of the window (command_late); 0 ms: the latter",
       "0 ms"},
      degraded.after, {}, seconds(10));
  fields.one_of({"fallback", "fallback: an entry of fallbacks", "none"}, degraded.fallback, names, "fallback", "none");
  fields.duration({"for", "damped stop after this long in degraded, anew at each entry; 0 s: never", "0 s"},
                  degraded.longest, {}, seconds(3600));
  fields.flag({"by_temperature", "true: limits.temperature.warning degrades, until 5 degrees cooler", "false"},
              degraded.by_temperature);
}

void describe_stop(Fields& fields, StopConfig& stop) {
  fields.choice({"how",
                 "rest: damped, then held (without model and imu as hold); damping: never held; hold: at once; policy: "
                 "by degraded.fallback's while usable"},
                stop.how, kStopHow);
  if ((stop.how != StopHow::rest && stop.how != StopHow::damping) || fields.shows_all()) {
    fields.duration({"for", "hold, policy: so long, then rest; 0 s: without end"}, stop.longest, {}, seconds(3600));
    fields.text({"shown_by", "hold, policy: as fallbacks.NAME.shown_by", "none"}, stop.shown_by);
  }
}

}  // namespace

void describe_policy(Fields& fields, RobotConfig& robot) {
  fields.each_named({"fallbacks", "fallbacks of degraded mode, by name", "{}"}, robot.fallbacks,
                    [&](Fields& f, Fallback& fallback) { describe_fallback(f, fallback, robot); });
  fields.section({"degraded", "reaction to a late policy"},
                 [&](Fields& f) { describe_degraded(f, robot.degraded, robot.fallbacks); });
  fields.each_named({"stops", "how damped stops come to rest, by cause; others: rest", "{}"}, robot.stops,
                    [&](Fields& f, StopConfig& stop) { describe_stop(f, stop); });
  fields.each({"sensors", "outside sensors of the policy", "[]"}, robot.sensors, kMaxSensors, describe_sensor);
  bool has_imu = robot.imu.has_value();
  fields.optional_section({"imu", "the base's IMU"}, has_imu, [&](Fields& f) {
    if (!robot.imu) robot.imu.emplace();
    std::vector<std::string_view> sensors;
    for (const Sensor& sensor : robot.sensors) sensors.emplace_back(sensor.name);
    describe_imu(f, *robot.imu, sensors);
  });
  bool present = robot.policy.has_value();
  fields.optional_section({"policy", "the learned policy"}, present, [&](Fields& f) {
    if (!robot.policy) robot.policy.emplace();
    describe_policy_section(f, *robot.policy, robot);
  });
}

}  // namespace takt::config
