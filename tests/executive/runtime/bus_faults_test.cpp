// SPDX-License-Identifier: Apache-2.0
// Goal: a fault on a bus reaches the tick as its cause, through the loop and the edge as they are; a healthy bus does
// not. Method: the real loop in virtual time; scripted buses that answer every command, with one fault each on bus 0.
// A rival controller is tried with real drivers on a loopback bus.
#include <gtest/gtest.h>

#include <filesystem>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "drivers/bus/loopback_bus.hpp"
#include "drivers/bus/loopback_hub.hpp"
#include "drivers/bus/open_bus.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "executive/runtime/open_edge.hpp"
#include "tests/executive/runtime/loop_rig.hpp"

namespace takt::runtime::test {
namespace {

using pipeline::bit;
using pipeline::CauseMask;

constexpr CauseMask kBusCauses = bit(Cause::bus_off) | bit(Cause::bus_down) | bit(Cause::bus_error_passive) |
                                 bit(Cause::transmit_queue_full) | bit(Cause::receive_overflow) |
                                 bit(Cause::replies_lost) | bit(Cause::replies_repeated) | bit(Cause::replies_delayed) |
                                 bit(Cause::foreign_node) | bit(Cause::bus_babble) | bit(Cause::feedback_lost);

// What bus 0 does with the answer of its first joint's drive in command number `n`.
using Script = void (*)(FakeBus& bus, const drivers::ReceivedFrame& answer, int n);

drivers::ReceivedFrame answer_to(const drivers::CanFrame& command, MonoTime at) {
  drivers::ReceivedFrame reply;
  reply.frame.id = 0x100 + command.id - 1;
  reply.frame.length = 1;
  reply.received_at = at;
  return reply;
}

CauseMask causes_after(std::uint64_t ticks, Script script) {
  LoopRig rig(3, 2);  // bus 0: joints 0 and 2; bus 1: joint 1
  int n = 0;
  for (FakeBus* bus : rig.buses) {
    bus->on_sent = [&rig, &n, bus, script](const drivers::CanFrame& command) {
      const drivers::ReceivedFrame answer = answer_to(command, rig.clock.now());
      if (command.id == 1)
        script(*bus, answer, n++);
      else
        bus->arriving.push_back(answer);
    };
  }
  rig.run(ticks);
  const auto records = rig.records();
  EXPECT_EQ(records.size(), ticks);
  return records.back().header.causes_active & kBusCauses;
}

void add(FakeBus& bus, drivers::ReceivedFrame frame, std::uint32_t id, int count) {
  frame.frame.id = id;
  for (int i = 0; i < count; ++i) bus.arriving.push_back(frame);
}

TEST(BusFaults, AHealthyBusHasNone) {
  const auto healthy = [](FakeBus& bus, const drivers::ReceivedFrame& answer, int) { bus.arriving.push_back(answer); };
  EXPECT_EQ(causes_after(3000, healthy), 0U);
}

struct LoopCase {
  const char* when;
  Script script;
  CauseMask causes;
};
const LoopCase kLoopCases[] = {
    {"four of five replies lost",
     [](FakeBus& bus, const drivers::ReceivedFrame& answer, int n) {
       if (n % 5 == 0) bus.arriving.push_back(answer);
     },
     bit(Cause::replies_lost)},
    {"every reply twice",
     [](FakeBus& bus, const drivers::ReceivedFrame& answer, int) { add(bus, answer, answer.frame.id, 2); },
     bit(Cause::replies_repeated)},
    {"replies in bunches",
     [](FakeBus& bus, const drivers::ReceivedFrame& answer, int n) {
       if (n % 12 == 11) add(bus, answer, answer.frame.id, 12);
     },
     bit(Cause::replies_delayed)},
    {"somebody else commands our drive",
     [](FakeBus& bus, const drivers::ReceivedFrame& answer, int) {
       bus.arriving.push_back(answer);
       add(bus, answer, 1, 1);
     },
     bit(Cause::foreign_node)},
    {"babble: also strangers, since it is on our ids",
     [](FakeBus& bus, const drivers::ReceivedFrame& answer, int) {
       bus.arriving.push_front(answer);
       add(bus, answer, 1, 20);
     },
     bit(Cause::bus_babble) | bit(Cause::foreign_node)},
    {"frames of ours dropped",
     [](FakeBus& bus, const drivers::ReceivedFrame& answer, int n) {
       bus.arriving.push_back(answer);
       if (n % 10 == 0) ++bus.health_now.tx_dropped;
     },
     bit(Cause::transmit_queue_full)},
    {"frames lost on receive",
     [](FakeBus& bus, const drivers::ReceivedFrame& answer, int n) {
       bus.arriving.push_back(answer);
       if (n % 10 == 0) bus.health_now.rx_dropped += 40;
     },
     bit(Cause::receive_overflow)},
    {"error-passive",
     [](FakeBus& bus, const drivers::ReceivedFrame& answer, int) {
       bus.arriving.push_back(answer);
       bus.health_now.state = BusState::error_passive;
     },
     bit(Cause::bus_error_passive)},
    {"bus off",
     [](FakeBus& bus, const drivers::ReceivedFrame& answer, int) {
       bus.arriving.push_back(answer);
       bus.health_now.state = BusState::bus_off;
     },
     bit(Cause::bus_off)},
};

TEST(BusFaults, EachReachesTheTickAsItsCauseAlone) {
  for (const LoopCase& one : kLoopCases) EXPECT_EQ(causes_after(3000, one.script), one.causes) << one.when;
}

TEST(BusFaults, AnInstantOfEachIsNone) {
  for (const LoopCase& one : kLoopCases) {
    if (one.causes == bit(Cause::bus_off)) continue;  // that one is known at once
    EXPECT_EQ(causes_after(20, one.script), 0U) << one.when;
  }
}

TEST(BusFaults, ALinkThatGoesDownIsNamedAtOnceAndForgottenWhenItIsUpAgain) {
  const auto down_for_100_ms = [](FakeBus& bus, const drivers::ReceivedFrame& answer, int n) {
    const bool down = n >= 1000 && n < 1100;
    bus.health_now.state = down ? BusState::down : BusState::up;
    if (!down) bus.arriving.push_back(answer);
  };
  EXPECT_EQ(causes_after(1005, down_for_100_ms), bit(Cause::bus_down));
  EXPECT_EQ(causes_after(1080, down_for_100_ms), bit(Cause::bus_down) | bit(Cause::feedback_lost));
  EXPECT_EQ(causes_after(3000, down_for_100_ms), 0U);
}

TEST(BusFaults, FloodedIsMoreThanOurDrivesCanSay) {
  const auto flooded_after = [](std::size_t frames) {
    LoopRig rig(3, 2);  // two joints on bus 0
    rig.buses[0]->arriving.resize(frames);
    rig.run(1);
    const TickRecordHeader header = rig.records().at(0).header;
    EXPECT_EQ(header.buses[1].flooded, 0);
    return header.buses[0].flooded != 0;
  };
  EXPECT_FALSE(flooded_after(2 * drivers::kMaxFramesPerDrive));
  EXPECT_TRUE(flooded_after(2 * drivers::kMaxFramesPerDrive + 1));
}

// The executive's filters let its own command ids in, which no other host may use.
// Threat: rival-frames
TEST(BusFaults, ARivalControllerShowsAsForeignFrames) {
  const std::string directory = testing::TempDir() + "takt_rival";
  std::filesystem::remove_all(directory);
  const config::RobotConfig robot = config::load("config/arm6.yaml").value();
  std::vector<std::unique_ptr<drivers::LoopbackHub>> hubs;
  for (std::size_t bus = 0; bus < robot.buses.size(); ++bus)
    hubs.push_back(drivers::LoopbackHub::listen(config::loopback_socket(directory, robot.buses[bus].interface),
                                                {robot.buses[bus].interface, false, drivers::device_ids(robot, bus)})
                       .value());
  auto edge = open_edge(robot, directory, std::chrono::milliseconds(0));
  ASSERT_TRUE(edge) << edge.error().sentence;
  auto rival = drivers::LoopbackBus::connect(config::loopback_socket(directory, robot.buses[1].interface), {}).value();
  for (const auto& hub : hubs) hub->pump({});
  PublishedSegments records = PublishedSegments::create(robot.joints.size()).value();
  pipeline::TickInput input;
  EXPECT_EQ(edge->edge.receive(input, records), 0U);

  drivers::CanFrame command;
  command.id = std::ranges::find(robot.joints, 1U, &config::Joint::bus)->drive.id;
  command.length = 8;
  ASSERT_EQ(rival->send(command), drivers::SendResult::sent);
  command.id = 0x7E0;  // no node's
  ASSERT_EQ(rival->send(command), drivers::SendResult::sent);
  hubs[1]->pump({});
  EXPECT_EQ(edge->edge.receive(input, records), 1U);
  EXPECT_EQ(input.buses[1].foreign_frames, 1U);
  EXPECT_EQ(input.buses[0].foreign_frames, 0U);
}

}  // namespace
}  // namespace takt::runtime::test
