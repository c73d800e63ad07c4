// SPDX-License-Identifier: Apache-2.0
// Goal: a kernel's refusal is answered by what corrects it, and by nothing else; each step is judged and read back.
// Method: answers of `ip` as kernels and drivers word them, each with the advice that fits; interfaces that take what
// their drivers take, played back.
#include "cli/robot/bus_up_steps.hpp"

#include <gtest/gtest.h>

#include <string>

namespace takt::cli {
namespace {

using Words = std::vector<std::string>;
const Words kTiming{"ip", "link", "set", "can0", "type", "can", "bitrate", "1000000"};
const Words kFdTiming{"ip",      "link",    "set",      "can0",    "type", "can",
                      "bitrate", "1000000", "dbitrate", "5000000", "fd",   "on"};
const Words kUp{"ip", "link", "set", "can0", "txqueuelen", "32", "up"};

struct Said {
  Words command;
  const char* answer;
  const char* advice;  // "": none is known
};

const Said kSaid[] = {
    {kTiming, "RTNETLINK answers: Operation not permitted\n", "it needs root"},
    {kTiming, "Cannot find device \"can0\"\n", "the adapter is gone"},
    {kUp, "RTNETLINK answers: No such device\n", "the adapter is gone"},
    {kTiming, "RTNETLINK answers: Device or resource busy\n", "something else brought it up"},
    {kFdTiming, "RTNETLINK answers: Operation not supported\n", "has no CAN FD"},
    {kTiming, "RTNETLINK answers: Operation not supported\n", "gets its bit rate from slcand"},
    {kTiming, "Error: bitrate error 12.5% too high\n", "cannot make this bit timing"},
    {kTiming, "RTNETLINK answers: Numerical result out of range\n", "cannot make this bit timing"},
    {kTiming, "RTNETLINK answers: Invalid argument\n", "cannot make this bit timing"},
    {kFdTiming, "Error: argument \"dbitrate\" is unknown\n", "iproute2 is too old"},
    {kUp, "RTNETLINK answers: Connection timed out\n", "does not answer"},
    {kUp, "RTNETLINK answers: Input/output error\n", "does not answer"},
    {kUp, "RTNETLINK answers: No buffer space available\n", ""},
};

TEST(BusUpSteps, ARefusalIsAnsweredByWhatMendsIt) {
  for (const Said& said : kSaid) {
    const std::string sentence = why_refused(said.command, said.answer);
    const std::string all = "`" + line_of(said.command) + "` failed: ";
    EXPECT_EQ(sentence.find(all), 0U) << sentence;
    EXPECT_NE(sentence.find(said.advice), std::string::npos) << sentence;
    const bool is_of_rights = std::string(said.answer).find("not permitted") != std::string::npos;
    EXPECT_EQ(sentence.find("root") != std::string::npos, is_of_rights) << sentence;
    if (*said.advice == '\0') {
      EXPECT_EQ(sentence.find(';'), std::string::npos) << sentence;
    }
  }
}

config::RobotConfig one_bus(bool fd) {
  config::RobotConfig robot;
  robot.buses.push_back(
      {.name = "left", .interface = "can0", .bitrate = 1'000'000, .fd = fd, .data_bitrate = 5'000'000});
  return robot;
}

TEST(BusUpSteps, TheRestartIsAStepOfItsOwnThatMayBeRefused) {
  const auto steps = up_steps(one_bus(true), 0, LinkKind::controller);
  ASSERT_EQ(steps.size(), 4U);
  EXPECT_EQ(line_of(steps[1].command), "ip link set can0 type can bitrate 1000000 dbitrate 5000000 fd on");
  EXPECT_EQ(line_of(steps[2].command), "ip link set can0 type can restart-ms 100");
  for (std::size_t i = 0; i < steps.size(); ++i) EXPECT_EQ(steps[i].sets == UpStep::Sets::restart, i == 2);
}

TEST(BusUpSteps, NoBitRateIsSetWhereTheKernelHasNone) {
  EXPECT_EQ(up_steps(one_bus(false), 0, LinkKind::vcan).size(), 2U);
  EXPECT_EQ(line_of(up_steps(one_bus(true), 0, LinkKind::vcan)[1].command), "ip link set can0 mtu 72");
  EXPECT_EQ(up_steps(one_bus(false), 0, LinkKind::serial).size(), 2U);
}

// An interface, and what its driver makes of commands.
struct Played {
  drivers::CanLink link;
  std::string refused{};  // the command whose line has this is answered with `answer`
  const char* answer = "";
  bool forgets_bitrate = false, falls_down = false;
  int commands = 0;

  ToolResult run(const Words& command) {
    ++commands;
    const std::string line = line_of(command);
    if (!refused.empty() && line.find(refused) != std::string::npos) return {2, answer};
    if (line.find(" bitrate ") != std::string::npos && !forgets_bitrate) link.bitrate = 1'000'000;
    if (line.find("restart-ms") != std::string::npos) link.restart_ms = 100;
    if (line.ends_with(" down")) link.up = false;
    if (line.ends_with(" up")) link.up = !falls_down;
    return {0, ""};
  }
  std::expected<std::vector<std::string>, Refusal> bring_up(bool fd = false) {
    config::RobotConfig robot = one_bus(fd);
    robot.file = "robot.yaml";
    return cli::bring_up(robot, 0, {[this](const Words& command) { return run(command); }, [this] { return link; }});
  }
};
drivers::CanLink interface_of(const char* kind) {
  drivers::CanLink link;
  link.exists = true;
  link.kind = kind;
  link.is_virtual = link.kind != "can";
  return link;
}
drivers::CanLink controller() {
  drivers::CanLink link = interface_of("can");
  link.up = true;
  link.controller_state = "BUS-OFF";
  link.bitrate = 500'000;
  return link;
}

TEST(BusUpSteps, AControllerIsGivenItsTimingAndItsRestart) {
  Played played{.link = controller()};
  const auto told = played.bring_up();
  ASSERT_TRUE(told.has_value()) << told.error().sentence;
  EXPECT_EQ(*told, std::vector<std::string>{"can0 is up for bus left"});
  EXPECT_EQ(played.link.restart_ms, 100U);
}

// gs_usb (candleLight, CANable) since Linux 6.12.47: without do_set_mode the restart is refused, and nothing else.
TEST(BusUpSteps, AnAdapterThatCannotRestartIsUpAndToldOf) {
  Played played{.link = controller(), .refused = "restart-ms", .answer = "RTNETLINK answers: Operation not supported"};
  const auto told = played.bring_up();
  ASSERT_TRUE(told.has_value()) << told.error().sentence;
  ASSERT_EQ(told->size(), 2U);
  EXPECT_NE(told->front().find("takt bus up --robot robot.yaml --interface can0"), std::string::npos) << told->front();
  EXPECT_TRUE(played.link.up);
  EXPECT_EQ(played.link.bitrate, 1'000'000U);
}

// Every answer, at the step that it refuses: that step is the last, its sentence alone is told, and nothing is up.
TEST(BusUpSteps, EveryAnswerOfTheKernelEndsTheStepThatItRefuses) {
  std::size_t wrong_advice = 0;
  for (const Said& said : kSaid) {
    const bool fd = said.command == kFdTiming, at_the_end = said.command == kUp;
    Played played{.link = controller(), .refused = line_of(said.command), .answer = said.answer};
    const auto told = played.bring_up(fd);
    ASSERT_FALSE(told.has_value()) << said.answer;
    EXPECT_EQ(told.error().exit_code, kExitFailed);
    EXPECT_EQ(told.error().sentence, why_refused(said.command, said.answer));
    wrong_advice += told.error().sentence.find(said.advice) == std::string::npos ? 1U : 0U;
    EXPECT_FALSE(played.link.up) << said.answer;
    EXPECT_EQ(played.commands, at_the_end ? 4 : 2) << said.answer;
  }
  EXPECT_GE(std::size(kSaid), 12U);
  EXPECT_EQ(wrong_advice, 0U);
}

TEST(BusUpSteps, WhatWasTakenAndNotDoneIsNoSuccess) {
  Played forgetful{.link = controller(), .forgets_bitrate = true};
  const auto told = forgetful.bring_up();
  ASSERT_FALSE(told.has_value());
  EXPECT_NE(told.error().sentence.find("500000 bit/s, the robot file says 1000000 bit/s"), std::string::npos);
  EXPECT_FALSE(forgetful.link.up) << "not with another bit rate";
  Played falling{.link = controller(), .falls_down = true};
  const auto fallen = falling.bring_up();
  ASSERT_FALSE(fallen.has_value());
  EXPECT_NE(fallen.error().sentence.find("did not stay up"), std::string::npos);
}

TEST(BusUpSteps, ASerialLineIsNoVirtualBus) {
  Played played{.link = interface_of("")};
  const auto told = played.bring_up();
  ASSERT_TRUE(told.has_value()) << told.error().sentence;
  EXPECT_NE(told->back().find("Was slcand started with the option for 1000000 bit/s?"), std::string::npos);
  Played vcan{.link = interface_of("vcan")};
  ASSERT_TRUE(vcan.bring_up().has_value());
  EXPECT_EQ(vcan.bring_up()->size(), 1U);
  EXPECT_EQ(vcan.link.bitrate, 0U);
}

}  // namespace
}  // namespace takt::cli
