// SPDX-License-Identifier: Apache-2.0
// Goal: CANopen frames are exact to the byte, every statusword is read as CiA 402 says, and nothing that arrives can
// hurt. Method: bytes written out by hand from CiA 301's and 402's tables; all 65536 statuswords against bit patterns
// as the standard prints them; frames of every kind and length thrown at the decoders.
#include "drivers/protocol/cia402/cia402_codec.hpp"

#include <gtest/gtest.h>

#include "tests/drivers/protocol/cia402/cia402_frames.hpp"

namespace takt::drivers::cia402 {
namespace {

using config::Cia402Mode;
using test::text;

CanFrame frame_of(std::initializer_list<int> bytes) {
  CanFrame frame;
  for (const int byte : bytes) frame.data[frame.length++] = static_cast<std::uint8_t>(byte);
  return frame;
}

TEST(Cia402Codec, NmtAndSync) {
  EXPECT_EQ(text(encode_nmt(NmtCommand::start, 5)), "000#0105");
  EXPECT_EQ(text(encode_nmt(NmtCommand::stop, 5)), "000#0205");
  EXPECT_EQ(text(encode_nmt(NmtCommand::pre_operational, 127)), "000#807f");
  EXPECT_EQ(text(encode_nmt(NmtCommand::reset_node, 1)), "000#8101");
  EXPECT_EQ(text(encode_nmt(NmtCommand::reset_communication, 1)), "000#8201");
  EXPECT_EQ(text(encode_sync()), "080#");
}

TEST(Cia402Codec, SdoRequests) {
  EXPECT_EQ(text(encode_sdo_write(5, {0x6060, 0}, 10, 1)), "605#2f6060000a000000") << "the published vector";
  EXPECT_EQ(text(encode_sdo_write(5, {0x1017, 0}, 100, 2)), "605#2b17100064000000");
  EXPECT_EQ(text(encode_sdo_write(5, {0x1234, 7}, 0xAABBCC, 3)), "605#27341207ccbbaa00");
  EXPECT_EQ(text(encode_sdo_write(5, {0x1400, 1}, 0x80000205, 4)), "605#2300140105020080");
  EXPECT_EQ(text(encode_sdo_read(5, {0x6076, 0})), "605#4076600000000000");
}

TEST(Cia402Codec, SdoAnswers) {
  struct Row {
    const char* when;
    CanFrame frame;
    SdoAnswer::Kind kind;
    ObjectId object;
    std::uint32_t value;
  };
  using Kind = SdoAnswer::Kind;
  const Row rows[] = {
      {"written", frame_of({0x60, 0x60, 0x60, 0, 0, 0, 0, 0}), Kind::written, {0x6060, 0}, 0},
      {"one byte, the rest is noise", frame_of({0x4F, 0x61, 0x60, 0, 0x0A, 9, 9, 9}), Kind::value, {0x6061, 0}, 10},
      {"two bytes", frame_of({0x4B, 0x17, 0x10, 0, 0x64, 1, 9, 9}), Kind::value, {0x1017, 0}, 0x164},
      {"three bytes", frame_of({0x47, 0, 0x20, 3, 1, 2, 3, 9}), Kind::value, {0x2000, 3}, 0x030201},
      {"without a size, as CiA 301 allows",
       frame_of({0x42, 0x61, 0x60, 0, 0x0A, 9, 9, 9}),
       Kind::value,
       {0x6061, 0},
       0x0909090A},
      {"four bytes", frame_of({0x43, 0, 0x10, 0, 0x92, 1, 2, 0}), Kind::value, {0x1000, 0}, 0x00020192},
      {"aborted", frame_of({0x80, 0, 0x14, 1, 0x30, 0, 9, 6}), Kind::aborted, {0x1400, 1}, 0x06090030},
  };
  for (const Row& row : rows) {
    const auto answer = decode_sdo_answer(row.frame);
    ASSERT_TRUE(answer) << row.when;
    EXPECT_EQ(answer->kind, row.kind) << row.when;
    EXPECT_EQ(answer->object, row.object) << row.when;
    EXPECT_EQ(answer->value, row.value) << row.when;
  }
  for (const int command : {0x40, 0x41}) {
    const auto segmented = decode_sdo_answer(frame_of({command, 0x0A, 0x10, 0, 9, 0, 0, 0}));
    ASSERT_TRUE(segmented);
    EXPECT_EQ(segmented->kind, Kind::segmented);
    EXPECT_EQ(segmented->object, (ObjectId{0x100A, 0}));
  }
  EXPECT_FALSE(decode_sdo_answer(frame_of({0x20, 0, 0, 0, 0, 0, 0, 0}))) << "segment of a write";
  EXPECT_FALSE(decode_sdo_answer(frame_of({0x60, 0x60, 0x60, 0}))) << "short";
}

// CiA 301, upload SDO segment: 000 toggle, how many of the seven bytes are none (3 bits), last.
TEST(Cia402Codec, SegmentsOfAnUpload) {
  EXPECT_EQ(text(encode_sdo_segment_request(5, false)), "605#6000000000000000");
  EXPECT_EQ(text(encode_sdo_segment_request(5, true)), "605#7000000000000000");
  EXPECT_EQ(text(encode_sdo_abort(5, {0x100A, 0})), "605#800a100000000008");
  const auto whole = decode_sdo_segment(frame_of({0x00, 1, 2, 3, 4, 5, 6, 7}));
  ASSERT_TRUE(whole);
  EXPECT_FALSE(whole->toggle);
  EXPECT_FALSE(whole->last);
  EXPECT_EQ(whole->length, 7U);
  EXPECT_EQ(whole->bytes, (std::array<std::uint8_t, 7>{1, 2, 3, 4, 5, 6, 7}));
  const auto last = decode_sdo_segment(frame_of({0x1B, 1, 2, 9, 9, 9, 9, 9}));
  ASSERT_TRUE(last);
  EXPECT_TRUE(last->toggle);
  EXPECT_TRUE(last->last);
  EXPECT_EQ(last->length, 2U);
  EXPECT_EQ(last->bytes, (std::array<std::uint8_t, 7>{1, 2}));
  EXPECT_FALSE(decode_sdo_segment(frame_of({0x20, 0, 0, 0, 0, 0, 0, 0})));
  EXPECT_FALSE(decode_sdo_segment(frame_of({0x00, 1, 2})));
}

TEST(Cia402Codec, CommandsOfEveryMode) {
  // The published vector of CST; the others from the maps' order and little-endian.
  EXPECT_EQ(text(encode_rpdo(Cia402Mode::cst, 5, 0x0F, -125)), "205#0f000a83ff");
  EXPECT_EQ(text(encode_rpdo(Cia402Mode::csp, 5, 0x0F, -2)), "205#0f0008feffffff");
  EXPECT_EQ(text(encode_rpdo(Cia402Mode::csv, 5, 0x80, 0x01020304)), "205#80000904030201");
  EXPECT_EQ(rpdo_bytes(Cia402Mode::cst), 5U);
  EXPECT_EQ(rpdo_bytes(Cia402Mode::csp), 7U);
  EXPECT_EQ(rpdo_bytes(Cia402Mode::csv), 7U);
}

// Goal: maps and frames agree: what the drive is told to expect is what is sent.
TEST(Cia402Codec, MapsAreAsLongAsTheFrames) {
  EXPECT_EQ(rpdo_map(Cia402Mode::cst), (PdoMap{0x60400010, 0x60600008, 0x60710010}));
  EXPECT_EQ(rpdo_map(Cia402Mode::csp), (PdoMap{0x60400010, 0x60600008, 0x607A0020}));
  EXPECT_EQ(rpdo_map(Cia402Mode::csv), (PdoMap{0x60400010, 0x60600008, 0x60FF0020}));
  const auto bytes = [](const PdoMap& map) {
    std::size_t bits = 0;
    for (const std::uint32_t entry : map) bits += entry & 0xFFU;
    return bits / 8;
  };
  for (const Cia402Mode mode : {Cia402Mode::csp, Cia402Mode::csv, Cia402Mode::cst}) {
    EXPECT_EQ(bytes(rpdo_map(mode)), rpdo_bytes(mode));
    EXPECT_EQ(encode_rpdo(mode, 1, 0, 0).length, rpdo_bytes(mode));
  }
  EXPECT_EQ(bytes(kTpdoMap), kTpdoBytes);
}

TEST(Cia402Codec, Reports) {
  const auto report = decode_tpdo(frame_of({0x37, 0x12, 0xFE, 0xFF, 0xFF, 0xFF, 0x83, 0xFF}));
  ASSERT_TRUE(report);
  EXPECT_EQ(report->statusword, 0x1237);
  EXPECT_EQ(report->position, -2);
  EXPECT_EQ(report->torque, -125);
  EXPECT_FALSE(decode_tpdo(frame_of({0x37, 0x12}))) << "a drive with its default map";
}

TEST(Cia402Codec, HeartbeatsAndEmergencies) {
  EXPECT_EQ(decode_heartbeat(frame_of({0})), NmtState::boot);
  EXPECT_EQ(decode_heartbeat(frame_of({4})), NmtState::stopped);
  EXPECT_EQ(decode_heartbeat(frame_of({5})), NmtState::operational);
  EXPECT_EQ(decode_heartbeat(frame_of({127})), NmtState::pre_operational);
  EXPECT_FALSE(decode_heartbeat(frame_of({1})));
  EXPECT_FALSE(decode_heartbeat(frame_of({0x85}))) << "node guarding, toggle bit set";
  EXPECT_FALSE(decode_heartbeat(frame_of({})));
  const auto emergency = decode_emergency(frame_of({0x10, 0x23, 0x03, 1, 2, 3, 4, 5}));
  ASSERT_TRUE(emergency);
  EXPECT_EQ(emergency->code, 0x2310);
  EXPECT_EQ(emergency->error_register, 3);
  EXPECT_FALSE(decode_emergency(frame_of({0x10, 0x23, 0x03})));
}

TEST(Cia402Codec, OtherKindsOfFrameAreNothing) {
  const auto refused = [](auto spoil) {
    CanFrame eight = frame_of({0x60, 0, 0, 0, 0, 0, 0, 0}), one = frame_of({5});
    spoil(eight);
    spoil(one);
    return !decode_sdo_answer(eight) && !decode_tpdo(eight) && !decode_emergency(eight) && !decode_heartbeat(one);
  };
  EXPECT_TRUE(refused([](CanFrame& frame) { frame.extended = true; }));
  EXPECT_TRUE(refused([](CanFrame& frame) { frame.fd = true; }));
  EXPECT_TRUE(refused([](CanFrame& frame) { frame.remote = true; }));
  EXPECT_TRUE(refused([](CanFrame& frame) { frame.error = true; }));
  for (std::uint8_t length = 0; length <= 64; ++length) {
    CanFrame frame;
    frame.length = length;
    frame.fd = length > 8;
    EXPECT_EQ(decode_tpdo(frame).has_value(), length == 8) << int{length};
    EXPECT_EQ(decode_emergency(frame).has_value(), length == 8) << int{length};
    EXPECT_EQ(decode_heartbeat(frame).has_value(), length == 1) << int{length};
  }
}

// As CiA 402 prints them, bit 6 first: x does not matter. Bit 4 is never looked at.
struct Printed {
  PowerState state;
  const char* bits_6_to_0;
};
constexpr Printed kPrinted[] = {
    {PowerState::not_ready, "0xx0000"},
    {PowerState::switch_on_disabled, "1xx0000"},
    {PowerState::ready, "01x0001"},
    {PowerState::switched_on, "01x0011"},
    {PowerState::operation_enabled, "01x0111"},
    {PowerState::quick_stop, "00x0111"},
    {PowerState::fault_reaction, "0xx1111"},
    {PowerState::fault, "0xx1000"},
};

TEST(Cia402Codec, EveryStatuswordIsOneStateOrNone) {
  std::size_t undefined = 0;
  for (unsigned word = 0; word <= 0xFFFF; ++word) {
    PowerState expected = PowerState::undefined;
    for (const Printed& printed : kPrinted) {
      bool fits = true;
      for (unsigned bit = 0; bit < 7; ++bit) {
        const char wanted = printed.bits_6_to_0[6 - bit];
        fits &= wanted == 'x' || (wanted == '1') == ((word >> bit & 1U) != 0);
      }
      if (!fits) continue;
      ASSERT_EQ(expected, PowerState::undefined) << "two patterns fit " << word;
      expected = printed.state;
    }
    ASSERT_EQ(power_state(static_cast<std::uint16_t>(word)), expected) << std::hex << word;
    undefined += expected == PowerState::undefined;
  }
  // 128 combinations of bits 6..0: 4 + 4 + 2 + 2 + 2 + 2 + 4 + 4 are states, 104 are not; times 2^9 for the rest.
  EXPECT_EQ(undefined, 104U * 512U);
}

TEST(Cia402Codec, OneStepUpFromEachState) {
  struct Row {
    PowerState state;
    int controlword;
  };
  constexpr Row kRows[] = {
      {PowerState::not_ready, 0x00},
      {PowerState::switch_on_disabled, 0x06},
      {PowerState::ready, 0x07},
      {PowerState::switched_on, 0x0F},
      {PowerState::operation_enabled, 0x0F},
      {PowerState::quick_stop, 0x00},
      {PowerState::fault_reaction, 0x00},
      {PowerState::fault, 0x00},
      {PowerState::undefined, 0x00},
  };
  for (const Row& row : kRows) EXPECT_EQ(step_up(row.state), row.controlword) << static_cast<int>(row.state);
}

}  // namespace
}  // namespace takt::drivers::cia402
