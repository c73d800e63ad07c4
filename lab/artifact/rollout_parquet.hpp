// SPDX-License-Identifier: Apache-2.0
// rollouts.parquet: the rows of an artifact as flat columns, one per field of rollout_fields(), named with underscores
// for dots. Whole numbers are INT64, numbers DOUBLE, names and texts BYTE_ARRAY (UTF8), and a field that may be null is
// an optional column.
#pragma once

#include <span>
#include <string>

#include "evidence/rollout/rollout_row.hpp"

namespace takt::lab {

// The file's bytes. The artifact's id and the row schema's name go into its key-value metadata.
std::string rollouts_parquet(std::span<const evidence::RolloutRow> rows, const std::string& artifact_id);

}  // namespace takt::lab
