// SPDX-License-Identifier: Apache-2.0
#include "systemd/doctor/neighbourhood.hpp"

#include <fmt/format.h>
#include <sched.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "systemd/doctor/collect.hpp"
#include "systemd/doctor/kernel_files.hpp"

namespace takt::doctor {
namespace {

namespace fs = std::filesystem;

constexpr int kBitsOfGroup = 32;

bool is_number(const std::string& name) {
  return !name.empty() && name.find_first_not_of("0123456789") == std::string::npos;
}

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream parts(line);
  std::vector<std::string> words;
  for (std::string word; parts >> word;) words.push_back(word);
  return words;
}

int int_of(const std::string& text) {
  int value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

std::vector<int> allowed_cpus(const std::string& task) {
  constexpr std::string_view kKey = "Cpus_allowed_list:\t";
  std::ifstream status(task + "/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(kKey)) return cpu_list(line.substr(kKey.size()));
  return {};
}

// /proc/PID/task/TID/stat: "TID (name) state ..."; the 40th field is the real-time priority, the 41st the policy, see
// proc(5). The name may hold anything.
std::optional<RealTimeThread> real_time_thread(const std::string& task) {
  const std::string stat = first_line(task + "/stat");
  const auto open = stat.find('('), close = stat.rfind(')');
  if (open == std::string::npos || close == std::string::npos) return std::nullopt;
  const auto fields = words_of(stat.substr(close + 1));  // from the third on
  if (fields.size() < 39) return std::nullopt;
  const int policy = int_of(fields[38]);
  if (policy != SCHED_FIFO && policy != SCHED_RR) return std::nullopt;
  return RealTimeThread{stat.substr(open + 1, close - open - 1), int_of(fields[37]), allowed_cpus(task)};
}

void read_threads(const std::string& root, Neighbourhood& into) {
  std::error_code error;
  for (const auto& process : fs::directory_iterator(root + "/proc", error)) {
    if (!is_number(process.path().filename())) continue;
    if (first_line(process.path() / "comm") == "irqbalance") into.irqbalance_runs = true;
    std::error_code gone;
    for (const auto& task : fs::directory_iterator(process.path() / "task", gone))
      if (auto thread = real_time_thread(task.path())) into.real_time_threads.push_back(std::move(*thread));
  }
}

// "always [madvise] never"
std::string chosen(const std::string& choices) {
  const auto open = choices.find('['), close = choices.find(']');
  return open == std::string::npos || close == std::string::npos ? "" : choices.substr(open + 1, close - open - 1);
}

bool has_swap(const std::string& root) {
  std::ifstream swaps(root + "/proc/swaps");
  std::string line;
  return std::getline(swaps, line) && std::getline(swaps, line) && !line.empty();  // below the heading
}

// As systemd reads them: the unit, then its drop-ins in the order of their names; an empty assignment starts over.
std::vector<int> unit_cpus(const std::string& root) {
  constexpr std::string_view kKey = "CPUAffinity=";
  std::vector<fs::path> files;
  for (const char* folder : {"/usr/lib/systemd/system", "/etc/systemd/system"}) {
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(fmt::format("{}{}/takt-executive.service.d", root, folder), error))
      files.push_back(entry.path());
  }
  std::ranges::sort(files, {}, &fs::path::filename);
  const std::string own = root + "/etc/systemd/system/takt-executive.service";
  files.insert(files.begin(), fs::exists(own) ? own : root + "/usr/lib/systemd/system/takt-executive.service");
  std::vector<int> cpus;
  for (const fs::path& path : files) {
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);) {
      if (!line.starts_with(kKey)) continue;
      std::string list = line.substr(kKey.size());
      if (list.empty()) cpus.clear();
      std::ranges::replace(list, ' ', ',');
      for (const int cpu : cpu_list(list)) cpus.push_back(cpu);
    }
  }
  return cpus;
}

}  // namespace

std::vector<int> cpu_mask(const std::string& text) {
  std::vector<std::string> groups;
  std::istringstream parts(text);
  for (std::string group; std::getline(parts, group, ',');) groups.push_back(group);
  std::vector<int> cpus;
  int first = 0;
  for (auto group = groups.rbegin(); group != groups.rend(); ++group, first += kBitsOfGroup) {
    std::uint32_t bits = 0;
    std::from_chars(group->data(), group->data() + group->size(), bits, 16);
    for (int bit = 0; bit < kBitsOfGroup; ++bit)
      if ((bits >> static_cast<unsigned>(bit) & 1U) != 0) cpus.push_back(first + bit);
  }
  return cpus;
}

Neighbourhood read_neighbourhood(const std::string& root, int control_cpu) {
  Neighbourhood all;
  const std::string cpu = fmt::format("{}/sys/devices/system/cpu/cpu{}", root, control_cpu);
  all.hardware_threads = cpu_list(first_line(cpu + "/topology/thread_siblings_list"));
  read_threads(root, all);
  all.huge_pages = chosen(first_line(root + "/sys/kernel/mm/transparent_hugepage/enabled"));
  all.has_swap = has_swap(root);
  all.work_queue_cpus = cpu_mask(first_line(root + "/sys/devices/virtual/workqueue/cpumask"));
  if (const auto migrate = number_in(root + "/proc/sys/kernel/timer_migration")) all.timers_migrate = *migrate != 0;
  all.idle_driver = first_line(root + "/sys/devices/system/cpu/cpuidle/current_driver");
  all.tuned_profile = first_line(root + "/etc/tuned/active_profile");
  all.unit_cpus = unit_cpus(root);
  return all;
}

}  // namespace takt::doctor
