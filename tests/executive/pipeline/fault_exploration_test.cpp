// SPDX-License-Identifier: Apache-2.0
// Goal: under any schedule of faults the promises of the design hold. Method: thousands of seeded schedules in virtual
// time mix a policy that dies, freezes, sends NaN, wrong shapes, old, future and repeated messages or random bytes,
// with silent and faulty drives, bus-off, lossy, repeating, delaying, babbling and foreign-ridden buses, late ticks,
// shoves and operator requests; every tick is judged by checks that
// keep their own books (when each observation was sensed, when a command was last usable) and share no code with the
// tick.
//
// A failing seed prints one command that reproduces it. TAKT_SEED runs one seed; TAKT_SEEDS sets how many (default
// 300).
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <optional>
#include <random>
#include <span>
#include <string>

#include "executive/pipeline/freshness.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::chunk_for;
using testing::Rig;
using testing::robot;

template <class Value>
bool same_bits(const Value& a, const Value& b) {
  return std::ranges::equal(std::as_bytes(std::span(&a, 1)), std::as_bytes(std::span(&b, 1)));
}

enum class Policy : std::uint8_t {
  good,
  dead,
  not_a_number,
  wild_values,
  wrong_shape,
  old_observation,
  future_observation,
  repeated,
  future_stamps,
  old_sensor,
  random_bytes,
  corrupt,
  another_policy,
};
constexpr unsigned kPolicyCount = 13;

// What a bus does to replies and counters while it lasts, each well over its limit.
enum class Trouble : std::uint8_t { none, lost, repeated, delayed, tx, rx, foreign, babble, passive };
constexpr unsigned kTroubleCount = 9;
constexpr int kTroubleIsFoundWithin = 1100;  // ticks

class Schedule {
 public:
  explicit Schedule(std::uint32_t seed)
      : random_(seed), bus_random_(~seed), rig_(configure(seed)), chunk_(std::make_unique<CommandChunk>()) {}

  // One tick of the schedule.
  void tick() {
    if (chance(300)) policy_ = !chance(3) ? Policy::good : static_cast<Policy>(random_() % kPolicyCount);
    disturb();
    trouble_the_bus();
    const std::optional<std::size_t> bytes = message();
    const Arrival mailbox = policy_ == Policy::corrupt && chance(20) ? Arrival::corrupt : Arrival::accepted;
    rig_.tick(bytes ? chunk_.get() : nullptr, request(), mailbox, bytes.value_or(0));
  }
  [[nodiscard]] const Rig& rig() const { return rig_; }
  // Ticks that the present trouble has lasted without a break.
  [[nodiscard]] int troubled_for() const { return troubled_for_; }

 private:
  static TickConfig configure(std::uint32_t seed) {
    TickConfig config = robot(1 + seed % 8);
    config.gravity_compensation = seed % 3 == 0;
    config.degraded = static_cast<DegradedBehaviour>(seed / 3 % 3);
    config.policy.hash = 5;
    config.interpolation = static_cast<Interpolation>(seed / 9 % 3);
    return config;
  }
  bool chance(std::uint32_t one_in) { return random_() % one_in == 0; }
  float spread(float width) { return std::uniform_real_distribution<float>(-width, width)(random_); }

  void disturb() {
    Rig::Drive& drive = rig_.drives[random_() % rig_.config.joint_count];
    const bool quiet = !chance(4);  // most ticks pass without a new disturbance
    if (quiet) return;
    if (chance(1500)) drive.silent = true;
    if (chance(100)) drive.silent = false;
    if (chance(3000)) drive.fault = true;
    if (chance(100)) drive.fault = false;
    if (chance(3000)) drive.drops_out = true;
    if (chance(100)) drive.drops_out = false;
    if (chance(3000)) rig_.input.buses[0].state = BusState::bus_off;
    if (chance(50)) rig_.input.buses[0].state = BusState::up;
    if (chance(400)) drive.dq += spread(3.0F);
    if (chance(5000)) drive.q += spread(2.0F);
    if (chance(5000)) rig_.input.joints[0].q = NAN;
    rig_.input.lateness = chance(300) ? milliseconds(5) : microseconds(40);
  }

  // From a generator of its own, so that the rest of a schedule does not depend on it.
  void trouble_the_bus() {
    if (bus_random_() % (trouble_ == Trouble::none ? 3000 : 900) == 0) {
      trouble_ = trouble_ == Trouble::none ? static_cast<Trouble>(bus_random_() % kTroubleCount) : Trouble::none;
      troubled_for_ = 0;
    }
    BusHealth& bus = rig_.input.buses[0];
    bus.flooded = trouble_ == Trouble::babble ? 1 : 0;
    if (bus.state == BusState::error_passive) bus.state = BusState::up;
    const bool is_hidden = trouble_ == Trouble::passive && bus.state != BusState::up;  // by one that is off or down
    troubled_for_ = trouble_ == Trouble::none || rig_.drives[0].silent || is_hidden ? 0 : troubled_for_ + 1;
    if (troubled_for_ == 0) return;
    std::uint8_t& replies = rig_.input.joints[0].replies;  // the rig adds one
    const auto add = [&replies](int count) { replies = static_cast<std::uint8_t>(replies + count); };
    switch (trouble_) {
      case Trouble::none:
      case Trouble::babble:
        return;
      case Trouble::lost:
        return add(troubled_for_ % 10 == 0 ? 0 : -1);
      case Trouble::repeated:
        return add(1);
      case Trouble::delayed:
        return add(troubled_for_ % 18 == 0 ? 17 : -1);
      case Trouble::tx:
        ++bus.tx_dropped;
        return;
      case Trouble::rx:
        ++bus.rx_dropped;
        return;
      case Trouble::foreign:
        ++bus.foreign_frames;
        return;
      case Trouble::passive:
        if (bus.state == BusState::up) bus.state = BusState::error_passive;
        return;
    }
  }

  OperatorRequest request() {
    if (chance(40)) return OperatorRequest::arm;
    if (chance(60)) return OperatorRequest::reset;
    return chance(3000) ? OperatorRequest::stop : OperatorRequest::none;
  }

  std::optional<std::size_t> message() {
    const std::uint64_t newest = rig_.newest_observation;
    if (newest == 0 || policy_ == Policy::dead || !chance(20)) return std::nullopt;
    const std::uint64_t lag = policy_ == Policy::old_observation ? 3 + random_() % 80 : 0;
    const std::uint64_t id = newest > lag ? newest - lag : newest;
    const auto& published = rig_.published_at.at(id);
    const auto steps = static_cast<std::uint16_t>(chance(8) ? 1 + random_() % 16 : 16);
    *chunk_ = chunk_for(rig_.config, id, published, rig_.now, ++rig_.sequence, spread(1.6F), steps);
    spoil();
    return bytes_;
  }

  void spoil() {
    CommandHeader& header = chunk_->header;
    if (chance(2)) header.fields = static_cast<std::uint8_t>(1U | (random_() & 31U));
    const auto dq = static_cast<unsigned>(CommandField::dq);
    if (rig_.config.interpolation == Interpolation::cubic)
      header.fields = static_cast<std::uint8_t>(header.fields | dq);
    if (rig_.config.interpolation == Interpolation::linear)
      header.fields = static_cast<std::uint8_t>(header.fields & ~dq);
    bytes_ = chunk_->used_bytes();
    switch (policy_) {
      case Policy::good:
      case Policy::dead:
      case Policy::old_observation:
      case Policy::corrupt:
        break;
      case Policy::not_a_number:
        chunk_->values[random_() % chunk_->value_count()] = chance(2) ? NAN : INFINITY;
        break;
      case Policy::wild_values:
        for (std::size_t i = 0; i < chunk_->value_count(); ++i) chunk_->values[i] = spread(chance(2) ? 3.0F : 1e30F);
        break;
      case Policy::wrong_shape:
        header.joint_count = static_cast<std::uint16_t>(header.joint_count + 1);
        break;
      case Policy::future_observation:
        header.observation_id += 1 + random_() % 5;
        break;
      case Policy::repeated:
        header.sequence = --rig_.sequence;
        break;
      case Policy::future_stamps:
        header.infer_ended_at = rig_.now + seconds(1);
        break;
      case Policy::old_sensor:
        header.outside_sensed_at = rig_.now - milliseconds(static_cast<std::int64_t>(random_() % 200));
        break;
      case Policy::another_policy:
        header.policy_hash = 6;
        break;
      case Policy::random_bytes:
        scramble();
        break;
    }
  }

  // Random bytes over the whole segment; half of them behind a header that passes the first checks.
  void scramble() {
    const CommandHeader sound = chunk_->header;
    auto* words = reinterpret_cast<std::uint32_t*>(chunk_.get());
    for (std::size_t i = 0; i < sizeof(CommandChunk) / 4; ++i) words[i] = static_cast<std::uint32_t>(random_());
    if (chance(2)) {
      chunk_->header = sound;
    } else {
      bytes_ = random_() % (sizeof(CommandChunk) + 1);
    }
  }

  std::mt19937 random_;
  std::mt19937 bus_random_;
  Trouble trouble_ = Trouble::none;
  int troubled_for_ = 0;
  Rig rig_;
  std::unique_ptr<CommandChunk> chunk_;
  std::size_t bytes_ = 0;
  Policy policy_ = Policy::good;
};

bool is_armed(Mode mode) {
  return mode == Mode::tracking || mode == Mode::degraded;
}

// The promises, one function each, on the test's own books.
class Judge {
 public:
  explicit Judge(const Rig& rig) : rig_(rig), config_(rig.config) {}

  // nullptr, or what was broken.
  const char* broken() {
    const char* what = nullptr;
    for (const auto check :
         {&Judge::age, &Judge::stale_is_never_followed, &Judge::envelope, &Judge::reference, &Judge::slew,
          &Judge::unheard, &Judge::bounded_stop, &Judge::recorded, &Judge::window, &Judge::latches})
      if (what == nullptr) what = (this->*check)();
    remember();
    return what;
  }

 private:
  [[nodiscard]] const TickRecord& record() const { return rig_.out->record; }
  [[nodiscard]] const TickRecordHeader& header() const { return rig_.out->record.header; }
  [[nodiscard]] bool usable() const {
    return header().seats[Seat::policy].freshness == Freshness::fresh ||
           header().seats[Seat::policy].freshness == Freshness::aging;
  }

  // The parts add up to an age that is no younger than what the robot knows.
  const char* age() {
    if (header().seats[Seat::policy].freshness == Freshness::missing) {
      return header().age.total().ns == 0 ? nullptr : "age while missing";
    }
    const MonoTime sensed = rig_.sensed_at.at(header().seats[Seat::policy].observation_answered);
    true_age_ = header().now - sensed;
    if (header().age.total() < true_age_) return "a command claims to be younger than its observation";
    if (usable() && true_age_ > config_.freshness.max_age) return "a command older than max_age counts as usable";
    return nullptr;
  }

  // Unless usable, the reference may only brake (hold), go to the fallback, or follow the measured motion.
  const char* stale_is_never_followed() {
    if (usable() || !is_armed(header().mode)) return nullptr;
    if (rig_.out->valid_until.is_set() || header().chunk_step != 0) return "an unusable command is being played";
    const bool fallback = header().mode == Mode::degraded && config_.degraded == DegradedBehaviour::fallback;
    if (fallback || !is_armed(last_mode_)) return nullptr;
    for (std::size_t j = 0; j < config_.joint_count; ++j) {
      const float before = std::abs(last_.joints[j].dq_reference);
      const float change = config_.joints[j].limits.acceleration * 0.001F;
      // A joint that runs away from its reference carries it along, no faster than it moves itself.
      const float carried = std::abs(record().joints[j].dq_estimate);
      if (std::abs(record().joints[j].dq_reference) > std::max({before - change, carried, 0.0F}) + 1e-5F)
        return "the reference does not brake while the command is unusable";
    }
    return nullptr;
  }

  const char* envelope() {
    for (std::size_t j = 0; j < config_.joint_count; ++j) {
      const JointSetpoint& s = rig_.out->setpoints[j];
      const JointLimits& limits = config_.joints[j].limits;
      const JointRecord& joint = record().joints[j];
      const float torque = s.kp * (s.q - joint.q_estimate) + s.kd * (s.dq - joint.dq_estimate) + s.tau;
      if (!std::isfinite(s.q + s.dq + s.kp + s.kd + s.tau)) return "a setpoint is not finite";
      if (s.q < limits.q_min - limits.q_hard_margin || s.q > limits.q_max + limits.q_hard_margin)
        return "a position leaves the hard margin";
      const bool outside = s.q < limits.q_min || s.q > limits.q_max;
      if (outside && is_armed(header().mode) && is_armed(last_mode_) &&
          std::abs(s.q) > std::abs(last_.joints[j].q_command))
        return "a position leaves its limits";
      if (std::abs(s.dq) > limits.velocity) return "a velocity leaves its limits";
      if (s.kp < 0 || s.kp > limits.kp_max || s.kd < 0 || s.kd > limits.kd_max) return "a gain leaves its limits";
      if (std::abs(s.tau) > limits.torque || std::abs(torque) > 1.001F * limits.torque) return "a torque is too big";
      if ((joint.interventions & bit(Intervention::envelope_clamp)) != 0) return "the last clamp had to act";
    }
    return nullptr;
  }

  // Stiffness grows at a joint that is too fast to come to rest inside its limits, or is outside them: the reference
  // goes on as fast as one could that comes to rest there, between the joint's own speed and none.
  bool grows_stiff_before_a_limit(std::size_t j) {
    const JointLimits& limits = config_.joints[j].limits;
    const JointRecord& joint = record().joints[j];
    const float speed = joint.dq_estimate, step = limits.acceleration * 0.001F;
    const float room = speed < 0 ? joint.q_estimate - limits.q_min : limits.q_max - joint.q_estimate;
    return joint.kp_command > last_.joints[j].kp_command &&
           speed * speed > 2 * limits.acceleration * std::max(room, 0.0F) &&
           joint.dq_reference >= std::min(speed, 0.0F) - step && joint.dq_reference <= std::max(speed, 0.0F) + step;
  }

  const char* reference() {
    if (!is_armed(header().mode) || !is_armed(last_mode_)) return nullptr;
    for (std::size_t j = 0; j < config_.joint_count; ++j) {
      const JointLimits& limits = config_.joints[j].limits;
      const float change = record().joints[j].dq_reference - last_.joints[j].dq_reference;
      // Towards the joint's own motion it may jump: that asks less of the joint, not more.
      const float measured = record().joints[j].dq_estimate;
      const float step = limits.acceleration * 0.001F * 1.001F;
      const bool nears = std::abs(record().joints[j].dq_reference - measured) <=
                         std::abs(last_.joints[j].dq_reference - measured) + step;
      // A held target has no velocity, and no path leads to it; without stiffness a reference pulls nothing.
      const bool is_held = plays_held_targets(config_, config_.joints[j]) && record().joints[j].dq_reference == 0.0F;
      const bool pulls = record().joints[j].kp_command > 0.0F && !is_held;
      if (pulls && std::abs(change) > step && !nears && !grows_stiff_before_a_limit(j))
        return "a reference accelerates too hard";
      if (std::abs(record().joints[j].dq_reference) > limits.velocity) return "a reference is too fast";
    }
    return nullptr;
  }

  const char* slew() {
    if (!rig_.out->drives_enabled || !last_enabled_) return nullptr;
    for (std::size_t j = 0; j < config_.joint_count; ++j) {
      if (!rig_.out->drive_enabled[j]) continue;  // power is taken away at once
      const JointLimits& limits = config_.joints[j].limits;
      const bool made_torque = last_.joints[j].feedback.drive_state == DriveState::enabled;
      const float change = record().joints[j].tau_total - (made_torque ? last_.joints[j].tau_total : 0.0F);
      if (std::abs(change) > limits.torque_rate * 0.001F + 2e-3F * limits.torque) return "torque slews too fast";
    }
    return nullptr;
  }

  // A joint that is not heard gets no power and no setpoint that pushes, from the tick on that knows.
  const char* unheard() {
    for (std::size_t j = 0; j < config_.joint_count; ++j) {
      const MonoTime heard = record().joints[j].feedback.received_at;
      if (heard.is_set() && header().now - heard <= config_.feedback_timeout) continue;
      const JointSetpoint& s = rig_.out->setpoints[j];
      if (rig_.out->drive_enabled[j]) return "a drive that is not heard stays enabled";
      if (s.kp != 0 || s.kd != 0 || s.tau != 0 || s.dq != 0) return "a joint that is not heard is pushed";
    }
    return nullptr;
  }

  const char* bounded_stop() {
    if (usable() || !(is_armed(header().mode) || header().mode == Mode::arming)) {
      last_usable_ = header().now;
      return nullptr;
    }
    return header().now - last_usable_ >= config_.freshness.stop_after + config_.period
               ? "still armed long after the last usable command"
               : nullptr;
  }

  const char* recorded() {
    for (std::size_t j = 0; j < config_.joint_count; ++j) {
      const JointRecord& joint = record().joints[j];
      const JointSetpoint written{joint.q_command, joint.dq_command, joint.kp_command, joint.kd_command,
                                  joint.tau_command};
      if (!same_bits(written, rig_.out->setpoints[j])) return "the record differs from the setpoint";
      if ((joint.drive_enabled != 0) != rig_.out->drive_enabled[j]) return "enabling is recorded wrongly";
      if (!same_bits(joint.feedback, rig_.input.joints[j])) return "feedback is recorded wrongly";
    }
    if (header().tick != rig_.input.tick || header().now != rig_.now) return "the tick is recorded wrongly";
    if ((header().drives_enabled != 0) != rig_.out->drives_enabled) return "enabling is recorded wrongly";
    if (header().previous_mode != last_mode_) return "a transition went unrecorded";
    if ((header().mode != header().previous_mode) != (header().cause != Cause::none))
      return "a transition without a cause";
    return nullptr;
  }

  // A plain list of the ticks that counted.
  const char* window() {
    if (is_armed(header().previous_mode)) misses_.push_back(!usable());
    if (misses_.size() > config_.freshness.window_ticks) misses_.pop_front();
    if (header().mode == Mode::tracking && header().previous_mode != Mode::tracking) misses_.clear();
    const auto count = static_cast<std::uint32_t>(std::count(misses_.begin(), misses_.end(), true));
    if (count != header().window_misses) return "the window miscounts";
    if (header().mode != Mode::tracking) return nullptr;
    const double bound = config_.freshness.epsilon * config_.freshness.window_ticks;
    const auto silence = std::find(misses_.rbegin(), misses_.rend(), false) - misses_.rbegin();
    if (static_cast<double>(silence) > bound) return "tracking on in spite of a silence";
    return most_beyond_epsilon() > std::max(bound, kEvidence * static_cast<double>(longest_silence())) + 0.1
               ? "tracking on in spite of the contract"
               : nullptr;
  }

  // Misses beyond epsilon of any stretch that ends now.
  [[nodiscard]] double most_beyond_epsilon() const {
    double sum = 0, most = 0;
    for (auto one = misses_.rbegin(); one != misses_.rend(); ++one) {
      sum += (*one ? 1 : 0) - config_.freshness.epsilon;
      most = std::max(most, sum);
    }
    return most;
  }
  [[nodiscard]] std::uint32_t longest_silence() const {
    std::uint32_t longest = 0, now = 0;
    for (const bool miss : misses_) longest = std::max(longest, now = miss ? now + 1 : 0);
    return longest;
  }

  const char* latches() {
    const bool was_latched = last_mode_ == Mode::damped_stop || last_mode_ == Mode::fault_latched;
    const bool is_latched = header().mode == Mode::damped_stop || header().mode == Mode::fault_latched;
    if (was_latched && !is_latched && rig_.input.operator_request != OperatorRequest::reset)
      return "a latch let go by itself";
    if (last_mode_ == Mode::standby && header().mode != Mode::standby &&
        rig_.input.operator_request != OperatorRequest::arm)
      return "armed without being asked";
    return nullptr;
  }

  void remember() {
    last_ = record();
    last_mode_ = header().mode;
    last_enabled_ = rig_.out->drives_enabled;
  }

  const Rig& rig_;
  const TickConfig& config_;
  TickRecord last_;
  Mode last_mode_ = Mode::standby;
  bool last_enabled_ = false;
  MonoTime last_usable_{1'000'000'000};
  Duration true_age_;
  std::deque<bool> misses_;
};

struct Coverage {
  std::uint64_t ticks = 0, tracked = 0;
  std::uint64_t arrivals[kArrivalCount] = {};
  std::uint64_t causes[kCauseCount] = {};
};

// Returns false when a promise was broken.
bool explore(std::uint32_t seed, int ticks, Coverage& seen) {
  Schedule schedule(seed);
  Judge judge(schedule.rig());
  for (int i = 0; i < ticks; ++i) {
    schedule.tick();
    const TickRecordHeader& header = schedule.rig().header();
    ++seen.ticks;
    seen.tracked += header.mode == Mode::tracking ? 1U : 0U;
    ++seen.arrivals[static_cast<std::size_t>(header.seats[Seat::policy].arrival)];
    ++seen.causes[static_cast<std::size_t>(header.cause)];
    const char* what = judge.broken();
    if (what == nullptr && schedule.troubled_for() > kTroubleIsFoundWithin && is_armed(header.mode))
      what = "armed in spite of a bus fault";
    if (what != nullptr) {
      ADD_FAILURE() << what << " at tick " << i << " (" << name(header.mode) << ") of seed " << seed
                    << "\n  reproduce: TAKT_SEED=" << seed << " build/release/bin/fault_exploration_test";
      return false;
    }
  }
  return true;
}

std::uint32_t from_environment(const char* variable, std::uint32_t otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : static_cast<std::uint32_t>(std::strtoul(text, nullptr, 10));
}

TEST(FaultExploration, EveryPromiseHoldsUnderEverySchedule) {
  constexpr int kTicks = 4000;
  Coverage seen;
  if (std::getenv("TAKT_SEED") != nullptr) {
    explore(from_environment("TAKT_SEED", 0), kTicks, seen);
    return;
  }
  const std::uint32_t seeds = from_environment("TAKT_SEEDS", 300);
  for (std::uint32_t seed = 1; seed <= seeds; ++seed)
    if (!explore(seed, kTicks, seen)) break;
  if (HasFailure() || seeds < 100) return;
  // The schedules must have reached what they are for.
  EXPECT_GT(seen.tracked * 10, seen.ticks) << "the robot hardly ever tracked";
  for (const Arrival arrival :
       {Arrival::accepted, Arrival::corrupt, Arrival::wrong_shape, Arrival::wrong_policy, Arrival::repeated_sequence,
        Arrival::expired_observation, Arrival::future_observation, Arrival::not_finite, Arrival::out_of_range})
    EXPECT_GT(seen.arrivals[static_cast<std::size_t>(arrival)], 0U) << name(arrival) << " never happened";
  for (const Cause cause :
       {Cause::operator_arm,      Cause::operator_stop,       Cause::operator_reset,   Cause::drives_enabled,
        Cause::command_late,      Cause::contract_restored,   Cause::command_lost,     Cause::feedback_lost,
        Cause::drive_fault,       Cause::drive_disabled,      Cause::bus_off,          Cause::envelope_exceeded,
        Cause::bus_error_passive, Cause::transmit_queue_full, Cause::receive_overflow, Cause::replies_lost,
        Cause::replies_repeated,  Cause::replies_delayed,     Cause::foreign_node,     Cause::bus_babble})
    EXPECT_GT(seen.causes[static_cast<std::size_t>(cause)], 0U) << name(cause) << " never happened";
}

}  // namespace
}  // namespace takt::pipeline
