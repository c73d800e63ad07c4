// SPDX-License-Identifier: Apache-2.0
// Goal: one controller per interface, wherever its files lie, and none once its process is gone. Method: the loopback
// network interface stands for a CAN interface (a claim knows no difference), claimed by this process and by a child.
#include "drivers/bus/interface_claim.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "drivers/bus/open_bus.hpp"

namespace takt::drivers {
namespace {

TEST(InterfaceClaim, ASecondOneIsToldWhoHoldsIt) {
  const auto first = InterfaceClaim::make("lo");
  ASSERT_TRUE(first) << first.error();
  const auto second = InterfaceClaim::make("lo");
  ASSERT_FALSE(second);
  EXPECT_TRUE(second.error().starts_with("lo: ")) << second.error();
  EXPECT_NE(second.error().find("(pid " + std::to_string(getpid()) + ", uid "), std::string::npos) << second.error();
}

TEST(InterfaceClaim, ItEndsWithItsHolder) {
  { ASSERT_TRUE(InterfaceClaim::make("lo")); }
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  if (child == 0) {
    const auto claim = InterfaceClaim::make("lo");
    const char word = claim ? 'y' : 'n';
    if (write(ready[1], &word, 1) == 1) pause();
    _exit(1);
  }
  char word = 0;
  ASSERT_EQ(read(ready[0], &word, 1), 1);
  EXPECT_EQ(word, 'y');
  EXPECT_FALSE(InterfaceClaim::make("lo"));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  const auto after = InterfaceClaim::make("lo");
  EXPECT_TRUE(after) << after.error();
  close(ready[0]);
  close(ready[1]);
}

// Two simulated robots have buses of one name in two runtime directories: nothing to share, nothing to claim.
TEST(InterfaceClaim, OnlyInterfacesThatExistAreClaimed) {
  config::Bus simulated, real;
  simulated.interface = "takt-none0";
  real.interface = "lo";
  const auto one_robot = claim_interfaces({simulated});
  const auto another = claim_interfaces({simulated});
  EXPECT_TRUE(one_robot && another);
  const auto first = claim_interfaces({simulated, real});
  EXPECT_TRUE(first);
  EXPECT_FALSE(claim_interfaces({real}));
}

}  // namespace
}  // namespace takt::drivers
