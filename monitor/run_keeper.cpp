// SPDX-License-Identifier: Apache-2.0
#include "monitor/run_keeper.hpp"

#include <spdlog/spdlog.h>

#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <stop_token>
#include <vector>

#include "monitor/record/run_shelf.hpp"

namespace takt::monitor {
namespace {

constexpr std::chrono::minutes kPeriod{1};

std::int64_t unix_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace

RunKeeper::RunKeeper(const config::RobotConfig& robot)
    : thread_([this, &robot](const std::stop_token& stop) {
        std::mutex mutex;
        std::condition_variable_any ended;
        std::unique_lock lock(mutex);
        do {
          try {
            look(robot);
          } catch (const std::exception& error) {  // no folder's content ends a recording
            spdlog::warn("the folder of the runs was not looked after: {}", error.what());
          }
        } while (!ended.wait_for(lock, stop, kPeriod, [&] { return stop.stop_requested(); }));
      }) {}

void RunKeeper::look(const config::RobotConfig& robot) {
  std::vector<ShelvedRun> runs = runs_in(robot.record.directory, unix_ns());
  const Pruned pruned = prune(runs, robot, unix_ns());
  for (const ShelvedRun& run : pruned.gone)
    spdlog::info("deleted {}, as record.keep says ({:.1f} GiB)", run.folder,
                 static_cast<double>(run.bytes) / (1U << 30U));
  for (const std::string& failure : pruned.failures)
    if (failed_.insert(failure).second) spdlog::error("record.keep: {}", failure);
  hours_left_ = monitor::hours_left(runs, robot, free_bytes_at(robot.record.directory));
}

}  // namespace takt::monitor
