// SPDX-License-Identifier: Apache-2.0
// Goal: the GPIO line is requested without permission, set where it changes, read back in every call, set again after a
// doubt, and taken at the end; what cannot be had is told in one sentence. Method: a chip of this test's own in place
// of libgpiod: its functions are defined here, and the linker takes these. No kernel's GPIO is touched.
#include "drivers/torque_output/gpio_line.hpp"

#include <gmock/gmock.h>
#include <gpiod.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <string>
#include <vector>

namespace {

struct FakeChip {
  bool exists = true;
  int request_error = 0;  // errno of the request; 0: granted
  bool set_works = true;
  bool stuck = false;  // takes what it is told, and stays as it is
  bool read_works = true;
  // what was seen:
  int value = -1, flags = -1;
  bool is_open = false;
  std::vector<int> sets;
};
FakeChip g_chip;

}  // namespace

struct gpiod_chip {};
struct gpiod_line {};
namespace {
gpiod_chip g_handle;
gpiod_line g_line;
}  // namespace

extern "C" {
gpiod_chip* gpiod_chip_open(const char*) {
  if (!g_chip.exists) errno = ENOENT;
  g_chip.is_open = g_chip.exists;
  return g_chip.exists ? &g_handle : nullptr;
}
void gpiod_chip_close(gpiod_chip*) {
  g_chip.is_open = false;
}
const char* gpiod_chip_label(gpiod_chip*) {
  return "fake";
}
unsigned int gpiod_chip_num_lines(gpiod_chip*) {
  return 32;
}
gpiod_line* gpiod_chip_get_line(gpiod_chip*, unsigned int offset) {
  return offset < 32 ? &g_line : nullptr;
}
int gpiod_line_request_output_flags(gpiod_line*, const char*, int flags, int value) {
  errno = g_chip.request_error;
  if (g_chip.request_error != 0) return -1;
  g_chip.flags = flags;
  g_chip.value = value;
  return 0;
}
const char* gpiod_line_consumer(gpiod_line*) {
  return "relay-daemon";
}
int gpiod_line_set_value(gpiod_line*, int value) {
  if (!g_chip.set_works) return -1;
  g_chip.sets.push_back(value);
  if (!g_chip.stuck) g_chip.value = value;
  return 0;
}
int gpiod_line_get_value(gpiod_line*) {
  return g_chip.read_works ? g_chip.value : -1;
}
}

namespace takt::drivers {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class GpioLineTest : public testing::Test {
 protected:
  GpioLineTest() {
    g_chip = {};
    wanted.chip = "/dev/gpiochip7";
    wanted.line = 17;
  }
  config::SafeTorqueOff wanted;
};

TEST_F(GpioLineTest, IsRequestedWithoutPermissionAndGivenBackAtTheEnd) {
  {
    const auto opened = open_torque_output(wanted);
    ASSERT_TRUE(opened) << opened.error();
    EXPECT_EQ(opened->description, "line 17 of /dev/gpiochip7 (fake), active high");
    EXPECT_EQ(g_chip.value, 0);
    EXPECT_EQ(g_chip.flags, 0);
    EXPECT_TRUE(opened->output->tell(true));
    EXPECT_EQ(g_chip.value, 1);
  }
  EXPECT_EQ(g_chip.value, 0) << "taken before the line is given back";
  EXPECT_FALSE(g_chip.is_open);
}

TEST_F(GpioLineTest, ActiveLowIsTheKernelsAffair) {
  wanted.active = config::ActiveLevel::low;
  const auto opened = open_torque_output(wanted).value();
  EXPECT_EQ(g_chip.flags, GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW);
  EXPECT_EQ(opened.description, "line 17 of /dev/gpiochip7 (fake), active low");
}

TEST_F(GpioLineTest, IsSetWhereItChangesOnly) {
  const auto opened = open_torque_output(wanted).value();
  for (const bool permitted : {false, true, true, true, false, false}) EXPECT_TRUE(opened.output->tell(permitted));
  EXPECT_THAT(g_chip.sets, ElementsAre(1, 0));
}

TEST_F(GpioLineTest, ALineThatReadsOtherwiseIsNotAsToldAndIsSetAgain) {
  const auto opened = open_torque_output(wanted).value();
  ASSERT_TRUE(opened.output->tell(true));
  g_chip.value = 0;  // another part pulls it
  EXPECT_FALSE(opened.output->tell(true));
  EXPECT_TRUE(opened.output->tell(true)) << "set again";
  g_chip.stuck = true;
  EXPECT_FALSE(opened.output->tell(false)) << "torque that is not taken is told";
  EXPECT_FALSE(opened.output->tell(false));
  g_chip.stuck = false;
  EXPECT_TRUE(opened.output->tell(false));
}

TEST_F(GpioLineTest, AChipThatIsGoneIsNotAsTold) {
  const auto opened = open_torque_output(wanted).value();
  ASSERT_TRUE(opened.output->tell(true));
  g_chip.read_works = g_chip.set_works = false;
  EXPECT_FALSE(opened.output->tell(true));
  EXPECT_FALSE(opened.output->tell(false));
}

TEST_F(GpioLineTest, WhatCannotBeHadIsToldInOneSentence) {
  g_chip.exists = false;
  EXPECT_THAT(open_torque_output(wanted).error(),
              HasSubstr("safety.safe_torque_off: line 17 of /dev/gpiochip7: No such file"));
  g_chip.exists = true;
  g_chip.request_error = EBUSY;
  EXPECT_THAT(open_torque_output(wanted).error(), HasSubstr("relay-daemon uses it"));
  g_chip.request_error = EPERM;
  EXPECT_THAT(open_torque_output(wanted).error(), HasSubstr("not permitted"));
  wanted.line = 40;
  EXPECT_THAT(open_torque_output(wanted).error(), HasSubstr("the chip has 32 lines"));
  EXPECT_FALSE(g_chip.is_open);
}

}  // namespace
}  // namespace takt::drivers
