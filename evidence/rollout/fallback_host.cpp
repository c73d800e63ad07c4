// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/fallback_host.hpp"

#include <utility>

#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "policy_host/engines/load_policy.hpp"
#include "policy_host/policy_fit.hpp"

namespace takt::evidence {

std::expected<std::unique_ptr<FallbackHost>, std::string> load_fallback_host(const config::RobotConfig& robot) {
  const config::Fallback* const fallback = config::fallback_policy_of(robot);
  if (fallback == nullptr) return nullptr;
  auto host = std::make_unique<FallbackHost>();
  host->robot = config::seen_by_fallback(robot, *fallback);
  const config::Policy& section = *host->robot.policy;
  const auto hash = config::policy_hash(section.file);
  if (!hash) return std::unexpected(hash.error());
  auto policy = policy_host::load_policy(host->robot);
  if (!policy) return std::unexpected(policy.error());
  if (const auto fits = policy_host::check_fit(host->robot, **policy); !fits) return std::unexpected(fits.error());
  host->policy = std::move(*policy);
  host->policy_hash = *hash;
  return host;
}

}  // namespace takt::evidence
