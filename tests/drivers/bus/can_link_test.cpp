// SPDX-License-Identifier: Apache-2.0
// Goal: what the kernel says of a CAN interface is read as ip-link(8) reads it, and contradictions with the robot file
// are named. Method: answers of a Linux 6.1 kernel to RTM_GETLINK, recorded of an SJA1000 that `ip link set can0 type
// can bitrate 500000 sample-point 0.875 sjw 2 restart-ms 100` had set up, and of a vcan (attributes of no interest left
// out); each cut off anywhere.
#include "drivers/bus/can_link.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <vector>

namespace takt::drivers {
namespace {

constexpr const char* kController =
    "000100001000000001000000ed0000000000180102000000c1000500000000000900030063616e300000000008000d003000"
    "00000500100006000000c40012000800010063616e001c000300000000000000000000000000000000000000000000000000"
    "9c0002002400010020a107006b0300007d000000060000000700000002000000020000000100000034000200736a61313030"
    "3000000000000000000001000000100000000100000008000000040000000100000040000000010000000800030000127a00"
    "08000400000000000c00050000000000000000000800060064000000080008000000000008000f00000000000c0011800800"
    "01005f010000";
constexpr const char* kVirtual =
    "4c0000001000000001000000ed000000000018010600000080000400000000000a0003007663616e3900000008000d00e803"
    "0000050010000200000010001200090001007663616e00000000";
constexpr const char* kNoSuchInterface =
    "440000000200000001000000ed000000edffffff300000001200010001000000000000000000000000000000000000000000"
    "00000d0003006e6f7468696e673000000000";

std::vector<std::byte> bytes_of(const std::string& hexadecimal) {
  std::vector<std::byte> bytes;
  for (std::size_t at = 0; at < hexadecimal.size(); at += 2)
    bytes.push_back(static_cast<std::byte>(std::stoi(hexadecimal.substr(at, 2), nullptr, 16)));
  return bytes;
}

TEST(CanLink, ReadsAController) {
  const CanLink link = can_link_of(bytes_of(kController));
  EXPECT_TRUE(link.exists && link.up && !link.is_virtual && !link.fd);
  EXPECT_EQ(link.bitrate, 500'000U);
  EXPECT_DOUBLE_EQ(link.sample_point, 0.875);
  EXPECT_EQ(link.sjw, 2U);
  EXPECT_EQ(link.queue_length, 48U);
  EXPECT_EQ(link.controller_state, "ERROR-ACTIVE");
  EXPECT_EQ(link.transmit_errors, 0U);
  EXPECT_EQ(link.receive_errors, 0U);
  EXPECT_EQ(link.went_off, 0U);
  EXPECT_EQ(link.restart_ms, 100U);
}

TEST(CanLink, AVirtualInterfaceHasNoBitTiming) {
  const CanLink link = can_link_of(bytes_of(kVirtual));
  EXPECT_TRUE(link.exists && link.is_virtual && !link.up);
  EXPECT_EQ(link.bitrate, 0U);
  EXPECT_EQ(link.queue_length, 1000U);
  EXPECT_FALSE(link.transmit_errors.has_value()) << "its driver counts nothing";
}

TEST(CanLink, WhatIsNotThereIsNotThere) {
  EXPECT_FALSE(can_link_of(bytes_of(kNoSuchInterface)).exists);
  EXPECT_FALSE(read_can_link("no-such-can").exists);
}

TEST(CanLink, AnAnswerMayEndAnywhere) {
  for (const char* whole : {kController, kVirtual}) {
    const std::vector<std::byte> answer = bytes_of(whole);
    for (std::size_t size = 0; size < answer.size(); ++size) {
      const std::vector<std::byte> cut(answer.begin(), answer.begin() + static_cast<std::ptrdiff_t>(size));
      EXPECT_FALSE(can_link_of(cut).exists) << "the head tells its whole length";
    }
    for (std::size_t at = 16; at < answer.size(); ++at) {
      std::vector<std::byte> wrong = answer;
      wrong[at] = std::byte{0xFF};
      EXPECT_TRUE(can_link_of(wrong).exists);
    }
  }
}

TEST(CanLink, AContradictionWithTheRobotFileIsNamed) {
  const CanLink link = can_link_of(bytes_of(kController));
  config::Bus bus;
  bus.bitrate = 1'000'000;
  EXPECT_EQ(wrong_timing(bus, link), "500000 bit/s, the robot file says 1000000 bit/s");
  bus.bitrate = 500'000;
  EXPECT_EQ(wrong_timing(bus, link), "");
  bus.sample_point = 0.75;
  EXPECT_EQ(wrong_timing(bus, link), "sample point 0.875, the robot file says 0.750");
  bus.sample_point = 0.85;
  EXPECT_EQ(wrong_timing(bus, link), "") << "a controller reads a bit at whole time quanta";
  bus.sjw = 1;
  EXPECT_EQ(wrong_timing(bus, link), "sjw 2, the robot file says 1");
  bus.fd = true;
  EXPECT_EQ(wrong_timing(bus, link), "classic CAN, the robot file says FD");
  EXPECT_EQ(wrong_timing(bus, can_link_of(bytes_of(kVirtual))), "") << "it has none";
  EXPECT_EQ(wrong_timing(bus, CanLink{}), "") << "the kernel could not be asked";
  CanLink serial = link;
  serial.bitrate = 0;
  EXPECT_EQ(wrong_timing(bus, serial), "") << "an slcan adapter that was told its bit rate over its line";
}

}  // namespace
}  // namespace takt::drivers
