// SPDX-License-Identifier: Apache-2.0
// Goal: what the kernel and `ip` say is read as they mean it, and what is absent stays empty. Method: a planted tree in
// place of /proc, /sys, /dev and /etc, and texts of `ip -details -json` in iproute2's own form.
#include "systemd/doctor/collect.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "config/load.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::doctor {
namespace {

namespace fs = std::filesystem;

class Collect : public testing::Test {
 protected:
  void plant(const std::string& path, const std::string& text) const {
    fs::create_directories((root_.path() + path).substr(0, (root_.path() + path).rfind('/')));
    std::ofstream(root_.path() + path) << text;
  }
  [[nodiscard]] Snapshot collected(const config::RobotConfig* robot = nullptr) const {
    return collect({root_.path(), [](const auto&) { return drivers::CanLink{}; }}, robot);
  }
  const test::TemporaryDirectory root_;
};

TEST_F(Collect, AnEmptyMachineSaysNothing) {
  const Snapshot machine = collected();
  EXPECT_TRUE(machine.cpus.empty());
  EXPECT_FALSE(machine.rt_runtime_us.has_value());
  EXPECT_TRUE(machine.watchdog.empty());
  EXPECT_FALSE(machine.units_installed);
  EXPECT_FALSE(machine.cpu_dma_latency.has_value());
  EXPECT_FALSE(machine.service_user.has_value());
  EXPECT_EQ(machine.steal_share, 0);
}

TEST_F(Collect, FilesAreReadAsTheKernelWritesThem) {
  const std::string cpu = "/sys/devices/system/cpu/";
  plant(cpu + "online", "0-3\n");
  plant(cpu + "isolated", "1,3\n");
  plant(cpu + "nohz_full", "(null)\n");
  plant(cpu + "cpu1/cpufreq/scaling_governor", "powersave\n");
  plant(cpu + "cpu1/cpuidle/state0/name", "C6\n");
  plant(cpu + "cpu1/cpuidle/state0/latency", "133\n");
  plant(cpu + "cpu1/cpuidle/state0/disable", "1\n");
  plant("/proc/sys/kernel/sched_rt_runtime_us", "-1\n");
  plant("/proc/cpuinfo", "processor : 0\nvendor_id\t: GenuineIntel\nflags\t\t: fpu hypervisor sse\n");
  plant("/proc/stat", "cpu  70 0 10 10 0 0 0 10 5 5\ncpu0 1 1 1\n");
  plant("/proc/irq/120/smp_affinity_list", "0,2-3\n");
  plant("/proc/irq/120/nvme0q1/spurious", "");
  plant("/proc/irq/121/smp_affinity_list", "0-3\n");  // a queue the kernel manages: kept off the isolated cores
  plant("/proc/irq/121/effective_affinity_list", "2\n");
  plant("/proc/irq/default_smp_affinity", "f\n");
  plant("/etc/systemd/system.conf", "[Manager]\n#RuntimeWatchdogSec=off\nRuntimeWatchdogSec=10s\n");
  plant("/sys/class/watchdog/watchdog0/identity", "iTCO_wdt\n");
  const auto robot = config::load("config/arm6.yaml");
  ASSERT_TRUE(robot.has_value());
  Snapshot machine = collected(&*robot);
  std::ranges::sort(machine.interrupts, {}, &Interrupt::number);
  EXPECT_EQ(machine.cpus, (std::vector<int>{0, 1, 2, 3}));
  EXPECT_EQ(machine.isolated, (std::vector<int>{1, 3}));
  EXPECT_TRUE(machine.nohz_full.empty());
  EXPECT_EQ(machine.governor, "powersave");
  ASSERT_EQ(machine.sleep_states.size(), 1U);
  EXPECT_EQ(machine.sleep_states[0].exit_latency_us, 133);
  EXPECT_TRUE(machine.sleep_states[0].disabled);
  EXPECT_EQ(machine.rt_runtime_us, -1);
  EXPECT_TRUE(machine.hypervisor);
  EXPECT_EQ(machine.processor_vendor, "GenuineIntel");
  EXPECT_DOUBLE_EQ(machine.steal_share, 0.1);
  ASSERT_EQ(machine.interrupts.size(), 2U);
  EXPECT_EQ(machine.interrupts[0].name, "nvme0q1");
  EXPECT_EQ(machine.interrupts[0].cpus, (std::vector<int>{0, 2, 3}));
  EXPECT_EQ(machine.interrupts[1].cpus, (std::vector<int>{2})) << "where it goes, not where it might";
  EXPECT_EQ(machine.systemd_watchdog, "10s");
  EXPECT_EQ(machine.watchdog, "iTCO_wdt");
  EXPECT_EQ(machine.can.size(), 2U);
  EXPECT_FALSE(machine.can[0].exists);
  EXPECT_GT(machine.runs_free_bytes, 0U);
}

// Goal: what else may take the control core (1, of config/arm6.yaml) is read as kernel, systemd and tuned write it.
// Method: planted files; a thread whose name has brackets and blanks; a drop-in that starts the unit's cores over.
TEST_F(Collect, WhatElseMayTakeTheCore) {
  plant("/sys/devices/system/cpu/cpu1/topology/thread_siblings_list", "1,5\n");
  const std::string zeros =
      " 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0";  // fields 4 to 39
  plant("/proc/7/comm", "irqbalance\n");
  plant("/proc/7/task/7/stat", "7 (irqbalance) S" + zeros + " 0 0 0 0\n");
  plant("/proc/24/task/24/stat", "24 (irq/24-a) b)) S" + zeros + " 50 1 0 0\n");
  plant("/proc/24/task/24/status", "Name:\tirq/24\nCpus_allowed_list:\t0-1\n");
  plant("/proc/24/task/25/stat", "25 (rr) S" + zeros + " 7 2 0 0\n");
  plant("/proc/24/task/26/stat", "26 (cut S 1 2");
  plant("/proc/swaps", "Filename Type Size Used Priority\n/dev/sda2 partition 1 0 -2\n");
  plant("/sys/kernel/mm/transparent_hugepage/enabled", "always [madvise] never\n");
  plant("/sys/devices/virtual/workqueue/cpumask", "1,00000005\n");
  plant("/proc/sys/kernel/timer_migration", "1\n");
  plant("/sys/devices/system/cpu/cpuidle/current_driver", "intel_idle\n");
  plant("/etc/tuned/active_profile", "balanced\n");
  plant("/usr/lib/systemd/system/takt-executive.service", "[Service]\nCPUAffinity=0\n");
  const auto robot = config::load("config/arm6.yaml");
  ASSERT_TRUE(robot.has_value());
  const Neighbourhood around = collected(&*robot).neighbourhood;
  EXPECT_EQ(around.hardware_threads, (std::vector<int>{1, 5}));
  EXPECT_TRUE(around.irqbalance_runs);
  ASSERT_EQ(around.real_time_threads.size(), 2U) << "of the others none is real-time, or one cannot be read";
  const auto& irq = *std::ranges::find(around.real_time_threads, 50, &RealTimeThread::priority);
  EXPECT_EQ(irq.name, "irq/24-a) b)");
  EXPECT_EQ(irq.cpus, (std::vector<int>{0, 1}));
  EXPECT_TRUE(around.has_swap);
  EXPECT_EQ(around.huge_pages, "madvise");
  EXPECT_EQ(around.work_queue_cpus, (std::vector<int>{0, 2, 32}));
  EXPECT_EQ(around.timers_migrate, true);
  EXPECT_EQ(around.idle_driver, "intel_idle");
  EXPECT_EQ(around.tuned_profile, "balanced");
  EXPECT_EQ(around.unit_cpus, (std::vector<int>{0}));
  plant("/etc/systemd/system/takt-executive.service.d/override.conf", "[Service]\nCPUAffinity=\nCPUAffinity=2 3\n");
  EXPECT_EQ(collected(&*robot).neighbourhood.unit_cpus, (std::vector<int>{2, 3}));
  plant("/proc/swaps", "Filename Type Size Used Priority\n");
  EXPECT_FALSE(collected().neighbourhood.has_swap);
}

// Users and groups in the form of passwd(5) and group(5): takt is in its own group and in two that list it; names that
// only begin alike, and lines that are cut off, are not its.
TEST_F(Collect, RightsAreFactsOfTheFileAndOfTheServiceUser) {
  plant("/dev/cpu_dma_latency", "");
  fs::permissions(root_.path("dev/cpu_dma_latency"), fs::perms{0460});
  plant("/etc/passwd",
        "root:x:0:0:root:/root:/bin/bash\ntakt-policy:x:997:997::/:/bin/false\ntakt:x:998:998::/var/lib/takt:/bin/"
        "false\n");
  plant("/etc/group",
        "root:x:0:\ntakt-policy:x:997:takter\ntakt:x:996:\ndialout:x:20:anna,takt\nrealtime:x:21:takt\nvideo:x:44:"
        "anna\nx\n");
  const Snapshot machine = collected();
  ASSERT_TRUE(machine.cpu_dma_latency.has_value());
  EXPECT_EQ(machine.cpu_dma_latency->owner, geteuid());
  EXPECT_EQ(machine.cpu_dma_latency->mode, 0460U);
  EXPECT_EQ(machine.cpu_dma_latency->writable_by_us, geteuid() == 0) << "as access() says: the owner may only read";
  EXPECT_EQ(machine.examined_by_root, geteuid() == 0);
  ASSERT_TRUE(machine.service_user.has_value());
  EXPECT_EQ(machine.service_user->id, 998U);
  EXPECT_EQ(machine.service_user->groups, (std::vector<std::uint32_t>{996, 20, 21}));
  plant("/etc/passwd", "takt-policy:x:997:997::/:/bin/false\ntakt:x:none:998::/:/bin/false\ntakt:x\n");
  EXPECT_FALSE(collected().service_user.has_value());
}

TEST(CpuList, CopesWithWhateverStandsThere) {
  EXPECT_EQ(cpu_list("0-2,5"), (std::vector<int>{0, 1, 2, 5}));
  EXPECT_TRUE(cpu_list("").empty());
  EXPECT_TRUE(cpu_list("(null)").empty());
  EXPECT_EQ(cpu_list("3,x,1"), (std::vector<int>{3, 1}));
  EXPECT_LE(cpu_list("0-999999999").size(), 4096U);
}

}  // namespace
}  // namespace takt::doctor
