// SPDX-License-Identifier: Apache-2.0
// A rollout row as one line of JSON, and the JSON Schema of that line: both from rollout_fields().
//
// Strict both ways: a row that check() refuses is not written, and a line with a missing, unknown, repeated or
// wrongly typed field is not read. The text of a row is canonical (fields in table order, shortest digits that give
// the same number back), so that equal rows are equal bytes. Errors are one sentence without the row's number; what
// reads several rows puts "row N: " in front.
#pragma once

#include <expected>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "evidence/rollout/rollout_row.hpp"

namespace takt::lab {

enum class HostFields : std::uint8_t { included, left_out };

// One line, without the line end. `left_out` gives the bytes that are the same on every machine.
std::expected<std::string, std::string> row_text(const evidence::RolloutRow& row,
                                                 HostFields host = HostFields::included);
std::expected<evidence::RolloutRow, std::string> row_of(std::string_view line);

// JSON Schema (draft 2020-12) of a line, as committed in rollout.schema.json.
std::string rollout_schema();
// SHA-256 of rollout_schema(): rows of two artifacts mean the same only if this is equal.
std::string rollout_schema_sha256();

}  // namespace takt::lab
