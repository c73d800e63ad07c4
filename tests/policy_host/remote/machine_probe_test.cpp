// SPDX-License-Identifier: Apache-2.0
// Goal: a machine that is there is known as such though nothing listens on it, one that never answered is not called
// silent, and what is no address is not asked. Method: the loopback interface, whose kernel answers.
#include "policy_host/remote/machine_probe.hpp"

#include <gtest/gtest.h>

#include "executive/contract/monotonic_clock.hpp"

namespace takt::policy_host::remote {
namespace {

TEST(MachineProbe, KnowsAMachineThatIsThere) {
  EXPECT_EQ(address_of("lo"), "127.0.0.1");
  EXPECT_EQ(address_of("none0"), "");
  MachineProbe probe("lo");
  probe.aim(address_of("lo"));
  const MonoTime silent_since = monotonic_now();
  EXPECT_EQ(probe.verdict(silent_since), Machine::unknown);
  probe.ask(silent_since, silent_since);  // the loopback's refusal is there at once
  probe.ask(silent_since + MachineProbe::kPeriod, silent_since);
  EXPECT_EQ(probe.verdict(silent_since), Machine::answers);
  EXPECT_EQ(probe.verdict(silent_since + seconds(1)), Machine::silent) << "it answered before that";
  probe.aim("127.0.0.2");
  EXPECT_EQ(probe.verdict(silent_since), Machine::unknown) << "another machine";
}

TEST(MachineProbe, AsksNothingThatIsNoAddress) {
  MachineProbe probe("lo");
  for (const char* const address : {"", "gpu1", "::1", "127.0.0.1 "}) {
    probe.aim(address);
    for (int i = 0; i < 3; ++i) probe.ask(MonoTime{1'000'000'000} + seconds(i), MonoTime{1});
    EXPECT_EQ(probe.verdict(MonoTime{1}), Machine::unknown) << address;
  }
}

}  // namespace
}  // namespace takt::policy_host::remote
