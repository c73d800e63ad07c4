// SPDX-License-Identifier: Apache-2.0
// Any sample that a DDS neighbour may write, as Cyclone hands it over: answers, words and observations of a remote
// policy, requests, and ROS 2's messages for sensors. Nothing is played, shown or done but what belongs to this robot,
// is whole, and is no younger than it can be; what is refused is refused with a sentence.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

#include "executive/contract/mode.hpp"
#include "monitor/dds/requests.hpp"
#include "policy_host/remote/answer_gate.hpp"
#include "policy_host/remote/far_samples.hpp"
#include "policy_host/remote/topics.hpp"
#include "policy_host/remote/wire_messages.hpp"
#include "sensors/ros/ros_sample.hpp"
#include "sensors/ros/ros_stamp.hpp"
#include "tests/fuzz/refused_with_a_sentence.hpp"
#include "tests/fuzz/scratch.hpp"
#include "tests/fuzz/source.hpp"

namespace {

using namespace takt;
using namespace takt::policy_host::remote;
using fuzz::require;
using fuzz::Source;

constexpr MonoTime kNow{10'000'000'000};
constexpr std::size_t kJoints = 2;
constexpr PeerId kServer{{1}}, kRobot{{2}}, kOther{{3}};

// A sequence of idlc's, of values out of the input.
template <class Value, class Sequence>
std::vector<Value> fill(Sequence& sequence, Source& source, std::size_t count) {
  std::vector<Value> values(count);
  if (count != 0) source.copy_to(values.data(), count * sizeof(Value));
  refer(sequence, values.data(), values.size());
  return values;
}

// --- a remote policy's answers, as the robot's bridge judges them ---

void answer(Source& source) {
  constexpr GateFacts kFacts{1, 2, 3, kJoints, milliseconds(20), milliseconds(100)};
  AnswerGate gate(kFacts);
  gate.begin(7);
  for (std::uint64_t id = 1; id <= 4; ++id)
    gate.show({id, kNow - milliseconds(10), kNow - milliseconds(9), kNow - milliseconds(20), kNow - milliseconds(15)});
  std::uint64_t newest = 0;
  for (int i = 0; i < 8 && !source.is_empty(); ++i) {
    takt_remote_Command message{};
    message.server = message.config_hash = 1;
    message.policy_hash = 2;
    message.epoch = 7;
    message.observation_id = 1 + source.byte() % 4U;
    message.number = static_cast<std::uint64_t>(i) + 1;
    message.step_period_ns = 20'000'000;
    message.step_count = 3;
    message.joint_count = kJoints;
    message.fields = 1;
    source.spoil(message);
    message.name[sizeof message.name - 1] = '\0';
    const std::size_t count = source.byte() % 8 == 0 ? source.byte() : std::size_t{3} * kJoints;
    const auto values = fill<float>(message.values, source, count);
    fuzz::require_printable(server_name_of(message));
    const Answer read = answer_of(message, kServer);
    const bool finite = std::ranges::all_of(values, [](float value) { return std::isfinite(value); });
    if (gate.judge(read, finite, kNow) != AnswerVerdict::usable) continue;
    require(finite && count == 3 * kJoints * field_count(read.fields) && read.epoch == 7);
    require(read.observation_id >= std::max<std::uint64_t>(newest, 1) && read.observation_id <= 4);
    newest = read.observation_id;
    const CommandHeader header = gate.play(read, kNow);
    require(header.step_count == 3 && header.joint_count == kJoints && header.observation_id == newest);
    require(header.dequeued_at <= header.infer_started_at && header.infer_started_at <= header.infer_ended_at);
    require(header.infer_ended_at <= header.published_at && header.published_at == kNow);
    require(header.outside_sensed_at.is_set() && header.outside_sensed_at <= kNow - milliseconds(20));
    require(gate.judge(read, finite, kNow) == AnswerVerdict::repeated);
  }
}

// --- what a server says of itself, and what the robot makes of it ---

void tell_status(Source& source) {
  Silence silence;
  while (!source.is_empty()) {
    takt_remote_ServerStatus message{};
    source.spoil(message);
    message.name[sizeof message.name - 1] = '\0';
    message.problem[sizeof message.problem - 1] = '\0';
    message.address[sizeof message.address - 1] = '\0';
    message.has_policy = source.byte() % 2 == 0;
    message.lacks_samples = source.byte() % 2 == 0;
    message.has_other_files = source.byte() % 2 == 0;
    silence.heard(state_of(message, source.byte() % 2 == 0 ? kOther : kServer, kNow));
    silence.refused(static_cast<AnswerVerdict>(source.byte() % kAnswerVerdictCount));
    fuzz::require_printable(silence.reason(kServer, 7, source.byte(), milliseconds(150), kNow));
  }
}

// --- a robot's observations and samples, as the policy's machine takes them ---

const config::RobotConfig& watched_robot() {
  static const config::RobotConfig one = [] {
    config::RobotConfig made;
    made.sensors.push_back({.name = "gauge", .values = 3, .timeout = seconds(1)});
    made.sensors.push_back({.name = "eye", .timeout = seconds(1), .image = config::ImageShape{2, 3, 1}});
    made.policy.emplace();
    for (const config::Sensor& sensor : made.sensors) {
      config::ObservationTerm& term = made.policy->observation.emplace_back();
      term.sensor = sensor.name;
    }
    return made;
  }();
  return one;
}

void take_sample(Source& source, FarSamples& samples) {
  takt_remote_Sample message{};
  message.sensor = source.byte() % 3;
  message.epoch = source.byte() % 3;
  message.number = source.byte() % 4;
  const auto values = fill<float>(message.values, source, source.byte() % 5);
  const auto image = fill<std::uint8_t>(message.image, source, source.byte() % 8);
  samples.take(message, source.byte() % 4 == 0 ? kOther : kRobot);
}

void observe(Source& source) {
  static FarSamples samples = FarSamples::open(watched_robot(), fuzz::scratch_folder(), {}).value();
  for (int left = source.byte() % 4; left > 0; --left) take_sample(source, samples);
  takt_remote_Observation message{};
  message.id = message.tick = 1;
  message.period_ns = 1'000'000;
  message.age_ns = message.oldest_age_ns = 2'000'000;
  message.imu_sequence = source.byte() % 2;
  source.spoil(message);
  const auto joints = [&] { return source.byte() % 16 == 0 ? source.byte() % 65U : kJoints; };
  const auto q = fill<float>(message.q, source, joints()), dq = fill<float>(message.dq, source, joints()),
             tau = fill<float>(message.tau, source, joints()),
             q_setpoint = fill<float>(message.q_setpoint, source, joints()),
             dq_of_drive = fill<float>(message.dq_of_drive, source, joints()),
             imu = fill<float>(message.imu, source, source.byte() % 2 == 0 ? kImuValues : source.byte() % 11U);
  std::vector<takt_remote_SampleReference> named(source.byte() % 4);
  for (takt_remote_SampleReference& one : named)
    one = {source.byte() % 3U, source.byte() % 4U, source.value<std::int64_t>()};
  refer(message.samples, named.data(), named.size());
  if (!is_sound(message, kJoints)) return;
  require(message.q._length == kJoints && message.mode < kModeCount);
  const Observation shown = observation_of(message, kNow);
  require(shown.joint_count == kJoints && shown.period > Duration{});
  require(shown.oldest_sensed_at <= shown.published_at && shown.published_at <= kNow);
  require(shown.oldest_sensed_at.is_set() && shown.imu.sensed_at <= kNow);
  if (samples.pass_on(message, kRobot, kNow) && !named.empty())
    require(samples.oldest_sensed_at().is_set() && samples.oldest_sensed_at() <= kNow);
}

// --- a request to the robot ---

void request(Source& source) {
  using namespace takt::monitor::dds;
  constexpr std::int64_t kUnix = 1'700'000'000'000'000'000;
  const Address here{.robot = "arm6", .machine = "aa11", .namesakes = {"bb22"}};
  constexpr std::array<const char*, 4> kVerbs{"arm", "stop", "reset", ""};
  const std::uint8_t what = source.byte();
  Request one;
  one.robot = what % 2 == 0 ? "arm6" : source.text();
  one.machine = what / 2 % 2 == 0 ? "aa11" : source.text();
  one.id = source.value<std::uint64_t>();
  one.sent_unix_ns = what / 4 % 2 == 0 ? kUnix : source.value<std::int64_t>();
  one.verb = printable(what / 8 % 2 == 0 ? kVerbs[what / 16 % 4] : source.text());
  if (!is_for(one, here)) return;
  require(one.robot == here.robot && (one.machine == here.machine || one.machine.empty()));
  const auto verb = judge(one, here, kUnix);
  fuzz::check_refusal(verb);
  if (!verb || *verb == OperatorVerb::stop) return;
  require(*verb == OperatorVerb::arm && one.verb == "arm" && one.machine == here.machine);
  require(one.sent_unix_ns >= kUnix - kArmWithin.ns && one.sent_unix_ns <= kUnix + kArmWithin.ns);
}

// --- ROS 2's messages for sensors ---

const config::Sensor& ros_sensor(config::RosType type) {
  static const std::vector<config::Sensor> sensors = [] {
    std::vector<config::Sensor> made(4);
    for (std::size_t i = 0; i < made.size(); ++i) {
      made[i].ros.emplace();
      made[i].ros->type = static_cast<config::RosType>(i);
    }
    made[static_cast<std::size_t>(config::RosType::image)].image = config::ImageShape{2, 3, 1};
    made[static_cast<std::size_t>(config::RosType::joint_state)].ros->joints = {{"hip"}, {"knee"}};
    made[static_cast<std::size_t>(config::RosType::twist)].values = 3;
    return made;
  }();
  return sensors[static_cast<std::size_t>(type)];
}

void take_image(Source& source) {
  std::string encoding = source.byte() % 4 != 0 ? "mono8" : source.text();
  sensor_msgs_msg_dds__Image_ message{};
  message.height = 2;
  message.width = 3;
  message.step = 3;
  source.spoil(message);
  message.encoding = source.byte() % 16 == 0 ? nullptr : encoding.data();
  const auto data = fill<std::uint8_t>(message.data, source, source.byte());
  std::array<std::byte, 6> pixels{};
  const auto taken = sensors::take_image(message, ros_sensor(config::RosType::image), pixels);
  fuzz::check_refusal(taken);
  if (taken) require(message.height == 2 && message.width == 3 && data.size() >= pixels.size());
}

void take_joints(Source& source) {
  std::array<std::string, 3> names{"knee", "hip", source.text()};
  std::vector<char*> pointers;
  for (std::string& name : names) pointers.push_back(source.byte() % 16 == 0 ? nullptr : name.data());
  pointers.resize(3 - source.byte() % 2U);
  sensor_msgs_msg_dds__JointState_ message{};
  refer(message.name, pointers.data(), pointers.size());
  const auto position = fill<double>(message.position, source, source.byte() % 8 == 0 ? 1 : pointers.size());
  sensors::RosValues values;
  const auto taken = sensors::take(message, ros_sensor(config::RosType::joint_state), values);
  fuzz::check_refusal(taken);
  if (taken) require(values.count == 2 && position.size() == pointers.size());
}

void take_ros(Source& source) {
  sensors::SenderClock clock;
  for (int left = source.byte() % 4; left > 0; --left) {
    std_msgs_msg_dds__Header_ header{};
    header.stamp = {source.value<std::int32_t>(), source.value<std::uint32_t>()};
    const sensors::Arrival arrival{{kNow, kNow - milliseconds(5)}, source.value<std::int64_t>() & INT64_MAX};
    const auto sensed = clock.take({sensors::stamp_of(header), source.value<std::int64_t>()}, arrival);
    require(sensed.at <= kNow && sensed.at.is_set() && sensed.ahead >= Duration{});
  }
  sensors::RosValues values;
  switch (source.byte() % 4) {
    case 0:
      return take_image(source);
    case 1:
      return take_joints(source);
    case 2: {
      const auto message = source.value<sensor_msgs_msg_dds__Imu_>();
      const auto taken = sensors::take(message, ros_sensor(config::RosType::imu), values);
      fuzz::check_refusal(taken);
      return require(!taken || values.count == kImuValues);
    }
    default: {
      const auto message = source.value<geometry_msgs_msg_dds__Twist_>();
      require(sensors::take(message, ros_sensor(config::RosType::twist), values).has_value() && values.count == 3);
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Source source({data, size});
  switch (source.byte() % 5) {
    case 0:
      answer(source);
      break;
    case 1:
      observe(source);
      break;
    case 2:
      request(source);
      break;
    case 3:
      tell_status(source);
      break;
    default:
      take_ros(source);
  }
  return 0;
}
