// SPDX-License-Identifier: Apache-2.0
// Goal: every message of an MTi is found once and read as its maker means it, whatever surrounds it; what is damaged is
// none, and what is missing is named. Method: bytes of an encoder written from the protocol's description; garbage,
// splits and damage drawn from seeds.
#include "sensors/imu/mtdata2.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <random>

#include "tests/sensors/imu/mti_encoder.hpp"

namespace takt::sensors {
namespace {

using test::Bytes;

constexpr MonoTime kNow{5'000'000'000};

std::vector<MtMessage> messages_of(const Bytes& bytes) {
  return MtStream().take(bytes, kNow);
}

TEST(MtStream, ReadsThePublishedExample) {
  // GoToConfig and its acknowledgement, as the protocol's documentation prints them.
  const auto found = messages_of({0xFA, 0xFF, 0x30, 0x00, 0xD1, 0xFA, 0xFF, 0x31, 0x00, 0xD0});
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].id, 0x30);
  EXPECT_EQ(found[1].id, 0x31);
  EXPECT_TRUE(found[0].data.empty());
}

TEST(MtStream, RefusesEveryDamagedByte) {
  const Bytes whole = test::message(kMtData2, test::mtdata2({}));
  for (std::size_t i = 0; i < whole.size(); ++i) {
    Bytes damaged = whole;
    damaged[i] ^= 0x10;
    EXPECT_TRUE(messages_of(damaged).empty()) << "byte " << i;
  }
}

TEST(MtStream, FindsEveryMessageAmongGarbageHoweverItIsCut) {
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    std::mt19937_64 random(seed);
    Bytes bytes;
    std::vector<Bytes> sent;
    for (int i = 0; i < 20; ++i) {
      for (std::uint64_t garbage = random() % 40; garbage > 0; --garbage)
        bytes.push_back(static_cast<std::uint8_t>(random() % 0xFA));  // begins no message
      Bytes data(random() % (i % 5 == 0 ? 2049 : 200));
      for (std::uint8_t& byte : data) byte = static_cast<std::uint8_t>(random());
      const Bytes whole = test::message(static_cast<std::uint8_t>(random()), data);
      bytes.insert(bytes.end(), whole.begin(), whole.end());
      sent.push_back(data);
    }
    MtStream stream;
    std::vector<MtMessage> found;
    for (std::size_t at = 0; at < bytes.size();) {
      const std::size_t part = std::min<std::size_t>(1 + random() % 100, bytes.size() - at);
      for (MtMessage& message : stream.take(std::span(bytes).subspan(at, part), kNow)) found.push_back(message);
      at += part;
    }
    ASSERT_EQ(found.size(), sent.size()) << "seed " << seed;
    for (std::size_t i = 0; i < sent.size(); ++i) ASSERT_EQ(found[i].data, sent[i]) << "seed " << seed;
  }
}

TEST(MtStream, RandomBytesHoldNoMessageThatIsNotThere) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    std::mt19937_64 random(seed);
    Bytes bytes(4000);
    constexpr std::uint8_t kLikely[] = {0xFA, 0xFF, 0x36, 0x00};
    for (std::uint8_t& byte : bytes)
      byte = random() % 3 == 0 ? kLikely[random() % 4] : static_cast<std::uint8_t>(random());
    auto from = bytes.begin();
    for (const MtMessage& message : messages_of(bytes)) {
      std::optional<Bytes::iterator> end;
      for (const bool has_long_length : {false, true}) {
        if (!has_long_length && message.data.size() > 254) continue;
        const Bytes whole = test::message(message.id, message.data, has_long_length);
        const auto at = std::search(from, bytes.end(), whole.begin(), whole.end());
        if (at == bytes.end()) continue;
        const auto behind = at + static_cast<std::ptrdiff_t>(whole.size());
        end = end ? std::min(*end, behind) : behind;
      }
      ASSERT_TRUE(end) << "seed " << seed;
      from = *end;
    }
  }
}

TEST(MtStream, AfterAFalseBeginningItLooksOnFromTheNextByte) {
  Bytes bytes{0xFA, 0xFF, 0x36, 0x02};  // promises two bytes and a checksum, and is cut off by a whole message
  const Bytes whole = test::message(kMtData2, test::mtdata2({.counter = 7}));
  bytes.insert(bytes.end(), whole.begin(), whole.end());
  MtStream stream;
  const auto found = stream.take(bytes, kNow);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(parse_mtdata2(found[0].data)->counter, 7);
  EXPECT_EQ(stream.counts().bad_checksums, 1U);
  EXPECT_EQ(stream.counts().skipped, 4U);
}

TEST(MtStream, AMessageIsAsOldAsItsFirstByte) {
  const Bytes whole = test::message(kMtData2, test::mtdata2({}));
  MtStream stream;
  EXPECT_TRUE(stream.take(std::span(whole).first(1), kNow).empty());
  const auto found = stream.take(std::span(whole).subspan(1), kNow + milliseconds(3));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].first_byte.at, kNow);
}

TEST(MtData2, IsReadAsItsMakerMeansIt) {
  const auto read = parse_mtdata2(test::mtdata2({.counter = 0xABCD,
                                                 .ticks = 0x12345678,
                                                 .q = {0.5F, -0.5F, 0.5F, 0.25F},
                                                 .rate = {1, -2, 3},
                                                 .acceleration = {-1, 0.5F, 9.75F}}));
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->counter, 0xABCD);
  EXPECT_EQ(read->ticks, 0x12345678U);
  EXPECT_EQ(read->rotation, (std::array{0.5, -0.5, 0.5, 0.25}));
  EXPECT_EQ(read->angular_velocity, (std::array{1.0, -2.0, 3.0}));
  EXPECT_EQ(read->acceleration, (std::array{-1.0, 0.5, 9.75}));
}

// The same with one item's identifier changed.
Bytes with_id(unsigned from, unsigned to) {
  Bytes data = test::mtdata2({});
  const Bytes was{static_cast<std::uint8_t>(from >> 8U), static_cast<std::uint8_t>(from)};
  const auto at = std::search(data.begin(), data.end(), was.begin(), was.end());
  at[0] = static_cast<std::uint8_t>(to >> 8U);
  at[1] = static_cast<std::uint8_t>(to);
  return data;
}

TEST(MtData2, DoublesAndNorthWestUpAreFineToo) {
  EXPECT_TRUE(parse_mtdata2(with_id(0x2010, 0x2018)));
  Bytes data;
  test::add_big(data, 0x102002, 3);
  test::add_big(data, 9, 2);
  test::add_big(data, 0x106004, 3);
  test::add_big(data, 8, 4);
  const float q[] = {0, 1, 0, 0}, v[] = {0.25F, 2, -3};
  test::add_item<double>(data, 0x2013, q, 4);
  test::add_item<double>(data, 0x8023, v, 3);
  test::add_item<double>(data, 0x4023, v, 3);
  const auto read = parse_mtdata2(data);
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->rotation, (std::array{0.0, 1.0, 0.0, 0.0}));
  EXPECT_EQ(read->angular_velocity, (std::array{0.25, 2.0, -3.0}));
}

TEST(MtData2, WhatThePartHasToBeToldIsSaid) {
  const auto said = [](const Bytes& data) {
    const auto read = parse_mtdata2(data);
    return read ? std::string("nothing") : read.error();
  };
  EXPECT_NE(said(with_id(0x1020, 0x1010)).find("Packet Counter"), std::string::npos);
  EXPECT_NE(said(with_id(0x1060, 0x1070)).find("Sample Time Fine"), std::string::npos);
  EXPECT_NE(said(with_id(0x2010, 0x2030)).find("Quaternion"), std::string::npos);
  EXPECT_NE(said(with_id(0x4020, 0x4030)).find("Acceleration"), std::string::npos);
  EXPECT_NE(said(with_id(0x8020, 0x8030)).find("Rate of Turn"), std::string::npos);
  EXPECT_NE(said(with_id(0x2010, 0x2014)).find("NED"), std::string::npos);
  EXPECT_NE(said(with_id(0x8020, 0x8021)).find("floating point"), std::string::npos);
  Bytes cut = test::mtdata2({});
  cut.pop_back();
  EXPECT_NE(said(cut).find("cut off"), std::string::npos);
}

}  // namespace
}  // namespace takt::sensors
