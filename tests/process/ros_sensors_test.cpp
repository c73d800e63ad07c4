// SPDX-License-Identifier: Apache-2.0
// Goal: topics of ROS 2 reach the readers of the robot's sensors, number by number and with their own stamps; what does
// not fit the robot file, or claims to be from the future, does not pass as something better than it is. Method:
// takt-ros-sensors as a real process, Fast DDS with no types of ours as camera, IMU, hand and operator, and a reader at
// each sensor's mailbox as a policy is.
#include <gtest/gtest.h>
#include <signal.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "config/paths.hpp"
#include "dds/type_hash.hpp"
#include "executive/contract/image_sample.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "tests/process/child.hpp"
#include "tests/process/fast_messages.hpp"
#include "tests/process/fastdds_peer.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::test {
namespace {

using namespace std::chrono_literals;

constexpr const char* kSensors = R"(
  - { name: cam0, image: { height: 48, width: 64, channels: 3 }, timeout: 10 s, ros: { topic: /camera/image_raw, type: sensor_msgs/msg/Image, encoding: rgb8 } }
  - { name: torso, values: 10, timeout: 10 s, queue: 20, ros: { topic: /imu/data, type: sensor_msgs/msg/Imu } }
  - { name: hand, values: 2, timeout: 10 s, ros: { topic: /hand/joint_states, type: sensor_msgs/msg/JointState, joints: [{ name: thumb }, { name: index }] } }
  - { name: wish, values: 3, timeout: 700 ms, ros: { topic: /cmd_vel, type: geometry_msgs/msg/Twist } }
)";

std::int64_t unix_now() {
  timespec time{};
  clock_gettime(CLOCK_REALTIME, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

// A reader of one sensor, as a policy host is.
class Mailbox {
 public:
  Mailbox(const std::string& socket, const ipc::RingShape& shape) {
    Hello hello;
    hello.role = Role::sensor_reader;
    auto lease = ipc::attach(socket, hello, 5s);
    EXPECT_TRUE(lease) << lease.error();
    auto segment = ipc::Segment::adopt_read_only(lease->descriptors.at(0).release(), ipc::ring_bytes(shape));
    EXPECT_TRUE(segment) << segment.error();
    lease_.emplace(std::move(*lease));
    segment_.emplace(std::move(*segment));
    reader_.emplace(ipc::SlotReader::attach(segment_->readable(), shape).value());
    bytes_.resize(shape.payload_capacity);
  }
  // The newest, if there is a new one.
  bool read() { return reader_->read_latest(bytes_).status == ipc::ReadStatus::fresh; }
  [[nodiscard]] SensorSample sample() const {
    SensorSample sample;
    std::memcpy(&sample, bytes_.data(), sizeof sample);
    return sample;
  }
  [[nodiscard]] ImageHeader image_header() const {
    ImageHeader header;
    std::memcpy(&header, bytes_.data(), sizeof header);
    return header;
  }
  [[nodiscard]] std::span<const std::byte> pixels() const { return std::span(bytes_).subspan(sizeof(ImageHeader)); }

 private:
  std::optional<ipc::Lease> lease_;
  std::optional<ipc::Segment> segment_;
  std::optional<ipc::SlotReader> reader_;
  std::vector<std::byte> bytes_;
};

class RosSensors : public testing::Test {
 protected:
  RosSensors() {
    std::filesystem::copy_file("config/arm6_reach.onnx", folder_.path("arm6_reach.onnx"));
    std::string arm = text_of("config/arm6.yaml");
    const std::string sensors = "\nsensors:";
    arm.insert(arm.find(sensors) + sensors.size(), kSensors);
    std::ofstream(robot_file()) << arm << "\ndds: { domain: " << domain_of_this_test() << " }\n";
    program_.emplace(
        std::vector<std::string>{"takt-ros-sensors", "--robot", robot_file(), "--runtime-dir", folder_.path()}, log());
    peer_.emplace(domain_of_this_test());
  }
  ~RosSensors() override { end(); }
  void end() {
    if (!program_) return;
    program_->signal(SIGTERM);
    EXPECT_EQ(program_->wait(20s), 0) << text_of(log());
    program_.reset();
  }
  [[nodiscard]] std::string robot_file() const { return folder_.path("arm6.yaml"); }
  [[nodiscard]] std::string log() const { return folder_.path("log"); }
  void offer(const std::string& topic, const std::string& type) {
    peer_->offer(topic, type);
    ASSERT_TRUE(until([&] { return peer_->is_matched(topic); })) << text_of(log());
  }
  [[nodiscard]] Mailbox mailbox(const std::string& sensor, const ipc::RingShape& shape = ipc::sensor_mailbox()) const {
    return {config::sensor_socket(folder_.path(), sensor), shape};
  }
  // Sent again until it is there: best effort, and matching takes a moment longer on the other side.
  bool arrives(Mailbox& mailbox, const std::string& topic, const std::function<Payload()>& payload) {
    return until([&] {
      peer_->send(topic, payload());
      std::this_thread::sleep_for(20ms);
      return mailbox.read();
    });
  }
  static bool until(const std::function<bool()>& holds) {
    for (int poll = 0; poll < 500; ++poll) {
      if (holds()) return true;
      std::this_thread::sleep_for(20ms);
    }
    return holds();
  }
  const TemporaryDirectory folder_;
  std::optional<Child> program_;
  std::optional<FastDdsPeer> peer_;
};

TEST_F(RosSensors, AreWhatTheNodesSent) {
  constexpr std::int64_t kBefore = 7'000'000;  // ns that the nodes took
  offer("rt/camera/image_raw", "sensor_msgs::msg::dds_::Image_");
  offer("rt/imu/data", "sensor_msgs::msg::dds_::Imu_");
  offer("rt/hand/joint_states", "sensor_msgs::msg::dds_::JointState_");
  offer("rt/cmd_vel", "geometry_msgs::msg::dds_::Twist_");
  EXPECT_EQ(peer_->readers().at("rt/imu/data").user_data, dds::user_data("sensor_msgs/msg/Imu"));

  FastImage image{.unix_ns = 0, .height = 48, .width = 64, .step = 200, .encoding = "rgb8", .data = {}};
  image.data.resize(std::size_t{48} * 200);
  for (std::size_t i = 0; i < image.data.size(); ++i) image.data[i] = static_cast<std::uint8_t>(i % 251);
  Mailbox camera = mailbox("cam0", ipc::image_mailbox(48, 64, 3));
  ASSERT_TRUE(arrives(camera, "rt/camera/image_raw", [&] {
    image.unix_ns = unix_now() - kBefore;
    return encode_image(image);
  })) << text_of(log());
  for (std::size_t y = 0; y < 48; ++y)
    for (std::size_t x = 0; x < 192; ++x)
      ASSERT_EQ(std::to_integer<std::uint8_t>(camera.pixels()[y * 192 + x]), image.data[y * 200 + x]) << y << ' ' << x;
  EXPECT_LE(camera.image_header().sensed_at, camera.image_header().published_at - Duration{kBefore});
  EXPECT_GT(camera.image_header().sensed_at, camera.image_header().published_at - seconds(5));

  Mailbox torso = mailbox("torso");
  ASSERT_TRUE(arrives(torso, "rt/imu/data", [] {
    return encode_imu(unix_now() - kBefore, {0.1, 0.2, 0.3, 0.9, 1, 2, 3, 4, 5, 6});
  })) << text_of(log());
  const std::vector<float> turned{0.9F, 0.1F, 0.2F, 0.3F, 1, 2, 3, 4, 5, 6};
  ASSERT_EQ(torso.sample().value_count, 10U);
  EXPECT_TRUE(std::ranges::equal(turned, std::span(torso.sample().values, 10)));
  EXPECT_LE(torso.sample().sensed_at, torso.sample().published_at - Duration{kBefore});

  Mailbox hand = mailbox("hand");
  ASSERT_TRUE(arrives(hand, "rt/hand/joint_states", [] {
    return encode_joint_state({unix_now(), "", {"index", "little", "thumb"}, {0.5, 7, 0.25}, {}, {}});
  })) << text_of(log());
  EXPECT_EQ(hand.sample().values[0], 0.25F);
  EXPECT_EQ(hand.sample().values[1], 0.5F);

  Mailbox wish = mailbox("wish");
  ASSERT_TRUE(arrives(wish, "rt/cmd_vel", [] { return encode_twist({0.5, 0.25, 9, 9, 9, -0.5}); })) << text_of(log());
  EXPECT_EQ(wish.sample().values[0], 0.5F);
  EXPECT_EQ(wish.sample().values[1], 0.25F);
  EXPECT_EQ(wish.sample().values[2], -0.5F);
  EXPECT_LE(wish.sample().sensed_at, wish.sample().published_at);
}

TEST_F(RosSensors, AStampOfTheFutureIsTheArrivalAndOneOfThePastIsOld) {
  offer("rt/imu/data", "sensor_msgs::msg::dds_::Imu_");
  const std::vector<double> level{0, 0, 0, 1, 0, 0, 0, 0, 0, 9.81};
  Mailbox torso = mailbox("torso");
  ASSERT_TRUE(arrives(torso, "rt/imu/data", [&] { return encode_imu(unix_now() + 3'600'000'000'000, level); }));
  EXPECT_LE(torso.sample().sensed_at, torso.sample().published_at) << "an hour ahead";
  EXPECT_GT(torso.sample().sensed_at, torso.sample().published_at - seconds(10));
  // From here on every new sample is one with a stamp of a simulation, sooner or later.
  ASSERT_TRUE(until([&] {
    peer_->send("rt/imu/data", encode_imu(12'000'000'000, level));
    std::this_thread::sleep_for(20ms);
    return torso.read() && torso.sample().published_at - torso.sample().sensed_at > seconds(10);
  })) << text_of(log());
  EXPECT_NE(text_of(log()).find("use_sim_time"), std::string::npos) << text_of(log());
}

TEST_F(RosSensors, WithoutAStampAMessageIsAsOldAsItsWriterSays) {
  constexpr std::int64_t kBefore = 3'000'000'000;
  const std::vector<double> level{0, 0, 0, 1, 0, 0, 0, 0, 0, 9.81};
  FastImage image{.unix_ns = 0, .height = 48, .width = 64, .step = 192, .encoding = "rgb8", .data = {}};
  image.data.resize(std::size_t{48} * 192);
  const auto is_old = [&](Mailbox& mailbox, const std::string& topic, const Payload& payload) {
    return until([&] {
      peer_->send_as_of(unix_now() - kBefore, topic, payload);
      std::this_thread::sleep_for(20ms);
      return mailbox.read();
    });
  };
  offer("rt/camera/image_raw", "sensor_msgs::msg::dds_::Image_");
  Mailbox camera = mailbox("cam0", ipc::image_mailbox(48, 64, 3));
  ASSERT_TRUE(is_old(camera, "rt/camera/image_raw", encode_image(image))) << text_of(log());
  EXPECT_LE(camera.image_header().sensed_at, camera.image_header().published_at - Duration{kBefore});
  offer("rt/imu/data", "sensor_msgs::msg::dds_::Imu_");
  offer("rt/hand/joint_states", "sensor_msgs::msg::dds_::JointState_");
  offer("rt/cmd_vel", "geometry_msgs::msg::dds_::Twist_");
  for (const auto& [sensor, topic, payload] :
       {std::tuple("torso", "rt/imu/data", encode_imu(0, level)),
        std::tuple("hand", "rt/hand/joint_states",
                   encode_joint_state({0, "", {"thumb", "index"}, {0.5, 0.25}, {}, {}})),
        std::tuple("wish", "rt/cmd_vel", encode_twist({0, 0, 0, 0, 0, 0}))}) {
    Mailbox values = mailbox(sensor);
    ASSERT_TRUE(is_old(values, topic, payload)) << sensor << text_of(log());
    EXPECT_LE(values.sample().sensed_at, values.sample().published_at - Duration{kBefore}) << sensor;
  }
}

TEST_F(RosSensors, WhatDoesNotFitTheRobotFileIsNotPassedOnAndSaidOnce) {
  offer("rt/camera/image_raw", "sensor_msgs::msg::dds_::Image_");
  Mailbox camera = mailbox("cam0", ipc::image_mailbox(48, 64, 3));
  FastImage image{.unix_ns = 0, .height = 48, .width = 64, .step = 192, .encoding = "bgr8", .data = {}};
  image.data.resize(std::size_t{48} * 192);
  ASSERT_TRUE(until([&] {
    peer_->send("rt/camera/image_raw", encode_image(image));
    return text_of(log()).find("images are bgr8, the robot file says rgb8") != std::string::npos;
  })) << text_of(log());
  EXPECT_FALSE(camera.read());
  image.encoding = "rgb8";
  ASSERT_TRUE(arrives(camera, "rt/camera/image_raw", [&] { return encode_image(image); })) << text_of(log());
}

TEST_F(RosSensors, PausesAreCounted) {
  offer("rt/cmd_vel", "geometry_msgs::msg::dds_::Twist_");
  Mailbox wish = mailbox("wish");
  const auto stand = [] { return encode_twist({0, 0, 0, 0, 0, 0}); };
  ASSERT_TRUE(arrives(wish, "rt/cmd_vel", stand)) << text_of(log());
  const MonoTime heard = wish.sample().published_at;
  ASSERT_TRUE(until([&] {
    wish.read();
    return monotonic_now() - heard > seconds(1);
  }));
  ASSERT_TRUE(arrives(wish, "rt/cmd_vel", stand)) << text_of(log());
  end();
  EXPECT_NE(text_of(log()).find("1 pauses beyond 700 ms"), std::string::npos) << text_of(log());
}

TEST_F(RosSensors, ASecondServerOfTheSameSensorsIsRefused) {
  ASSERT_TRUE(until([&] { return text_of(log()).find("4 topics") != std::string::npos; })) << text_of(log());
  Child second({"takt-ros-sensors", "--robot", robot_file(), "--runtime-dir", folder_.path()}, folder_.path("second"));
  EXPECT_EQ(second.wait(20s), 69) << text_of(folder_.path("second"));
}

TEST(RosSensorsProgram, RefusesARobotWithoutSuchSensors) {
  const std::string log = testing::TempDir() + "takt-ros-none-" + std::to_string(getpid());
  Child program({"takt-ros-sensors", "--robot", "config/arm6.yaml"}, log);
  EXPECT_EQ(program.wait(20s), 65);
  EXPECT_NE(text_of(log).find("none of its `sensors` has `ros`"), std::string::npos) << text_of(log);
  std::filesystem::remove(log);
}

}  // namespace
}  // namespace takt::test
