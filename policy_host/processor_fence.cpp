// SPDX-License-Identifier: Apache-2.0
#include "policy_host/processor_fence.hpp"

#include <fmt/format.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <vector>

#include "policy_host/seccomp_program.hpp"

namespace takt::policy_host {
namespace {

std::vector<pid_t> threads_of_this_process() {
  std::vector<pid_t> threads;
  std::error_code gone;  // a thread that ends meanwhile is no problem
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task", gone)) {
    const std::string name = entry.path().filename();
    pid_t thread = 0;
    std::from_chars(name.data(), name.data() + name.size(), thread);
    threads.push_back(thread);
  }
  return threads;
}

std::string name_of(pid_t thread) {
  std::ifstream file(fmt::format("/proc/self/task/{}/comm", thread));
  std::string name;
  std::getline(file, name);
  return name;
}

bool may_run_on(pid_t thread, int cpu) {
  cpu_set_t mask;
  return sched_getaffinity(thread, sizeof mask, &mask) == 0 && CPU_ISSET(static_cast<unsigned>(cpu), &mask);
}

// True: that thread is off `cpu`, or has ended.
bool take_off(pid_t thread, int cpu) {
  cpu_set_t mask;
  if (sched_getaffinity(thread, sizeof mask, &mask) != 0) return true;
  if (!CPU_ISSET(static_cast<unsigned>(cpu), &mask)) return true;
  CPU_CLR(static_cast<unsigned>(cpu), &mask);
  return sched_setaffinity(thread, sizeof mask, &mask) == 0;
}

bool forbid_affinity() {
  constexpr std::uint32_t refuse = SECCOMP_RET_ERRNO | EPERM;
  std::array program{
      statement(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, arch)),
      jump(BPF_JMP | BPF_JEQ | BPF_K, kArchitecture, 0, 3),  // calls of another architecture: refused, all of them
      statement(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      statement(BPF_ALU | BPF_AND | BPF_K, ~kX32Bit),
      jump(BPF_JMP | BPF_JEQ | BPF_K, __NR_sched_setaffinity, 0, 1),
      statement(BPF_RET | BPF_K, refuse),
      statement(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  };
  const sock_fprog filter{.len = static_cast<std::uint16_t>(program.size()), .filter = program.data()};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_TSYNC, &filter) == 0;
}

}  // namespace

std::expected<Fence, std::string> keep_off_processor(std::optional<int> cpu) {
  if (!cpu || *cpu < 0 || *cpu >= CPU_SETSIZE || sysconf(_SC_NPROCESSORS_ONLN) == 1) return Fence::none;
  for (const pid_t thread : threads_of_this_process())
    if (!take_off(thread, *cpu))
      return std::unexpected(
          fmt::format("processor {} is the executive's (control.cpu), and the only one that this process may use; "
                      "allow it another (taskset, CPUAffinity=, AllowedCPUs=), or give the executive another",
                      *cpu));
  return forbid_affinity() ? Fence::by_kernel : Fence::by_mask;
}

std::expected<void, std::string> check_fence(std::optional<int> cpu, Fence fence) {
  if (fence == Fence::none) return {};
  for (const pid_t thread : threads_of_this_process())
    if (may_run_on(thread, *cpu) && !take_off(thread, *cpu))
      return std::unexpected(
          fmt::format("thread {} of the engine may run on processor {}, the executive's "
                      "(control.cpu), and cannot be kept off; have the engine set no affinity",
                      name_of(thread), *cpu));
  return {};
}

void limit_thread_pools(unsigned threads, PoolSize size) {
  const std::string count = std::to_string(threads);
  for (const char* const name :
       {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "NUMEXPR_NUM_THREADS"})
    setenv(name, count.c_str(), size == PoolSize::as_told ? 1 : 0);  // NOLINT(concurrency-mt-unsafe): set-up
}

std::size_t thread_count() {
  return threads_of_this_process().size();
}

}  // namespace takt::policy_host
