// SPDX-License-Identifier: Apache-2.0
// Goal: the RobStride codec is exact to the byte, and nothing that arrives can hurt it.
// Method: bytes worked out by hand from the formulas of the protocol's description, properties over random commands and
// models, and frames of every kind and length thrown at the decoders.
#include "drivers/protocol/robstride/robstride_codec.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>

#include "config/drive_presets.hpp"
#include "simulation/robstride_device.hpp"

namespace takt::drivers {
namespace {

constexpr RobstrideAddress kAddress{.drive = 0x7F, .host = 0xFD};

RobstrideRange range_of(const config::DrivePreset& preset) {
  return {static_cast<float>(preset.position), static_cast<float>(preset.velocity), static_cast<float>(preset.kp),
          static_cast<float>(preset.kd), static_cast<float>(preset.torque)};
}

// RS04's is no preset: position, velocity, kp, kd, torque.
constexpr RobstrideRange kRs04{12.566370614359172F, 15, 5000, 100, 120};

RobstrideRange preset(std::string_view model) {
  if (model == "RS04") return kRs04;
  return range_of(*config::find_drive_preset(config::DriveProtocol::robstride, model));
}

// can-utils' grammar: id#data.
std::string text(const CanFrame& frame) {
  char two[16];
  std::snprintf(two, sizeof two, "%08X#", frame.id);
  std::string all = frame.extended ? two : "not extended";
  for (int i = 0; i < frame.length; ++i) {
    std::snprintf(two, sizeof two, "%02x", frame.data[i]);
    all += two;
  }
  return all;
}

CanFrame frame_of(std::uint32_t id, std::initializer_list<int> bytes) {
  CanFrame frame;
  frame.id = id;
  frame.extended = true;
  for (const int byte : bytes) frame.data[frame.length++] = static_cast<std::uint8_t>(byte);
  return frame;
}

TEST(RobstrideCodec, EncodesMotionAsWorkedOutByHand) {
  struct Row {
    const char* when;
    const char* model;
    RobstrideCommand command;
    const char* frame;
  };
  const Row rows[] = {
      // p (1 + 4 pi) * 65535 / (8 pi) = 35375.05 = 8A2F; v 28 * 65535 / 60 = 30583 = 7777; kp 100 / 500 * 65535 = 13107
      // = 3333; kd 1.5 / 5 * 65535 = 19660.5, cut to 4CCC; t 15 * 65535 / 24 = 40959.4, cut to 9FFF, in the id.
      {"every field set", "CyberGear", {1, -2, 100, 1.5F, 3}, "019FFF7F#8a2f777733334ccc"},
      // p 23641.06 = 5C59; v 19 * 65535 / 30 = 41505.5 = A221; kp 3276.75 = 0CCC; kd 7 / 100 * 65535 = 4587.45 = 11EB;
      // t 60 * 65535 / 240 = 16383.75 = 3FFF.
      {"a model with other ranges", "RS04", {-3.5F, 4, 250, 7, -60}, "013FFF7F#5c59a2210ccc11eb"},
      // 32767.5, cut off.
      {"zero lies half a quantum below", "CyberGear", {}, "017FFF7F#7fff7fff00000000"},
      {"everything at the lower end", "RS00", {-13, -33, 0, 0, -14}, "0100007F#0000000000000000"},
      {"far outside is clamped first", "RS00", {-1e9F, -1e9F, -9, -9, -1e9F}, "0100007F#0000000000000000"},
      {"far outside on the other side", "RS00", {1e9F, 1e9F, 1e9F, 1e9F, 1e9F}, "01FFFF7F#ffffffffffffffff"},
  };
  for (const Row& row : rows)
    EXPECT_EQ(text(encode_robstride_motion(preset(row.model), kAddress, row.command)), row.frame) << row.when;
}

TEST(RobstrideCodec, OtherFramesCarryOurNumberInTheMiddleOfTheId) {
  EXPECT_EQ(text(encode_robstride_enable(kAddress)), "0300FD7F#0000000000000000");
  EXPECT_EQ(text(encode_robstride_stop(kAddress, false)), "0400FD7F#0000000000000000");
  EXPECT_EQ(text(encode_robstride_stop(kAddress, true)), "0400FD7F#0100000000000000");
  // 17 = 11 hex, 18 = 12 hex; index and value with the low byte first.
  EXPECT_EQ(text(encode_robstride_question(kAddress, RobstrideParameter::stored_timeout)), "1100FD7F#0c20000000000000");
  EXPECT_EQ(text(encode_robstride_setting(kAddress, RobstrideParameter::run_mode, 0)), "1200FD7F#0570000000000000");
  // The makers' manuals of RS00 to RS06: 7028, 20000 is 1 s.
  EXPECT_EQ(text(encode_robstride_setting(kAddress, RobstrideParameter::can_timeout, 20000)),
            "1200FD7F#28700000204e0000");
}

TEST(RobstrideCodec, NotFiniteMeansNoStiffnessAndNoTorque) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  const auto sent = [](const RobstrideCommand& command) {
    return text(encode_robstride_motion(preset("CyberGear"), kAddress, command));
  };
  const std::string limp = sent({0, 0, 0, 2, 0});
  EXPECT_EQ(sent({nan, 1, 50, 2, 3}), limp);
  EXPECT_EQ(sent({1, -inf, 50, 2, 3}), limp);
  EXPECT_EQ(sent({1, 1, inf, 2, 3}), limp);
  EXPECT_EQ(sent({1, 1, 50, 2, nan}), limp);
  EXPECT_EQ(sent({1, 1, 50, nan, 3}), sent({}));
}

TEST(RobstrideCodec, DecodesFeedbackAsWorkedOutByHand) {
  // Mode 2 (top two bits), faults 000101, drive 7F, host FD. p, v, t: the codes above; 0x016D = 365: 36.5 degrees.
  const CanFrame frame = frame_of(0x02857FFD, {0x8A, 0x2F, 0x77, 0x77, 0x9F, 0xFF, 0x01, 0x6D});
  ASSERT_EQ(robstride_kind(kAddress, frame), RobstrideKind::feedback);
  const auto feedback = decode_robstride_feedback(preset("CyberGear"), frame);
  ASSERT_TRUE(feedback);
  EXPECT_NEAR(feedback->p, 0.999979, 2e-6);  // 35375 * 8 pi / 65535 - 4 pi
  EXPECT_NEAR(feedback->v, -2.0, 1e-5);
  EXPECT_NEAR(feedback->t, 2.999863, 1e-5);  // 40959 * 24 / 65535 - 12
  EXPECT_FLOAT_EQ(feedback->temperature_C, 36.5F);
  EXPECT_EQ(feedback->faults, 0b000101) << "under-voltage and over-temperature";
  EXPECT_EQ(feedback->mode, RobstrideMode::running);
}

TEST(RobstrideCodec, DecodesAnswersAndFaultReports) {
  const CanFrame answer = frame_of(0x11007FFD, {0x0C, 0x20, 0, 0, 0x20, 0x4E, 0, 0});
  ASSERT_EQ(robstride_kind(kAddress, answer), RobstrideKind::answer);
  EXPECT_EQ(decode_robstride_answer(answer)->index, 0x200C);
  EXPECT_EQ(decode_robstride_answer(answer)->value, 20000U);
  EXPECT_FALSE(decode_robstride_answer(answer)->failed);
  // Bits 16..23 of the id: 01, the reading failed.
  EXPECT_TRUE(decode_robstride_answer(frame_of(0x11017FFD, {0x0C, 0x20, 0, 0, 0, 0, 0, 0}))->failed);
  const CanFrame report = frame_of(0x15007FFD, {0x08, 0, 0x01, 0, 0x01, 0, 0, 0x80});
  ASSERT_EQ(robstride_kind(kAddress, report), RobstrideKind::fault_report);
  EXPECT_EQ(decode_robstride_fault_report(report)->faults, 0x10008U);
  EXPECT_EQ(decode_robstride_fault_report(report)->warnings, 0x80000001U);
  // Type 24: the drive reports by itself, laid out as feedback.
  EXPECT_EQ(robstride_kind(kAddress, frame_of(0x18807FFD, {})), RobstrideKind::active_report);
  EXPECT_EQ(robstride_kind(kAddress, frame_of(0x00007FFE, {1, 2, 3, 4, 5, 6, 7, 8})), RobstrideKind::identity);
}

TEST(RobstrideCodec, NamesNothingThatIsNotThisDrivesWordToUs) {
  EXPECT_FALSE(robstride_kind(kAddress, frame_of(0x02007EFD, {}))) << "another drive";
  EXPECT_FALSE(robstride_kind(kAddress, frame_of(0x02007FFC, {}))) << "to another host";
  EXPECT_FALSE(robstride_kind(kAddress, frame_of(0x00007FFD, {}))) << "an identity goes to FE";
  EXPECT_FALSE(robstride_kind(kAddress, frame_of(0x0100FD7F, {}))) << "a command to the drive";
  for (const std::uint32_t type : {1U, 3U, 4U, 6U, 7U, 18U, 22U, 31U})
    EXPECT_FALSE(robstride_kind(kAddress, frame_of(type << 24U | 0x7FFDU, {}))) << type;
  CanFrame standard = frame_of(0x7FD, {});
  standard.extended = false;
  EXPECT_FALSE(robstride_kind(kAddress, standard));
}

TEST(RobstrideCodec, DecodersRefuseEveryOtherLengthAndKind) {
  const RobstrideRange range = preset("CyberGear");
  const CanFrame good = frame_of(0x02007FFD, {0, 0, 0, 0, 0, 0, 0, 0});
  ASSERT_TRUE(decode_robstride_feedback(range, good));
  const auto refused = [&range](const CanFrame& frame) {
    return !decode_robstride_feedback(range, frame) && !decode_robstride_answer(frame) &&
           !decode_robstride_fault_report(frame);
  };
  for (std::uint8_t length = 0; length <= 64; ++length) {
    CanFrame odd = good;
    odd.length = length;
    EXPECT_EQ(refused(odd), length != 8) << int{length};
  }
  for (bool CanFrame::*flag : {&CanFrame::fd, &CanFrame::remote, &CanFrame::error}) {
    CanFrame odd = good;
    odd.*flag = true;
    EXPECT_TRUE(refused(odd));
  }
}

TEST(RobstrideCodec, AMillionRandomFramesDecodeToNumbersInRangeOrNothing) {
  std::mt19937_64 random(20260101);
  const RobstrideRange range = preset("RS03");
  for (int i = 0; i < 1'000'000; ++i) {
    CanFrame frame;
    const std::uint64_t bits = random();
    std::memcpy(frame.data, &bits, 8);
    const std::uint64_t shape = random();
    frame.id = static_cast<std::uint32_t>(shape & 0x1FFF'FFFFU);
    frame.length = static_cast<std::uint8_t>((shape >> 32U) % 10);
    frame.extended = true;
    const auto feedback = decode_robstride_feedback(range, frame);
    if (!feedback) continue;
    ASSERT_LE(std::abs(feedback->p), range.p * 1.0001F);
    ASSERT_LE(std::abs(feedback->v), range.v * 1.0001F);
    ASSERT_LE(std::abs(feedback->t), range.t * 1.0001F);
  }
}

// Both directions against the simulated drive, which has a codec of its own.

struct Pair {
  explicit Pair(std::size_t model) {
    config::DrivePreset from = config::kRobstridePresets[model];
    if (from.torque == config::kUnsettled) from.torque = 6;  // what a robot file might say
    range = range_of(from);
    drive.protocol = config::DriveProtocol::robstride;
    drive.id = kAddress.drive;
    drive.host_id = kAddress.host;
    drive.position_range = from.position;
    drive.velocity_range = from.velocity;
    drive.torque_range = from.torque;
    drive.kp_range = from.kp;
    drive.kd_range = from.kd;
    device.emplace(drive, seconds(1));
  }
  RobstrideRange range;
  config::Drive drive;
  std::optional<simulation::RobstrideDevice> device;
};

// Inside, and in one of 24 cases far outside.
float draw(float limit, bool positive) {
  const float share = static_cast<float>(*rc::gen::inRange(0, 1'000'001)) / 1e6F;
  const float inside = positive ? share * limit : (2 * share - 1) * limit;
  return *rc::gen::inRange(0, 24) == 0 ? inside * 1e6F : inside;
}

double inside(float x, float low, float high) {
  return static_cast<double>(std::clamp(x, low, high));
}

// What the drive makes of `sent` when it reads q and dq: the impedance law shows every field.
double torque_felt(Pair& pair, const RobstrideCommand& sent, double q, double dq) {
  simulation::Frames said;
  pair.device->receive(encode_robstride_enable(kAddress), MonoTime{1}, said);
  const CanFrame frame = encode_robstride_motion(pair.range, kAddress, sent);
  RC_ASSERT(frame.id >> 24U == 1U);
  pair.device->receive(frame, MonoTime{1}, said);
  return pair.device->update({q, dq}, MonoTime{2}, milliseconds(1), said);
}

constexpr double kQuantum = 1.05 / 65535;  // of a field's span; a little more for float32

// One gain at a time, against an error that asks for half the torque, so that nothing saturates and nothing hides.
TEST(RobstrideCodec, TheDriveFeelsStiffnessAndPositionWithinOneQuantum) {
  EXPECT_TRUE(rc::check([] {
    Pair pair(*rc::gen::inRange<std::size_t>(0, config::kRobstridePresets.size()));
    const RobstrideRange& r = pair.range;
    const RobstrideCommand sent{draw(r.p, false), 0, draw(r.kp, true), 0, 0};
    const double p = inside(sent.p, -r.p, r.p), kp = inside(sent.kp, 0, r.kp), limit = pair.drive.torque_range;
    const double error = std::min(limit / 2 / std::max(kp, 1e-3), 2 * pair.drive.position_range);
    const double slack =
        kQuantum * (kp * 2 * pair.drive.position_range + pair.drive.kp_range * error + 2 * limit) * 1.1;
    RC_ASSERT(std::abs(torque_felt(pair, sent, p - error, 0) - kp * error) <= slack);
  }));
}

TEST(RobstrideCodec, TheDriveFeelsDampingAndVelocityWithinOneQuantum) {
  EXPECT_TRUE(rc::check([] {
    Pair pair(*rc::gen::inRange<std::size_t>(0, config::kRobstridePresets.size()));
    const RobstrideRange& r = pair.range;
    const RobstrideCommand sent{0, draw(r.v, false), 0, draw(r.kd, true), 0};
    const double v = inside(sent.v, -r.v, r.v), kd = inside(sent.kd, 0, r.kd), limit = pair.drive.torque_range;
    const double error = std::min(limit / 2 / std::max(kd, 1e-3), 2 * pair.drive.velocity_range);
    const double slack =
        kQuantum * (kd * 2 * pair.drive.velocity_range + pair.drive.kd_range * error + 2 * limit) * 1.1;
    RC_ASSERT(std::abs(torque_felt(pair, sent, 0, v - error) - kd * error) <= slack);
  }));
}

TEST(RobstrideCodec, TheDriveFeelsTorqueWithinOneQuantum) {
  EXPECT_TRUE(rc::check([] {
    Pair pair(*rc::gen::inRange<std::size_t>(0, config::kRobstridePresets.size()));
    const RobstrideRange& r = pair.range;
    const RobstrideCommand sent{draw(r.p, false), draw(r.v, false), 0, 0, draw(r.t, false)};
    RC_ASSERT(std::abs(torque_felt(pair, sent, 0, 0) - inside(sent.t, -r.t, r.t)) <=
              kQuantum * 2 * pair.drive.torque_range);
  }));
}

TEST(RobstrideCodec, TheHostReadsWhatTheDriveMeasuredWithinOneQuantum) {
  EXPECT_TRUE(rc::check([] {
    const std::size_t model = *rc::gen::inRange<std::size_t>(0, config::kRobstridePresets.size());
    Pair pair(model);
    const double p = static_cast<double>(draw(pair.range.p, false)), v = static_cast<double>(draw(pair.range.v, false));
    simulation::Frames said;
    pair.device->update({p, v}, MonoTime{1}, milliseconds(1), said);
    pair.device->receive(encode_robstride_stop(kAddress, false), MonoTime{1}, said);
    RC_ASSERT(said.size() == 1U);
    const auto feedback = decode_robstride_feedback(pair.range, said[0]);
    RC_ASSERT(feedback.has_value());
    const auto near = [](float seen, double was, double limit) {
      return std::abs(static_cast<double>(seen) - std::clamp(was, -limit, limit)) <= 2 * limit / 65535 * 1.02;
    };
    RC_ASSERT(near(feedback->p, p, pair.drive.position_range));
    RC_ASSERT(near(feedback->v, v, pair.drive.velocity_range));
    RC_ASSERT(near(feedback->t, 0, pair.drive.torque_range));
    RC_ASSERT(std::abs(feedback->temperature_C - 25) < 0.11F);
  }));
}

}  // namespace
}  // namespace takt::drivers
