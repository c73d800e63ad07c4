// SPDX-License-Identifier: Apache-2.0
// A robot, as its configuration file describes it: parsed strictly, validated, in SI units. Read by every process;
// all of them must hold the same hash. Source of every number: the robot file, with file:line:column in any complaint.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/chunk_score.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::config {

enum class DriveProtocol : std::uint8_t { mit, robstride, odrive, moteus, cia402 };
enum class Cia402Mode : std::uint8_t { csp, csv, cst };
// What one count of a target velocity (object 60FF) means, motor side.
enum class Cia402VelocityUnit : std::uint8_t { counts_per_s, rpm, tenth_rpm, hundredth_rpm, thousandth_rpm };
// What a drive's position means after power-on: the joint's place, nothing, one of several places that its encoder
// cannot tell apart, or the place but for whole turns of its output.
enum class PositionAfterPowerUp : std::uint8_t { absolute, unknown, one_of_several, within_a_turn };
enum class WakeMode : std::uint8_t { sleep, hybrid };
enum class WhenBusMissing : std::uint8_t { refuse, loopback };
// A slide's numbers are in metres and newtons where a hinge's are in radians and newton metres (joint_units.hpp).
enum class JointKind : std::uint8_t { hinge, slide };
enum class Degraded : std::uint8_t { hold, slow, fallback };
enum class FallbackKind : std::uint8_t { pose, state_feedback, policy };
enum class StopHow : std::uint8_t { rest, damping, hold, policy };
enum class TargetKind : std::uint8_t { lissajous, steps };
enum class TermKind : std::uint8_t {
  joint_position_relative,
  joint_position,
  joint_velocity,
  sensor,
  last_action,
  constant,
  base_angular_velocity,
  projected_gravity,
  command,
  gait_phase,
  joint_torque,
  drive_velocity,
  base_orientation,
  motion_reference
};
enum class QuaternionOrder : std::uint8_t { wxyz, xyzw };
// Of an image as the network takes it: channel after channel, or the channels of a pixel together.
enum class ImageLayout : std::uint8_t { chw, hwc };
enum class ActionKind : std::uint8_t { joint_position, joint_velocity, joint_torque };
enum class Interpolation : std::uint8_t { hold, linear, cubic };
enum class OffsetKind : std::uint8_t { zero, home, measured, values };

struct Control {
  Duration period;
  int priority = 0;  // SCHED_FIFO, 1..99
  std::optional<int> cpu;
  WakeMode wake = WakeMode::sleep;
  Duration spin;
  double late_share = 0;  // (0, 1]; 1: switched off
};

// The sliding window's capacity in the tick.
inline constexpr std::int64_t kMaxWindowTicks = 8192;

struct Freshness {
  Duration max_age;
  double aging_fraction = 0;  // (0, 1)
  double epsilon = 0;         // (0, 1)
  double confidence = 0;      // (0, 1)
  Duration window;
  Duration recover_after;
  Duration flap_memory;
  Duration stop_after;
  std::uint32_t bad_command_limit = 0;
  double clamped_share = 0;  // (0, 1]; 1: switched off
};

// One driven joint's torque: -(position . (q - pose) + velocity . dq).
struct FeedbackRow {
  std::size_t joint = 0;         // index into joints
  std::vector<double> position;  // Nm/rad, one per joint
  std::vector<double> velocity;  // Nm s/rad, one per joint
};

struct Fallback {
  std::string name;
  FallbackKind kind = FallbackKind::pose;
  std::vector<double> pose;        // rad, one per joint; pose and state_feedback
  double speed = 0;                // rad/s; pose only
  double slide_speed = 0;          // m/s, of joints that slide; pose only
  std::string shown_by;            // attestation that a robot which can fall stands by it; "none": there is none
  std::vector<FeedbackRow> gains;  // state_feedback only, one per driven joint
  std::string file;                // policy only; none: the policy's own
  std::vector<double> command;     // policy only: what its observation terms `command` read
  Duration longest;                // policy only: how long it may move the robot at one go; 0: without end
  [[nodiscard]] bool has_own_file() const { return kind == FallbackKind::policy && file != "none"; }
};

// How a cause's damped stop brings the robot to rest.
struct StopConfig {
  std::string name;  // of the cause
  StopHow how = StopHow::rest;
  Duration longest;      // hold, policy: then as `rest`; 0: without end
  std::string shown_by;  // hold, policy: as of a fallback; absolute once loaded
};

inline bool is_shown(const std::string& by) {
  return !by.empty() && by != "none";
}

struct DegradedConfig {
  Degraded behaviour = Degraded::hold;
  double speed_scale = 0;       // (0, 1]
  Duration resume_over;         // >= 0; 0: full speed at once
  Duration after;               // no usable command for this long; 0: the contract's window alone decides
  std::string fallback;         // empty: none
  Duration longest;             // at one go, then a damped stop; 0: without end
  bool by_temperature = false;  // a drive beyond its warning degrades the robot
};

enum class Following : std::uint8_t { warn, degrade, stop };

struct FeedbackConfig {
  Duration timeout;
  Duration enable_timeout;
  double rest_velocity = 0;               // rad/s
  double jump = 0;                        // rad; 0: not looked for
  double contradiction = 0;               // rad; 0: not looked for
  Duration frozen_after;                  // 0: not looked for
  Duration following_timeout;             // 0: not looked for
  Following following = Following::warn;  // what a joint does that is beyond limits.following_error for that long
};

// Shares (0, 1] of the ticks in about the last window; 1 switches the fault off.
struct BusFaults {
  Duration window;
  double replies_lost = 0, replies_repeated = 0, replies_delayed = 0;                               // of one joint
  double transmit_drops = 0, receive_drops = 0, foreign_frames = 0, babble = 0, error_passive = 0;  // of one bus
};

struct Bus {
  std::string name;
  std::string interface;
  std::uint32_t bitrate = 0;  // bit/s
  bool fd = false;
  std::uint32_t data_bitrate = 0;  // bit/s of FD frames' data phase; fd only
  // Where in a bit it is read, (0, 1), and by how many time quanta the controller may shift it; 0: the kernel's choice.
  double sample_point = 0, data_sample_point = 0;
  std::uint32_t sjw = 0, data_sjw = 0;
  WhenBusMissing when_missing = WhenBusMissing::refuse;
};

struct Drive {
  DriveProtocol protocol = DriveProtocol::mit;
  std::uint32_t id = 0;     // mit: CAN id of commands; the others: node, motor or device number
  int direction = 1;        // +1 or -1
  double offset = 0;        // rad, joint side: q_joint = direction * q_motor / gear_ratio + offset
  double gear_ratio = 1;    // motor turns per joint turn beyond what the drive already accounts for; slide: rad/m
  double torque_range = 0;  // Nm, motor side: no frame ever asks for more
  // mit, robstride: what the packed fields span, motor side; from the model unless given.
  std::string model;  // empty when the ranges are given in full
  double position_range = 0, velocity_range = 0, kp_range = 0, kd_range = 0;
  // mit
  std::string variant;  // "tmotor" (6-byte reply) | "damiao" (8-byte reply) | "robstride" (8-byte reply)
  std::uint32_t reply_id = 0;
  // damiao: bit/s of the data phase of CAN FD, in which commands and replies come; 0: classic frames
  std::uint32_t fd_bitrate = 0;
  // mit, robstride, moteus: written to every n-th tick
  std::uint32_t every = 1;
  // all but moteus: why it may be armed though nothing is known to stop it when commands cease; "none": not
  std::string watchdog_waiver;
  // What the drive must tell of itself before it may be enabled, in the words of its drive card; "any": nothing.
  std::string identity;                                                           // damiao, robstride, moteus, cia402
  std::string firmware;                                                           // damiao, odrive, moteus, cia402
  PositionAfterPowerUp position_after_power_up = PositionAfterPowerUp::absolute;  // all but moteus
  std::uint32_t places_per_turn = 0;                                              // one_of_several only, of the joint
  // robstride: our own number on the bus
  std::uint32_t host_id = 0;
  // moteus: the drive's own servo.pid_position gains, which commands scale by 0..1
  double servo_kp = 0, servo_kd = 0;  // Nm/rad, Nm s/rad, motor side
  // cia402
  Cia402Mode mode = Cia402Mode::cst;
  std::uint32_t counts_per_turn = 0;                                    // position units of object 6064 per motor turn
  double rated_torque = 0;                                              // Nm, object 6076: 1000 per mille
  Cia402VelocityUnit velocity_unit = Cia402VelocityUnit::counts_per_s;  // csv
};

// Degrees Celsius; 0: not looked at.
struct TemperatureLimits {
  double warning = 0, stop = 0;                // of the hottest part the drive reports
  double casing_warning = 0, casing_stop = 0;  // of casing or output stage, where the drive tells it apart
};

struct Limits {
  double q_min = 0, q_max = 0, position_margin = 0, target_margin = 0, velocity = 0, velocity_hard = 0,
         acceleration = 0, torque = 0, torque_rate = 0, kp = 0, kd = 0;
  double following_error = 0;  // rad between a joint and its reference; 0: by torque and stiffness
  std::optional<TemperatureLimits> temperature{};
};

// Units are a hinge's.
struct Joint {
  std::string name;
  JointKind kind = JointKind::hinge;
  std::size_t bus = 0;   // index into buses
  bool passive = false;  // an encoder read like a drive, and nothing that could move it: no gains, no torque
  Drive drive;
  Limits limits;
  double kp = 0, kd = 0, damping = 0;
  double inertia = 0;             // kg m^2
  double inertia_max = 0;         // kg m^2; 0: not stated
  double observer_bandwidth = 0;  // rad/s
  double home = 0;                // rad
};

using Vector3 = std::array<double, 3>;

struct Link {
  std::string joint;
  int parent = -1;  // link index, -1: base
  Vector3 origin_xyz{}, origin_rpy{}, axis{}, com{}, inertia{};
  double mass = 0;
};

struct Model {
  Vector3 gravity{};
  std::vector<Link> links;  // same order as joints
  int tool_link = -1;
  Vector3 tool_xyz{};
};

// The longest history of an observation term, instants.
inline constexpr std::uint32_t kMostHistory = 64;

// What the network is shown is (scale * clipped value - mean) / standard deviation. A byte of an image is a value from
// 0 to 1.
struct ObservationTerm {
  TermKind kind = TermKind::joint_position;
  std::string sensor;                             // TermKind::sensor and command
  std::vector<std::size_t> joints;                // joint terms: of each value; empty: as joint_order
  QuaternionOrder order = QuaternionOrder::wxyz;  // TermKind::base_orientation only
  ImageLayout layout = ImageLayout::chw;          // TermKind::sensor, of a sensor of images
  std::string output;                             // TermKind::motion_reference: the network's own, of an inference ago
  std::uint32_t values = 0;                       // TermKind::motion_reference: how many
  std::vector<double> constant;                   // TermKind::constant only
  Duration gait_period;                           // TermKind::gait_phase only
  std::vector<double> clip;                       // lowest and highest value, before the scale; empty: none
  std::vector<double> scale;                      // one, or one per value (of an image: per channel)
  std::vector<double> mean, standard_deviation;   // likewise
  std::uint32_t history = 1;                      // instants
};

enum class JoinKind : std::uint8_t { replace, cross_fade, blend, ensemble, align, quintic, prefix };

struct Join {
  JoinKind kind = JoinKind::replace;
  Duration over;         // cross_fade, align, quintic
  double new_share = 0;  // blend: (0, 1]
  double decay = 0;      // ensemble: m of exp(-m i), i = 0 the oldest prediction; >= 0
  Duration taper;        // ensemble: >= 0
  Duration longest;      // prefix
};

struct Action {
  ActionKind kind = ActionKind::joint_position;
  Interpolation interpolation = Interpolation::linear;
  Join join;
  std::vector<double> scale;  // one, or one per policy output
  OffsetKind offset = OffsetKind::home;
  std::vector<double> offset_values;
  std::vector<std::size_t> joint_of_output;  // policy output i drives this joint; empty: identity
  // Names of further outputs of the same shape as the action's, taken as they are: rad/s, Nm, Nm/rad, Nms/rad.
  std::string velocity = "none", torque = "none", kp = "none", kd = "none";
};

// Watches the policy's answers by their numbers alone (monitor/judge/chunk_monitors.hpp).
struct ChunkThreshold {
  ChunkScore score = ChunkScore::temporal_error;
  double above = 0;  // in the score's own unit
};
struct ChunkMonitors {
  int votes = 20, of = 40;  // answers
  std::vector<ChunkThreshold> thresholds;
};

inline constexpr std::uint32_t kMostRequests = 8;  // in flight

// How a policy that denoises is drawn towards the path that is being played while it denoises.
enum class PrefixUse : std::uint8_t { none, guided, trained };
enum class PrefixSchedule : std::uint8_t { ones, zeros, linear, exponential };
// Which of several samples is the answer.
enum class SampleChoice : std::uint8_t { first, coherent, agreed };

// policy.file is the velocity network of a flow, and policy_host/flow samples chunks with it.
struct Sampler {
  std::string noisy, time;  // its input tensors besides policy.input
  std::uint32_t steps = 0;  // of denoising, >= 1
  std::uint64_t seed = 0;
  PrefixUse prefix = PrefixUse::none;
  PrefixSchedule schedule = PrefixSchedule::exponential;  // guided
  double limit = 0;                                       // guided: of the error's share in the velocity, > 0
  std::uint32_t samples = 1;
  SampleChoice choice = SampleChoice::first;
  double decay = 0;      // coherent: m of exp(-m i), i = 0 the first step
  double tolerance = 0;  // agreed: units of the outputs, > 0
};

// Which states count as the one that a speculative chunk assumed, of each joint.
struct Speculation {
  double position = 0;  // rad
  double velocity = 0;  // rad/s
};

// What runs the policy's file, and how (docs/policies.md). A plugin's path and the library's are absolute after load.
struct TensorShape {
  std::string tensor;
  std::vector<double> shape;  // whole numbers, at least 1
};
struct Engine {
  std::string name = "auto";  // auto, builtin, onnxruntime, torchscript, or a plugin's path: with a slash
  std::uint32_t threads = 1;  // of one inference
  std::string provider = "cpu";
  std::string library;  // "": the engine's own choice
  Duration load_within = seconds(60);
  std::vector<TensorShape> shapes;
};

struct Policy {
  std::string file;              // absolute after load
  std::string signed_by;         // public key, PEM; absolute after load; "none": any file is taken
  std::optional<Engine> engine;  // absent: as Engine says
  Duration period;
  Duration step_period;
  std::uint32_t steps = 0;
  std::string input, output;  // tensor names
  int nice = 0;
  std::uint32_t requests_in_flight = 1;  // observations that the policy host answers at a time
  Duration probation;                    // of tracking, of a policy that was swapped in on the live robot
  std::vector<ObservationTerm> observation;
  Action action;
  std::string history_layout;            // "by_term": each term's history together | "by_time": all terms per instant
  std::string history_order;             // "oldest_first" | "newest_first"
  std::vector<std::size_t> joint_order;  // policy's joint k is this joint; empty: identity
  std::optional<ChunkMonitors> monitors;
  std::optional<Sampler> sampler;
  std::optional<Speculation> speculation;  // absent: no speculative chunk is taken
  [[nodiscard]] bool names_key() const { return !signed_by.empty() && signed_by != "none"; }
};

// 8-bit, row after row, channels of a pixel together.
struct ImageShape {
  std::uint32_t height = 0, width = 0, channels = 0;
  [[nodiscard]] std::uint32_t bytes() const { return height * width * channels; }
};

// Limits of an operator's input, and the value used without any.
struct CommandLimits {
  std::vector<double> minimum, maximum, when_absent;  // one per value
};

enum class RosType : std::uint8_t { image, imu, joint_state, twist };
enum class RosEncoding : std::uint8_t { mono8, rgb8, bgr8, rgba8, bgra8 };
enum class RosQuantity : std::uint8_t { position, velocity, effort };

struct RosJoint {
  std::string name;  // as the messages have it
};

// A topic of ROS 2 that a sensor's samples come from (docs/sensors.md).
struct RosTopic {
  std::string topic;  // "/imu/data"
  RosType type = RosType::image;
  RosEncoding encoding = RosEncoding::mono8;     // image
  RosQuantity quantity = RosQuantity::position;  // joint_state
  std::vector<RosJoint> joints{};                // joint_state: a value each
};

struct Sensor {
  std::string name;
  std::uint32_t values = 0;  // float32; 0: an image
  std::uint32_t queue = 0;   // samples that a policy is given at once; 0: the newest only
  Duration timeout;
  std::string unit = "unstated", frame = "unstated";
  std::optional<ImageShape> image{};
  std::optional<CommandLimits> command{};
  std::optional<RosTopic> ros{};
};

// The base's inertial measurement unit: a sensor of kImuValues values (executive/contract/imu.hpp).
struct Imu {
  std::string sensor;
  double tilt = 0;              // rad
  double angular_velocity = 0;  // rad/s
  Duration frozen_after;        // 0: not looked for
  double contradiction = 0;     // rad; 0: not looked for
};

enum class TorqueOutputKind : std::uint8_t { gpio, file };
enum class ActiveLevel : std::uint8_t { high, low };
enum class OnJointFault : std::uint8_t { keep, drop };

// The output that permits torque (docs/safe-torque-off.md).
struct SafeTorqueOff {
  TorqueOutputKind output = TorqueOutputKind::gpio;
  std::string chip;        // gpio
  std::uint32_t line = 0;  // gpio
  ActiveLevel active = ActiveLevel::high;
  std::string file;  // file: absolute after load
  OnJointFault on_joint_fault = OnJointFault::drop;
};

enum class Recorder : std::uint8_t { required, optional };

// How much of the images that policies are shown a run keeps as files.
struct ImageRecord {
  double budget_mib = 0;      // 0: none
  double rate_mib_per_s = 0;  // in the mean; above 0
};

// Which runs stay; none given: all.
struct RunKeep {
  std::optional<int> days, gib;
  [[nodiscard]] bool is_given() const { return days || gib; }
};

struct Record {
  Recorder recorder = Recorder::required;
  std::string directory;  // absolute after load
  Duration keyframe_period;
  bool policy_inputs = true;
  ImageRecord images;
  RunKeep keep;
};

struct DdsPeer {
  std::string address;  // name or address of a host
};

// What the monitor tells ROS 2, and whether it listens (docs/ros2.md).
struct Dds {
  std::uint32_t domain = 0;
  std::string interface;
  bool multicast = false;
  std::vector<DdsPeer> peers;
  double joint_state_rate = 0;  // Hz
  bool allow_requests = false;
  std::string security;  // folder of this machine's identity and permissions; empty: DDS without security
};

// Where the monitor answers Prometheus (docs/metrics.md).
struct Prometheus {
  std::string address;
  std::uint32_t port = 0;
};

// What the monitor tells OpenTelemetry (docs/opentelemetry.md).
struct Otlp {
  bool file = false;     // into the run folder
  std::string endpoint;  // http(s)://host:port; empty: nothing is sent
  Duration metrics_period;
};

// A cart on a belt (first joint, radians of the pulley) that carries a pole on a free pivot (second joint, passive,
// 0: upright, positive towards positive cart positions).
struct CartPole {
  double pulley_radius = 0;             // m: the cart's position is this times its joint's angle
  double cart_mass = 0, pole_mass = 0;  // kg
  double pole_com = 0;                  // m, pivot to centre of mass
  double pole_inertia = 0;              // kg m^2, about the centre of mass
  double pole_length = 0;               // m, pivot to tip
  double pivot_viscous = 0;             // Nm s/rad
};

// Physics by MuJoCo, of the user's own model.
struct MujocoWorld {
  std::string model;     // MJCF; absolute once loaded
  std::string keyframe;  // where the robot begins; empty: as the model stands, joints at home
  std::string imu_site;  // empty: no IMU
};

struct Simulation {
  Duration step;
  double viscous = 0, coulomb = 0;  // Nm s/rad, Nm
  double encoder_step = 0;          // rad
  Duration torque_delay;
  Duration drive_watchdog;
  std::uint64_t seed = 0;
  std::string camera_sensor;
  Duration camera_period, camera_delay, camera_jitter;
  TargetKind target = TargetKind::lissajous;
  Vector3 target_centre{}, target_amplitude{}, target_frequency{};  // lissajous: m, m, Hz
  double step_amplitude = 0;                                        // steps: m
  Duration step_period;                                             // steps
  std::optional<CartPole> cart_pole;                                // instead of rigid bodies
  std::optional<MujocoWorld> mujoco;                                // likewise
};

constexpr std::string_view name(DriveProtocol protocol) {
  switch (protocol) {
    case DriveProtocol::mit:
      return "mit";
    case DriveProtocol::robstride:
      return "robstride";
    case DriveProtocol::odrive:
      return "odrive";
    case DriveProtocol::moteus:
      return "moteus";
    case DriveProtocol::cia402:
      return "cia402";
  }
  return "invalid";
}

// mit and robstride pack a whole impedance command into ranged integers; the others have units of their own.
constexpr bool has_packed_ranges(DriveProtocol protocol) {
  return protocol == DriveProtocol::mit || protocol == DriveProtocol::robstride;
}

// The robot file says in writing that this drive may be armed without a time-out of its own.
inline bool waives_watchdog(const Drive& drive) {
  return !drive.watchdog_waiver.empty() && drive.watchdog_waiver != "none";
}

// What no artifact may keep quiet about.
struct WatchdogWaiver {
  std::string joint, reason;
};

struct RobotConfig {
  std::string file;  // as given, for messages
  std::string robot;
  Control control;
  Freshness freshness;
  DegradedConfig degraded;
  std::vector<Fallback> fallbacks;
  std::vector<StopConfig> stops;
  FeedbackConfig feedback;
  BusFaults bus_faults;
  std::vector<Bus> buses;
  std::vector<Joint> joints;
  std::optional<SafeTorqueOff> safe_torque_off;  // absent: torque is taken by frames alone
  std::optional<Model> model;                    // absent: no gravity compensation, no simulation
  std::optional<Policy> policy;
  std::vector<Sensor> sensors;
  std::optional<Imu> imu;  // absent: the base stands on the ground, or no part asks how it stands
  Record record;
  std::optional<Dds> dds;                // absent: no DDS at all
  std::optional<Prometheus> prometheus;  // absent: no port is opened
  std::optional<Otlp> otlp;              // absent: nothing is exported
  std::optional<Simulation> simulation;
  std::string resolved;    // canonical YAML text: what differs from the defaults, and their revision
  std::string sha256;      // of `resolved`, hex
  std::uint64_t hash = 0;  // first 8 bytes of it, big-endian
};

// Bytes of the largest chunk a policy may send to this robot.
inline std::size_t largest_command_of(const RobotConfig& robot) {
  return largest_command_bytes(robot.joints.size(), robot.policy ? robot.policy->steps : 0);
}

// The fallback policy that runs beside the policy; nullptr: none does.
inline const Fallback* fallback_policy_of(const RobotConfig& robot) {
  if (robot.degraded.behaviour != Degraded::fallback) return nullptr;
  for (const Fallback& fallback : robot.fallbacks)
    if (fallback.name == robot.degraded.fallback && fallback.kind == FallbackKind::policy) return &fallback;
  return nullptr;
}

// What one radian in a key of all joints is of this one: 1 of a hinge, and of a slide the metres by which a radian of
// its motor moves it.
inline double per_rad(const Joint& joint) {
  return joint.kind == JointKind::slide ? 1 / joint.drive.gear_ratio : 1;
}

inline std::vector<WatchdogWaiver> watchdog_waivers(const RobotConfig& robot) {
  std::vector<WatchdogWaiver> waivers;
  for (const Joint& joint : robot.joints)
    if (waives_watchdog(joint.drive)) waivers.push_back({joint.name, joint.drive.watchdog_waiver});
  return waivers;
}

}  // namespace takt::config
