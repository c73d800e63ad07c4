// SPDX-License-Identifier: Apache-2.0
// Goal: a reader gets the camera's mailbox over the socket, several at once, and no other role gets anything.
#include "executive/ipc/sensor_server.hpp"

#include <gtest/gtest.h>

#include <filesystem>

namespace takt::ipc {
namespace {

using namespace std::chrono_literals;

std::string fresh_socket() {
  const auto directory = std::filesystem::path(testing::TempDir()) / "takt_sensor";
  std::filesystem::create_directories(directory);
  return directory / "sensor.sock";
}

TEST(SensorServer, ReadersSeeTheNewestSample) {
  const std::string socket = fresh_socket();
  const auto server = SensorServer::start(socket);
  ASSERT_TRUE(server) << server.error();
  Hello hello;
  hello.role = Role::sensor_reader;
  for (int reader = 0; reader < 2; ++reader) {
    auto lease = attach(socket, hello, 2000ms);
    ASSERT_TRUE(lease) << lease.error();
    ASSERT_EQ(lease->descriptors.size(), 1U);
    const auto segment = Segment::adopt_read_only(lease->descriptors[0].release(), ring_bytes(sensor_mailbox()));
    ASSERT_TRUE(segment) << segment.error();
    auto mailbox = SlotReader::attach(segment->readable(), sensor_mailbox());
    ASSERT_TRUE(mailbox) << mailbox.error();
    SensorSample sent;
    sent.sequence = static_cast<std::uint64_t>(reader) + 1;
    sent.value_count = 3;
    sent.values[2] = 0.25F;
    (*server)->publish(sent);
    SensorSample read;
    EXPECT_EQ(mailbox->read_latest(std::as_writable_bytes(std::span(&read, 1))).status, ReadStatus::fresh);
    EXPECT_EQ(read.sequence, sent.sequence);
    EXPECT_EQ(read.values[2], 0.25F);
  }
}

TEST(SensorServer, OtherRolesAreRefused) {
  const std::string socket = fresh_socket();
  const auto server = SensorServer::start(socket);
  ASSERT_TRUE(server) << server.error();
  Hello hello;
  hello.role = Role::monitor;
  const auto lease = attach(socket, hello, 2000ms);
  ASSERT_FALSE(lease);
  EXPECT_NE(lease.error().find("sensor"), std::string::npos) << lease.error();
}

}  // namespace
}  // namespace takt::ipc
