// SPDX-License-Identifier: Apache-2.0
// Goal: the CANSimple codec is exact to the byte, and nothing that arrives can hurt it.
// Method: vectors from published layouts (ODriveArduino src/can_simple_messages.hpp) worked out by hand, a reader of
// the test's own, and frames of every kind and length thrown at the decoder.
#include "drivers/protocol/odrive/odrive_codec.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>
#include <cstring>

#include "tests/drivers/bus/frame_text.hpp"

namespace takt::drivers {
namespace {

using test::frame_of;
using test::hex;

TEST(OdriveCodec, EncodesThePublishedVectors) {
  struct Row {
    const char* when;
    CanFrame frame;
    std::uint32_t id;
    const char* bytes;
  };
  const Row rows[] = {
      {"position 1.5 turn with velocity -0.25 and torque 1.2", odrive_input_pos(3, 1.5F, -0.25F, 1.2F), 0x06C,
       "0000c03f06ffb004"},
      {"torque -0.75 Nm", odrive_input_torque(3, -0.75F), 0x06E, "000040bf"},
      {"closed loop", odrive_set_axis_state(3, 8), 0x067, "08000000"},
      {"idle", odrive_set_axis_state(3, 1), 0x067, "01000000"},
      // From the same layouts: 2.0 is 40000000, 0.5 is 3f000000, 20 is 41a00000, low byte first.
      {"torque control, passthrough", odrive_controller_mode(3, 1, 1), 0x06B, "0100000001000000"},
      {"velocity", odrive_input_vel(3, 2.0F, 0.5F), 0x06D, "000000400000003f"},
      {"limits", odrive_limits(3, 2.0F, 20.0F), 0x06F, "000000400000a041"},
      {"a place: the second half means nothing", odrive_set_absolute_position(3, 2.0F), 0x079, "0000004000000000"},
      {"clear errors, do not blink", odrive_clear_errors(3), 0x078, "00"},
      {"emergency stop has no data", odrive_estop(3), 0x062, ""},
      {"the lowest node", odrive_input_torque(0, 0), 0x00E, "00000000"},
      {"the highest node", odrive_input_torque(63, 0), 0x7EE, "00000000"},
  };
  for (const Row& row : rows) {
    EXPECT_EQ(row.frame.id, row.id) << row.when;
    EXPECT_EQ(hex(row.frame), row.bytes) << row.when;
    EXPECT_FALSE(row.frame.extended || row.frame.fd || row.frame.remote) << row.when;
  }
}

TEST(OdriveCodec, FeedForwardSaturatesAndNeverWraps) {
  EXPECT_EQ(hex(odrive_input_pos(0, 0, 1e9F, -1e9F)), "00000000ff7f0080");
  EXPECT_EQ(hex(odrive_input_pos(0, 0, std::nanf(""), INFINITY)), "000000000000ff7f");
}

// Reads as a drive would: the payload as one little-endian number, cut by start bit and length.
template <typename To>
To field(const CanFrame& frame, unsigned start, unsigned bits) {
  std::uint64_t word = 0;
  for (unsigned i = 0; i < 8; ++i) word |= std::uint64_t{frame.data[i]} << 8 * i;
  const std::uint64_t raw = word >> start & (bits == 64 ? ~0ULL : (1ULL << bits) - 1);
  To value;
  if constexpr (sizeof(To) == 4) {
    const auto narrow = static_cast<std::uint32_t>(raw);
    std::memcpy(&value, &narrow, 4);
  } else {
    const auto narrow = static_cast<std::uint16_t>(raw);
    std::memcpy(&value, &narrow, 2);
  }
  return value;
}

TEST(OdriveCodec, WhatTheDriveReadsIsWhatWasSent) {
  EXPECT_TRUE(rc::check([](std::int32_t a, std::int16_t b, std::int16_t c) {
    const float turns = static_cast<float>(a) / 65536.0F;
    const float velocity = static_cast<float>(b) * 0.9e-3F;
    const float torque = static_cast<float>(c) * 0.9e-3F;
    const std::uint32_t node = static_cast<std::uint32_t>(a) & 63U;
    const CanFrame pos = odrive_input_pos(node, turns, velocity, torque);
    RC_ASSERT(pos.id >> 5U == node);
    RC_ASSERT(field<float>(pos, 0, 32) == turns);
    RC_ASSERT(std::abs(static_cast<float>(field<std::int16_t>(pos, 32, 16)) * 1e-3F - velocity) <= 0.505e-3F);
    RC_ASSERT(std::abs(static_cast<float>(field<std::int16_t>(pos, 48, 16)) * 1e-3F - torque) <= 0.505e-3F);
    RC_ASSERT(field<float>(odrive_input_torque(node, torque), 0, 32) == torque);
    const CanFrame vel = odrive_input_vel(node, velocity, torque);
    RC_ASSERT(field<float>(vel, 0, 32) == velocity);
    RC_ASSERT(field<float>(vel, 32, 32) == torque);
  }));
}

TEST(OdriveCodec, DecodesReports) {
  const auto heartbeat = decode_odrive_heartbeat(3, frame_of(0x061, "0020000008030100"));
  ASSERT_TRUE(heartbeat);
  EXPECT_EQ(heartbeat->axis_error, 0x2000U) << "motor over-temperature";
  EXPECT_EQ(heartbeat->axis_state, 8);
  EXPECT_EQ(heartbeat->procedure_result, 3);
  EXPECT_TRUE(heartbeat->trajectory_done);
  EXPECT_FALSE(decode_odrive_heartbeat(3, frame_of(0x061, "00200000080300fe"))->trajectory_done) << "bit 48 only";

  const auto errors = decode_odrive_errors(3, frame_of(0x063, "0000000100000002"));
  ASSERT_TRUE(errors);
  EXPECT_EQ(errors->active, 0x0100'0000U);
  EXPECT_EQ(errors->disarm_reason, 0x0200'0000U);

  // 1.5 is 3fc00000, -0.25 is be800000.
  for (const auto message : {OdriveMessage::encoder_estimates, OdriveMessage::iq, OdriveMessage::temperature,
                             OdriveMessage::bus_voltage, OdriveMessage::torques}) {
    const auto pair = decode_odrive_pair(3, message, frame_of(odrive_id(3, message), "0000c03f000080be"));
    ASSERT_TRUE(pair);
    EXPECT_EQ(pair->first, 1.5F);
    EXPECT_EQ(pair->second, -0.25F);
  }
}

TEST(OdriveCodec, RefusesWhatIsNoReport) {
  const CanFrame good = frame_of(0x069, "0000c03f000080be");
  const auto decoded = [](const CanFrame& frame) {
    return decode_odrive_pair(3, OdriveMessage::encoder_estimates, frame).has_value();
  };
  ASSERT_TRUE(decoded(good));
  for (std::uint8_t length = 0; length < 8; ++length) {
    CanFrame shorter = good;
    shorter.length = length;
    EXPECT_FALSE(decoded(shorter)) << int{length};
  }
  for (bool CanFrame::*flag : {&CanFrame::extended, &CanFrame::fd, &CanFrame::remote, &CanFrame::error}) {
    CanFrame odd = good;
    odd.*flag = true;
    EXPECT_FALSE(decoded(odd));
  }
  for (const std::uint32_t id : {0x049U, 0x089U, 0x061U, 0x07CU}) {
    CanFrame other = good;
    other.id = id;
    EXPECT_FALSE(decoded(other)) << id;
  }
}

}  // namespace
}  // namespace takt::drivers
