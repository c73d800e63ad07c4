// SPDX-License-Identifier: Apache-2.0
// Where to look when commands stay away and the record cannot say why. What knows better replaces it: the policy's host
// itself (contract/policy_word.hpp), or `takt run`, which sees processes end (events.jsonl).
#pragma once

#include <string>
#include <string_view>

namespace takt::incident {

inline constexpr std::string_view kPolicyLogHint =
    "the policy host's log says whether a sensor, the policy or the way between failed";

// `sentence` of an incident, with what the policy's host says in the place of the hint; empty: it said nothing.
inline std::string with_known_reason(std::string sentence, std::string_view problem) {
  const std::size_t at = problem.empty() ? std::string::npos : sentence.find(kPolicyLogHint);
  if (at != std::string::npos) sentence.replace(at, kPolicyLogHint.size(), "policy: " + std::string(problem));
  return sentence;
}

}  // namespace takt::incident
