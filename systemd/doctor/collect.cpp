// SPDX-License-Identifier: Apache-2.0
#include "systemd/doctor/collect.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <linux/capability.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "executive/contract/version.hpp"
#include "systemd/doctor/kernel_files.hpp"
#include "systemd/doctor/neighbourhood.hpp"

namespace takt::doctor {
namespace {

namespace fs = std::filesystem;

// Below this: a list of processors that names more is malformed.
constexpr int kMostCpus = 4096;

bool has_capability(unsigned capability) {
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  std::array<__user_cap_data_struct, 2> data{};
  if (syscall(SYS_capget, &header, data.data()) != 0) return false;
  return (data.at(capability / 32).effective >> (capability % 32) & 1U) != 0;
}

std::uint64_t hard_limit(__rlimit_resource resource) {
  rlimit limit{};
  return getrlimit(resource, &limit) == 0 ? limit.rlim_max : 0;
}

std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream parts(line);
  for (std::string part; std::getline(parts, part, ':');) fields.push_back(part);
  return fields;
}

std::optional<std::uint32_t> id_in(const std::string& text) {
  std::uint32_t id = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return id;
}

bool names(const std::string& members, const std::string& name) {
  std::istringstream parts(members);
  for (std::string part; std::getline(parts, part, ',');)
    if (part == name) return true;
  return false;
}

// With the groups that `User=` and `Group=` of the same name give a service, see passwd(5) and group(5).
std::optional<Account> service_account(const std::string& root, const std::string& name) {
  std::optional<Account> account;
  std::ifstream passwd(root + "/etc/passwd"), group(root + "/etc/group");
  for (std::string line; std::getline(passwd, line);)
    if (const auto entry = fields_of(line); entry.size() >= 4 && entry[0] == name)
      if (const auto id = id_in(entry[2])) account = Account{*id, {}};
  if (!account) return account;
  for (std::string line; std::getline(group, line);) {
    const auto entry =
        fields_of(line);  // name:password:id:member,member; nothing after the last colon: no fourth field
    if (entry.size() < 3 || (entry[0] != name && (entry.size() < 4 || !names(entry[3], name)))) continue;
    if (const auto id = id_in(entry[2])) account->groups.push_back(*id);
  }
  return account;
}

std::optional<FileRights> rights_of(const std::string& path) {
  struct stat file {};
  if (stat(path.c_str(), &file) != 0) return std::nullopt;
  return FileRights{file.st_uid, file.st_gid, file.st_mode & 07777U, access(path.c_str(), W_OK) == 0};
}

void read_kernel(const std::string& root, Snapshot& into) {
  utsname system{};
  (void)::uname(&system);
  into.kernel_release = system.release;
  into.kernel_version = system.version;
  into.rt_runtime_us = number_in(root + "/proc/sys/kernel/sched_rt_runtime_us");
  into.rt_period_us = number_in(root + "/proc/sys/kernel/sched_rt_period_us");
  into.clocksource = first_line(root + "/sys/devices/system/clocksource/clocksource0/current_clocksource");
}

void read_sleep_states(const std::string& cpu, Snapshot& into) {
  for (int state = 0; fs::exists(fmt::format("{}/cpuidle/state{}", cpu, state)); ++state) {
    const std::string folder = fmt::format("{}/cpuidle/state{}", cpu, state);
    into.sleep_states.push_back({first_line(folder + "/name"), number_in(folder + "/latency").value_or(0),
                                 number_in(folder + "/disable").value_or(0) != 0});
  }
}

void read_processors(const std::string& root, int control_cpu, Snapshot& into) {
  const std::string cpus = root + "/sys/devices/system/cpu";
  into.cpus = cpu_list(first_line(cpus + "/online"));
  into.isolated = cpu_list(first_line(cpus + "/isolated"));
  into.nohz_full = cpu_list(first_line(cpus + "/nohz_full"));
  const std::string cpu = fmt::format("{}/cpu{}", cpus, control_cpu);
  into.governor = first_line(cpu + "/cpufreq/scaling_governor");
  read_sleep_states(cpu, into);
}

void read_platform(const std::string& root, Snapshot& into) {
  std::ifstream cpuinfo(root + "/proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);) {
    if (line.starts_with("flags") && line.find(" hypervisor") != std::string::npos) into.hypervisor = true;
    if (line.starts_with("vendor_id"))
      if (const auto value = line.find_last_of(" \t"); value != std::string::npos)
        into.processor_vendor = line.substr(value + 1);
  }
  // cpu user nice system idle iowait irq softirq steal ...
  std::istringstream stat(first_line(root + "/proc/stat"));
  std::string word;
  stat >> word;
  double total = 0, steal = 0, value = 0;
  for (int field = 0; field < 8 && stat >> value; ++field) {
    total += value;
    if (field == 7) steal = value;
  }
  into.steal_share = total > 0 ? steal / total : 0;
}

// Where the interrupt goes; where it may go, as long as no driver has requested it or the kernel does not tell.
std::vector<int> interrupted_cpus(const fs::path& interrupt) {
  const std::string effective = first_line(interrupt / "effective_affinity_list");
  return cpu_list(effective.empty() ? first_line(interrupt / "smp_affinity_list") : effective);
}

// /proc/irq/N holds one folder per driver that listens, named after it.
void read_interrupts(const std::string& root, Snapshot& into) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(root + "/proc/irq", error)) {
    const std::string number = entry.path().filename();
    if (number.find_first_not_of("0123456789") != std::string::npos) continue;
    Interrupt interrupt{std::atoi(number.c_str()), {}, interrupted_cpus(entry.path())};
    std::error_code ignored;
    for (const auto& inside : fs::directory_iterator(entry.path(), ignored))
      if (inside.is_directory()) interrupt.name = inside.path().filename();
    into.interrupts.push_back(std::move(interrupt));
  }
}

void read_rights(const std::string& root, Snapshot& into) {
  into.rtprio_limit = hard_limit(RLIMIT_RTPRIO);
  into.memlock_limit_bytes = hard_limit(RLIMIT_MEMLOCK);
  into.may_set_priority = has_capability(CAP_SYS_NICE);
  into.may_lock_memory = has_capability(CAP_IPC_LOCK);
  into.cpu_dma_latency = rights_of(root + "/dev/cpu_dma_latency");
  into.examined_by_root = geteuid() == 0;
  into.service_user = service_account(root, "takt");
  into.units_installed = fs::exists(root + "/usr/lib/systemd/system/takt-executive.service");
}

void read_watchdog(const std::string& root, Snapshot& into) {
  into.watchdog = first_line(root + "/sys/class/watchdog/watchdog0/identity");
  if (into.watchdog.empty() && fs::exists(root + "/sys/class/watchdog/watchdog0")) into.watchdog = "unnamed";
  std::vector<fs::path> files{root + "/etc/systemd/system.conf"};
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(root + "/etc/systemd/system.conf.d", error))
    files.push_back(entry.path());
  constexpr std::string_view kKey = "RuntimeWatchdogSec=";
  for (const fs::path& path : files) {
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);)
      if (line.starts_with(kKey)) into.systemd_watchdog = line.substr(kKey.size());
  }
}

void read_disk(const config::RobotConfig& robot, Snapshot& into) {
  fs::path folder = robot.record.directory;
  while (!folder.empty() && folder != folder.root_path() && !fs::exists(folder)) folder = folder.parent_path();
  std::error_code error;
  const fs::space_info space = fs::space(folder, error);
  into.runs_folder = folder;
  into.runs_free_bytes = error ? 0 : space.available;
}

}  // namespace

std::vector<int> cpu_list(const std::string& text) {
  std::vector<int> cpus;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    int first = 0;
    const char* const end = part.data() + part.size();
    auto [rest, error] = std::from_chars(part.data(), end, first);
    if (error != std::errc{}) continue;
    int last = first;
    if (rest != end && *rest == '-') std::from_chars(rest + 1, end, last);
    for (int cpu = first; cpu <= last && cpu < kMostCpus; ++cpu) cpus.push_back(cpu);
  }
  return cpus;
}

Snapshot collect(const Sources& sources, const config::RobotConfig* robot) {
  Snapshot snapshot;
  snapshot.examined_at = fmt::format("{:%FT%TZ}", fmt::gmtime(std::time(nullptr)));
  snapshot.takt_version = version();
  const int control_cpu = robot == nullptr ? 0 : robot->control.cpu.value_or(0);
  read_kernel(sources.root, snapshot);
  read_processors(sources.root, control_cpu, snapshot);
  read_platform(sources.root, snapshot);
  read_interrupts(sources.root, snapshot);
  read_rights(sources.root, snapshot);
  read_watchdog(sources.root, snapshot);
  snapshot.neighbourhood = read_neighbourhood(sources.root, control_cpu);
  if (robot == nullptr) return snapshot;
  read_disk(*robot, snapshot);
  for (const config::Bus& bus : robot->buses) snapshot.can.push_back(sources.can_link(bus.interface));
  return snapshot;
}

}  // namespace takt::doctor
