// SPDX-License-Identifier: Apache-2.0
// Goal: a scan finds every drive of a mixed robot by number and protocol, invents none, and the zero frame moves a
// drive's zero. Method: the questions are handed to the simulated drives, their answers to the scan.
#include "commissioning/discovery.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "config/load.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "simulation/device_table.hpp"

namespace takt::commissioning {
namespace {

using Key = std::pair<config::DriveProtocol, std::uint32_t>;

class DiscoveryTest : public testing::Test {
 protected:
  // Everything the drives of one bus hear is answered at once; a second of their own words goes by first.
  std::set<Key> scan(std::size_t bus, std::uint32_t last_id = 127) {
    std::vector<std::unique_ptr<simulation::Device>> devices;
    std::set<config::DriveProtocol> protocols;
    for (const config::Joint& joint : robot_.joints) {
      if (joint.bus != bus) continue;
      devices.push_back(simulation::make_device(joint.drive, milliseconds(100)));
      protocols.insert(joint.drive.protocol);
    }
    BusScan scan(protocols, 0, last_id);
    for (const config::Joint& joint : robot_.joints)
      if (joint.bus == bus)
        for (const drivers::CanFrame& question : own_questions(joint.drive, robot_.buses[bus])) scan.also_ask(question);
    simulation::Frames said;
    MonoTime now{1};
    for (int ms = 0; ms < 1000; ++ms, now = now + milliseconds(1))
      for (const auto& device : devices) device->update({}, now, milliseconds(1), said);
    while (const auto question = scan.next_question())
      for (const auto& device : devices) device->receive(*question, now, said);
    for (const drivers::CanFrame& frame : said) scan.take(frame);
    std::set<Key> found;
    for (const BusScan::Drive& drive : scan.found()) {
      found.insert({drive.protocol, drive.id});
      said_.insert(drive.said.begin(), drive.said.end());
    }
    return found;
  }
  std::set<Key> expected(std::size_t bus) const {
    std::set<Key> keys;
    for (const config::Joint& joint : robot_.joints)
      if (joint.bus == bus) keys.insert({joint.drive.protocol, joint.drive.id});
    return keys;
  }

  config::RobotConfig robot_ = config::load("config/dual_arm12.yaml").value();
  std::set<std::string> said_;
};

TEST_F(DiscoveryTest, FindsEveryDriveOfEveryBusAndNoOther) {
  for (std::size_t bus = 0; bus < robot_.buses.size(); ++bus) EXPECT_EQ(scan(bus), expected(bus)) << bus;
}

TEST_F(DiscoveryTest, ReadsTheRangesOfDamiaoDrivesBack) {
  scan(0);
  for (const char* what : {"PMAX 12.5 rad", "VMAX 45 rad/s", "TMAX 54 Nm", "replies on 0x11, control mode 1"})
    EXPECT_TRUE(said_.contains(what)) << what;
}

TEST_F(DiscoveryTest, NamesADriveWithAkV3Firmware) {
  BusScan scan({config::DriveProtocol::mit, config::DriveProtocol::robstride}, 0, 127);
  drivers::CanFrame frame;
  frame.id = 0x2903;
  frame.extended = true;
  frame.length = 8;
  scan.take(frame);
  ASSERT_EQ(scan.found().size(), 1U);
  EXPECT_EQ(scan.found()[0].id, 3U);
  EXPECT_NE(scan.found()[0].said.begin()->find("AK V3"), std::string::npos);
}

TEST_F(DiscoveryTest, NumbersBeyondTheLastAreNotReported) {
  EXPECT_EQ(scan(1, 5), (std::set<Key>{{config::DriveProtocol::robstride, 4}, {config::DriveProtocol::odrive, 5}}));
}

TEST_F(DiscoveryTest, TheZeroThatADriveIsToldOutlivesItsSupply) {
  for (const std::size_t joint : {std::size_t{0}, std::size_t{3}}) {
    const config::Drive& drive = robot_.joints[joint].drive;
    const auto device = simulation::make_device(drive, milliseconds(100));
    const auto frames = zero_frames(drive);
    ASSERT_FALSE(frames.empty());
    simulation::Frames said;
    device->update({0.7, 0}, MonoTime{1}, milliseconds(1), said);
    for (const drivers::CanFrame& frame : frames) device->receive(frame, MonoTime{2}, said);
    device->power_cycle(MonoTime{2});
    auto driver = drivers::make_joint_driver(robot_, joint).value();
    std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out;
    for (int i = 3; i < 400; ++i) {
      const MonoTime now = MonoTime{} + milliseconds(i);
      device->update({0.7, 0}, now, milliseconds(1), said);
      said.clear();
      const std::size_t sent = driver->encode(false, {}, now, {}, out);
      for (std::size_t k = 0; k < sent; ++k) device->receive(out[k], now, said);
      for (const drivers::CanFrame& answer : said) driver->decode({answer, now});
    }
    EXPECT_NEAR(driver->feedback().q, 0, 1e-3) << joint;
  }
}

}  // namespace
}  // namespace takt::commissioning
