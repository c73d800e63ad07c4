// SPDX-License-Identifier: Apache-2.0
// Goal: a kernel's refusal is answered by what mends it, and by nothing else. Method: answers of `ip` as kernels and
// drivers word them, each with the advice that fits.
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
  for (std::size_t i = 0; i < steps.size(); ++i) EXPECT_EQ(steps[i].is_restart, i == 2);
}

TEST(BusUpSteps, NoBitRateIsSetWhereTheKernelHasNone) {
  EXPECT_EQ(up_steps(one_bus(false), 0, LinkKind::vcan).size(), 2U);
  EXPECT_EQ(line_of(up_steps(one_bus(true), 0, LinkKind::vcan)[1].command), "ip link set can0 mtu 72");
  EXPECT_EQ(up_steps(one_bus(false), 0, LinkKind::serial).size(), 2U);
}

}  // namespace
}  // namespace takt::cli
