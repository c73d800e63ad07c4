// SPDX-License-Identifier: Apache-2.0
// Goal: whatever frame comes, in whatever moment, what leaves keeps the contract: no kind of torque, position or
// setting is excused. Method: 200,000 random frames of every protocol before the guard, most of them near something
// that may leave: a torque a slew step from the last, braking, a position a little further on. An oracle that shares
// nothing with the guard but the robot file reads what leaves, in double, and remembers what left before. Seeded.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <numbers>
#include <optional>
#include <random>
#include <string>

#include "tests/drivers/guard/guard_bench.hpp"

namespace takt::drivers {
namespace {

using test::Decision;

constexpr int kFrames = 200'000;

struct Case {
  const char* joint;
  config::Cia402Mode mode = config::Cia402Mode::cst;
};
constexpr std::array kCases{Case{"left_shoulder"},                            // mit, damiao
                            Case{"left_elbow"},                               // mit, direction -1
                            Case{"left_wrist_roll"},                          // robstride
                            Case{"left_wrist_pitch"},                         // odrive
                            Case{"right_elbow"},                              // odrive, gear -8
                            Case{"right_wrist_roll"},                         // moteus
                            Case{"right_base_yaw"},                           // CST
                            Case{"right_base_yaw", config::Cia402Mode::csv},  //
                            Case{"right_base_yaw", config::Cia402Mode::csp}};

config::RobotConfig robot_of(const Case& one) {
  config::RobotConfig robot = test::every_protocol();
  config::Joint joint = robot.joints[test::joint_named(robot, one.joint)];
  joint.drive.mode = one.mode;
  robot.joints = {joint};
  return robot;
}

// Joint side.
struct Ask {
  enum class Kind : std::uint8_t { other, off, on, setting, drive } kind = Kind::other;
  double q = 0, dq = 0, kp = 0, kd = 0, tau = 0;
  double most = INFINITY;  // Nm, the frame's own limit
  double life = 0;         // s; 0: not said
};

std::uint64_t big(const std::uint8_t* at, int bytes) {
  std::uint64_t value = 0;
  for (int i = 0; i < bytes; ++i) value = value << 8U | at[i];
  return value;
}
template <typename T>
T little(const std::uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}
template <typename T>
void put(std::uint8_t* at, T value) {
  std::memcpy(at, &value, sizeof value);
}

// One drive's language: what frames say, and how to say something.
class Language {
 public:
  explicit Language(const config::Joint& joint) : joint_(joint), drive_(joint.drive) {
    ratio_ = drive_.direction * drive_.gear_ratio;
  }

  [[nodiscard]] bool has_fields() const {
    return drive_.protocol == config::DriveProtocol::mit || drive_.protocol == config::DriveProtocol::robstride ||
           drive_.protocol == config::DriveProtocol::moteus;
  }
  [[nodiscard]] bool has(config::Cia402Mode mode) const {
    return drive_.protocol == config::DriveProtocol::cia402 && drive_.mode == mode;
  }
  // What a step on the wire is worth, joint side, generously.
  [[nodiscard]] Ask rounding() const {
    const double gear = std::abs(ratio_);
    const double steps = drive_.protocol == config::DriveProtocol::mit ? 4095 : 65535;
    Ask r{.q = 1e-5, .dq = 1e-5, .kp = 1e-4, .kd = 1e-4, .tau = 2.5e-3 * joint_.limits.torque};
    if (drive_.protocol == config::DriveProtocol::mit || drive_.protocol == config::DriveProtocol::robstride) {
      r.q += 2.5 * 2 * drive_.position_range / 65535 / gear;
      r.dq += 2.5 * 2 * drive_.velocity_range / steps / gear;
      r.kp += 2.5 * drive_.kp_range / steps * gear * gear;
      r.kd += 2.5 * drive_.kd_range / steps * gear * gear;
      r.tau += 2.5 * 2 * drive_.torque_range / steps * gear;
    }
    if (drive_.protocol == config::DriveProtocol::cia402) {
      r.q += 2.5 * radians(1) / gear;
      r.dq += 2.5 * radians(1) / gear;
      r.tau += 2.5 * drive_.rated_torque / 1000 * gear;
    }
    return r;
  }

  [[nodiscard]] CanFrame say(const Ask& ask, std::mt19937_64& random) const {
    CanFrame frame;
    std::uint8_t* const b = frame.data;
    const double p = (ask.q - drive_.offset) * ratio_, v = ask.dq * ratio_, t = ask.tau / ratio_;
    const double kp = ask.kp / ratio_ / ratio_, kd = ask.kd / ratio_ / ratio_;
    switch (drive_.protocol) {
      case config::DriveProtocol::mit: {
        const auto vc = code(v, drive_.velocity_range, 12), tc = code(t, drive_.torque_range, 12);
        const auto pc = code(p, drive_.position_range, 16);
        const auto kpc = gain(kp, drive_.kp_range, 12), kdc = gain(kd, drive_.kd_range, 12);
        frame.id = drive_.id;
        frame.length = 8;
        frame.fd = frame.bit_rate_switch = drive_.fd_bitrate != 0;
        const std::uint64_t bits = std::uint64_t{pc} << 48U | std::uint64_t{vc} << 36U | std::uint64_t{kpc} << 24U |
                                   std::uint64_t{kdc} << 12U | tc;
        for (int i = 0; i < 8; ++i) b[i] = static_cast<std::uint8_t>(bits >> (56 - 8 * i) & 0xFFU);
        return frame;
      }
      case config::DriveProtocol::robstride: {
        const std::array codes{code(p, drive_.position_range, 16), code(v, drive_.velocity_range, 16),
                               gain(kp, drive_.kp_range, 16), gain(kd, drive_.kd_range, 16)};
        frame.id = 1U << 24U | code(t, drive_.torque_range, 16) << 8U | drive_.id;
        frame.extended = true;
        frame.length = 8;
        for (std::size_t i = 0; i < 4; ++i) {
          b[2 * i] = static_cast<std::uint8_t>(codes[i] >> 8U);
          b[2 * i + 1] = static_cast<std::uint8_t>(codes[i] & 0xFFU);
        }
        return frame;
      }
      case config::DriveProtocol::odrive:
        frame.id = drive_.id << 5U | 0x0EU;
        frame.length = 4;
        put(b, static_cast<float>(t));
        return frame;
      case config::DriveProtocol::moteus: {
        const std::array<std::uint8_t, 6> head{0x01, 0x00, 0x0A, 0x0C, 0x06, 0x20};
        const bool says_more = random() % 20 == 0;
        const std::array values{
            p / (2 * std::numbers::pi), v / (2 * std::numbers::pi), t,
            kp / drive_.servo_kp,       kd / drive_.servo_kd,       drive_.torque_range * (says_more ? 1.1 : 1)};
        frame.id = 0x8000U | drive_.id;
        frame.extended = frame.fd = frame.bit_rate_switch = true;
        std::uint8_t* at = std::ranges::copy(head, b).out;
        for (const double value : values) put(at, static_cast<float>(value)), at += 4;
        *at++ = 0x0D;
        *at++ = 0x27;
        put(at, static_cast<float>(0.001 * static_cast<double>(10 + random() % 60)));
        at += 4;
        for (const int byte : {0x02, 0x28, 0xFF, 0xFF}) *at++ = static_cast<std::uint8_t>(byte);
        frame.length = static_cast<std::uint8_t>(at - b);
        return frame;
      }
      case config::DriveProtocol::cia402:
        break;
    }
    const bool cst = drive_.mode == config::Cia402Mode::cst;
    frame.id = 0x200 + drive_.id;
    frame.length = cst ? 5 : 7;
    b[0] = 0x0F;
    b[2] = cst ? 10 : drive_.mode == config::Cia402Mode::csv ? 9 : 8;
    if (cst) {
      put(b + 3, static_cast<std::int16_t>(std::clamp(std::round(t / drive_.rated_torque * 1000), -32767.0, 32767.0)));
    } else {
      const double wide = std::round((drive_.mode == config::Cia402Mode::csv ? v : p) / radians(1));
      put(b + 3, static_cast<std::int32_t>(std::clamp(wide, -2e9, 2e9)));
    }
    return frame;
  }

  [[nodiscard]] Ask read(const CanFrame& frame) const {
    const std::uint8_t* const b = frame.data;
    switch (drive_.protocol) {
      case config::DriveProtocol::mit:
        return read_mit(frame);
      case config::DriveProtocol::robstride: {
        const std::uint32_t type = frame.id >> 24U;
        if (type == 3) return {.kind = Ask::Kind::on};
        if (type == 4) return {.kind = Ask::Kind::off};
        if (type != 1) return {};
        return to_joint(field(big(b, 2), drive_.position_range, 16), field(big(b + 2, 2), drive_.velocity_range, 16),
                        static_cast<double>(big(b + 4, 2)) / 65535 * drive_.kp_range,
                        static_cast<double>(big(b + 6, 2)) / 65535 * drive_.kd_range,
                        field(frame.id >> 8U & 0xFFFFU, drive_.torque_range, 16));
      }
      case config::DriveProtocol::odrive: {
        const std::uint32_t message = frame.id & 0x1FU;
        if (message == 0x07) return {.kind = little<std::uint32_t>(b) == 8 ? Ask::Kind::on : Ask::Kind::off};
        if (message == 0x0E) return to_joint(0, 0, 0, 0, static_cast<double>(little<float>(b)));
        return {};
      }
      case config::DriveProtocol::moteus:
        return read_moteus(frame);
      case config::DriveProtocol::cia402:
        return read_cia402(frame);
    }
    return {};
  }

 private:
  static double field(std::uint64_t code, double range, int bits) {
    return (2 * static_cast<double>(code) / ((1 << bits) - 1) - 1) * range;
  }
  static std::uint32_t code(double value, double range, int bits) {
    const double top = (1 << bits) - 1;
    return static_cast<std::uint32_t>(std::clamp((value / range + 1) / 2 * top, 0.0, top));
  }
  static std::uint32_t gain(double value, double range, int bits) {
    const double top = (1 << bits) - 1;
    return static_cast<std::uint32_t>(std::clamp(value / range * top, 0.0, top));
  }
  [[nodiscard]] double radians(double counts) const {
    return counts * 2 * std::numbers::pi / static_cast<double>(drive_.counts_per_turn);
  }
  [[nodiscard]] Ask to_joint(double p, double v, double kp, double kd, double t) const {
    return {.kind = Ask::Kind::drive,
            .q = p / ratio_ + drive_.offset,
            .dq = v / ratio_,
            .kp = kp * ratio_ * ratio_,
            .kd = kd * ratio_ * ratio_,
            .tau = t * ratio_};
  }
  [[nodiscard]] Ask read_mit(const CanFrame& frame) const {
    if (frame.id != drive_.id) return {};
    const std::uint64_t bits = big(frame.data, 8);
    if (bits >> 16U == 0xFFFF'FFFF'FFFF) {
      if ((bits >> 8U & 0xFFU) != 0xFF) return {.kind = Ask::Kind::setting};  // a RobStride's mode, protocol or number
      const std::uint64_t last = bits & 0xFFU;
      return {.kind = last == 0xFC                   ? Ask::Kind::on
                      : last == 0xFE || last == 0xFA ? Ask::Kind::setting
                                                     : Ask::Kind::off};
    }
    return to_joint(field(bits >> 48U, drive_.position_range, 16),
                    field(bits >> 36U & 0xFFFU, drive_.velocity_range, 12),
                    static_cast<double>(bits >> 24U & 0xFFFU) / 4095 * drive_.kp_range,
                    static_cast<double>(bits >> 12U & 0xFFFU) / 4095 * drive_.kd_range,
                    field(bits & 0xFFFU, drive_.torque_range, 12));
  }
  // As say() and the guard's replacement write it.
  [[nodiscard]] Ask read_moteus(const CanFrame& frame) const {
    const std::uint8_t* const b = frame.data;
    if (b[0] != 0x01 || b[1] != 0x00) return {};
    if (b[2] == 0) return {.kind = Ask::Kind::off};
    const auto value = [b](int i) { return static_cast<double>(little<float>(b + 6 + 4 * i)); };
    const double kp = value(3), kd = std::min(value(4), kp);
    Ask ask = to_joint(value(0) * 2 * std::numbers::pi, value(1) * 2 * std::numbers::pi, kp * drive_.servo_kp,
                       kd * drive_.servo_kd, value(2));
    ask.most = value(5) * std::abs(ratio_);
    ask.life = static_cast<double>(little<float>(b + 32));
    return ask;
  }
  [[nodiscard]] Ask read_cia402(const CanFrame& frame) const {
    const std::uint8_t* const b = frame.data;
    if (frame.id == 0x600 + drive_.id) return {.kind = (b[0] & 0xF0U) == 0x20 ? Ask::Kind::setting : Ask::Kind::other};
    if (frame.id != 0x200 + drive_.id) return {};
    if (b[0] == 0 || b[0] == 0x80) return {.kind = Ask::Kind::off};
    if (b[0] != 0x0F) return {.kind = Ask::Kind::on};
    switch (drive_.mode) {
      case config::Cia402Mode::cst:
        return to_joint(0, 0, 0, 0, little<std::int16_t>(b + 3) * drive_.rated_torque / 1000);
      case config::Cia402Mode::csv:
        return to_joint(0, radians(little<std::int32_t>(b + 3)), 0, 0, 0);
      case config::Cia402Mode::csp:
        return to_joint(radians(little<std::int32_t>(b + 3)), 0, 0, 0, 0);
    }
    return {};
  }

  const config::Joint& joint_;
  const config::Drive& drive_;
  double ratio_ = 1;
};

// Judges what leaves, and remembers it.
class Oracle {
 public:
  Oracle(const config::RobotConfig& robot, const Language& language)
      : robot_(robot), limits_(robot.joints[0].limits), language_(language), r_(language.rounding()) {}

  // Empty: it may leave. `was_passed`: it is the frame that came, not what the guard wrote instead.
  std::string judge(const Ask& ask, const Decision& decided, bool was_passed) {
    const std::string wrong = wrong_with(ask, decided, was_passed);
    remember(ask, decided, was_passed);
    return wrong;
  }
  [[nodiscard]] double last_torque() const { return torque_; }
  [[nodiscard]] double last_position() const { return position_.value_or(0); }

 private:
  [[nodiscard]] double period() const { return robot_.control.period.seconds(); }
  [[nodiscard]] bool says_torque() const {
    return !language_.has(config::Cia402Mode::csp) && !language_.has(config::Cia402Mode::csv);
  }
  [[nodiscard]] static double torque_of(const Ask& a, const Decision& d) {
    const double sum =
        a.kp * (a.q - static_cast<double>(d.at_q)) + a.kd * (a.dq - static_cast<double>(d.at_dq)) + a.tau;
    return a.most > 0 ? std::clamp(sum, -a.most, a.most) : sum;
  }
  [[nodiscard]] bool is_nothing(const Ask& a, const Decision& d) const {
    if (language_.has(config::Cia402Mode::csp)) return std::abs(a.q - static_cast<double>(d.at_q)) <= r_.q;
    if (language_.has(config::Cia402Mode::csv)) return std::abs(a.dq) <= r_.dq;
    return a.kp == 0 && std::abs(a.tau) <= r_.tau && (a.kd == 0 || std::abs(a.dq) <= r_.dq);
  }

  [[nodiscard]] std::string wrong_with(const Ask& a, const Decision& d, bool was_passed) const {
    switch (a.kind) {
      case Ask::Kind::other:
      case Ask::Kind::off:
        return {};
      case Ask::Kind::on:
        return d.moment.enabled ? "" : "switches on what is to be off";
      case Ask::Kind::setting:
        return d.moment.enabled ? "changes settings of what is to be on" : "";
      case Ask::Kind::drive:
        break;
    }
    if (a.kp > limits_.kp + r_.kp || a.kd > limits_.kd + r_.kd || a.kp < 0 || a.kd < 0) return "gains";
    if (!d.moment.enabled) {
      const bool switches_on = robot_.joints[0].drive.protocol == config::DriveProtocol::moteus ||
                               robot_.joints[0].drive.protocol == config::DriveProtocol::cia402;
      return !switches_on && a.kd <= r_.kd && is_nothing(a, d) ? "" : "drives what is to be off";
    }
    if (is_nothing(a, d)) return {};
    return was_passed ? wrong_with_push(a, d) : wrong_with_replacement(a, d);
  }

  [[nodiscard]] std::string wrong_with_push(const Ask& a, const Decision& d) const {
    const Duration left = d.moment.valid_until.is_set() ? d.moment.valid_until - d.moment.decided_at : Duration{};
    const double shortest = std::clamp(robot_.feedback.timeout.seconds(), 0.02, 0.1);
    if (d.moment.valid_until.is_set() && d.moment.now > d.moment.valid_until) return "expired";
    if (a.life > std::max(left.seconds(), shortest) + 2e-6) return "outlives its command";
    if (d.feedback_age > robot_.feedback.timeout) return "not heard";
    if (std::abs(a.dq) > limits_.velocity + r_.dq) return "velocity";
    const bool moves_to = a.kp > 0 || language_.has(config::Cia402Mode::csp);
    if (moves_to &&
        (a.q < limits_.q_min - limits_.position_margin - r_.q || a.q > limits_.q_max + limits_.position_margin + r_.q))
      return "position";
    if (says_torque()) {
      const double gap = torque_of(a, d), doubt = doubt_of(a, d);
      if (std::abs(gap) > limits_.torque + doubt || std::abs(a.tau) > limits_.torque + r_.tau) return "torque";
      if (!is_within_slew(gap, doubt + doubt_)) return "slew";
    }
    if (language_.has(config::Cia402Mode::csp) && jumps(a.q, d)) return "jump";
    return is_decided(a, d) ? "" : "not decided";
  }

  // Damping that the guard wrote itself.
  [[nodiscard]] std::string wrong_with_replacement(const Ask& a, const Decision& d) const {
    if (language_.has(config::Cia402Mode::csp))
      return position_ && std::abs(a.q - *position_) <= r_.q ? "" : "neither where it was told nor where it is";
    if (language_.has(config::Cia402Mode::csv)) return "a speed instead of a refused frame";
    if (d.feedback_age > robot_.feedback.timeout) return "brakes what is not heard";
    const auto estimate = static_cast<double>(d.at_dq), own = static_cast<double>(d.own_dq.value_or(d.at_dq));
    if (!(a.tau * estimate < 0 && a.tau * own < 0)) return "pushes instead of a refused frame";
    if (std::abs(a.tau) > robot_.joints[0].damping * std::min(std::abs(estimate), std::abs(own)) + r_.tau)
      return "brakes harder than the joint's damping";
    if (std::abs(a.tau) > limits_.torque + r_.tau) return "torque instead of a refused frame";
    const double step = limits_.torque_rate * period() + r_.tau + doubt_;
    return a.tau >= std::min(torque_, 0.0) - step && a.tau <= std::max(torque_, 0.0) + step
               ? ""
               : "slew instead of a refused frame";
  }

  [[nodiscard]] bool is_within_slew(double torque, double doubt) const {
    const double step = limits_.torque_rate * period() + doubt;
    const double low = is_passive_ ? std::min(torque_, 0.0) : torque_;
    const double high = is_passive_ ? std::max(torque_, 0.0) : torque_;
    return torque >= low - step && torque <= high + step;
  }
  [[nodiscard]] bool jumps(double q, const Decision& d) const {
    const auto at = static_cast<double>(d.at_q);
    const double step = limits_.velocity * period() + r_.q;
    const bool led = position_ && !is_passive_;
    const double moved = led ? 0 : limits_.velocity_hard * std::max(d.feedback_age.seconds(), 0.0) + step;
    const double from = position_.value_or(at);
    return q < std::min(from, at - moved) - step || q > std::max(from, at + moved) + step;
  }
  [[nodiscard]] double doubt_of(const Ask& a, const Decision& d) const {
    if (!language_.has_fields()) return r_.tau;
    return r_.tau + a.kp * r_.q + std::abs(a.q - static_cast<double>(d.at_q)) * r_.kp + a.kd * r_.dq +
           std::abs(a.dq - static_cast<double>(d.at_dq)) * r_.kd;
  }
  [[nodiscard]] bool is_decided(const Ask& a, const Decision& d) const {
    const auto near = [](double x, float y, double tolerance) {
      return std::abs(x - static_cast<double>(y)) <= tolerance;
    };
    if (language_.has(config::Cia402Mode::csp)) return near(a.q, d.q, r_.q);
    if (language_.has(config::Cia402Mode::csv)) return near(a.dq, d.dq, r_.dq);
    if (!language_.has_fields()) return near(a.tau, d.tau, r_.tau);
    return near(a.q, d.q, r_.q) && near(a.dq, d.dq, r_.dq) && near(a.kp, d.kp, r_.kp) && near(a.kd, d.kd, r_.kd) &&
           near(a.tau, d.tau, r_.tau);
  }

  void remember(const Ask& a, const Decision& d, bool was_passed) {
    if (a.kind == Ask::Kind::off) {
      torque_ = doubt_ = 0;
      is_passive_ = true;
      position_.reset();
    }
    if (a.kind != Ask::Kind::drive) return;
    is_passive_ = is_nothing(a, d) || !was_passed;
    const double torque = torque_of(a, d);
    torque_ = std::isfinite(torque) ? torque : 0;
    doubt_ = std::isfinite(torque) ? doubt_of(a, d) : 0;
    if (language_.has(config::Cia402Mode::csp)) position_ = a.q;
  }

  const config::RobotConfig& robot_;
  const config::Limits& limits_;
  const Language& language_;
  Ask r_;
  double torque_ = 0, doubt_ = 0;
  bool is_passive_ = true;
  std::optional<double> position_;
};

class RandomFrames {
 public:
  RandomFrames(const Case& one, std::uint64_t seed)
      : robot_(robot_of(one)), language_(robot_.joints[0]), oracle_(robot_, language_), guard_(robot_), random_(seed) {}

  // Empty: what left may leave.
  std::string one_more() {
    now_ = now_ + milliseconds(1);
    draw_moment();
    CanFrame frame = happens(0.85) ? language_.say(draw_ask(), random_) : draw_strange();
    const Ask came = language_.read(frame);
    draw_decision(came);
    const bool passed = guard_.pass(0, robot_.joints[0].bus, decided_.moment, record(), frame) == WireVerdict::allowed;
    const Ask leaves = language_.read(frame);
    ++(passed ? passed_ : refused_);
    pushes_ += passed && came.kind == Ask::Kind::drive && std::abs(came.tau) > 0.5 ? 1 : 0;
    return oracle_.judge(leaves, decided_, passed);
  }
  [[nodiscard]] int passed() const { return passed_; }
  [[nodiscard]] int refused() const { return refused_; }
  [[nodiscard]] int pushes() const { return pushes_; }

 private:
  bool happens(double share) { return uniform(0, 1) < share; }
  double uniform(double low, double high) { return std::uniform_real_distribution(low, high)(random_); }
  [[nodiscard]] const config::Limits& limits() const { return robot_.joints[0].limits; }

  void draw_moment() {
    const MonoTime written = now_ + microseconds(static_cast<std::int64_t>(uniform(0, 2'000)));
    decided_ = {};
    decided_.moment = {now_, written, now_ + microseconds(static_cast<std::int64_t>(uniform(-5'000, 50'000))),
                       happens(0.9)};
    if (happens(0.3)) decided_.moment.valid_until = {};
    decided_.feedback_age = microseconds(static_cast<std::int64_t>(uniform(0, happens(0.9) ? 3'000 : 40'000)));
    if (happens(0.2)) at_q_ = uniform(limits().q_min, limits().q_max);
    at_q_ += uniform(-0.002, 0.002);
    decided_.at_q = static_cast<float>(at_q_);
    decided_.at_dq = static_cast<float>(uniform(-1.5, 1.5) * limits().velocity);
    decided_.own_dq = happens(0.6) ? decided_.at_dq * static_cast<float>(uniform(0.3, 1.5))
                                   : static_cast<float>(uniform(-2, 2) * limits().velocity);
    if (happens(0.02)) decided_.own_dq = NAN;
  }

  Ask draw_ask() {
    const double slew = limits().torque_rate * robot_.control.period.seconds();
    Ask ask{.kind = Ask::Kind::drive};
    const double from = happens(0.7) ? oracle_.last_position() : at_q_;
    ask.q = from + uniform(-1, 1) * (happens(0.7) ? 0.004 : 2.5);
    ask.dq = happens(0.5) ? 0 : uniform(-1.2, 1.2) * limits().velocity;
    ask.kp = happens(0.5) ? 0 : uniform(0, 1.1) * limits().kp * (happens(0.7) ? 0.02 : 1);
    ask.kd = happens(0.4) ? 0 : uniform(0, 1.1) * limits().kd * (happens(0.5) ? 0.1 : 1);
    const double impedance = language_.has_fields() ? ask.kp * (ask.q - static_cast<double>(decided_.at_q)) +
                                                          ask.kd * (ask.dq - static_cast<double>(decided_.at_dq))
                                                    : 0;
    const double draw = uniform(0, 1);
    if (draw < 0.5)  // near the last
      ask.tau = oracle_.last_torque() + uniform(-1.3, 1.3) * slew - impedance;
    else if (draw < 0.75)  // braking, as the estimate has it
      ask.tau = -uniform(0, 1) * limits().kd * static_cast<double>(decided_.at_dq);
    else if (draw < 0.9)
      ask.tau = uniform(-1.5, 1.5) * limits().torque;
    return ask;
  }

  // Specials, states, settings, and single bits that are wrong.
  CanFrame draw_strange() {
    CanFrame frame = language_.say(draw_ask(), random_);
    const config::Drive& drive = robot_.joints[0].drive;
    const auto pick = [this](std::initializer_list<int> bytes) {
      return static_cast<std::uint8_t>(*(bytes.begin() + random_() % bytes.size()));
    };
    switch (drive.protocol) {
      case config::DriveProtocol::mit:
        std::fill_n(frame.data, 6, std::uint8_t{0xFF});
        frame.data[6] = pick({0xFF, 0xFF, 0xFF, 0x00, 0x02, 0xFD});
        frame.data[7] = pick({0xFA, 0xFB, 0xFC, 0xFD, 0xFE});
        break;
      case config::DriveProtocol::robstride:
        frame.id = std::uint32_t{pick({3, 4, 6, 7, 18})} << 24U | drive.host_id << 8U | drive.id;
        break;
      case config::DriveProtocol::odrive:
        frame.id = drive.id << 5U | pick({0x07, 0x07, 0x0C, 0x0D});
        put(frame.data, std::uint32_t{pick({1, 8})});
        break;
      case config::DriveProtocol::moteus:
        if (happens(0.5)) frame.data[2] = pick({0, 15});
        break;
      case config::DriveProtocol::cia402:
        if (happens(0.5)) {
          frame.data[0] = pick({0x00, 0x06, 0x07, 0x1F, 0x80});
        } else {
          frame.id = 0x600 + drive.id;
          frame.length = 8;
          frame.data[0] = pick({0x23, 0x2B, 0x2F, 0x40});
          put(frame.data + 1, static_cast<std::uint16_t>(std::array{0x1400, 0x1017, 0x6060, 0x60C2}[random_() % 4]));
          frame.data[3] = pick({0, 1, 2});
          put(frame.data + 4, static_cast<std::uint32_t>(random_() % 3 == 0 ? random_() : random_() % 300));
        }
        break;
    }
    if (happens(0.2)) frame.data[random_() % 8] ^= static_cast<std::uint8_t>(1U << random_() % 8);
    return frame;
  }

  void draw_decision(const Ask& came) {
    decided_.q = static_cast<float>(came.q);
    decided_.dq = static_cast<float>(came.dq);
    decided_.kp = static_cast<float>(came.kp);
    decided_.kd = static_cast<float>(came.kd);
    decided_.tau = static_cast<float>(came.tau);
    if (happens(0.8)) return;
    float* const field =
        std::array{&decided_.q, &decided_.dq, &decided_.kp, &decided_.kd, &decided_.tau}[random_() % 5];
    *field = happens(0.5) ? -*field : *field * 1.5F + 0.1F;
  }

  [[nodiscard]] JointRecord record() const { return decided_.record(); }

  config::RobotConfig robot_;
  Language language_;
  Oracle oracle_;
  WireGuard guard_;
  std::mt19937_64 random_;
  MonoTime now_{1'000'000'000};
  double at_q_ = 0;
  Decision decided_;
  int passed_ = 0, refused_ = 0, pushes_ = 0;
};

TEST(RandomFrames, NoneIsExcused) {
  std::map<std::string, int> wrong;
  for (std::size_t i = 0; i < kCases.size(); ++i) {
    const Case& one = kCases[i];
    RandomFrames frames(one, 20'26 + i);
    const auto share = static_cast<int>(kFrames / kCases.size()) + 1;
    for (int n = 0; n < share; ++n) {
      const std::string why = frames.one_more();
      if (!why.empty()) ++wrong[std::string(one.joint) + " " + std::to_string(static_cast<int>(one.mode)) + ": " + why];
    }
    EXPECT_GT(frames.passed(), share / 20) << one.joint << ": little passed";
    EXPECT_GT(frames.refused(), share / 20) << one.joint << ": little was refused";
    const bool pushes = one.mode == config::Cia402Mode::cst;
    if (pushes) {
      EXPECT_GT(frames.pushes(), share / 100) << one.joint << ": hardly a torque passed";
    }
  }
  for (const auto& [what, count] : wrong) ADD_FAILURE() << what << ", " << count << " times";
}

}  // namespace
}  // namespace takt::drivers
