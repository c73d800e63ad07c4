#include "systemd/doctor/interference.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <sstream>

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

// user nice system idle iowait irq softirq steal, in ticks of the unit that sysconf tells
std::optional<std::int64_t> stolen_ms(const std::string& root, std::optional<int> cpu) {
  const std::string wanted = cpu ? fmt::format("cpu{}", *cpu) : "cpu";
  std::ifstream stat(root + "/proc/stat");
  for (std::string line; std::getline(stat, line);) {
    std::istringstream fields(line);
    std::string name;
    if (!(fields >> name) || name != wanted) continue;
    std::int64_t ticks = 0;
    for (int field = 0; field < 8; ++field)
      if (!(fields >> ticks)) return std::nullopt;
    return ticks * 1000 / std::max<std::int64_t>(1, sysconf(_SC_CLK_TCK));
  }
  return std::nullopt;
}

}  // namespace

Interference read_interference(const std::string& root, std::optional<int> cpu) {
  Interference count;
  count.stolen_ms = stolen_ms(root, cpu);
  read_smis(root, cpu.value_or(0), count);
  return count;
}

Interference interference_between(const Interference& before, const Interference& after) {
  Interference between;
  between.smi_counter = before.smi_counter == SmiCounter::read ? after.smi_counter : before.smi_counter;
  if (between.smi_counter == SmiCounter::read) between.smis = after.smis - before.smis;  // right across an overflow too
  if (before.stolen_ms && after.stolen_ms)
    between.stolen_ms = std::max<std::int64_t>(0, *after.stolen_ms - *before.stolen_ms);
  return between;
}

}  // namespace takt::doctor
