// SPDX-License-Identifier: Apache-2.0
// Goal: the IMU's process is found whenever it is there, its newest sample reaches the tick in the period in which it
// was published, what has another width is dropped, and its end is seen. Method: a real sensor server on a real
// socket, the loop of loop_rig.hpp; time is passed in.
#include "executive/runtime/imu_link.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>

#include "executive/ipc/sensor_server.hpp"
#include "tests/executive/runtime/loop_rig.hpp"

namespace takt::runtime::test {
namespace {

class ImuLinkTest : public testing::Test {
 protected:
  ImuLinkTest() { std::filesystem::create_directories(std::filesystem::path(socket_).parent_path()); }

  void start() { server_ = ipc::SensorServer::start(socket_).value(); }
  void publish(std::uint64_t sequence, std::uint32_t values = kImuValues) {
    SensorSample sample;
    sample.sequence = sequence;
    sample.sensed_at = MonoTime{} + milliseconds(static_cast<std::int64_t>(sequence));
    sample.value_count = values;
    for (std::size_t i = 0; i < kImuValues; ++i) sample.values[i] = static_cast<float>(i) + 0.5F;
    server_->publish(sample);
  }
  void serve_a_second_later() { link.serve(now_ = now_ + seconds(1)); }
  // What the control thread reads.
  ImuSample read() {
    ImuMailbox* const mailbox = link.mailboxes().current();
    if (mailbox != nullptr) mailbox->read(newest_);
    return newest_;
  }

  std::string socket_ = (std::filesystem::path(testing::TempDir()) / "takt_imu" / "sensor-imu.sock").string();
  std::unique_ptr<ipc::SensorServer> server_;
  ImuLink link{socket_, "imu"};

 private:
  MonoTime now_{1'000'000'000};
  ImuSample newest_;
};

TEST_F(ImuLinkTest, ItsValuesAreReadInTheirOrder) {
  serve_a_second_later();
  EXPECT_EQ(read().sequence, 0U) << "nobody is there";
  start();
  serve_a_second_later();
  publish(1);
  publish(2);
  const ImuSample imu = read();
  EXPECT_EQ(imu.sequence, 2U);
  EXPECT_EQ(imu.sensed_at, MonoTime{} + milliseconds(2));
  EXPECT_EQ(imu.rotation[0], 0.5F);
  EXPECT_EQ(imu.rotation[3], 3.5F);
  EXPECT_EQ(imu.angular_velocity[0], 4.5F);
  EXPECT_EQ(imu.acceleration[2], 9.5F);
}

TEST_F(ImuLinkTest, ASampleOfAnotherWidthReachesNobody) {
  start();
  serve_a_second_later();
  publish(1);
  EXPECT_EQ(read().sequence, 1U);
  publish(2, 9);
  EXPECT_EQ(read().sequence, 1U);
}

TEST_F(ImuLinkTest, ASensorThatIsKilledIsLost) {
  start();
  serve_a_second_later();
  publish(1);
  EXPECT_EQ(read().sequence, 1U);
  server_.reset();
  serve_a_second_later();
  EXPECT_EQ(link.mailboxes().current(), nullptr);
  EXPECT_EQ(read().sequence, 1U) << "what was read last stays; its age tells";
  start();
  serve_a_second_later();
  publish(5);
  serve_a_second_later();
  EXPECT_EQ(read().sequence, 5U) << "and it is found again";
}

TEST_F(ImuLinkTest, TheLoopReadsItInTheTickAndRecordsIt) {
  start();
  serve_a_second_later();
  LoopRig rig;
  pipeline::TickConfig config = rig.config;
  config.imu = {.present = true, .timeout = seconds(10), .frozen_after = {}, .tilt = 4, .angular_velocity = 1000};
  CyclicLoop loop({config, rig.clock, rig.edge, rig.mailboxes, rig.requests, rig.recorded, rig.published, rig.board,
                   &link.mailboxes()},
                  {{}, {}, 100});
  publish(3);
  loop.run(EvidenceSource::open().value(), 2);
  const auto records = rig.records();
  ASSERT_EQ(records.size(), 2U);
  for (const TickRecord& record : records) {
    EXPECT_EQ(record.header.imu.sequence, 3U);
    EXPECT_EQ(record.header.imu.angular_velocity[2], 6.5F);
    EXPECT_EQ(record.header.imu_verdict, ImuVerdict::not_unit);
  }
}

}  // namespace
}  // namespace takt::runtime::test
