// SPDX-License-Identifier: Apache-2.0
#include "tests/exploration/world.hpp"

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "config/drive_ids.hpp"
#include "config/load.hpp"
#include "config/stop_causes.hpp"
#include "config/turns.hpp"
#include "drivers/bus/receive_stamp.hpp"
#include "drivers/guard/wire_guard.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/setup/tick_config_of.hpp"

namespace takt::exploration {
namespace {

constexpr Duration kInference = milliseconds(12);
constexpr std::uint16_t kSteps = 16;  // as the robot file says
constexpr Duration kStepPeriod = milliseconds(20);
constexpr std::uint64_t kPolicyHash = 5, kFallbackHash = 6, kCandidateHash = 7;
constexpr Duration kAsksEvery = milliseconds(400);  // the operator: to arm, or to reset

}  // namespace

config::RobotConfig small_robot() {
  auto robot = config::load("config/dual_arm12.yaml").value();
  std::vector<config::Joint> joints;
  for (const config::Joint& joint : robot.joints) {
    const auto same = [&joint](const config::Joint& other) { return other.drive.protocol == joint.drive.protocol; };
    if (std::none_of(joints.begin(), joints.end(), same)) joints.push_back(joint);
  }
  robot.joints = std::move(joints);
  for (config::Joint& joint : robot.joints)
    if (joint.drive.variant == "damiao") joint.limits.temperature = {.warning = 100, .stop = 120};
  robot.model.reset();
  // A wait and a memory of relapses, so that both are explored.
  robot.freshness.recover_after = milliseconds(250);
  robot.freshness.flap_memory = seconds(10);
  robot.safe_torque_off.emplace().on_joint_fault = config::OnJointFault::keep;
  robot.sensors.push_back({.name = "base_imu", .values = kImuValues, .timeout = milliseconds(20)});
  robot.imu =
      config::Imu{.sensor = "base_imu", .tilt = 1.0, .angular_velocity = 6.0, .frozen_after = milliseconds(100)};
  return robot;
}

config::RobotConfig robot_that_minds() {
  config::RobotConfig robot = small_robot();
  robot.degraded.by_temperature = true;
  robot.degraded.longest = milliseconds(200);
  robot.feedback.following = config::Following::stop;
  for (config::Joint& joint : robot.joints)
    if (joint.limits.temperature) joint.limits.temperature->stop = 0;
  return robot;
}

config::RobotConfig robot_with_turns() {
  config::RobotConfig robot = small_robot();
  for (config::Joint& joint : robot.joints) {
    if (joint.drive.protocol == config::DriveProtocol::mit) joint.drive.every = 3;
    if (joint.drive.protocol == config::DriveProtocol::robstride) joint.drive.every = 2;
  }
  return robot;
}

config::RobotConfig robot_with_fallback() {
  config::RobotConfig robot = small_robot();
  robot.degraded.behaviour = config::Degraded::fallback;
  robot.degraded.fallback = "second";
  config::Fallback second;
  second.name = "second";
  second.kind = config::FallbackKind::policy;
  second.file = "none";
  second.longest = seconds(1);
  robot.fallbacks = {second};
  return robot;
}

namespace {

config::StopConfig drawn_stop(Cause cause, bool is_backed, std::mt19937_64& random) {
  using config::StopHow;
  constexpr std::array kWays{StopHow::rest, StopHow::damping, StopHow::hold, StopHow::policy};
  constexpr std::array kLongest{Duration{}, milliseconds(150), milliseconds(600), seconds(2)};
  const bool may_be_policys =
      is_backed && std::ranges::find(config::kPolicyStopCauses, cause) != config::kPolicyStopCauses.end();
  config::StopConfig stop{.name = std::string(name(cause)), .how = {}, .longest = {}, .shown_by = {}};
  // Where it may be the policy's, it is more often than not.
  stop.how = may_be_policys && random() % 2 == 0 ? StopHow::policy : kWays.at(random() % (kWays.size() - 1));
  if (stop.how != StopHow::rest && stop.how != StopHow::damping) stop.longest = kLongest.at(random() % kLongest.size());
  return stop;
}

}  // namespace

config::RobotConfig robot_that_stops(std::uint64_t seed) {
  using config::Degraded;
  constexpr std::array kBehaviours{Degraded::hold, Degraded::slow, Degraded::fallback};
  constexpr std::array kLongest{Duration{}, milliseconds(200), seconds(1)};
  std::mt19937_64 random(seed * 0x9E37'79B9'7F4A'7C15ULL);
  config::RobotConfig robot = robot_with_fallback();
  config::Fallback tuck;
  tuck.name = "tuck";
  tuck.kind = config::FallbackKind::pose;
  tuck.speed = 1;
  for (const config::Joint& joint : robot.joints) tuck.pose.push_back(joint.home);
  robot.fallbacks.push_back(tuck);
  const bool is_backed = random() % 4 != 0;
  if (!is_backed) {
    robot.degraded.behaviour = kBehaviours.at(random() % kBehaviours.size());
    robot.degraded.fallback = robot.degraded.behaviour == Degraded::fallback ? "tuck" : "";
  }
  robot.fallbacks[0].longest = kLongest.at(random() % kLongest.size());
  robot.degraded.longest = kLongest.at(random() % kLongest.size());
  robot.degraded.by_temperature = random() % 2 == 0;
  for (const Cause cause : config::kStopCauses) robot.stops.push_back(drawn_stop(cause, is_backed, random));
  return robot;
}

config::RobotConfig robot_at_random(std::uint64_t seed) {
  using config::JoinKind;
  constexpr std::array kJoins{JoinKind::replace, JoinKind::cross_fade, JoinKind::blend, JoinKind::ensemble,
                              JoinKind::align,   JoinKind::quintic,    JoinKind::prefix};
  std::mt19937_64 random(seed * 0xBF58'476D'1CE4'E5B9ULL);
  config::RobotConfig robot = robot_that_stops(seed);
  robot.policy->action.join = {.kind = kJoins.at(random() % kJoins.size()),
                               .over = milliseconds(60),
                               .new_share = 0.7,
                               .decay = 0.1,
                               .taper = {},
                               .longest = milliseconds(60)};
  for (config::Joint& joint : robot.joints)
    if (joint.drive.protocol == config::DriveProtocol::cia402 && random() % 2 == 0)
      joint.drive.mode = config::Cia402Mode::csp;
  if (random() % 2 == 0) return robot;
  config::Model& model = robot.model.emplace();
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    config::Link& link = model.links.emplace_back();
    link.joint = robot.joints[j].name;
    link.parent = j % 2 == 1 ? static_cast<int>(j) - 1 : -1;
    link.axis = {0, 0, 1};
  }
  return robot;
}

namespace {

pipeline::TickConfig planted_config(const config::RobotConfig& robot, Planted planted) {
  pipeline::TickConfig config = setup::tick_config_of(robot, kPolicyHash, kFallbackHash);
  using pipeline::StopManner;
  for (pipeline::StopRule& rule : config.stops) {
    if (planted == Planted::stops_without_end) rule.longest = {};
    if (planted == Planted::stiff_damping && rule.manner == StopManner::damping) rule.manner = StopManner::hold;
    if (planted == Planted::policy_in_any_stop) rule.manner = StopManner::policy;
  }
  if (planted == Planted::degraded_without_end) config.degraded_longest = {};
  if (planted == Planted::early_rest) config.rest_velocity = 5;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    pipeline::JointConfig& joint = config.joints[j];
    if (planted == Planted::fast_limits) joint.limits.velocity *= 3;
    if (planted == Planted::fast_limits) joint.limits.acceleration *= 1.8F;
    if (planted == Planted::sudden_limits) joint.limits.acceleration *= 10;
    if (planted != Planted::led_when_lost) continue;
    joint.fallback_pose = joint.home + 0.5F;
    joint.fallback_speed = 1;
  }
  if (planted == Planted::led_when_lost) {
    config.degraded = pipeline::DegradedBehaviour::fallback;
    config.fallback = pipeline::FallbackKind::pose;
  }
  return config;
}

}  // namespace

// --- ports ---

class World::VirtualClock final : public runtime::Clock {
 public:
  explicit VirtualClock(World& world) : world_(world) {}
  MonoTime now() noexcept override {
    world_.stall_in(Happening::stall_in_clock);
    world_.pass(Duration{200});
    return world_.now_;
  }
  void sleep_until(MonoTime when) noexcept override {
    world_.before_tick();
    const Event* const late = world_.active(Happening::late_wake_ups);
    if (when > world_.now_)
      world_.go_to(when + (late ? std::min(Duration{late->length.ns / 8}, milliseconds(3)) : microseconds(30)));
    world_.fall_asleep(Happening::computer_sleeps);
  }
  Duration since_boot() noexcept override { return world_.now_ - MonoTime{} + world_.slept_; }

 private:
  World& world_;
};

class World::VirtualBus final : public drivers::CanBus {
 public:
  VirtualBus(World& world, std::size_t index) : world_(world), index_(index) {}
  drivers::SendResult send(const drivers::CanFrame& frame) noexcept override {
    const drivers::SendResult result = world_.send(index_, frame);
    health_.tx_dropped += result == drivers::SendResult::sent ? 0U : 1U;
    world_.fall_asleep(Happening::computer_sleeps_in_tick);
    world_.stall_in(Happening::stall_in_send);  // the frame is out; what stalls inside the write itself is unseen
    return result;
  }
  std::size_t receive(std::span<drivers::ReceivedFrame> out) noexcept override {
    world_.fall_asleep(Happening::computer_sleeps_in_tick);
    world_.stall_in(Happening::stall_in_receive);
    world_.collect(index_);
    health_.rx_dropped += world_.is_on(Happening::bus_overflows, index_) ? 1U : 0U;
    std::deque<Arriving>& waiting = world_.arriving_[index_];
    std::size_t count = 0;
    if (world_.is_on(Happening::bus_has_stranger, index_)) out[count++] = {strange_reply(), world_.now_};
    for (int i = 0; i < 20 && world_.is_on(Happening::bus_babbles, index_) && count < out.size(); ++i)
      out[count++] = {heartbeat_, world_.now_};
    const bool undated = world_.is_on(Happening::frames_undated, index_);
    for (; count < out.size() && !waiting.empty() && waiting.front().readable_at <= world_.now_; waiting.pop_front()) {
      out[count] = waiting.front().frame;
      if (undated) out[count].received_at = drivers::kUndated;
      ++count;
    }
    for (std::size_t i = 0; i < count; ++i)
      if (is_heartbeat(out[i].frame)) heartbeat_ = out[i].frame;
    return count;
  }
  [[nodiscard]] BusHealth health() const noexcept override {
    BusHealth health = health_;
    if (world_.is_on(Happening::bus_error_passive, index_)) health.state = BusState::error_passive;
    if (world_.is_on(Happening::bus_off, index_)) health.state = BusState::bus_off;
    if (world_.is_on(Happening::bus_down, index_)) health.state = BusState::down;
    return health;
  }

 private:
  // An ODrive's: it counts as no reply, however often it comes.
  static bool is_heartbeat(const drivers::CanFrame& frame) {
    return !frame.extended && frame.length == 8 && (frame.id & 0x1FU) == 0x01;
  }
  // On the id of the bus's first drive, and too short to be its word.
  [[nodiscard]] drivers::CanFrame strange_reply() const {
    const auto& joints = world_.robot_.joints;
    const auto first = std::ranges::find(joints, index_, &config::Joint::bus);
    drivers::CanFrame frame;
    if (first == joints.end()) return frame;
    const config::IdPattern id = config::ids_of(first->drive).replies.front();
    frame.id = id.id;
    frame.extended = id.extended;
    frame.length = 1;
    return frame;
  }

  World& world_;
  std::size_t index_;
  BusHealth health_;
  drivers::CanFrame heartbeat_;
};

class World::VirtualTorque final : public drivers::TorqueOutput {
 public:
  explicit VirtualTorque(World& world) : world_(world) {}
  bool tell(bool permitted) noexcept override {
    if (!world_.torque_output_works()) return false;
    if (permitted || world_.planted_ != Planted::keeps_torque) world_.torque_permitted_ = permitted;
    return true;
  }

 private:
  World& world_;
};

class World::PlantedGuard final : public drivers::FrameGuard {
 public:
  explicit PlantedGuard(World& world) : world_(world), guard_(world.robot_) {}
  WireVerdict pass(std::size_t joint, std::size_t bus, const drivers::GuardedMoment& moment, const JointRecord& record,
                   drivers::CanFrame& frame) noexcept override {
    const WireVerdict verdict = guard_.pass(joint, bus, moment, record, frame);
    const bool is_due = world_.planted_ == Planted::refused && moment.now > kStart + seconds(2);
    if (!is_due || world_.refused_at_.is_set()) return verdict;
    world_.refused_at_ = moment.now;
    return WireVerdict::differs;
  }

 private:
  World& world_;
  drivers::WireGuard guard_;
};

// Between a driver and the tick: what the joint said becomes a lie, whatever its protocol.
class World::LyingDriver final : public drivers::JointDriver {
 public:
  LyingDriver(World& world, std::size_t joint, std::unique_ptr<drivers::JointDriver> driver)
      : world_(world), joint_(joint), driver_(std::move(driver)), said_(driver_->feedback()) {}
  std::size_t encode(bool enable, const drivers::DriveSetpoint& setpoint, MonoTime now, MonoTime valid_until,
                     std::span<drivers::CanFrame> out) noexcept override {
    const std::size_t count = driver_->encode(enable, setpoint, now, valid_until, out);
    JointFeedback state = driver_->feedback();  // which a driver may change by itself; motion is what was said
    state.received_at = said_.received_at;
    state.q = said_.q;
    state.dq = said_.dq;
    state.tau = said_.tau;
    said_ = state;
    return count;
  }
  [[nodiscard]] bool is_set_up() const noexcept override { return driver_->is_set_up(); }
  void assume_set_up() noexcept override { driver_->assume_set_up(); }
  void assume_home(float q, float tolerance) noexcept override { driver_->assume_home(q, tolerance); }
  [[nodiscard]] float shift() const noexcept override { return driver_->shift(); }
  bool decode(const drivers::ReceivedFrame& received) noexcept override {
    if (!driver_->decode(received)) return false;
    const JointFeedback& truth = driver_->feedback();
    const Event* const lie = world_.lie_of(joint_);
    if (lie == nullptr) {
      said_ = before_ = truth;
      return true;
    }
    if (lie != lie_) first_ = said_;
    lie_ = lie;
    const JointFeedback said_before = said_;
    said_ = truth;
    tell(*lie, said_before);
    if (truth.replies != before_.replies) before_ = truth;
    return true;
  }
  [[nodiscard]] const JointFeedback& feedback() const noexcept override { return said_; }

 private:
  void tell(const Event& lie, const JointFeedback& said_before) {
    const bool again = said_.replies == said_before.replies;  // the same reading, with more to it
    if (lie.what == Happening::says_frozen) said_.q = first_.q;
    if (lie.what == Happening::says_frozen && lie.length.ns / milliseconds(1).ns % 2 == 0) {
      said_.dq = first_.dq;
      said_.tau = first_.tau;
    }
    if (lie.what == Happening::says_jump) said_.q += 0.3F;
    if (lie.what == Happening::says_wrap) said_.q -= 6.2831853F;
    if (lie.what == Happening::says_sign) said_.q = 2 * first_.q - said_.q;
    if (lie.what == Happening::says_scale) said_.q += 0.5F * (said_.q - first_.q);
    if (!shows(lie)) said_.dq *= lie.what == Happening::says_sign ? -1.0F : 1.5F;
    if (lie.what == Happening::says_repeated && said_.replies % 2 != 0) {
      said_.q = again ? said_before.q : before_.q;
      said_.dq = again ? said_before.dq : before_.dq;
    }
    if (lie.what == Happening::says_future) said_.received_at = said_.received_at + std::min(lie.length, seconds(1));
  }

  World& world_;
  std::size_t joint_;
  std::unique_ptr<drivers::JointDriver> driver_;
  JointFeedback said_{}, before_{}, first_{};  // told last, true of the reply before, told when the lie began
  const Event* lie_ = nullptr;
};

// --- construction ---

// Shared memory of one writer, and who reads it.
struct World::Mailbox {
  explicit Mailbox(const ipc::RingShape& ring)
      : shape(ring),
        segment(ipc::Segment::create("explored", ipc::ring_bytes(ring), true).value()),
        writer(segment.writable(), ring) {}
  [[nodiscard]] ipc::Segment seen() const {
    return ipc::Segment::adopt_read_only(dup(segment.fd()), segment.size()).value();
  }
  // Of what is written from now on.
  [[nodiscard]] ipc::SlotReader reader(const ipc::Segment& of) const {
    ipc::SlotReader made = ipc::SlotReader::attach(of.readable(), shape).value();
    made.skip_to_newest();
    return made;
  }
  ipc::RingShape shape;
  ipc::Segment segment;
  ipc::SlotWriter writer;
};

// All of a world's shared memory. Sealing and faulting it would take a quarter of a schedule's time: one world lends it
// to the next of the same shape.
struct World::Rings {
  Rings(std::size_t joints, std::uint32_t largest)
      : joint_count(joints),
        largest_command(largest),
        published(runtime::PublishedSegments::create(joints, largest).value()),
        observation_segment(ipc::Segment::adopt_read_only(dup(published.observation_descriptor()),
                                                          ipc::ring_bytes(ipc::observation_mailbox()))
                                .value()) {
    // What a world allocates and frees stays with the process: the next one needs it, and would fault it in again.
    mallopt(M_MMAP_THRESHOLD, 32 << 20);
    mallopt(M_TRIM_THRESHOLD, 256 << 20);
  }
  static std::unique_ptr<Rings> take(std::size_t joints, std::uint32_t largest) {
    const auto fits = [&](const auto& one) { return one->joint_count == joints && one->largest_command == largest; };
    const auto found = std::ranges::find_if(spare(), fits);
    if (found == spare().end()) return std::make_unique<Rings>(joints, largest);
    std::unique_ptr<Rings> rings = std::move(*found);
    spare().erase(found);
    return rings;
  }
  static void give_back(std::unique_ptr<Rings> rings) { spare().push_back(std::move(rings)); }
  [[nodiscard]] ipc::SlotReader ticks() const {
    ipc::SlotReader reader = published.tick_reader();
    reader.skip_to_newest();
    return reader;
  }
  [[nodiscard]] ipc::SlotReader observations() const {
    auto reader = ipc::SlotReader::attach(observation_segment.readable(), ipc::observation_mailbox()).value();
    reader.skip_to_newest();
    return reader;
  }

  std::size_t joint_count;
  std::uint32_t largest_command;
  runtime::PublishedSegments published;
  ipc::Segment observation_segment;
  Mailbox policy{ipc::command_mailbox()}, fallback{ipc::command_mailbox()}, candidate{ipc::command_mailbox()};
  Mailbox imu{ipc::sensor_mailbox()};

 private:
  static std::vector<std::unique_ptr<Rings>>& spare() {
    static std::vector<std::unique_ptr<Rings>> rings;
    return rings;
  }
};

World::Policy::Policy(Mailbox& mailbox, runtime::MailboxHandover& handover, std::uint64_t policy_hash,
                      Happening what_silences, float kd_share)
    : hash(policy_hash), silence(what_silences), kd(kd_share), commands(mailbox.writer) {
  ipc::Segment seen = mailbox.seen();
  const ipc::SlotReader reader = mailbox.reader(seen);
  handover.want(std::make_unique<runtime::CommandMailbox>(std::move(seen), reader, std::uint8_t{1}, policy_hash));
}

World::World(const config::RobotConfig& robot, std::vector<Event> events, std::uint64_t seed, Planted planted)
    : robot_(robot),
      events_(std::move(events)),
      done_(events_.size()),
      random_(~seed),
      planted_(planted),
      plant_(simulation::Plant::on_free_inertias(robot).value()),
      arriving_(robot.buses.size()),
      unheard_since_(robot.joints.size()),
      shoved_at_(robot.joints.size()),
      handled_at_(robot.joints.size()),
      lied_at_(robot.joints.size()),
      held_at_(robot.joints.size(), std::numeric_limits<double>::quiet_NaN()),
      config_(planted_config(robot, planted)),
      clock_(std::make_unique<VirtualClock>(*this)),
      edge_(make_edge()),
      rings_(Rings::take(robot.joints.size(), config_.largest_command)),
      ticks_(rings_->ticks()),
      observations_(rings_->observations()),
      policy_(rings_->policy, mailboxes_[Seat::policy], kPolicyHash, Happening::policy_silent, kPolicyKd),
      fallback_(rings_->fallback, mailboxes_[Seat::fallback], kFallbackHash, Happening::fallback_silent, kFallbackKd) {
  for (const Event& event : events_) drawn_ |= std::uint64_t{1} << static_cast<unsigned>(event.what);
  advance_to(kStart);
  lies_ = std::ranges::any_of(events_, is_lie, &Event::what);
  if (std::ranges::any_of(events_, is_of_candidate, &Event::what))
    candidate_ = std::make_unique<Policy>(rings_->candidate, mailboxes_[Seat::candidate], kCandidateHash,
                                          Happening::candidate_silent, kCandidateKd);
  ipc::Segment seen = rings_->imu.seen();
  const ipc::SlotReader reader = rings_->imu.reader(seen);
  imu_mailboxes_.want(std::make_unique<runtime::ImuMailbox>(std::move(seen), reader));
  loop_ =
      std::make_unique<runtime::CyclicLoop>(runtime::LoopParts{config_, *clock_, edge_, mailboxes_, requests_,
                                                               recorded_, rings_->published, board_, &imu_mailboxes_},
                                            runtime::LoopTiming{{}, {}, 1'000'000});
}

World::~World() {
  Rings::give_back(std::move(rings_));
}

runtime::DriveEdge World::make_edge() {
  std::vector<std::unique_ptr<drivers::CanBus>> buses;
  for (std::size_t bus = 0; bus < robot_.buses.size(); ++bus) buses.push_back(std::make_unique<VirtualBus>(*this, bus));
  const std::vector<Turns> turns = config::turns_of(robot_);
  std::vector<runtime::JointOnBus> joints;
  for (std::size_t j = 0; j < robot_.joints.size(); ++j) {
    std::unique_ptr<drivers::JointDriver> driver = drivers::make_joint_driver(robot_, j).value();
    const auto lies = [j](const Event& event) { return is_lie(event.what) && event.index == j; };
    if (std::ranges::any_of(events_, lies)) driver = std::make_unique<LyingDriver>(*this, j, std::move(driver));
    joints.push_back({std::move(driver), robot_.joints[j].bus, turns[j]});
  }
  return {std::move(buses), std::move(joints), std::make_unique<PlantedGuard>(*this),
          std::make_unique<VirtualTorque>(*this)};
}

void World::run(Duration lasting) {
  loop_->run(runtime::EvidenceSource::none(), static_cast<std::uint64_t>(lasting.ns / config_.period.ns));
}

// --- time ---

void World::go_to(MonoTime until) {
  now_ = until;
  const Duration step = plant_.step_length();
  for (; plant_at_ + step <= now_; advance_to(plant_at_ + step)) {
    begin_and_end_events();
    plant_.step();
    lend_a_hand();
    if (lies_) note_lies();
    sense_base();
    for (std::size_t bus = 0; bus < arriving_.size(); ++bus) collect(bus);
    if (on_step) on_step();
  }
}

// One that shows is found within kFoundWithin.
void World::note_lies() {
  for (const Event& event : events_) {
    if (!is_lie(event.what) || plant_at_ < kStart + event.at) continue;
    const MonoTime until = kStart + (shows(event) ? event.at + std::min(event.length, kFoundWithin) : event.end());
    if (plant_at_ < until) lied_at_[event.index] = plant_at_;
  }
}

void World::advance_to(MonoTime at) {
  plant_at_ = at;
  active_ = 0;
  for (const Event& event : events_)
    if (is_active(event)) active_ |= std::uint64_t{1} << static_cast<unsigned>(event.what);
}

// Once a millisecond, with a little noise: no IMU says the same twice.
void World::sense_base() {
  if ((plant_at_ - kStart).ns % milliseconds(1).ns != 0 || active(Happening::imu_silent) != nullptr) return;
  SensorSample sample;
  sample.sequence = ++imu_sequence_;
  sample.published_at = plant_at_;
  sample.sensed_at = active(Happening::imu_late) != nullptr ? plant_at_ - milliseconds(30) : plant_at_;
  sample.value_count = kImuValues;
  const float lean = active(Happening::base_leans) != nullptr ? 1.5F : 0.0F;
  sample.values[0] = active(Happening::imu_lies) != nullptr ? 0.5F : std::cos(lean / 2);
  sample.values[1] = std::sin(lean / 2);
  const bool frozen = active(Happening::imu_frozen) != nullptr;
  sample.values[9] = 9.81F + (frozen ? 0.0F : 1e-3F * static_cast<float>(imu_sequence_ % 7));
  rings_->imu.writer.publish(std::as_bytes(std::span(&sample, 1)));
}

void World::stall_in(Happening port) {
  if ((drawn_ >> static_cast<unsigned>(port) & 1U) == 0) return;
  for (std::size_t i = 0; i < events_.size(); ++i) {
    if (done_[i] || events_[i].what != port || now_ < kStart + events_[i].at) continue;
    done_[i] = true;
    pass(events_[i].length);
  }
}

// Drives live on, by their own watchdogs; CLOCK_MONOTONIC stands still, and nothing that was said meanwhile is heard.
void World::fall_asleep(Happening when) {
  if ((drawn_ >> static_cast<unsigned>(when) & 1U) == 0) return;
  for (std::size_t i = 0; i < events_.size(); ++i) {
    if (done_[i] || events_[i].what != when || now_ < kStart + events_[i].at) continue;
    done_[i] = true;
    const Duration length = events_[i].length;
    slept_ = slept_ + length;
    for (Duration passed; passed < length; passed = passed + plant_.step_length()) {
      plant_.step();
      for (std::size_t bus = 0; bus < arriving_.size(); ++bus) plant_.collect(bus, said_);
    }
    std::ranges::fill(shoved_at_, plant_at_);
    for (Policy* const policy : {&policy_, &fallback_, candidate_.get()}) {
      if (policy == nullptr) continue;
      policy->newest_answered = policy->newest_answered - length;
      for (Answer& answer : policy->answers) answer.sensed = answer.sensed - length;
    }
  }
}

bool World::is_active(const Event& event) const {
  return plant_at_ >= kStart + event.at && plant_at_ < kStart + event.end();
}

const Event* World::active(Happening what) const {
  if (!may_be_on(what)) return nullptr;
  const auto found =
      std::find_if(events_.begin(), events_.end(), [&](const Event& e) { return e.what == what && is_active(e); });
  return found == events_.end() ? nullptr : &*found;
}

bool World::is_on(Happening what, std::size_t index) const {
  return may_be_on(what) && std::any_of(events_.begin(), events_.end(), [&](const Event& e) {
           return e.what == what && e.index == index && is_active(e);
         });
}

const Event* World::lie_of(std::size_t joint) const {
  const auto found = std::ranges::find_if(
      events_, [&](const Event& event) { return is_lie(event.what) && event.index == joint && is_active(event); });
  return found == events_.end() ? nullptr : &*found;
}

// What a second host sends to take the power away.
void World::disable_from_outside(std::size_t joint) {
  const config::Drive& drive = robot_.joints[joint].drive;
  drivers::CanFrame frame;
  if (drive.protocol == config::DriveProtocol::mit) {
    frame.id = drive.id;
    frame.length = 8;
    std::fill_n(frame.data, 7, std::uint8_t{0xFF});
    frame.data[7] = 0xFD;
  } else if (drive.protocol == config::DriveProtocol::odrive) {
    frame.id = drive.id << 5U | 0x07;
    frame.length = 4;
    frame.data[0] = 1;  // idle
  } else {
    return;
  }
  said_.clear();
  plant_.receive(robot_.joints[joint].bus, frame, said_);
}

void World::begin_and_end_events() {
  set_lines();
  for (std::size_t i = 0; i < events_.size(); ++i) {
    const Event& event = events_[i];
    if (done_[i] || plant_at_ < kStart + event.at) continue;
    done_[i] = true;
    switch (event.what) {
      case Happening::shove:
        push(event.index, 2);
        break;
      case Happening::hurl:
        push(event.index, 40);
        break;
      case Happening::drive_error:
        plant_.drive(event.index).inject(simulation::DeviceFault::over_temperature);
        break;
      case Happening::drive_restarts:
        plant_.drive(event.index).power_cycle(plant_.now());  // again and again, as long as it lasts
        done_[i] = !is_active(event);
        break;
      case Happening::drive_taken_away:
        disable_from_outside(event.index);
        done_[i] = !is_active(event);
        break;
      case Happening::operator_stop:
        if (planted_ != Planted::no_stop) requests_.stop(now_);
        stop_asked_at_ = plant_at_;
        break;
      case Happening::operator_deenergise:
        requests_.deenergise(now_);
        power_off_asked_at_ = plant_at_;
        break;
      case Happening::shutdown:
        requests_.shut_down(now_);
        stop_asked_at_ = plant_at_;
        break;
      case Happening::candidate_swap:
        requests_.swap(kCandidateHash);
        break;
      case Happening::candidate_back:
        requests_.back();
        break;
      case Happening::stall_in_clock:
      case Happening::stall_in_send:
      case Happening::stall_in_receive:
      case Happening::late_wake_ups:
      case Happening::policy_silent:
      case Happening::policy_slow:
      case Happening::policy_nonsense:
      case Happening::drive_silent:
      case Happening::drive_deaf:
      case Happening::drive_repeats:
      case Happening::drive_late:
      case Happening::drive_hot:
      case Happening::bus_off:
      case Happening::bus_down:
      case Happening::bus_error_passive:
      case Happening::bus_refuses:
      case Happening::bus_overflows:
      case Happening::bus_babbles:
      case Happening::bus_has_stranger:
      case Happening::frames_undated:
      case Happening::frames_lost:
      case Happening::recorder_ends:
      case Happening::computer_sleeps:
      case Happening::computer_sleeps_in_tick:
      case Happening::torque_output_fails:
      case Happening::imu_silent:
      case Happening::imu_lies:
      case Happening::base_leans:
      case Happening::fallback_silent:
      case Happening::imu_frozen:
      case Happening::imu_late:
      case Happening::no_stiffness:
      case Happening::little_stiffness:
      case Happening::no_damping:
      case Happening::little_damping:
      case Happening::asks_far:
      case Happening::hand_holds:
      case Happening::hand_pulls:
      case Happening::says_frozen:
      case Happening::says_jump:
      case Happening::says_wrap:
      case Happening::says_sign:
      case Happening::says_scale:
      case Happening::says_repeated:
      case Happening::says_future:
      case Happening::candidate_silent:
      case Happening::candidate_nonsense:
        done_[i] = false;  // lasts, or strikes at a port
    }
  }
}

void World::push(std::size_t joint, double speed) {
  simulation::ArmState state = plant_.state();
  state.dq[static_cast<Eigen::Index>(joint)] += speed;
  plant_.set_state(std::move(state));
  shoved_at_[joint] = plant_at_;
}

// A hand that holds is a spring and a damper as stiff as a millisecond's step allows. Between plant and drives, after
// each step: what a hand adds to a speed is not the executive's doing.
void World::lend_a_hand() {
  constexpr double kStiffness = 200;  // rad/s, of a joint's inertia on it, critically damped
  constexpr double kPull = 1.0 / 3;   // of the joint's torque
  const bool may_touch = may_be_on(Happening::hand_holds) || may_be_on(Happening::hand_pulls);
  const double dt = plant_.step_length().seconds();
  for (std::size_t joint = 0; joint < held_at_.size(); ++joint) {
    const bool holds = may_touch && is_on(Happening::hand_holds, joint);
    const bool pulls = may_touch && is_on(Happening::hand_pulls, joint);
    if (!holds) held_at_[joint] = std::numeric_limits<double>::quiet_NaN();
    if (!holds && !pulls) continue;
    simulation::ArmState state = plant_.state();
    double& q = state.q[static_cast<Eigen::Index>(joint)];
    double& dq = state.dq[static_cast<Eigen::Index>(joint)];
    if (holds && std::isnan(held_at_[joint])) held_at_[joint] = q;
    if (pulls) dq += dt * kPull * robot_.joints[joint].limits.torque / robot_.joints[joint].inertia;
    if (holds) {
      const double before = dq;
      dq = (dq + dt * kStiffness * kStiffness * (held_at_[joint] - q)) /
           (1 + dt * 2 * kStiffness + dt * dt * kStiffness * kStiffness);
      q += dt * (dq - before);  // as if it had been there in the plant's step
    }
    plant_.set_state(std::move(state));
    handled_at_[joint] = plant_at_;
  }
}

void World::set_lines() {
  constexpr std::uint64_t kOfLines = [] {
    std::uint64_t set = 0;
    for (const Happening what : {Happening::drive_silent, Happening::drive_restarts, Happening::drive_deaf,
                                 Happening::drive_repeats, Happening::drive_late})
      set |= std::uint64_t{1} << static_cast<unsigned>(what);
    return set;
  }();
  const bool had = std::exchange(has_lines_, (active_ & kOfLines) != 0);
  if (!had && !has_lines_) return;
  for (std::size_t joint = 0; joint < plant_.joint_count(); ++joint) {
    simulation::LineFaults line;
    for (const Event& event : events_) {
      if (is_of_bus(event.what) || event.index != joint || !is_active(event)) continue;
      line.silent |= event.what == Happening::drive_silent || event.what == Happening::drive_restarts;
      line.deaf |= event.what == Happening::drive_deaf;
      line.repeat |= event.what == Happening::drive_repeats;
      if (event.what == Happening::drive_late)
        line.delay = milliseconds(12 - (plant_at_ - kStart).ns / milliseconds(1).ns % 12);
    }
    plant_.set_line(joint, line);
    if (!line.silent)
      unheard_since_[joint] = {};
    else if (!unheard_since_[joint].is_set())
      unheard_since_[joint] = plant_at_;
  }
}

// --- frames ---

bool World::loses_frame(std::size_t bus) {
  return is_on(Happening::frames_lost, bus) && random_() % 3 == 0;
}

// A Damiao drive's report: state and number, position, speed, torque, then two temperatures.
void World::heat(std::size_t bus, drivers::CanFrame& frame) const {
  constexpr std::uint8_t kHot = 130;
  const Event* const hot = active(Happening::drive_hot);
  if (hot == nullptr) return;
  const config::Joint& joint = robot_.joints[hot->index];
  const bool is_its_report = joint.bus == bus && joint.drive.variant == "damiao" && frame.id == joint.drive.reply_id &&
                             (frame.data[0] & 0xFU) == (joint.drive.id & 0xFU) && frame.data[2] != 0x33;
  if (is_its_report) frame.data[7] = kHot;
}

void World::arrive(std::size_t bus, const simulation::Frames& said) {
  for (drivers::CanFrame frame : said) {
    if (loses_frame(bus)) continue;
    const MonoTime at = std::max(now_, plant_at_) + kOnTheWire;
    heat(bus, frame);
    arriving_[bus].push_back({{frame, at}, at});
  }
}

void World::collect(std::size_t bus) {
  said_.clear();
  plant_.collect(bus, said_);
  arrive(bus, said_);
}

drivers::SendResult World::send(std::size_t bus, drivers::CanFrame frame) {
  if (is_on(Happening::bus_off, bus) || (is_on(Happening::bus_refuses, bus) && random_() % 2 == 0))
    return drivers::SendResult::queue_full;
  if (is_on(Happening::bus_down, bus)) return drivers::SendResult::bus_down;
  if (planted_ != Planted::none && !plant_fault_in(frame)) return drivers::SendResult::sent;
  if (on_frame) on_frame({bus, frame, now_});
  pass(microseconds(2));
  if (loses_frame(bus)) return drivers::SendResult::sent;
  said_.clear();
  plant_.receive(bus, frame, said_);
  arrive(bus, said_);
  return drivers::SendResult::sent;
}

bool World::is_of_mit(std::uint32_t id) const {
  return std::ranges::any_of(robot_.joints, [id](const config::Joint& joint) {
    return joint.drive.protocol == config::DriveProtocol::mit && joint.drive.id == id;
  });
}

bool World::plant_fault_in(drivers::CanFrame& frame) {
  const bool odrive_torque = !frame.extended && (frame.id & 0x1FU) == 0x0E && frame.length >= 4;
  const bool odrive_idle = !frame.extended && (frame.id & 0x1FU) == 0x07 && frame.data[0] == 1;
  const bool mit_disable =
      !frame.extended && frame.length == 8 && frame.data[0] == 0xFF && frame.data[6] == 0xFF && frame.data[7] == 0xFD;
  const bool mit_motion = !frame.extended && frame.length == 8 && frame.data[6] != 0xFF && is_of_mit(frame.id);
  float torque = 0;
  std::memcpy(&torque, frame.data, sizeof torque);
  switch (planted_) {
    case Planted::none:
    case Planted::refused:
    case Planted::keeps_torque:
    case Planted::no_stop:
    case Planted::stops_without_end:
    case Planted::degraded_without_end:
    case Planted::stiff_damping:
    case Planted::policy_in_any_stop:
    case Planted::led_when_lost:
    case Planted::fast_limits:
    case Planted::sudden_limits:
    case Planted::early_rest:
      return true;
    case Planted::old_frames:
      if (active(Happening::policy_silent) != nullptr && last_frames_.contains(frame.id))
        frame = last_frames_[frame.id];
      else
        last_frames_[frame.id] = frame;
      return true;
    case Planted::sign:
    case Planted::doubled_torque:
      torque *= planted_ == Planted::sign ? -1.0F : 2.0F;
      if (odrive_torque) std::memcpy(frame.data, &torque, sizeof torque);
      return true;
    case Planted::deaf_to_recorder:
      return true;
    case Planted::wide_frames:
      if (mit_motion) frame.data[0] = frame.data[1] = 0xFF;
      return true;
    case Planted::pushes_unheard:
      if (!odrive_idle || active(Happening::drive_silent) == nullptr) return true;
      frame.id += 0x0E - 0x07;
      frame.length = 8;
      torque = 0.2F;
      std::memcpy(frame.data, &torque, sizeof torque);
      return true;
    case Planted::swings_on:
      torque += static_cast<float>(0.5 * std::sin(12 * (now_ - kStart).seconds()));
      if (odrive_torque && record_.header.mode == Mode::damped_stop) std::memcpy(frame.data, &torque, sizeof torque);
      return true;
    case Planted::stays_enabled:
      return now_ < kStart + seconds(1) ||
             (!odrive_idle && !mit_disable);  // before, it is how drives are asked where they are
  }
  return true;
}

// --- policy and operator ---

bool World::obeys(std::size_t joint) const {
  if (active_ == 0) return true;
  return std::none_of(events_.begin(), events_.end(), [&](const Event& event) {
    if (!is_active(event)) return false;
    const bool of_bus = event.what == Happening::bus_off || event.what == Happening::bus_down ||
                        event.what == Happening::bus_refuses || event.what == Happening::frames_lost;
    const bool of_joint = event.what == Happening::drive_deaf || event.what == Happening::drive_restarts;
    return (of_bus && event.index == robot_.joints[joint].bus) || (of_joint && event.index == joint);
  });
}

bool World::is_well(std::size_t joint) const {
  if (active_ == 0) return true;
  return std::none_of(events_.begin(), events_.end(), [&](const Event& event) {
    const bool of_bus = is_of_bus(event.what) && event.index == robot_.joints[joint].bus;
    const bool of_drive = event.what >= Happening::drive_silent && event.what <= Happening::drive_hot;
    return is_active(event) && (of_bus || (of_drive && event.index == joint));
  });
}

bool World::has_usual_gains(std::size_t joint) const {
  return is_damped(joint) && !is_on(Happening::no_stiffness, joint) && !is_on(Happening::little_stiffness, joint);
}

bool World::is_damped(std::size_t joint) const {
  return !is_on(Happening::no_damping, joint) && !is_on(Happening::little_damping, joint);
}

void World::before_tick() {
  last_tick_at_ = now_;
  while (ticks_.read_next(std::as_writable_bytes(std::span(&record_, 1))).status == ipc::ReadStatus::fresh)
    if (on_tick) on_tick(record_);
  recorded_.set(is_recorded() || planted_ == Planted::deaf_to_recorder ? record_.header.tick : 0);
  let_policies_work();
  const MonoTime stopped =
      std::max(stop_asked_at_, power_off_asked_at_);  // who stops a robot does not press on at once
  if (now_ - asked_at_ < kAsksEvery || now_ - stopped < kAsksEvery) return;
  asked_at_ = now_;
  if (record_.header.mode == Mode::standby)
    requests_.arm();
  else
    requests_.reset();
}

void World::let_policies_work() {
  const bool observes =
      observations_.read_latest(std::as_writable_bytes(std::span(&observation_, 1))).status == ipc::ReadStatus::fresh;
  let_work(policy_, observes);
  if (pipeline::has_fallback_policy(config_)) let_work(fallback_, observes);
  if (candidate_) let_work(*candidate_, observes);
}

void World::let_work(Policy& policy, bool observes) {
  if (observes && active(policy.silence) == nullptr) answer(policy, observation_);
  for (; !policy.answers.empty() && policy.answers.front().due <= now_; policy.answers.pop_front()) {
    Answer& ready = policy.answers.front();
    ready.chunk->header.published_at = now_;
    policy.commands.publish(std::as_bytes(std::span(ready.chunk.get(), 1)).first(ready.bytes));
    policy.newest_answered = std::max(policy.newest_answered, ready.sensed);
    spare_chunks_.push_back(std::move(ready.chunk));
  }
}

float World::share(float usual, Happening none, Happening little, std::size_t joint) const {
  if (is_on(none, joint)) return 0;
  return is_on(little, joint) ? kLittle : usual;
}

void World::answer(Policy& policy, const Observation& observation) {
  const bool is_main = &policy == &policy_;
  const Event* const slow = is_main ? active(Happening::policy_slow) : nullptr;
  const Duration takes =
      kInference + (slow != nullptr ? std::min(Duration{slow->length.ns / 4}, milliseconds(200)) : Duration{});
  if (spare_chunks_.empty()) spare_chunks_.push_back(std::make_unique<CommandChunk>());
  std::unique_ptr<CommandChunk> chunk = std::move(spare_chunks_.back());
  spare_chunks_.pop_back();
  CommandHeader& header = chunk->header = {};
  header.observation_id = observation.id;
  header.sequence = ++policy.sequence;
  header.policy_hash = policy.hash;
  header.outside_sensed_at = observation.published_at;
  header.outside_sensed_at = header.dequeued_at = header.infer_started_at = now_;
  header.infer_ended_at = header.published_at = now_ + takes;
  header.step_period = kStepPeriod;
  header.step_count = kSteps;
  header.joint_count = static_cast<std::uint16_t>(observation.joint_count);
  header.fields = static_cast<std::uint8_t>(CommandField::q) | static_cast<std::uint8_t>(CommandField::kp) |
                  static_cast<std::uint8_t>(CommandField::kd);
  const bool nonsense =
      active(is_main ? Happening::policy_nonsense : Happening::candidate_nonsense) != nullptr && &policy != &fallback_;
  for (std::size_t step = 0; step < kSteps; ++step) {
    const double at = (observation.published_at - kStart + kStepPeriod * static_cast<std::int64_t>(step)).seconds();
    for (std::size_t j = 0; j < header.joint_count; ++j) {
      const config::Joint& joint = robot_.joints[j];
      const double far = is_on(Happening::asks_far, j) ? 0.8 : 0.0;
      const double q = joint.home + far + 0.4 * std::sin(3.0 * at + static_cast<double>(j));
      chunk->values[value_index(header, CommandField::q, step, j)] =
          nonsense ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(q);
      chunk->values[value_index(header, CommandField::kp, step, j)] =
          share(kPolicyKp, Happening::no_stiffness, Happening::little_stiffness, j) * config_.joints[j].kp;
      chunk->values[value_index(header, CommandField::kd, step, j)] =
          share(policy.kd, Happening::no_damping, Happening::little_damping, j) * config_.joints[j].kd;
    }
  }
  policy.answers.push_back({now_ + takes, chunk->used_bytes(), std::move(chunk), observation.oldest_sensed_at});
}

}  // namespace takt::exploration
