// SPDX-License-Identifier: Apache-2.0
#include "systemd/doctor/own_load.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>
#include <unistd.h>

#include <cstring>

#include "executive/ipc/descriptor.hpp"

namespace takt::doctor {
namespace {

constexpr std::size_t kMemory = std::size_t{32} << 20U, kBlock = std::size_t{1} << 20U;
constexpr int kBlocksOfFile = 16;

void copy_memory(const std::stop_token& stop) {
  std::vector<char> from(kMemory, 1), to(kMemory);
  while (!stop.stop_requested())
    for (std::size_t at = 0; at < kMemory && !stop.stop_requested(); at += kBlock)
      std::memcpy(to.data() + at, from.data() + at, kBlock);
}

void write_file(const std::stop_token& stop, const std::string& folder) {
  const ipc::Descriptor file(open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0600));
  const std::vector<char> block(kBlock, 1);
  for (int count = 0; file.is_open() && !stop.stop_requested(); ++count) {
    if (pwrite(file.get(), block.data(), block.size(), off_t{count % kBlocksOfFile} * off_t{kBlock}) < 0) return;
    fdatasync(file.get());
  }
}

void stay_on(int cpu) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(static_cast<std::size_t>(cpu), &set);
  pthread_setaffinity_np(pthread_self(), sizeof set, &set);
}

}  // namespace

OwnLoad::OwnLoad(const std::string& folder, std::optional<int> spared) {
  const auto cores = static_cast<int>(std::thread::hardware_concurrency());
  for (int cpu = 0; cpu < cores; ++cpu) {
    if (cpu == spared) continue;
    threads_.emplace_back([cpu](const std::stop_token& stop) {
      stay_on(cpu);
      copy_memory(stop);
    });
  }
  threads_.emplace_back([folder](const std::stop_token& stop) { write_file(stop, folder); });
}

}  // namespace takt::doctor
