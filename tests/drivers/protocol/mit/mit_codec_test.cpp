// SPDX-License-Identifier: Apache-2.0
// Goal: the MIT codec is exact to the byte, and nothing that arrives can hurt it.
// Method: published vectors worked out from the formulas in the protocol's sources, properties over random commands,
// and frames of every kind and length thrown at the decoder.
#include "drivers/protocol/mit/mit_codec.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "config/drive_presets.hpp"

namespace takt::drivers {
namespace {

MitRange preset(std::string_view model) {
  const config::DrivePreset* found = config::find_drive_preset(config::DriveProtocol::mit, model);
  return {static_cast<float>(found->position), static_cast<float>(found->velocity), static_cast<float>(found->kp),
          static_cast<float>(found->kd), static_cast<float>(found->torque)};
}

std::string hex(const MitPayload& payload) {
  std::string text;
  char two[3];
  for (const std::uint8_t byte : payload) {
    std::snprintf(two, sizeof two, "%02x", byte);
    text += two;
  }
  return text;
}

CanFrame frame_of(std::initializer_list<int> bytes) {
  CanFrame frame;
  frame.id = 0x11;
  for (const int byte : bytes) frame.data[frame.length++] = static_cast<std::uint8_t>(byte);
  return frame;
}

bool six_ff(const MitPayload& payload) {
  return std::all_of(payload.begin(), payload.end() - 2, [](std::uint8_t byte) { return byte == 0xFF; });
}

TEST(MitCodec, EncodesThePublishedVectors) {
  struct Row {
    const char* when;
    const char* model;
    MitCommand command;
    const char* bytes;
  };
  // Expectations: truncating float32 formula of bgkatz/motorcontrol math_ops.c, clamped first.
  const Row rows[] = {
      {"an AK command with every field set", "AK10-9", {1.0F, -2.0F, 100, 1.5F, 3.0F}, "8a3c7ad3334cc85e"},
      {"a Damiao command with every field set", "DM4310", {0.5F, 1.0F, 20, 0.5F, -2.0F}, "851e8430a3199666"},
      {"zero lies half a quantum below", "AK10-9", {}, "7fff7ff0000007ff"},
      {"everything at the lower end", "DM8009", {-12.5F, -45, 0, 0, -54}, "0000000000000000"},
      {"values far outside are clamped first", "DM8009", {-1e6F, -1e6F, -1, -1, -1e6F}, "0000000000000000"},
      {"only position saturated", "DM8009", {99, -45, 0, 0, -54}, "ffff000000000000"},
      {"only torque saturated", "DM8009", {-12.5F, -45, 0, 0, 54}, "0000000000000fff"},
  };
  for (const Row& row : rows) EXPECT_EQ(hex(encode_mit_command(preset(row.model), row.command)), row.bytes) << row.when;
}

TEST(MitCodec, SpecialFramesAreSevenFfAndTheirCode) {
  EXPECT_EQ(hex(encode_mit_special(MitSpecial::enter_motor_mode)), "fffffffffffffffc");
  EXPECT_EQ(hex(encode_mit_special(MitSpecial::exit_motor_mode)), "fffffffffffffffd");
  EXPECT_EQ(hex(encode_mit_special(MitSpecial::set_zero)), "fffffffffffffffe");
  EXPECT_EQ(hex(encode_mit_special(MitSpecial::clear_error)), "fffffffffffffffb");
}

TEST(MitCodec, ASaturatedCommandIsNeverASpecialFrame) {
  // Every torque near the top, so that the last byte passes through FB..FF, with all else saturated.
  const MitRange range = preset("DM4310");
  for (int code = 0xF00; code <= 0xFFF; ++code) {
    const float torque = (static_cast<float>(code) + 0.5F) * 2 * range.t / 4095.0F - range.t;
    const MitPayload payload = encode_mit_command(range, {1e9F, 1e9F, 1e9F, 1e9F, torque});
    EXPECT_FALSE(six_ff(payload)) << hex(payload);
    EXPECT_EQ(payload[7], std::min(code, 0xFFF) & 0xFF) << "torque itself is kept";
  }
}

TEST(MitCodec, NeverASpecialFrameWhateverTheCommand) {
  EXPECT_TRUE(rc::check([](float p, float v, float kp, float kd, float t) {
    const auto extreme = [](float x) { return *rc::gen::element(x, 1e9F, -1e9F, 12.5F, 5.0F, 500.0F, 45.0F, 54.0F); };
    const MitCommand command{extreme(p), extreme(v), extreme(kp), extreme(kd), extreme(t)};
    RC_ASSERT(!six_ff(encode_mit_command(preset("DM8009"), command)));
  }));
}

TEST(MitCodec, NotFiniteMeansNoStiffnessAndNoTorque) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  const MitRange range = preset("DM4310");
  const std::string limp = hex(encode_mit_command(range, {0, 0, 0, 2, 0}));
  EXPECT_EQ(hex(encode_mit_command(range, {nan, 1, 50, 2, 3})), limp);
  EXPECT_EQ(hex(encode_mit_command(range, {1, -inf, 50, 2, 3})), limp);
  EXPECT_EQ(hex(encode_mit_command(range, {1, 1, inf, 2, 3})), limp);
  EXPECT_EQ(hex(encode_mit_command(range, {1, 1, 50, 2, nan})), limp);
  EXPECT_EQ(hex(encode_mit_command(range, {1, 1, 50, nan, 3})), hex(encode_mit_command(range, {})));
}

// Reads a command as a drive would, with arithmetic of its own: one 64-bit big-endian word cut from the top.
MitCommand read_back(const MitRange& range, const MitPayload& payload) {
  std::uint64_t word = 0;
  for (const std::uint8_t byte : payload) word = word << 8U | byte;
  const auto field = [&word](double low, double high, unsigned bits) {
    const auto code = static_cast<double>(word >> (64U - bits));
    word <<= bits;
    return static_cast<float>(low + code * (high - low) / (std::pow(2.0, bits) - 1));
  };
  MitCommand command;
  command.p = field(-range.p, range.p, 16);
  command.v = field(-range.v, range.v, 12);
  command.kp = field(0, range.kp, 12);
  command.kd = field(0, range.kd, 12);
  command.t = field(-range.t, range.t, 12);
  return command;
}

TEST(MitCodec, WhatTheDriveReadsIsWithinOneQuantum) {
  EXPECT_TRUE(rc::check([](std::uint16_t a, std::uint16_t b, std::uint16_t c, std::uint16_t d, std::uint16_t e) {
    const std::size_t model = *rc::gen::inRange<std::size_t>(0, config::kMitPresets.size());
    MitRange range = preset(config::kMitPresets[model].model);
    if (range.v == config::kUnsettled) range.v = 45;
    if (range.t == config::kUnsettled) range.t = 24;
    const auto symmetric = [](std::uint16_t x, float limit) { return (static_cast<float>(x) / 32767.5F - 1) * limit; };
    const auto positive = [](std::uint16_t x, float limit) { return static_cast<float>(x) / 65535.0F * limit; };
    const MitCommand sent{symmetric(a, range.p), symmetric(b, range.v), positive(c, range.kp), positive(d, range.kd),
                          symmetric(e, range.t)};
    const MitCommand read = read_back(range, encode_mit_command(range, sent));
    const auto within = [](float x, float y, float span, float codes) {
      return std::abs(x - y) <= span / codes * 1.01F;
    };
    RC_ASSERT(within(sent.p, read.p, 2 * range.p, 65535));
    RC_ASSERT(within(sent.v, read.v, 2 * range.v, 4095));
    RC_ASSERT(within(sent.kp, read.kp, range.kp, 4095));
    RC_ASSERT(within(sent.kd, read.kd, range.kd, 4095));
    RC_ASSERT(within(sent.t, read.t, 2 * range.t, 4095));
  }));
}

TEST(MitCodec, DecodesASixByteReply) {
  // p 0x8A3C, v 0x7AD, t 0x85E of the first vector: 1.0 rad, -2.0 rad/s, 3.0 Nm, each within a quantum.
  const auto reply =
      decode_mit_reply(preset("AK10-9"), MitVariant::tmotor, frame_of({0x03, 0x8A, 0x3C, 0x7A, 0xD8, 0x5E}));
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->id, 3);
  EXPECT_NEAR(reply->p, 1.0, 4e-4);
  EXPECT_NEAR(reply->v, -2.0, 0.025);
  EXPECT_NEAR(reply->t, 3.0, 0.033);
  EXPECT_EQ(reply->status, 0);
}

TEST(MitCodec, DecodesAnEightByteTMotorReply) {
  const auto reply =
      decode_mit_reply(preset("AK10-9"), MitVariant::tmotor, frame_of({0x03, 0x8A, 0x3C, 0x7A, 0xD8, 0x5E, 65, 2}));
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, 2) << "over-current";
  EXPECT_EQ(reply->temperature_C, 25) << "unsigned, offset by 40";
  const auto temperature = [](int byte) {
    return decode_mit_reply(preset("AK10-9"), MitVariant::tmotor, frame_of({0x03, 0x80, 0, 0x80, 0x08, 0, byte, 0}))
        ->temperature_C;
  };
  EXPECT_EQ(temperature(0), -40);
  EXPECT_EQ(temperature(255), 215) << "no sign: the hottest, not one below freezing";
}

// The maker's manual of RS00, MIT protocol: the last two bytes are the temperature in 0.1 deg C.
TEST(MitCodec, DecodesARobstrideReply) {
  const MitRange rs00{12.57F, 33, 500, 5, 14};
  const auto reply_at = [&rs00](int high, int low) {
    return decode_mit_reply(rs00, MitVariant::robstride, frame_of({0x7F, 0x8A, 0x3C, 0x7A, 0xD8, 0x5E, high, low}));
  };
  const auto reply = reply_at(0x00, 0xFA);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->id, 0x7F);
  EXPECT_NEAR(reply->p, 1.0, 6e-3);
  EXPECT_NEAR(reply->v, -1.32, 0.02);
  EXPECT_NEAR(reply->t, 0.647, 0.007);
  EXPECT_EQ(reply->status, 0);
  EXPECT_EQ(reply->temperature_C, 25);
  EXPECT_EQ(reply_at(0x01, 0x2C)->temperature_C, 30);
  EXPECT_EQ(reply_at(0xFF, 0x9C)->temperature_C, -10) << "signed";
}

// The maker's AK manual: V3 firmware and servo mode report with 29-bit ids, 0x29 in front of the drive's number.
TEST(MitCodec, KnowsTheOtherAkProtocolBySight) {
  CanFrame frame = frame_of({0x0A, 0x3C, 0x00, 0x10, 0x00, 0x20, 35, 0});
  frame.extended = true;
  frame.id = 0x2903;
  EXPECT_TRUE(is_ak_v3_feedback(3, frame));
  EXPECT_FALSE(is_ak_v3_feedback(4, frame)) << "another drive's";
  frame.extended = false;
  EXPECT_FALSE(is_ak_v3_feedback(3, frame));
}

TEST(MitCodec, DecodesADamiaoReply) {
  const auto reply =
      decode_mit_reply(preset("DM4310"), MitVariant::damiao, frame_of({0xB4, 0x85, 0x1E, 0x84, 0x36, 0x66, 35, 48}));
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->id, 4);
  EXPECT_EQ(reply->status, 0xB) << "MOS temperature";
  EXPECT_NEAR(reply->p, 0.5, 4e-4);
  EXPECT_NEAR(reply->v, 1.0, 0.015);
  EXPECT_NEAR(reply->t, -2.0, 0.005);
  EXPECT_EQ(reply->temperature_C, 48);
}

TEST(MitCodec, RefusesWhatIsNoReply) {
  const MitRange range = preset("DM4310");
  CanFrame good = frame_of({0x14, 0, 0, 0, 0, 0, 30, 30});
  ASSERT_TRUE(decode_mit_reply(range, MitVariant::damiao, good));
  for (std::uint8_t length = 0; length <= 7; ++length) {
    CanFrame shorter = good;
    shorter.length = length;
    EXPECT_FALSE(decode_mit_reply(range, MitVariant::damiao, shorter)) << int{length};
    EXPECT_FALSE(decode_mit_reply(range, MitVariant::robstride, shorter)) << int{length};
    EXPECT_EQ(decode_mit_reply(range, MitVariant::tmotor, shorter).has_value(), length == 6) << int{length};
  }
  for (bool CanFrame::*flag : {&CanFrame::extended, &CanFrame::fd, &CanFrame::remote, &CanFrame::error}) {
    CanFrame odd = good;
    odd.*flag = true;
    EXPECT_FALSE(decode_mit_reply(range, MitVariant::damiao, odd));
  }
}

TEST(MitCodec, AMillionRandomFramesDecodeToNumbersInRangeOrNothing) {
  std::mt19937_64 random(20260101);
  const MitRange range = preset("DM8009");
  for (int i = 0; i < 1'000'000; ++i) {
    CanFrame frame;
    const std::uint64_t bits = random();
    std::memcpy(frame.data, &bits, 8);
    const std::uint64_t shape = random();
    frame.length = static_cast<std::uint8_t>(shape % 65);
    frame.fd = frame.length > 8;
    frame.extended = (shape & 0x1000) != 0;
    constexpr std::array kVariants{MitVariant::tmotor, MitVariant::damiao, MitVariant::robstride};
    const auto variant = kVariants[(shape >> 13U) % kVariants.size()];
    const auto reply = decode_mit_reply(range, variant, frame);
    if (!reply) continue;
    ASSERT_LE(std::abs(reply->p), range.p * 1.0001F);
    ASSERT_LE(std::abs(reply->v), range.v * 1.0001F);
    ASSERT_LE(std::abs(reply->t), range.t * 1.0001F);
  }
}

}  // namespace
}  // namespace takt::drivers
