// SPDX-License-Identifier: Apache-2.0
// Keys: sensors, imu, policy, fallbacks, degraded, stops.
#include <array>

#include "config/join_names.hpp"
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
  fields.quantities({"when_absent", "each value while no usable sample is there"}, limits.when_absent, Dimension::none,
                    any_value(), one_each);
}

void describe_ros(Fields& fields, Sensor& sensor) {
  if (!sensor.ros) sensor.ros.emplace();
  RosTopic& ros = *sensor.ros;
  fields.text({"topic", "as ros2 topic list shows it"}, ros.topic);
  fields.choice({"type", "of its messages"}, ros.type, kRosTypes);
  if (ros.type == RosType::image || fields.shows_all())
    fields.choice({"encoding", "Image: of its pixels; another one is refused"}, ros.encoding, kRosEncodings);
  if (ros.type != RosType::joint_state && !fields.shows_all()) return;
  fields.each({"joints", "JointState: a value each", "[]"}, ros.joints, kMaxSensorValues,
              [](Fields& f, RosJoint& joint) {
                f.text({"name", "as the messages have it"}, joint.name);
              });
  fields.choice({"quantity", "JointState: what of each joint", "position"}, ros.quantity, kRosQuantities);
}

void describe_sensor(Fields& fields, Sensor& sensor) {
  fields.identifier({"name", "its socket is sensor-NAME.sock in the runtime directory"}, sensor.name);
  bool is_image = sensor.image.has_value();
  fields.optional_section({"image", "samples are images of 8 bits, row after row, channels of a pixel together"},
                          is_image, [&](Fields& f) { describe_image(f, sensor); });
  if (!is_image || fields.shows_all())
    fields.integer({"values", "numbers per sample; none for an image"}, sensor.values, 1, kMaxSensorValues);
  fields.duration({"timeout", "a sample older than this is not used"}, sensor.timeout, milliseconds(1), seconds(60));
  fields.text({"unit", "of its values; a publisher of another unit is refused", "unstated"}, sensor.unit);
  fields.text(
      {"frame",
       "what its values are expressed in: base, world, a body's name; where a policy's exporter says one, it must be "
       "that",
       "unstated"},
      sensor.frame);
  if (!is_image || fields.shows_all())
    fields.integer(
        {"queue", "most samples since the last observation that a policy in Python or C is given; 0: the newest only",
         "0"},
        sensor.queue, 0, kMaxSensorQueue);
  bool is_command = sensor.command.has_value();
  fields.optional_section({"command", "operator input: limits, and what holds while there is none"}, is_command,
                          [&](Fields& f) { describe_command(f, sensor); });
  bool is_from_ros = sensor.ros.has_value();
  fields.optional_section({"ros", "takt-ros-sensors serves it from a topic of ROS 2, in the domain of `dds`"},
                          is_from_ros, [&](Fields& f) { describe_ros(f, sensor); });
}

void describe_imu(Fields& fields, Imu& imu, Words sensors) {
  fields.one_of(
      {"sensor",
       "entry of sensors with ten values: rotation w x y z (base in world); angular velocity x y z (rad/s, base "
       "frame); specific force x y z (m/s^2, base frame)"},
      imu.sensor, sensors, "sensor");
  fields.quantity({"tilt", "angle from upright beyond which the robot stops"}, imu.tilt, Dimension::angle,
                  above(0, 3.2));
  fields.quantity({"angular_velocity", "of the base; beyond it the robot stops", "100 rad/s"}, imu.angular_velocity,
                  Dimension::angular_velocity, above(0, 1000));
  fields.duration(
      {"frozen_after",
       "the same ten values for longer, under fresh stamps, are an IMU that is lost; 0 ms: not looked for", "0 ms"},
      imu.frozen_after, {}, seconds(60));
  fields.quantity(
      {"contradiction",
       "angle by which rotation and angular velocity may differ within about 0.5 s; beyond it the IMU is lost; "
       "0 rad: not looked for",
       "0 rad"},
      imu.contradiction, Dimension::angle, between(0, 3.2));
}

// What holds of a term of any kind.
void describe_scaling(Fields& fields, ObservationTerm& term) {
  const Count one_or_each{.low = 1, .high = kMaxSensorValues, .single_allowed = true};
  fields.quantities({"clip", "lowest and highest value, before the scale; empty: none", "[]"}, term.clip,
                    Dimension::none, any_value(), {.low = 0, .high = 2});
  fields.quantities(
      {"scale", "factor, one for all values or one each (of images: one per channel; so are mean and std)", "1"},
      term.scale, Dimension::none, any_value(), one_or_each);
  fields.quantities({"mean", "subtracted after the scale, one for all values or one each", "0"}, term.mean,
                    Dimension::none, any_value(), one_or_each);
  fields.quantities({"std", "standard deviation that divides what is left, one for all values or one each", "1"},
                    term.standard_deviation, Dimension::none, above(0, 1e9), one_or_each);
  fields.integer({"history", "how many instants, in history_order", "1"}, term.history, 1, 64);
}

void describe_term(Fields& fields, ObservationTerm& term, Words sensors, Words joints) {
  fields.choice({"term", "what is observed"}, term.kind, kTermNames);
  if (term.kind == TermKind::sensor || term.kind == TermKind::command || fields.shows_all())
    fields.one_of({"sensor", "terms sensor and command: name of an entry in sensors"}, term.sensor, sensors, "sensor");
  if (term.kind == TermKind::sensor || fields.shows_all())
    fields.choice(
        {"layout",
         "term sensor, of images: chw: channel after channel; hwc: the channels of a pixel together. A byte is "
         "a value from 0 to 1",
         "chw"},
        term.layout, kImageLayouts);
  if (term.kind == TermKind::gait_phase || fields.shows_all())
    fields.duration({"gait_period", "term gait_phase: one gait cycle; counted from the policy's last reset"},
                    term.gait_period, milliseconds(1), seconds(60));
  if (term.kind == TermKind::constant || fields.shows_all())
    fields.quantities({"values", "term constant: the numbers themselves"}, term.constant, Dimension::none, any_value(),
                      {.low = 1, .high = kMaxSensorValues});
  if (is_of_joints(term.kind) || fields.shows_all())
    fields.references({"joints", "terms of joints: the joint of each value; empty: as joint_order", "[]"}, term.joints,
                      joints, "joint");
  if (term.kind == TermKind::base_orientation || fields.shows_all())
    fields.choice({"order", "term base_orientation: of the quaternion's four values"}, term.order, kQuaternionOrders);
  if (term.kind == TermKind::motion_reference || fields.shows_all()) {
    fields.text(
        {"output", "term motion_reference: output of the network whose values of the inference before are shown"},
        term.output);
    fields.integer({"count", "term motion_reference: how many values that output has"}, term.values, 1,
                   kMaxSensorValues);
  }
  describe_scaling(fields, term);
}

void describe_join(Fields& fields, Join& join) {
  fields.choice(
      {"kind",
       "replace: at once; cross_fade: from the old path to the new one; blend: a fixed mixture; ensemble: all "
       "predictions of an instant, weighted; align: the difference at the join fades; quintic: the same, smooth "
       "in velocity and acceleration; prefix: the old path is played for as long as the policy was told",
       "replace"},
      join.kind, kJoinNames);
  fields.duration({"over", "cross_fade, align, quintic: how long a join takes", "100 ms"}, join.over, milliseconds(1),
                  seconds(10));
  fields.quantity({"new_share", "blend: the new chunk's share where both say something", "0.7"}, join.new_share,
                  Dimension::none, above(0, 1));
  fields.quantity({"decay", "ensemble: m of the weights exp(-m i), i = 0 the oldest prediction", "0.01"}, join.decay,
                  Dimension::none, between(0, 10));
  fields.duration({"taper", "ensemble: a prediction's weight falls to zero over the end of its chunk", "0 ms"},
                  join.taper, {}, seconds(10));
  fields.duration(
      {"longest", "prefix: no more of the path than this is promised; the longest delay trained for", "10 ms"},
      join.longest, microseconds(100), seconds(10));
}

void describe_action(Fields& fields, Action& action, Words joints) {
  constexpr std::array<std::string_view, 3> kOffsets{"zero", "home", "measured"};
  fields.choice({"kind", "what the outputs mean: target = offset + scale * output", "joint_position"}, action.kind,
                kActionKinds);
  fields.choice({"interpolation",
                 "hold: a step's target for its whole period, no velocity setpoint but a joint_velocity's own; linear: "
                 "straight lines between steps; cubic: a smooth curve through them",
                 "linear"},
                action.interpolation, kInterpolations);
  fields.section({"join", "how a new chunk takes over from the path being played", "{}"},
                 [&](Fields& f) { describe_join(f, action.join); });
  fields.quantities({"scale", "factor in rad, rad/s or Nm, one for all outputs or one each", "1"}, action.scale,
                    Dimension::none, any_value(), {.low = 1, .high = kMaxJoints, .single_allowed = true});
  auto offset = static_cast<std::size_t>(action.offset);
  fields.word_or_quantities(
      {"offset", "home, zero, measured (the position in the answered observation), or one angle per output", "home"},
      offset, kOffsets, action.offset_values, Dimension::angle, any_value(), {.low = 1, .high = kMaxJoints});
  action.offset = static_cast<OffsetKind>(offset);
  fields.references({"joints", "joint of each output; empty: as joint_order", "[]"}, action.joint_of_output, joints,
                    "joint");
  fields.section(
      {"outputs", "further outputs of the network, of the action's shape, taken as they are", "{}"}, [&](Fields& f) {
        f.text({"velocity", "joint_position: the output with velocities, rad/s; none: none", "none"}, action.velocity);
        f.text({"torque", "the output with torques, added to those of the gains, Nm; none: none", "none"},
               action.torque);
        f.text({"kp", "the output with stiffness, Nm/rad; none: the joints' own", "none"}, action.kp);
        f.text({"kd", "the output with damping, Nms/rad; none: the joints' own", "none"}, action.kd);
      });
}

void describe_monitors(Fields& fields, ChunkMonitors& monitors) {
  fields.integer({"votes", "a catch: so many of the newest answers are above the threshold", "20"}, monitors.votes, 1,
                 1000);
  fields.integer({"of", "the newest answers", "40"}, monitors.of, 1, 1000);
  fields.each(
      {"thresholds", "as `takt policy calibrate` prints them", "[]"}, monitors.thresholds, kChunkScoreCount,
      [](Fields& f, ChunkThreshold& threshold) {
        f.choice({"score", "number that is read off every answer (docs/policies.md)"}, threshold.score,
                 kChunkScoreNames);
        f.quantity({"above", "largest value that is still usual"}, threshold.above, Dimension::none, between(0, 1e9));
      });
}

void describe_sampler(Fields& fields, Sampler& sampler) {
  fields.text({"noisy", "name of the network's input for what is being denoised", "x_t"}, sampler.noisy);
  fields.text({"time", "name of its input for the time, 0 noise to 1 action: one number, or one per step", "t"},
              sampler.time);
  fields.integer({"steps", "of denoising, all of one size", "8"}, sampler.steps, 1, 1000);
  fields.integer({"seed", "what noise is drawn from, with the observation's id", "1"}, sampler.seed, 0, 1U << 30U);
  fields.choice({"prefix",
                 "none: each chunk for itself; guided: drawn towards the path that is being played while it is "
                 "denoised; trained: the network is shown the steps that will be played, as in its training",
                 "none"},
                sampler.prefix, kPrefixUses);
  fields.choice({"schedule", "guided: how the pull falls from the promised steps to the path's end", "exponential"},
                sampler.schedule, kPrefixSchedules);
  fields.quantity({"limit", "guided: most of the error's share in the velocity", "5"}, sampler.limit, Dimension::none,
                  above(0, 1000));
  fields.integer({"samples", "drawn for every answer", "1"}, sampler.samples, 1, kMostSamples);
  fields.choice({"choice",
                 "first: of them; coherent: the nearest to the path that is being played; agreed: the first, as far "
                 "as all agree",
                 "first"},
                sampler.choice, kSampleChoices);
  fields.quantity({"decay", "coherent: m of the weights exp(-m i), i = 0 the first step", "0.5"}, sampler.decay,
                  Dimension::none, between(0, 10));
  fields.quantity(
      {"tolerance", "agreed: samples agree where no output differs by more, in units of the outputs", "0.1"},
      sampler.tolerance, Dimension::none, above(0, 1e6));
}

void describe_speculation(Fields& fields, Speculation& speculation) {
  fields.quantity({"position", "how far each joint may be from where a speculative chunk assumed it"},
                  speculation.position, Dimension::angle, above(0, 1));
  fields.quantity({"velocity", "the same of its velocity, where the chunk assumes any"}, speculation.velocity,
                  Dimension::angular_velocity, above(0, 100));
}

void describe_engine(Fields& fields, Engine& engine) {
  fields.text({"name",
               "builtin, onnxruntime, torchscript, the path of a plugin (with a slash; docs/own-engine.md), or auto: "
               "torchscript for a .pt file, for an ONNX file builtin where it is the quicker one, else onnxruntime",
               "auto"},
              engine.name);
  fields.integer({"threads", "of one inference", "1"}, engine.threads, 1, kMostEngineThreads);
  fields.one_of({"provider", "what it computes on; cuda and tensorrt need a library that has them", "cpu"},
                engine.provider, kProviders, "provider");
  std::string library = engine.library.empty() ? "none" : engine.library;
  fields.text({"library", "onnxruntime: its libonnxruntime.so; none: the one that the dynamic linker finds", "none"},
              library);
  engine.library = library == "none" ? "" : library;
  fields.duration({"load_within", "a plugin that takes longer to load is refused", "60 s"}, engine.load_within,
                  milliseconds(100), seconds(3600));
  fields.each(
      {"shapes", "of inputs whose shape the file does not say (torchscript)", "[]"}, engine.shapes, kMaxTensorShapes,
      [](Fields& f, TensorShape& shape) {
        f.text({"tensor", "name of the input"}, shape.tensor);
        f.quantities({"shape", "its dimensions"}, shape.shape, Dimension::none, between(1, 1e6), {.low = 1, .high = 8});
      });
}

void describe_policy_section(Fields& fields, Policy& policy, const RobotConfig& robot) {
  const auto joints = joint_names(robot);
  std::vector<std::string_view> sensors;
  for (const Sensor& sensor : robot.sensors) sensors.emplace_back(sensor.name);
  fields.text({"file", "ONNX file, or what another engine reads; a relative path starts at this file's folder"},
              policy.file);
  fields.text(
      {"signed_by",
       "public key of Ed25519, PEM: policies arm this robot only with its signature beside their file, FILE.sig "
       "(docs/policies.md)",
       "none"},
      policy.signed_by);
  fields.duration({"period", "an observation is published this often; a whole number of control periods"},
                  policy.period, microseconds(100), seconds(10));
  fields.duration({"step_period", "time between two steps of an action chunk"}, policy.step_period, microseconds(100),
                  seconds(10));
  fields.integer({"steps", "steps of an action chunk", "1"}, policy.steps, 1, kMaxChunkSteps);
  fields.text({"input", "name of the model's input", "obs"}, policy.input);
  fields.text({"output", "name of the model's output", "actions"}, policy.output);
  bool has_engine = policy.engine.has_value();
  fields.optional_section({"engine", "what runs the file, and how (docs/policies.md)"}, has_engine, [&](Fields& f) {
    if (!policy.engine) policy.engine.emplace();
    describe_engine(f, *policy.engine);
  });
  fields.integer({"nice", "niceness of the policy host", "0"}, policy.nice, -20, 19);
  fields.integer({"requests_in_flight",
                  "observations that the policy host answers at a time, each with a network of its own", "1"},
                 policy.requests_in_flight, 1, kMostRequests);
  fields.duration(
      {"probation", "of tracking: so long a policy that was swapped in goes back by itself (docs/policies.md)", "10 s"},
      policy.probation, Duration{0}, seconds(3600));
  fields.references({"joint_order", "the policy's order of joints; empty: this file's", "[]"}, policy.joint_order,
                    joints, "joint");
  fields.one_of({"history_layout", "by_term: each term's history together; by_time: all terms of one instant together",
                 "by_term"},
                policy.history_layout, kLayouts, "layout");
  fields.one_of({"history_order", "which end of a history is the newest instant", "oldest_first"}, policy.history_order,
                kHistoryOrders, "order");
  fields.each({"observation", "terms, in the order of the model's input"}, policy.observation, kMaxTerms,
              [&](Fields& f, ObservationTerm& term) { describe_term(f, term, sensors, joints); });
  fields.section({"action", "how outputs become joint targets", "{}"},
                 [&](Fields& f) { describe_action(f, policy.action, joints); });
  bool monitored = policy.monitors.has_value();
  fields.optional_section({"monitors", "watch its answers by their numbers; a catch is recorded and decides nothing"},
                          monitored, [&](Fields& f) {
                            if (!policy.monitors) policy.monitors.emplace();
                            describe_monitors(f, *policy.monitors);
                          });
  bool samples = policy.sampler.has_value();
  fields.optional_section({"sampler", "the file is a flow's velocity network; the policy host denoises with it"},
                          samples, [&](Fields& f) {
                            if (!policy.sampler) policy.sampler.emplace();
                            describe_sampler(f, *policy.sampler);
                          });
  bool speculates = policy.speculation.has_value();
  fields.optional_section({"speculation", "take alternatives for states that are not there yet (docs/policies.md)"},
                          speculates, [&](Fields& f) {
                            if (!policy.speculation) policy.speculation.emplace();
                            describe_speculation(f, *policy.speculation);
                          });
}

void describe_feedback_row(Fields& fields, FeedbackRow& row, Words joints) {
  const Count one_each{.low = joints.size(), .high = joints.size(), .of = "joint"};
  fields.reference({"joint", "driven joint that gets the torque"}, row.joint, joints, "joint");
  fields.quantities({"position", "gain on each joint's angle beyond the pose"}, row.position, Dimension::stiffness,
                    between(-1e5, 1e5), one_each);
  fields.quantities({"velocity", "gain on each joint's velocity"}, row.velocity, Dimension::damping, between(-1e5, 1e5),
                    one_each);
}

void describe_fallback_policy(Fields& fields, Fallback& fallback) {
  fields.text({"file", "policy: another file for the same observation and action; none: policy.file", "none"},
              fallback.file);
  fields.quantities({"command", "policy: what its observation terms `command` read, whatever a person asks for", "[]"},
                    fallback.command, Dimension::none, any_value(), {.low = 0, .high = kMaxSensorValues});
  fields.duration({"for", "policy: how long it may move the robot at one go, then a damped stop; 0 s: without end"},
                  fallback.longest, {}, seconds(3600));
}

void describe_fallback(Fields& fields, Fallback& fallback, Words joints) {
  fields.choice({"kind",
                 "pose: move to a fixed pose; state_feedback: torque = -gains [q - pose; dq]; policy: a second policy, "
                 "kept warm by takt-policy-host --fallback"},
                fallback.kind, kFallbackKinds);
  if (fallback.kind != FallbackKind::policy || fields.shows_all())
    fields.quantities({"pose", "pose, state_feedback: one angle per joint"}, fallback.pose, Dimension::angle,
                      between(-1000, 1000), {.low = joints.size(), .high = joints.size(), .of = "joint"});
  if (fallback.kind == FallbackKind::pose || fields.shows_all())
    fields.quantity({"speed", "pose: joint speed on the way"}, fallback.speed, Dimension::angular_velocity,
                    above(0, 100));
  if (fallback.kind == FallbackKind::state_feedback || fields.shows_all())
    fields.each({"gains", "state_feedback: one row per driven joint"}, fallback.gains, kMaxJoints,
                [&](Fields& f, FeedbackRow& row) { describe_feedback_row(f, row, joints); });
  if (fallback.kind == FallbackKind::policy || fields.shows_all()) describe_fallback_policy(fields, fallback);
  fields.text({"shown_by",
               "of a robot that can fall: the file of `takt panel attest` that shows that it does not by this", "none"},
              fallback.shown_by);
}

void describe_degraded(Fields& fields, DegradedConfig& degraded, const std::vector<Fallback>& fallbacks) {
  std::vector<std::string_view> names;
  for (const Fallback& fallback : fallbacks) names.emplace_back(fallback.name);
  fields.choice({"behaviour",
                 "hold: brake and stay, whatever the policy says; slow: the policy at speed_scale, without a usable "
                 "command as hold; fallback: hand over to degraded.fallback"},
                degraded.behaviour, kDegraded);
  fields.quantity({"speed_scale", "slow: velocity limits are multiplied by it; also where resume_over begins", "0.3"},
                  degraded.speed_scale, Dimension::none, above(0, 1));
  fields.duration(
      {"resume_over", "back in tracking, velocity limits rise from speed_scale of them to all of them in it", "2 s"},
      degraded.resume_over, {}, seconds(60));
  fields.duration({"after",
                   "no usable command for this long degrades the robot (command_late), as epsilon of the window does; "
                   "0 ms: that alone",
                   "0 ms"},
                  degraded.after, {}, seconds(10));
  fields.one_of({"fallback", "fallback: name of an entry in fallbacks, or none", "none"}, degraded.fallback, names,
                "fallback", "none");
  fields.duration({"for", "how long the robot may be degraded at one go, then a damped stop; 0 s: without end", "0 s"},
                  degraded.longest, {}, seconds(3600));
  fields.flag(
      {"by_temperature",
       "true: a drive beyond its limits.temperature.warning degrades the robot until it is 5 degrees cooler", "false"},
      degraded.by_temperature);
}

void describe_stop(Fields& fields, StopConfig& stop) {
  fields.choice({"how",
                 "rest: damped to rest, then held; without model and imu braked and held at once; damping: damped and "
                 "never held; hold: braked and held at once; "
                 "policy: moved by the fallback policy of "
                 "degraded.fallback while it has something to say"},
                stop.how, kStopHow);
  if ((stop.how != StopHow::rest && stop.how != StopHow::damping) || fields.shows_all()) {
    fields.duration({"for", "hold, policy: for so long, then as rest; 0 s: without end"}, stop.longest, {},
                    seconds(3600));
    fields.text(
        {"shown_by",
         "hold, policy: of a robot that can fall, the file of `takt panel attest` that shows that it does not", "none"},
        stop.shown_by);
  }
}

}  // namespace

void describe_policy(Fields& fields, RobotConfig& robot) {
  fields.each_named({"fallbacks", "simple policies to hand over to, by name", "{}"}, robot.fallbacks,
                    [&](Fields& f, Fallback& fallback) { describe_fallback(f, fallback, joint_names(robot)); });
  fields.section({"degraded", "what happens when the policy is late, or its contract violated"},
                 [&](Fields& f) { describe_degraded(f, robot.degraded, robot.fallbacks); });
  fields.each_named({"stops", "how a damped stop comes to rest, by the name of its cause; others: rest", "{}"},
                    robot.stops, [&](Fields& f, StopConfig& stop) { describe_stop(f, stop); });
  fields.each({"sensors", "outside sensors the policy reads", "[]"}, robot.sensors, kMaxSensors, describe_sensor);
  bool has_imu = robot.imu.has_value();
  fields.optional_section({"imu", "the base's inertial measurement unit"}, has_imu, [&](Fields& f) {
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
