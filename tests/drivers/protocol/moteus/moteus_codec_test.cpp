// SPDX-License-Identifier: Apache-2.0
// Goal: the register codec is exact to the byte for every value type, stays inside its buffers, and nothing that
// arrives can hurt it. Method: the vectors of mjbots/moteus docs/protocol/can.md, step sizes of
// docs/protocol/registers.md, a reader of the test's own, and random bytes thrown at the decoder.
#include "drivers/protocol/moteus/moteus_codec.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <array>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "tests/drivers/bus/frame_text.hpp"

namespace takt::drivers {
namespace {

using Type = MoteusType;
using Reg = MoteusRegister;

std::string written(auto&& write) {
  CanFrame frame;
  MoteusWriter writer(frame.data);
  write(writer);
  frame.length = static_cast<std::uint8_t>(writer.finish());
  return test::hex(frame);
}

std::string one(Type type, Reg reg, std::vector<float> values) {
  return written([&](MoteusWriter& writer) { EXPECT_TRUE(writer.write(type, reg, values)); });
}

std::vector<MoteusReader::Value> values_of(std::string_view bytes, bool malformed = false) {
  const CanFrame frame = test::frame_of(0x100, bytes, true);
  MoteusReader reader(std::span(frame.data, frame.length));
  std::vector<MoteusReader::Value> values;
  for (MoteusReader::Value value; reader.next(value);) values.push_back(value);
  EXPECT_EQ(reader.malformed(), malformed) << bytes;
  return values;
}

TEST(MoteusCodec, WritesTheDocumentedCommand) {
  const std::string bytes = written([](MoteusWriter& writer) {
    writer.write(Type::int8, Reg::mode, std::array{10.0F});
    // 96 steps, 288 steps, -176 steps of int16.
    writer.write(Type::int16, Reg::command_position, std::array{0.0096F, 0.072F, -1.76F});
    writer.read(Type::int16, Reg::mode, 4);
    writer.read(Type::int8, Reg::voltage, 3);
  });
  EXPECT_EQ(bytes, "01000a07206000200150ff140400130d");
}

TEST(MoteusCodec, ReadsTheDocumentedReply) {
  const auto values = values_of("2404000a005000000170ff230d181400");
  struct Row {
    std::uint32_t reg;
    float value;
  };
  const Row rows[] = {{0x000, 10},    {0x001, 0.008F}, {0x002, 0.064F}, {0x003, -1.44F},
                      {0x00D, 12.0F}, {0x00E, 20},     {0x00F, 0}};
  ASSERT_EQ(values.size(), std::size(rows));
  for (std::size_t i = 0; i < values.size(); ++i) {
    EXPECT_EQ(values[i].reg, rows[i].reg);
    EXPECT_NEAR(values[i].value, rows[i].value, 1e-6) << i;
  }
}

TEST(MoteusCodec, EveryTypeOfEveryQuantity) {
  // One step of each integer type, from registers.md; then the float itself (1.0 is 3f800000).
  struct Row {
    Reg reg;
    float int8, int16, int32;
  };
  const Row rows[] = {{Reg::command_position, 0.01F, 1e-4F, 1e-5F},
                      {Reg::command_velocity, 0.1F, 2.5e-4F, 1e-5F},
                      {Reg::feedforward_torque, 0.5F, 0.01F, 1e-3F},
                      {Reg::kp_scale, 1 / 127.0F, 1 / 32767.0F, 1e-9F},
                      {Reg::watchdog_timeout, 0.01F, 1e-3F, 1e-6F},
                      {Reg::acceleration_limit, 0.05F, 1e-3F, 1e-5F},
                      {Reg::maximum_torque, 0.5F, 0.01F, 1e-3F},
                      {Reg::q_current, 1, 0.1F, 1e-3F},
                      {Reg::voltage, 0.5F, 0.1F, 1e-3F},
                      {Reg::temperature, 1, 0.1F, 1e-3F},
                      {Reg::power, 10, 0.05F, 1e-4F},
                      {Reg::mode, 1, 1, 1}};
  for (const Row& row : rows) {
    char reg[8];
    std::snprintf(reg, sizeof reg, "%02x", static_cast<unsigned>(row.reg) & 0xFFU);
    EXPECT_EQ(one(Type::int8, row.reg, {3 * row.int8}), "01" + std::string(reg) + "03");
    EXPECT_EQ(one(Type::int16, row.reg, {-2 * row.int16}), "05" + std::string(reg) + "feff");
    if (row.reg != Reg::kp_scale) {
      EXPECT_EQ(one(Type::int32, row.reg, {300 * row.int32}), "09" + std::string(reg) + "2c010000");
    }
    EXPECT_EQ(one(Type::float32, row.reg, {1}), "0d" + std::string(reg) + "0000803f");
  }
  EXPECT_EQ(one(Type::int32, Reg::kp_scale, {1}), "0923ffffff7f") << "all of it";
}

TEST(MoteusCodec, IntegersSaturateAndKeepTheLowestForNoValue) {
  EXPECT_EQ(one(Type::int16, Reg::command_position, {1e9F}), "0520ff7f");
  EXPECT_EQ(one(Type::int16, Reg::command_position, {-1e9F}), "05200180") << "-32767, not -32768";
  EXPECT_EQ(one(Type::int16, Reg::command_position, {NAN}), "05200080");
  EXPECT_EQ(one(Type::int8, Reg::command_position, {-INFINITY}), "012081");
  EXPECT_EQ(one(Type::int32, Reg::command_position, {INFINITY}), "0920ffffff7f");
  EXPECT_TRUE(std::isnan(values_of("25010080").at(0).value)) << "read back likewise";
}

TEST(MoteusCodec, LongCountsAreAVaruint) {
  EXPECT_EQ(one(Type::int8, Reg::command_position, {0, 0, 0, 0}), "00042000000000");
  EXPECT_EQ(written([](MoteusWriter& writer) { writer.read(Type::float32, Reg::mode, 16); }), "1c1000");
}

TEST(MoteusCodec, PadsToLegalLengthsOnly) {
  const std::size_t legal[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
  for (std::size_t bytes = 0; bytes <= 64; ++bytes)
    EXPECT_EQ(fd_length(bytes), *std::lower_bound(std::begin(legal), std::end(legal), bytes));
  EXPECT_EQ(one(Type::int8, Reg::mode, {0, 0, 0, 0, 0, 0}), "000600000000000000505050");
}

TEST(MoteusCodec, AFullBufferIsLeftAsItIs) {
  std::array<std::uint8_t, 8> small{};
  MoteusWriter writer(small);
  EXPECT_TRUE(writer.write(Type::float32, Reg::command_position, std::array{1.0F}));
  EXPECT_FALSE(writer.write(Type::int8, Reg::mode, std::array{1.0F})) << "needs three, has two";
  EXPECT_TRUE(writer.read(Type::int8, Reg::mode, 1));
  EXPECT_FALSE(writer.read(Type::int8, Reg::mode, 1));
  EXPECT_FALSE(writer.write(Type::int8, Reg::mode, {}));
  EXPECT_EQ(writer.finish(), 8U);
  EXPECT_EQ(small, (std::array<std::uint8_t, 8>{0x0d, 0x20, 0, 0, 0x80, 0x3f, 0x11, 0x00}));
}

TEST(MoteusCodec, RefusesWhatIsNoReply) {
  for (const char* bytes : {"01000a", "1404", "2404000a00", "24", "2404", "20ffffffffff00", "208080808080", "2f0100",
                            "60", "ff", "30", "3180", "20ffffffff0f00"})
    EXPECT_TRUE(values_of(bytes, true).empty()) << bytes;
  EXPECT_EQ(values_of("21000a24", true).size(), 1U) << "what came before was sound";
  EXPECT_TRUE(values_of("5050505050").empty()) << "padding is no reply, and no offence";
  EXPECT_TRUE(values_of("200000").empty()) << "no registers";
}

TEST(MoteusCodec, ErrorsAreCountedAndSkipped) {
  const CanFrame frame = test::frame_of(0x100,
                                        "3028073129082100"
                                        "0a",
                                        true);
  MoteusReader reader(std::span(frame.data, frame.length));
  MoteusReader::Value value;
  ASSERT_TRUE(reader.next(value));
  EXPECT_EQ(value.value, 10);
  EXPECT_EQ(reader.reported_errors(), 2U);
  EXPECT_FALSE(reader.malformed());
}

// Reads one written value as a drive would, with arithmetic of its own.
double read_back(const std::string& bytes, Type type, double step) {
  std::uint64_t raw = 0;
  const std::size_t size = type == Type::int8 ? 1 : type == Type::int16 ? 2 : 4;
  for (std::size_t i = 0; i < size; ++i)
    raw |= std::uint64_t{static_cast<std::uint64_t>(std::stoi(bytes.substr(4 + 2 * i, 2), nullptr, 16))} << 8 * i;
  if (type == Type::float32) {
    float value = 0;
    std::memcpy(&value, &raw, 4);
    return double{value};
  }
  const auto modulus = static_cast<double>(1ULL << 8 * size);
  const auto number = static_cast<double>(raw);
  return (number >= modulus / 2 ? number - modulus : number) * step;
}

TEST(MoteusCodec, WhatTheDriveReadsIsWithinHalfAStep) {
  EXPECT_TRUE(rc::check([](std::int16_t tenths) {
    const Type type = *rc::gen::element(Type::int8, Type::int16, Type::int32, Type::float32);
    const float limit = type == Type::int8 ? 1.2F : 3.2F;  // rev, inside the type's span
    const float wanted = static_cast<float>(tenths) / 32768.0F * limit;
    const double step = type == Type::int8 ? 0.01 : type == Type::int16 ? 1e-4 : type == Type::int32 ? 1e-5 : 0;
    const double read = read_back(one(type, Reg::command_position, {wanted}), type, step);
    RC_ASSERT(std::abs(read - static_cast<double>(wanted)) <= 0.5001 * step);
  }));
}

TEST(MoteusCodec, AMillionRandomPayloadsEndInTime) {
  std::mt19937_64 random(20260101);
  std::array<std::uint8_t, 64> bytes;
  for (int i = 0; i < 1'000'000; ++i) {
    const std::uint64_t shape = random();
    const std::size_t length = shape % 65;
    for (std::size_t at = 0; at < length; ++at) bytes[at] = static_cast<std::uint8_t>(random());
    if ((shape & 0x100U) != 0 && length > 0) bytes[0] = static_cast<std::uint8_t>(0x20U | (bytes[0] & 0x0FU));
    MoteusReader reader(std::span(bytes.data(), length));
    std::size_t values = 0;
    for (MoteusReader::Value value; reader.next(value);) ASSERT_LE(++values, 64U);
  }
}

}  // namespace
}  // namespace takt::drivers
