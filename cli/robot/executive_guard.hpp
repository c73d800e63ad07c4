// SPDX-License-Identifier: Apache-2.0
// What must not be done beside an executive. Each looks into every directory given that it may look into; an executive
// that is there but cannot be asked (no permission, another version, no answer) counts as one that must not be
// disturbed. Real interfaces are claimed besides (drivers/bus/interface_claim.hpp), which needs no rights.
#pragma once

#include <expected>
#include <string>
#include <string_view>
#include <vector>

#include "cli/command.hpp"
#include "executive/contract/mode.hpp"

namespace takt::cli {

// Of a robot whose drives have power. Never a second press of the stop, which would take it: what hangs would fall.
std::string_view steps_to_disarm(Mode mode);

// Refused while one runs: two masters on one bus fight over its drives.
std::expected<void, Refusal> require_no_executive(const std::vector<std::string>& runtime_directories);
// Refused while one has its drives enabled: what a moving robot rests on is not changed.
std::expected<void, Refusal> require_disarmed(const std::vector<std::string>& runtime_directories);

}  // namespace takt::cli
