// SPDX-License-Identifier: Apache-2.0
// What `takt doctor` read on this machine, before it is judged. Plain data, so that tests can plant facts.
// An absent optional or an empty text: the machine does not say.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/bus/can_link.hpp"

namespace takt::doctor {

struct SleepState {
  std::string name;  // "C6"
  std::int64_t exit_latency_us = 0;
  bool disabled = false;  // by the administrator
};

struct Interrupt {
  int number = 0;
  std::string name;       // "xhci_hcd"; empty: unnamed
  std::vector<int> cpus;  // where it goes, or may go as long as no driver requests it
};

// Who may write a file: what stat() says, and access() for the doctor itself. Access control lists are not looked at.
struct FileRights {
  std::uint32_t owner = 0, group = 0;  // ids
  std::uint32_t mode = 0;              // permission bits
  bool writable_by_us = false;
};

struct Account {
  std::uint32_t id = 0;
  std::vector<std::uint32_t> groups;
};

// A thread of another process that the scheduler treats as real-time.
struct RealTimeThread {
  std::string name;  // "irq/24-can0"
  int priority = 0;  // SCHED_FIFO or SCHED_RR, 1..99
  std::vector<int> cpus;
};

// What else may take the control core, or slow it down.
struct Neighbourhood {
  std::vector<int> hardware_threads;  // of the control core's physical core, itself among them
  std::vector<RealTimeThread> real_time_threads;
  bool irqbalance_runs = false;
  std::string huge_pages;  // "always", "madvise", "never"
  bool has_swap = false;
  std::vector<int> work_queue_cpus;    // where unbound kernel work runs
  std::optional<bool> timers_migrate;  // kernel.timer_migration
  std::string idle_driver;             // "intel_idle", "acpi_idle"
  std::string tuned_profile;           // empty: tuned sets nothing
  std::vector<int> unit_cpus;          // CPUAffinity= of the executive's unit, drop-ins included; empty: any
};

// Whether the processor's count of system management interrupts (SMIs) could be read.
enum class SmiCounter : std::uint8_t {
  read,
  no_driver,    // no /dev/cpu/N/msr: module msr is not loaded
  refused,      // the driver wants root
  no_register,  // the processor counts none
};

// What took a processor away without the kernel's doing.
struct Interference {
  SmiCounter smi_counter = SmiCounter::no_driver;
  std::uint32_t smis = 0;                 // 0 unless read
  std::optional<std::int64_t> stolen_ms;  // that a hypervisor gave to others; absent: not told
  // Of all cores but the measured one, busy or idle: since the machine started, or within a measurement.
  struct Time {
    std::int64_t busy_ticks = 0, all_ticks = 0;
  };
  std::optional<Time> others;  // absent: not told, or there are no others
};

// Lateness of periodic wake-ups of a thread like the control thread, ns.
struct WakeupLatency {
  bool real_time = false;   // SCHED_FIFO and locked memory were granted
  bool held_awake = false;  // /dev/cpu_dma_latency was held at 0 us meanwhile, as the executive holds it
  std::optional<int> cpu;   // to which the thread was to be pinned; absent: none
  std::uint64_t samples = 0;
  std::int64_t p50_ns = 0, p99_ns = 0, p999_ns = 0, max_ns = 0;
  std::optional<std::int64_t> p99999_ns;  // absent: too few samples to say
  std::uint64_t beyond_p99999 = 0;        // samples that were later still
  bool own_load = false;                  // the doctor loaded the other cores meanwhile
  std::vector<std::uint64_t> histogram;   // bucket k counts lateness in [2^k, 2^(k+1)) us; bucket 0 from 0
  Interference interference;              // while it was measured
};

struct Snapshot {
  std::string examined_at;  // UTC, "2026-11-21T09:33:00Z"
  std::string takt_version, kernel_release, kernel_version;
  std::vector<int> cpus;                      // online
  std::vector<int> isolated, nohz_full;       // isolcpus=, nohz_full=
  std::string governor;                       // of the control core, cpufreq
  std::vector<SleepState> sleep_states;       // of the control core
  std::optional<FileRights> cpu_dma_latency;  // absent: the kernel has no such device
  bool examined_by_root = false;              // root may write whatever is there, which says nothing of others
  std::optional<Account> service_user;        // takt, as whom the packaged executive runs; absent: no such user
  std::optional<std::int64_t> rt_runtime_us, rt_period_us;
  std::uint64_t rtprio_limit = 0;                          // RLIMIT_RTPRIO, hard
  std::uint64_t memlock_limit_bytes = 0;                   // RLIMIT_MEMLOCK, hard
  bool may_set_priority = false, may_lock_memory = false;  // CAP_SYS_NICE, CAP_IPC_LOCK
  bool units_installed = false;                            // the executive's unit grants itself both
  std::string clocksource;
  std::string processor_vendor;  // "GenuineIntel"; empty: not told, as on ARM
  bool hypervisor = false;
  double steal_share = 0;             // of all processor time since boot
  std::vector<Interrupt> interrupts;  // all
  Neighbourhood neighbourhood;
  std::string watchdog;               // of the hardware: its identity
  std::string systemd_watchdog;       // RuntimeWatchdogSec=, as written
  std::vector<drivers::CanLink> can;  // the robot file's interfaces, in its order
  std::string runs_folder;            // record.directory, or its nearest parent that exists
  std::uint64_t runs_free_bytes = 0;
  double runs_hours_left = 0;           // at the pace of the newest runs; infinite: record.keep makes room
  std::optional<WakeupLatency> wakeup;  // absent: not measured
};

}  // namespace takt::doctor
