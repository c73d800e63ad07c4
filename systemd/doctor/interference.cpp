// SPDX-License-Identifier: Apache-2.0
#include "systemd/doctor/interference.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <map>
#include <numeric>
#include <sstream>
#include <vector>

#include "executive/ipc/descriptor.hpp"

namespace takt::doctor {
namespace {

// MSR_SMI_COUNT, Intel SDM volume 4: bits 31:0 count since reset, the others are reserved.
constexpr off_t kSmiCountRegister = 0x34;

SmiCounter why_not(int error) {
  switch (error) {
    case EACCES:
    case EPERM:
      return SmiCounter::refused;
    case EIO:  // the driver is there, the processor has no such register
      return SmiCounter::no_register;
    default:  // ENOENT, ENXIO: no driver
      return SmiCounter::no_driver;
  }
}

void read_smis(const std::string& root, int cpu, Interference& into) {
  const ipc::Descriptor device(open(fmt::format("{}/dev/cpu/{}/msr", root, cpu).c_str(), O_RDONLY | O_CLOEXEC));
  if (!device.is_open()) {
    into.smi_counter = why_not(errno);
    return;
  }
  std::uint64_t value = 0;
  const ssize_t got = pread(device.get(), &value, sizeof value, kSmiCountRegister);
  into.smi_counter = got == sizeof value ? SmiCounter::read : why_not(got < 0 ? errno : EIO);
  into.smis = static_cast<std::uint32_t>(value);
}

// user nice system idle iowait irq softirq steal, in ticks of the unit that sysconf tells; cut off: fewer
using Ticks = std::vector<std::int64_t>;
constexpr std::size_t kIdle = 3, kIoWait = 4, kSteal = 7;

// "cpu", "cpu0", ...
std::map<std::string, Ticks> processor_times(const std::string& root) {
  std::map<std::string, Ticks> times;
  std::ifstream stat(root + "/proc/stat");
  for (std::string line; std::getline(stat, line) && line.starts_with("cpu");) {
    std::istringstream fields(line);
    std::string name;
    fields >> name;
    Ticks& ticks = times[name];
    for (std::int64_t value = 0; ticks.size() <= kSteal && fields >> value;) ticks.push_back(value);
  }
  return times;
}

std::string name_of(std::optional<int> cpu) {
  return cpu ? fmt::format("cpu{}", *cpu) : "cpu";
}

std::optional<std::int64_t> stolen_ms(const std::map<std::string, Ticks>& times, std::optional<int> cpu) {
  const auto found = times.find(name_of(cpu));
  if (found == times.end() || found->second.size() <= kSteal) return std::nullopt;
  return found->second[kSteal] * 1000 / std::max<std::int64_t>(1, sysconf(_SC_CLK_TCK));
}

std::optional<Interference::Time> others_time(const std::map<std::string, Ticks>& times, std::optional<int> cpu) {
  Interference::Time sum;
  for (const auto& [name, ticks] : times) {
    if (name == "cpu" || name == name_of(cpu) || ticks.size() <= kIoWait) continue;
    const std::int64_t all = std::accumulate(ticks.begin(), ticks.end(), std::int64_t{0});
    sum.all_ticks += all;
    sum.busy_ticks += all - ticks[kIdle] - ticks[kIoWait];
  }
  return sum.all_ticks == 0 ? std::nullopt : std::optional(sum);
}

}  // namespace

Interference read_interference(const std::string& root, std::optional<int> cpu) {
  Interference count;
  const auto times = processor_times(root);
  count.stolen_ms = stolen_ms(times, cpu);
  count.others = others_time(times, cpu);
  read_smis(root, cpu.value_or(0), count);
  return count;
}

Interference interference_between(const Interference& before, const Interference& after) {
  Interference between;
  between.smi_counter = before.smi_counter == SmiCounter::read ? after.smi_counter : before.smi_counter;
  if (between.smi_counter == SmiCounter::read) between.smis = after.smis - before.smis;  // right across an overflow too
  if (before.stolen_ms && after.stolen_ms)
    between.stolen_ms = std::max<std::int64_t>(0, *after.stolen_ms - *before.stolen_ms);
  if (before.others && after.others)
    between.others = Interference::Time{after.others->busy_ticks - before.others->busy_ticks,
                                        after.others->all_ticks - before.others->all_ticks};
  return between;
}

}  // namespace takt::doctor
