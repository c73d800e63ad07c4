// SPDX-License-Identifier: Apache-2.0
// The executive's status as a person and as a script wants to read it.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "executive/contract/session.hpp"

namespace takt::cli {

// The reply's sentences, one each; copes with a text that fills the field without a terminator.
std::vector<std::string> sentences_of(const OperatorReply& reply);

std::uint64_t overruns_of(const StatusSnapshot& status);

// The newest stop or fault in one sentence; empty: there was none, or the robot was reset since.
std::string incident_sentence(const IncidentNote& incident);
// Who runs beside the policy, or in its place, and how far apart the two are.
std::string candidate_text(const StatusSnapshot& status);
// Several lines, for `takt status`; why the robot stands comes first.
std::string status_text(const StatusSnapshot& status, const IncidentNote& incident);
// One line, for the live display. `max_age`: the configured limit; 0 when unknown.
std::string status_line(const StatusSnapshot& status, Duration max_age);
nlohmann::json status_json(const StatusSnapshot& status, const IncidentNote& incident);

}  // namespace takt::cli
