// SPDX-License-Identifier: Apache-2.0
#include "policy_host/fenced_load.hpp"

#include <fmt/format.h>

#include <utility>

#include "policy_host/policy_fit.hpp"

namespace takt::policy_host {
namespace {

std::expected<void, std::string> check_threads(const config::Engine& engine, std::size_t count, std::size_t started) {
  if (started <= count * engine.threads + kSpareThreads) return {};
  return std::unexpected(
      fmt::format("policy.engine {}: started {} threads, where policy.engine.threads allows {}{}, and {} besides; have "
                  "it start no more than it is told, or raise policy.engine.threads",
                  engine.name, started, engine.threads, count > 1 ? fmt::format(" to each of {} networks", count) : "",
                  kSpareThreads));
}

}  // namespace

std::expected<FencedPolicies, std::string> load_fenced(const config::RobotConfig& robot, std::size_t count,
                                                       const LoadPolicy& load) {
  const config::Engine engine = robot.policy->engine.value_or(config::Engine{});
  FencedPolicies loaded;
  const auto fence = keep_off_processor(robot.control.cpu);
  if (!fence) return std::unexpected(fence.error());
  loaded.fence = *fence;
  const std::size_t own_threads = thread_count();
  for (std::size_t i = 0; i < count; ++i) {
    auto policy = load(robot);
    if (!policy) return std::unexpected(policy.error());
    if (const auto fits = check_fit(robot, **policy); !fits) return std::unexpected(fits.error());
    loaded.policies.push_back(std::move(*policy));
  }
  const std::size_t threads = thread_count();
  loaded.threads = threads > own_threads ? threads - own_threads : 0;
  if (const auto held = check_threads(engine, count, loaded.threads); !held) return std::unexpected(held.error());
  if (const auto kept = check_fence(robot.control.cpu, loaded.fence); !kept) return std::unexpected(kept.error());
  return loaded;
}

}  // namespace takt::policy_host
