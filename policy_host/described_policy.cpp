// SPDX-License-Identifier: Apache-2.0
#include "policy_host/described_policy.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace takt::policy_host {

std::string sensor_for(const DescribedInput& input) {
  std::string text = "a sensor";
  if (!input.units.empty()) text += fmt::format(" whose unit is {}", fmt::join(input.units, " or "));
  if (!input.frame.empty()) text += fmt::format("{} whose frame is {}", input.units.empty() ? "" : " and", input.frame);
  return text;
}

}  // namespace takt::policy_host
