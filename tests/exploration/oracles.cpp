// SPDX-License-Identifier: Apache-2.0
#include "tests/exploration/oracles.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "executive/pipeline/mode_machine.hpp"

namespace takt::exploration {
namespace {

constexpr Duration kSettles = seconds(1);  // after something was wrong, or moved the joint
constexpr double kRestSpeed = 0.1;         // rad/s: a joint that is slower rests
// rad/s: of a joint that is braked stiffly at the host, which swings back; the most of 2,000 schedules is 0.65.
constexpr double kOvershoot = 0.7;
// Of its speed when it was released: damping that is made at the host follows a velocity that is some 10 ms old, and
// swings a light joint back by so much.
constexpr double kSwingsBack = 0.45;
constexpr double kQuantum = 0.01;  // share of a range: more than any field's last bit

double unpacked(unsigned raw, unsigned bits, double low, double high) {
  return low + (high - low) * raw / ((1U << bits) - 1U);
}

bool is_special(const drivers::CanFrame& frame) {
  return std::all_of(frame.data, frame.data + 7, [](std::uint8_t byte) { return byte == 0xFF; });
}

}  // namespace

Oracles::Oracles(World& world) : world_(world), joints_(world.robot().joints.size()), book_(world.robot()) {
  world.on_frame = [this](const World::Sent& sent) { frame(sent); };
  world.on_tick = [this](const TickRecord& record) { tick(record); };
  world.on_step = [this] { step(); };
}

void Oracles::breaks(const char* oracle, std::size_t joint, const std::string& how) {
  if (!broken_.empty()) return;
  broken_ = fmt::format("{}: {} at {:.4f} s, {}, {}", oracle, world_.robot().joints[joint].name,
                        (world_.now() - kStart).seconds(), name(mode_), how);
}

void Oracles::frame(const World::Sent& sent) {
  last_frame_at_ = sent.at;
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const config::Joint& joint = world_.robot().joints[j];
    if (joint.bus != sent.bus) continue;
    if (joint.drive.protocol == config::DriveProtocol::mit && !sent.frame.extended && sent.frame.id == joint.drive.id)
      mit_frame(j, sent);
    if (joint.drive.protocol == config::DriveProtocol::odrive && !sent.frame.extended &&
        sent.frame.id >> 5U == joint.drive.id)
      odrive_frame(j, sent);
  }
}

// position 16 bits, velocity 12, kp 12, kd 12, torque 12, most significant first
void Oracles::mit_frame(std::size_t j, const World::Sent& sent) {
  if (is_special(sent.frame) || sent.frame.length != 8) return;
  const config::Joint& joint = world_.robot().joints[j];
  const config::Drive& drive = joint.drive;
  const std::uint8_t* const d = sent.frame.data;
  const Asked asked{
      unpacked(static_cast<unsigned>(d[0] << 8 | d[1]), 16, -drive.position_range, drive.position_range),
      unpacked(static_cast<unsigned>(d[2] << 4 | d[3] >> 4), 12, -drive.velocity_range, drive.velocity_range),
      unpacked(static_cast<unsigned>((d[3] & 15) << 8 | d[4]), 12, 0, 500),
      unpacked(static_cast<unsigned>(d[5] << 4 | d[6] >> 4), 12, 0, 5),
      unpacked(static_cast<unsigned>((d[6] & 15) << 8 | d[7]), 12, -drive.torque_range, drive.torque_range)};
  const config::Limits& limits = joint.limits;
  const bool inside = asked.q > limits.q_min - limits.position_margin - 0.01 &&
                      asked.q < limits.q_max + limits.position_margin + 0.01 &&
                      std::abs(asked.dq) < limits.velocity + kQuantum * drive.velocity_range &&
                      asked.kp < limits.kp + kQuantum * 500 && asked.kd < limits.kd + kQuantum * 5 &&
                      std::abs(asked.tau) < limits.torque + kQuantum * drive.torque_range;
  if (!inside)
    breaks("frame_limits", j,
           fmt::format("q {} dq {} kp {} kd {} tau {}", asked.q, asked.dq, asked.kp, asked.kd, asked.tau));
  joints_[j].stiff |= asked.kp > kQuantum * 500;
  const auto has_gains = [&](float kd) {
    const double ratio = kPolicyKp * joint.kp / (kd * joint.kd);
    return asked.kp > 10 && asked.kd > 0.1 && std::abs(asked.kp / asked.kd / ratio - 1) < 0.08;
  };
  // A join may mix the gains of two chunks, and these may be any then.
  const MonoTime unusual = joints_[j].unusual_gains_at;
  if (unusual.is_set() && sent.at - unusual < kSettles) return;
  const Player sender = has_gains(kPolicyKd)      ? Player::policy
                        : has_gains(kFallbackKd)  ? Player::fallback
                        : has_gains(kCandidateKd) ? Player::candidate
                                                  : Player::none;
  if (sender == Player::none) return;
  seen_player_ = sender == Player::candidate ? Player::policy : sender;  // a candidate that plays is the policy
  const MonoTime answered = world_.newest_answered(sender);
  const Duration age = sent.at - answered;
  if (!answered.is_set() || age > world_.robot().freshness.max_age + microseconds(5))
    breaks("command_age", j,
           fmt::format("{}'s, written {:.1f} ms after the oldest sample", name(sender), age.milliseconds()));
}

// message 0x0E: torque, float32 little endian, Nm at the motor
void Oracles::odrive_frame(std::size_t j, const World::Sent& sent) {
  if ((sent.frame.id & 0x1FU) != 0x0E || sent.frame.length < 4) return;
  const config::Joint& joint = world_.robot().joints[j];
  float torque = 0;
  std::memcpy(&torque, sent.frame.data, 4);
  const double tau = static_cast<double>(torque) * joint.drive.gear_ratio;
  Watched& watched = joints_[j];
  if (!(std::abs(tau) < joint.limits.torque * 1.01)) breaks("frame_limits", j, fmt::format("torque {} Nm", tau));
  // What did not get out on a dead bus was slewed all the same; a period that was not worked in grants nothing.
  const auto ticks = static_cast<double>(std::max<std::uint64_t>(ticks_ - watched.last_torque_tick, 1));
  const double most = joint.limits.torque_rate * world_.robot().control.period.seconds() * ticks * 1.02 + 0.02;
  if (watched.torque_known && tau != 0 && std::abs(tau - watched.last_torque) > most)
    breaks("torque_slew", j, fmt::format("{} Nm after {} Nm", tau, watched.last_torque));
  watched.last_torque = tau;
  watched.last_torque_tick = ticks_;
  watched.torque_known = true;
}

void Oracles::watch_unheard(std::size_t j, double speed) {
  Watched& watched = joints_[j];
  const MonoTime since = world_.unheard_since(j);
  const bool executive_stands = world_.now() - last_frame_at_ > world_.robot().control.period * 2;
  const Duration patience = world_.robot().feedback.timeout + milliseconds(8);
  const auto is_new = [&](MonoTime at) { return at.is_set() && world_.now() - at < milliseconds(2); };
  const bool moved = is_new(world_.shoved_at(j)) || is_new(world_.handled_at(j));
  if (!since.is_set() || executive_stands || moved || world_.now() - since < patience) {
    watched.allowed_speed = -1;
  } else if (watched.allowed_speed < 0) {
    watched.allowed_speed = speed;
  } else if (speed > watched.allowed_speed + 0.1) {
    breaks("no_push", j, fmt::format("{:.2f} rad/s, {:.2f} when it was given up", speed, watched.allowed_speed));
  } else {
    watched.allowed_speed = std::min(watched.allowed_speed, speed);
  }
}

// True motion a few times as fast as what the executive calls rest: its estimates have noise.
void Oracles::watch_rest(std::size_t j, double speed) {
  constexpr double kCalm = 0.2;  // rad/s
  Watched& watched = joints_[j];
  if (speed > kCalm)
    watched.calm_since = {};
  else if (!watched.calm_since.is_set())
    watched.calm_since = world_.now();
  if (watched.calm_since.is_set() && world_.now() - watched.calm_since > milliseconds(60))
    watched.rested_at = world_.now();
}

void Oracles::watch_stop(const TickRecordHeader& header) {
  book_.tick(header);
  if (!book_.broken().empty() && broken_.empty())
    broken_ = fmt::format("{} at {:.4f} s", book_.broken(), (header.now - kStart).seconds());
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    Watched& watched = joints_[j];
    const bool stiff = std::exchange(watched.stiff, false);
    if (header.mode != Mode::damped_stop || !stiff || book_.may_be_stiff()) continue;
    const bool never = book_.way() == config::StopHow::damping;
    if (never || watched.rested_at < book_.rest_counts_from() + milliseconds(60))
      breaks("stop_ends", j, never ? "it is stiff in a stop by damping" : "it is stiff and did not rest in the stop");
  }
  if (header.mode == Mode::damped_stop && header.player == Player::fallback) damped_since_ = header.now;
}

void Oracles::watch_motion(std::size_t j, double velocity) {
  const config::Limits& limits = world_.robot().joints[j].limits;
  const MonoTime now = world_.now();
  Watched& watched = joints_[j];
  const double speed = std::abs(velocity);
  const bool lies = lies_now();  // of any: its drive may lose its power, and what hangs on it sags
  const bool is_shoved = world_.shoved_at(j) >= now - milliseconds(2);
  if (!world_.is_well(j) || !world_.is_prompt() || lies || is_shoved) watched.ill_at = now;
  if (world_.handled_at(j) >= now - milliseconds(2)) watched.touched_at = now;
  if (!world_.is_damped(j)) watched.undamped_at = now;
  if (!world_.has_usual_gains(j)) watched.unusual_gains_at = now;
  if (world_.plant().drive(j).state() == simulation::DeviceState::enabled) watched.powered_at = now;
  if (speed <= kRestSpeed) watched.moving_since = {};
  if (speed > kRestSpeed && !watched.moving_since.is_set()) watched.moving_since = now;
  double& then_slot = watched.speeds.at(steps_ % watched.speeds.size());
  const double then = std::exchange(then_slot, velocity);

  const bool is_ill = watched.ill_at.is_set() && now - watched.ill_at < kSettles;
  const bool is_touched = watched.touched_at == now;
  const bool was_touched = watched.touched_at.is_set() && now - watched.touched_at < kSettles;
  // A policy may leave damping out: then it swings as that policy wants.
  const bool swings = player_ != Player::none && watched.undamped_at.is_set() && now - watched.undamped_at < kSettles;
  if (swings) watched.swung_at = now;
  const bool is_let_go = !kPlayedJointsYieldToHands && was_touched && player_ != Player::none;
  const double over_s = world_.plant().step_length().seconds() * static_cast<double>(watched.speeds.size());
  // A swing that a stop cut off: its torque falls at the slew limit, and what is compared reaches back into it.
  const bool swung = watched.swung_at.is_set() && (now - watched.swung_at).seconds() < over_s;
  watched.carried = is_ill || is_touched || is_let_go || swung ? speed : std::min(watched.carried, speed);
  // A joint on a policy's half damping overshoots the speed of its reference, and a hand's spring adds to it.
  if (player_ != Player::none) watched.played_at = now;
  const bool is_played = watched.played_at.is_set() && now - watched.played_at < milliseconds(200);
  if (speed > std::max((is_played ? 1.3 : 1.1) * limits.velocity, watched.carried + 0.2))
    breaks("too_fast", j, fmt::format("{:.2f} rad/s", speed));
  const double gained = speed - (velocity * then > 0 ? std::abs(then) : 0.0);
  if (!is_ill && !was_touched && !swung && gained > 2 * limits.acceleration * over_s + 0.25)
    breaks("too_sudden", j, fmt::format("{:.2f} rad/s after {:.2f}, {:.0f} ms before", velocity, then, 1000 * over_s));
  const bool is_led = player_ != Player::none ||
                      (mode_ == Mode::degraded && world_.robot().degraded.behaviour == config::Degraded::fallback);
  if (is_led || is_ill || was_touched || mode_ == Mode::tracking) {
    watched.led = -1;
  } else if (watched.led < 0) {
    watched.let_go = speed;
    watched.led = speed + kOvershoot;
  } else if (speed > watched.led) {
    breaks("thrown", j, fmt::format("{:.2f} rad/s, {:.2f} when nobody played any more", speed, watched.let_go));
  } else {
    watched.led = std::min(watched.led, speed + std::max(kOvershoot, kSwingsBack * watched.let_go));
  }
}

void Oracles::watch_reset(const TickRecordHeader& header) {
  if (header.cause != Cause::operator_reset) return;
  const MonoTime now = world_.now();
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const Watched& watched = joints_[j];
    const bool is_ill = watched.ill_at.is_set() && now - watched.ill_at < milliseconds(100);
    const bool was_powered = watched.powered_at.is_set() && now - watched.powered_at < milliseconds(5);
    const bool moves = watched.moving_since.is_set() && now - watched.moving_since > milliseconds(20);
    if (!is_ill && was_powered && moves) breaks("reset_rests", j, "it moves, and its power is taken");
  }
}

void Oracles::step() {
  const simulation::ArmState& state = world_.plant().state();
  ++steps_;
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const double speed = std::abs(state.dq[static_cast<Eigen::Index>(j)]);
    watch_motion(j, state.dq[static_cast<Eigen::Index>(j)]);
    watch_unheard(j, speed);
    watch_rest(j, speed);
    if (!world_.obeys(j) || !world_.is_prompt() || world_.unheard_since(j).is_set() ||
        world_.shoved_at(j) >= world_.now() - milliseconds(2) || world_.lied_at(j) >= world_.now() - milliseconds(2) ||
        joints_[j].touched_at == world_.now())
      joints_[j].disturbed_at = world_.now();
    const Duration undisturbed = world_.now() - joints_[j].disturbed_at;
    if (undisturbed > seconds(2) && speed > world_.robot().joints[j].limits.velocity_hard)
      breaks("speed", j, fmt::format("{:.2f} rad/s", speed));
    const bool should_rest =
        damped_since_.is_set() && world_.now() - damped_since_ > seconds(2) && undisturbed > seconds(2);
    if (should_rest && speed > 0.1) breaks("comes_to_rest", j, fmt::format("{:.2f} rad/s", speed));
  }
}

bool Oracles::lies_now() const {
  for (std::size_t j = 0; j < joints_.size(); ++j)
    if (world_.lied_at(j).is_set() && world_.now() - world_.lied_at(j) < kSettles) return true;
  return false;
}

void Oracles::tick(const TickRecord& record) {
  ++ticks_;
  const TickRecordHeader& header = record.header;
  if (header.cause != Cause::none) seen_.insert({header.previous_mode, header.cause});
  if (header.mode != mode_) damped_since_ = header.mode == Mode::damped_stop ? header.now : MonoTime{};
  mode_ = header.mode;
  player_ = header.player;
  watch_reset(header);
  watch_stop(header);
  if (seen_player_ != Player::none && seen_player_ != header.player)
    breaks("player", 0,
           fmt::format("the frames are the {}'s, the tick says {}", name(seen_player_), name(header.player)));
  seen_player_ = Player::none;
  const bool refuses_our_own =
      std::ranges::any_of(record.joints, [](const JointRecord& joint) { return is_bug(joint.feedback.refused); });
  const bool is_bug_of_ours = (header.causes_active & pipeline::bit(Cause::internal_error)) != 0 || refuses_our_own;
  has_lied_ |= is_bug_of_ours && lies_now();
  if (is_bug_of_ours && !has_lied_) breaks("no_bug", 0, "the executive found an error of its own");
  const bool moves = mode_ == Mode::tracking || mode_ == Mode::degraded || mode_ == Mode::arming;
  unrecorded_ticks_ = moves && !world_.is_recorded() ? unrecorded_ticks_ + 1 : 0;
  if (unrecorded_ticks_ > 2) breaks("recorded", 0, "nothing records");
  const MonoTime asked = world_.stop_asked_at();
  if (moves && asked.is_set() && header.now > asked + world_.robot().control.period * 2 &&
      header.now < asked + milliseconds(300))
    breaks("stop_wins", 0, "the operator asked to stop");
  const MonoTime off = world_.power_off_asked_at();
  if (off.is_set() && mode_ != Mode::standby && header.now > off + world_.robot().control.period * 2 &&
      header.now < off + milliseconds(300))
    breaks("stop_wins", 0, "the operator asked to take the power away");
  permitted_ticks_ =
      mode_ == Mode::standby && world_.torque_output_works() && world_.is_torque_permitted() ? permitted_ticks_ + 1 : 0;
  if (permitted_ticks_ > 1) breaks("torque_off", 0, "its output permits torque");
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    int& ticks = joints_[j].standby_ticks;
    ticks = mode_ == Mode::standby && world_.obeys(j) ? ticks + 1 : 0;
    if (ticks > 50 && world_.plant().drive(j).state() == simulation::DeviceState::enabled)
      breaks("standby_still", j, "its drive is enabled");
  }
}

}  // namespace takt::exploration
