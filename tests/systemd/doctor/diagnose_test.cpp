// SPDX-License-Identifier: Apache-2.0
// Goal: every fact that stands between a machine and a punctual loop is named with the right verdict and how to correct
// it, and a good machine hears no complaint. Method: a snapshot of a machine without fault; each case plants one fact
// and expects exactly one finding to change.
#include "systemd/doctor/diagnose.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>

#include "config/load.hpp"

namespace takt::doctor {
namespace {

constexpr std::uint64_t kGiB = std::uint64_t{1} << 30U;

// Core 1 is the control core of config/arm6.yaml; its buses are can0 and can1.
Snapshot good_machine() {
  Snapshot machine;
  machine.takt_version = "0";
  machine.kernel_release = "6.1.0-rt";
  machine.kernel_version = "#1 SMP PREEMPT_RT Debian";
  machine.cpus = {0, 1, 2, 3};
  machine.isolated = {1};
  machine.nohz_full = {1};
  machine.governor = "performance";
  machine.sleep_states = {{"POLL", 0, false}, {"C1", 2, false}, {"C6", 133, true}};
  machine.rt_runtime_us = 950'000;
  machine.rt_period_us = 1'000'000;
  machine.rtprio_limit = 99;
  machine.memlock_limit_bytes = ~std::uint64_t{0};
  machine.clocksource = "tsc";
  machine.processor_vendor = "GenuineIntel";
  machine.interrupts = {{0, "timer", {0}}, {120, "nvme0q1", {0, 2, 3}}, {8, "", {0, 1, 2, 3}}};
  Neighbourhood& around = machine.neighbourhood;
  around.hardware_threads = {1, 5};  // 5 is switched off
  around.real_time_threads = {{"migration/1", 99, {1}}, {"irq/24-can0", 50, {0, 1}}, {"rtkit", 99, {0}}};
  around.huge_pages = "madvise";
  around.work_queue_cpus = {0, 2, 3};
  around.timers_migrate = false;
  around.idle_driver = "intel_idle";
  around.unit_cpus = {0};
  machine.watchdog = "iTCO_wdt";
  machine.systemd_watchdog = "10s";
  for (int bus = 0; bus < 2; ++bus) {
    drivers::CanLink can;
    can.exists = can.up = true;
    can.controller_state = "ERROR-ACTIVE";
    can.bitrate = 1'000'000;
    can.queue_length = 64;
    machine.can.push_back(can);
  }
  machine.runs_folder = "/var/lib/takt/runs";
  machine.runs_free_bytes = 100 * kGiB;
  machine.runs_hours_left = 80;
  WakeupLatency wakeup;
  wakeup.real_time = true;
  wakeup.held_awake = true;
  wakeup.cpu = 1;
  wakeup.interference = {SmiCounter::read, 0, 0, Interference::Time{900, 1000}};
  wakeup.samples = 10'000;
  wakeup.p50_ns = 3'000;
  wakeup.p99_ns = 8'000;
  wakeup.p999_ns = 15'000;
  wakeup.max_ns = 30'000;
  wakeup.histogram = {0, 100, 9'000, 900};
  machine.wakeup = wakeup;
  return machine;
}

config::RobotConfig arm() {
  auto robot = config::load("config/arm6.yaml");
  EXPECT_TRUE(robot.has_value());
  return *robot;
}

std::vector<Finding> complaints(const Snapshot& machine, const config::RobotConfig& robot) {
  auto findings = diagnose(machine, &robot);
  std::erase_if(findings, [](const Finding& finding) { return finding.verdict == Verdict::ok; });
  return findings;
}

TEST(Diagnose, AGoodMachineHearsNoComplaint) {
  const auto robot = arm();
  const auto findings = diagnose(good_machine(), &robot);
  EXPECT_EQ(worst(findings), Verdict::ok);
  for (const Finding& finding : complaints(good_machine(), robot))
    ADD_FAILURE() << finding.check << ": " << finding.found;
  EXPECT_GE(findings.size(), 18U);
}

struct Fact {
  const char* what;
  Verdict verdict;
  const char* check;
  const char* cure;  // part of the advice
  std::function<void(Snapshot&)> plant;
};

TEST(Diagnose, EachBadFactIsNamedAloneWithItsCure) {
  const Fact facts[] = {
      {"kernel", Verdict::fail, "kernel", "linux-image-rt",
       [](Snapshot& m) { m.kernel_version = "#1 SMP PREEMPT_DYNAMIC"; }},
      {"virtual machine", Verdict::fail, "platform", "metal", [](Snapshot& m) { m.hypervisor = true; }},
      {"stolen time", Verdict::warn, "platform", "shares", [](Snapshot& m) { m.steal_share = 0.02; }},
      {"core absent", Verdict::fail, "cores", "cpu: none",
       [](Snapshot& m) {
         m.cpus = {0, 2};
       }},
      {"one core", Verdict::warn, "cores", "two or more", [](Snapshot& m) { m.cpus = {1}; }},
      {"not isolated", Verdict::warn, "isolcpus", "isolcpus=managed_irq,domain,1",
       [](Snapshot& m) { m.isolated = {2}; }},
      {"a busy hardware thread", Verdict::warn, "hw threads", "cpu3/online",
       [](Snapshot& m) {
         m.neighbourhood.hardware_threads = {1, 3};
       }},
      {"somebody's real-time thread", Verdict::warn, "rt threads", "control.priority",
       [](Snapshot& m) { m.neighbourhood.real_time_threads[1].priority = 99; }},
      {"irqbalance", Verdict::warn, "irqbalance", "IRQBALANCE_BANNED_CPULIST",
       [](Snapshot& m) { m.neighbourhood.irqbalance_runs = true; }},
      {"work queues", Verdict::warn, "work queues", "mask",
       [](Snapshot& m) { m.neighbourhood.work_queue_cpus.push_back(1); }},
      {"timers", Verdict::warn, "timers", "timer_migration=0",
       [](Snapshot& m) { m.neighbourhood.timers_migrate = true; }},
      {"the unit's core", Verdict::warn, "unit", "systemctl edit",
       [](Snapshot& m) {
         m.neighbourhood.unit_cpus = {0, 1};
       }},
      {"huge pages", Verdict::warn, "huge pages", "madvise",
       [](Snapshot& m) { m.neighbourhood.huge_pages = "always"; }},
      {"swap", Verdict::warn, "swap", "swapoff", [](Snapshot& m) { m.neighbourhood.has_swap = true; }},
      {"the firmware's idle driver", Verdict::warn, "idle driver", "max_cstate",
       [](Snapshot& m) { m.neighbourhood.idle_driver = "acpi_idle"; }},
      {"a tuned profile that saves power", Verdict::warn, "tuned", "realtime",
       [](Snapshot& m) { m.neighbourhood.tuned_profile = "balanced"; }},
      {"an idle machine", Verdict::warn, "load", "--load",
       [](Snapshot& m) { m.wakeup->interference.others->busy_ticks = 20; }},
      {"governor", Verdict::warn, "governor", "performance", [](Snapshot& m) { m.governor = "powersave"; }},
      {"deep sleep", Verdict::warn, "sleep states", "cpu_dma_latency",
       [](Snapshot& m) { m.sleep_states[2].disabled = false; }},
      {"interrupts", Verdict::warn, "interrupts", "takt-irq-affinity",
       [](Snapshot& m) {
         m.interrupts[1].cpus = {0, 1};
       }},
      {"clock", Verdict::warn, "clock source", "TSC", [](Snapshot& m) { m.clocksource = "hpet"; }},
      {"priority", Verdict::fail, "rtprio", "rtprio 99", [](Snapshot& m) { m.rtprio_limit = 0; }},
      {"priority, with units", Verdict::warn, "rtprio", "rtprio",
       [](Snapshot& m) {
         m.rtprio_limit = 0;
         m.units_installed = true;
       }},
      {"memory", Verdict::fail, "memlock", "memlock unlimited", [](Snapshot& m) { m.memlock_limit_bytes = 8U << 20U; }},
      {"no interface", Verdict::warn, "can can0", "refuse", [](Snapshot& m) { m.can[0].exists = false; }},
      {"down", Verdict::fail, "can can1", "takt bus up", [](Snapshot& m) { m.can[1].up = false; }},
      {"bit rate", Verdict::fail, "can can0", "takt bus up", [](Snapshot& m) { m.can[0].bitrate = 500'000; }},
      {"bus-off", Verdict::fail, "can can0", "takt bus up", [](Snapshot& m) { m.can[0].controller_state = "BUS-OFF"; }},
      {"passive", Verdict::warn, "can can0", "termination",
       [](Snapshot& m) { m.can[0].controller_state = "ERROR-PASSIVE"; }},
      {"disturbed", Verdict::warn, "can can0", "termination", [](Snapshot& m) { m.can[0].receive_errors = 96; }},
      {"was off", Verdict::warn, "can can0", "timing", [](Snapshot& m) { m.can[0].went_off = 1; }},
      {"short queue", Verdict::warn, "can can0", "takt bus up", [](Snapshot& m) { m.can[0].queue_length = 10; }},
      {"full disk", Verdict::fail, "disk", "remove", [](Snapshot& m) { m.runs_hours_left = 0.5; }},
      {"little room", Verdict::warn, "disk", "room", [](Snapshot& m) { m.runs_hours_left = 5; }},
      {"no watchdog", Verdict::warn, "watchdog", "iTCO_wdt", [](Snapshot& m) { m.watchdog.clear(); }},
      {"unfed watchdog", Verdict::warn, "watchdog", "RuntimeWatchdogSec",
       [](Snapshot& m) { m.systemd_watchdog.clear(); }},
      {"late", Verdict::fail, "wake-ups", "hwlatdetect", [](Snapshot& m) { m.wakeup->max_ns = 600'000; }},
      {"rather late", Verdict::warn, "wake-ups", "isolate", [](Snapshot& m) { m.wakeup->max_ns = 150'000; }},
      {"measured without priority", Verdict::warn, "wake-ups", "isolate",
       [](Snapshot& m) { m.wakeup->real_time = false; }},
      {"late, sleep states allowed", Verdict::fail, "wake-ups", "measure where /dev/cpu_dma_latency can be opened",
       [](Snapshot& m) {
         m.wakeup->max_ns = 600'000;
         m.wakeup->held_awake = false;
       }},
      {"rather late, sleep states allowed", Verdict::warn, "wake-ups",
       "measure where /dev/cpu_dma_latency can be opened",
       [](Snapshot& m) {
         m.wakeup->max_ns = 150'000;
         m.wakeup->held_awake = false;
       }},
      {"an SMI", Verdict::warn, "SMIs", "USB legacy", [](Snapshot& m) { m.wakeup->interference.smis = 1; }},
      {"no msr driver", Verdict::warn, "SMIs", "as root: modprobe msr",
       [](Snapshot& m) { m.wakeup->interference.smi_counter = SmiCounter::no_driver; }},
      {"msr refused", Verdict::warn, "SMIs", "as root: modprobe msr",
       [](Snapshot& m) { m.wakeup->interference.smi_counter = SmiCounter::refused; }},
      {"time stolen meanwhile", Verdict::warn, "stolen time", "metal",
       [](Snapshot& m) { m.wakeup->interference.stolen_ms = 10; }},
  };
  const auto robot = arm();
  for (const Fact& fact : facts) {
    Snapshot machine = good_machine();
    fact.plant(machine);
    const auto found = complaints(machine, robot);
    ASSERT_EQ(found.size(), 1U) << fact.what;
    EXPECT_EQ(found[0].check, fact.check) << fact.what;
    EXPECT_EQ(found[0].verdict, fact.verdict) << fact.what;
    EXPECT_NE(found[0].cure.find(fact.cure), std::string::npos) << fact.what << ": " << found[0].cure;
    EXPECT_FALSE(found[0].found.empty() || found[0].where.empty()) << fact.what;
  }
}

// nohz_full is an option: without it nothing is wrong.
TEST(Diagnose, TheSchedulersTickIsNoFault) {
  Snapshot machine = good_machine();
  machine.nohz_full.clear();
  EXPECT_TRUE(complaints(machine, arm()).empty());
}

// Goal: a quantile is told with the count behind it, or not at all. Method: a million wake-ups, and fewer.
TEST(Diagnose, TheRarestQuantileComesWithItsCount) {
  Snapshot machine = good_machine();
  const auto robot = arm();
  EXPECT_NE(text_of(diagnose(machine, &robot), machine).find("p99.999 wants 1000000 wake-ups"), std::string::npos);
  machine.wakeup->p99999_ns = 28'000;
  machine.wakeup->beyond_p99999 = 9;
  machine.wakeup->samples = 1'000'000;
  const auto findings = diagnose(machine, &robot);
  const std::string text = text_of(findings, machine);
  EXPECT_NE(text.find("p99.999 28 us (9 of 1000000 later)"), std::string::npos) << text;
  EXPECT_NE(text.find("28 us at p99.999 (9 later)"), std::string::npos) << text;
}

// What the robot file says decides what a fact means.
TEST(Diagnose, TheRobotFileDecides) {
  auto robot = arm();
  Snapshot machine = good_machine();
  machine.can[0].exists = false;
  robot.buses[0].when_missing = config::WhenBusMissing::refuse;
  EXPECT_EQ(complaints(machine, robot).at(0).verdict, Verdict::fail) << "a bus that must be there";

  robot = arm();
  robot.control.wake = config::WakeMode::hybrid;
  robot.control.spin = microseconds(900);
  const auto throttled = complaints(good_machine(), robot);
  ASSERT_EQ(throttled.size(), 1U);
  EXPECT_EQ(throttled[0].check, "rt throttling");

  robot = arm();
  robot.buses[0].fd = true;
  robot.buses[0].data_bitrate = 5'000'000;
  EXPECT_EQ(complaints(good_machine(), robot).at(0).check, "can can0") << "FD is wanted, classic is set";

  machine = good_machine();
  machine.can[0].is_virtual = true;
  machine.can[0].bitrate = 0;
  machine.can[0].controller_state.clear();
  EXPECT_TRUE(complaints(machine, arm()).empty()) << "a virtual interface has no bit rate";
}

// Goal: bit timing that the robot file asks for is what the controller does. moteus at 5 Mbit/s wants 0.666 (maker's
// page).
TEST(Diagnose, BitTimingIsComparedWhereTheRobotFileGivesIt) {
  auto robot = arm();
  config::Bus& bus = robot.buses[0];
  bus.fd = true;
  bus.data_bitrate = 5'000'000;
  Snapshot machine = good_machine();
  drivers::CanLink& can = machine.can[0];
  can.fd = true;
  can.data_bitrate = 5'000'000;
  can.sample_point = can.data_sample_point = 0.75;
  can.sjw = can.data_sjw = 1;
  EXPECT_TRUE(complaints(machine, robot).empty()) << "the kernel may choose";
  bus.data_sample_point = 0.666;
  bus.data_sjw = 2;
  auto found = complaints(machine, robot);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].found, "sample point 0.750 for FD data, the robot file says 0.666");
  can.data_sample_point = 0.65;  // a bit of 20 quanta has no 0.666
  found = complaints(machine, robot);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].found, "sjw 1 for FD data, the robot file says 2");
  can.data_sjw = 2;
  EXPECT_TRUE(complaints(machine, robot).empty());
  bus.sample_point = 0.875;
  found = complaints(machine, robot);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].found, "sample point 0.750, the robot file says 0.875");
}

// Goal: a drive that has no command timeout is never passed over in silence.
TEST(Diagnose, AWatchdogWaiverIsAWarningThatRepeatsItsReason) {
  auto robot = arm();
  robot.joints[2].drive.watchdog_waiver = "seen to stop within 100 ms";
  const auto found = complaints(good_machine(), robot);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].check, "drive " + robot.joints[2].name);
  EXPECT_EQ(found[0].verdict, Verdict::warn);
  EXPECT_NE(found[0].found.find("seen to stop within 100 ms"), std::string::npos);
}

// Goal: a deep sleep state is fine exactly where the executive may forbid it, as whom it will run. Method: every case
// of owner, group and mode against every kind of examiner; takt is user 998 in groups 998 and 20.
TEST(Diagnose, ASleepStateThatTheExecutiveMayForbidIsFine) {
  const Account takt{998, {998, 20}};
  struct {
    const char* when;
    bool root;
    std::optional<Account> service_user;
    std::optional<FileRights> device;
    bool may;
  } const cases[] = {
      {"no device", true, takt, {}, false},
      {"root, root's alone", true, takt, FileRights{0, 0, 0600, true}, false},
      {"root, the kernel's own mode", true, takt, FileRights{0, 0, 0640, true}, false},
      {"root, as the package sets it", true, takt, FileRights{0, 998, 0660, true}, true},
      {"root, another group of takt's", true, takt, FileRights{0, 20, 0620, true}, true},
      {"root, a group that takt is not in", true, takt, FileRights{0, 21, 0660, true}, false},
      {"root, everybody's to read", true, takt, FileRights{0, 0, 0664, true}, false},
      {"root, everybody's", true, takt, FileRights{0, 0, 0666, true}, true},
      {"root, everybody's but the group's", true, takt, FileRights{0, 998, 0606, true}, false},
      {"root, takt's own", true, takt, FileRights{998, 0, 0200, true}, true},
      {"root, takt's own to read, its group's to write", true, takt, FileRights{998, 998, 0460, true}, false},
      {"root, no user takt: the executive is root's", true, {}, FileRights{0, 0, 0600, true}, true},
      {"another user, who may", false, takt, FileRights{0, 0, 0600, true}, true},
      {"another user, who may not", false, takt, FileRights{0, 998, 0660, false}, false},
  };
  for (const auto& row : cases) {
    Snapshot machine = good_machine();
    machine.sleep_states[2].disabled = false;
    machine.examined_by_root = row.root;
    machine.service_user = row.service_user;
    machine.cpu_dma_latency = row.device;
    const auto found = complaints(machine, arm());
    EXPECT_EQ(found.empty(), row.may) << row.when;
    if (found.empty()) continue;
    EXPECT_EQ(found[0].check, "sleep states") << row.when;
    const bool named = found[0].found.find("user takt may not write") != std::string::npos;
    EXPECT_EQ(named, row.root && row.device.has_value()) << row.when << ": " << found[0].found;
  }
}

const Finding& finding_of(const std::vector<Finding>& findings, const std::string& check) {
  const auto found = std::ranges::find(findings, check, &Finding::check);
  EXPECT_NE(found, findings.end()) << check;
  return *found;
}

// Goal: what a machine cannot count is said to be not counted, without complaint, and never as a number. Method: a
// processor of another make, one without the register, a virtual machine whose own register says 0, a kernel that tells
// no stolen time.
TEST(Diagnose, WhatCannotBeCountedIsNotHeldAgainstTheMachine) {
  struct {
    const char* when;
    const char* check;
    const char* key;
    bool hypervisor;
    std::function<void(Snapshot&)> plant;
  } const cases[] = {
      {"AMD, no driver", "SMIs", "smis", false,
       [](Snapshot& m) {
         m.processor_vendor = "AuthenticAMD";
         m.wakeup->interference.smi_counter = SmiCounter::no_driver;
       }},
      {"AMD, driver", "SMIs", "smis", false,
       [](Snapshot& m) {
         m.processor_vendor = "AuthenticAMD";
         m.wakeup->interference.smi_counter = SmiCounter::no_register;
       }},
      {"no such register", "SMIs", "smis", false,
       [](Snapshot& m) { m.wakeup->interference.smi_counter = SmiCounter::no_register; }},
      {"ARM", "SMIs", "smis", false,
       [](Snapshot& m) {
         m.processor_vendor.clear();
         m.wakeup->interference.smi_counter = SmiCounter::no_driver;
       }},
      {"a virtual machine that may read", "SMIs", "smis", true, [](Snapshot& m) { m.hypervisor = true; }},
      {"a virtual machine without driver", "SMIs", "smis", true,
       [](Snapshot& m) {
         m.hypervisor = true;
         m.wakeup->interference.smi_counter = SmiCounter::no_driver;
       }},
      {"no stolen time told", "stolen time", "stolen_ms", false,
       [](Snapshot& m) { m.wakeup->interference.stolen_ms.reset(); }},
  };
  const auto robot = arm();
  for (const auto& row : cases) {
    Snapshot machine = good_machine();
    row.plant(machine);
    const auto findings = diagnose(machine, &robot);
    const Finding& finding = finding_of(findings, row.check);
    EXPECT_EQ(finding.verdict, Verdict::ok) << row.when;
    EXPECT_TRUE(finding.found.starts_with("not counted")) << row.when << ": " << finding.found;
    EXPECT_EQ(complaints(machine, robot).size(), row.hypervisor ? 1U : 0U) << row.when;
    EXPECT_TRUE(nlohmann::json::parse(json_of(findings, machine)).at("wakeup").at(row.key).is_null()) << row.when;
  }
  Snapshot unmeasured = good_machine();
  unmeasured.wakeup.reset();
  for (const Finding& finding : diagnose(unmeasured, &robot))
    EXPECT_TRUE(finding.check != "SMIs" && finding.check != "stolen time") << "nothing was measured";
}

// Goal: text and JSON tell what was counted during the measurement, and whether sleep states were forbidden meanwhile.
TEST(Diagnose, TheMeasurementTellsWhatDisturbedIt) {
  const auto robot = arm();
  Snapshot machine = good_machine();
  machine.wakeup->interference = {SmiCounter::read, 3, 20, Interference::Time{9, 10}};
  auto findings = diagnose(machine, &robot);
  EXPECT_TRUE(finding_of(findings, "SMIs").found.starts_with("3 during the measurement"));
  EXPECT_NE(finding_of(findings, "SMIs").where.find("/dev/cpu/1/msr"), std::string::npos);
  EXPECT_EQ(finding_of(findings, "stolen time").found, "20 ms of core 1 during the measurement");
  auto json = nlohmann::json::parse(json_of(findings, machine)).at("wakeup");
  EXPECT_EQ(json.at("smis"), 3);
  EXPECT_EQ(json.at("stolen_ms"), 20);
  EXPECT_EQ(json.at("held_awake"), true);
  EXPECT_NE(text_of(findings, machine).find("real time, kept awake: p50"), std::string::npos);

  machine.wakeup->held_awake = false;
  machine.wakeup->cpu.reset();
  machine.wakeup->interference.smi_counter = SmiCounter::no_driver;
  findings = diagnose(machine, &robot);
  EXPECT_EQ(finding_of(findings, "wake-ups").verdict, Verdict::ok) << "punctual even so";
  EXPECT_NE(finding_of(findings, "wake-ups").found.find("with sleep states allowed"), std::string::npos);
  EXPECT_EQ(finding_of(findings, "stolen time").found, "20 ms of all cores during the measurement");
  json = nlohmann::json::parse(json_of(findings, machine)).at("wakeup");
  EXPECT_EQ(json.at("held_awake"), false);
  EXPECT_TRUE(json.at("smis").is_null()) << "3 is not a count when it was not read";
  const std::string text = text_of(findings, machine);
  EXPECT_NE(text.find("real time, SLEEP STATES ALLOWED: p50"), std::string::npos) << text;
  EXPECT_NE(text.find("could not be read"), std::string::npos) << text;
}

TEST(Diagnose, TextNamesTheCureAndJsonIsStable) {
  Snapshot machine = good_machine();
  machine.kernel_version = "#1 SMP";
  const auto robot = arm();
  const auto findings = diagnose(machine, &robot);
  const std::string text = text_of(findings, machine);
  EXPECT_NE(text.find("fail  kernel"), std::string::npos) << text;
  EXPECT_NE(text.find("-> apt-get install linux-image-rt"), std::string::npos);
  EXPECT_NE(text.find("1 to correct, 0 to improve"), std::string::npos);
  EXPECT_NE(text.find("not fit for hard real time"), std::string::npos);
  const auto json = nlohmann::json::parse(json_of(findings, machine));
  EXPECT_EQ(json["schema"], "takt.doctor/1");
  EXPECT_EQ(json["verdict"], "fail");
  EXPECT_EQ(json["findings"].size(), findings.size());
  EXPECT_EQ(json["wakeup"]["p99_ns"], 8'000);
}

}  // namespace
}  // namespace takt::doctor
