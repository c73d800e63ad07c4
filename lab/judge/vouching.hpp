// SPDX-License-Identifier: Apache-2.0
// Who stands by an artifact or a run folder, and since when: what came of the keys that the reader named.
#pragma once

#include <expected>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "lab/artifact/time_stamp.hpp"

namespace takt::lab {

struct Vouching {
  // Id of the key that the reader named, where it signed this; else why not. None: no key was named.
  std::optional<std::expected<std::string, std::string>> signed_by;
  // When, by an authority that the reader named, the signature was there; else why that is not known. None: no
  // authority was named.
  std::optional<std::expected<TimeStamp, std::string>> stamped;
  // Nothing that was asked for failed; also where nothing was.
  [[nodiscard]] bool holds() const;
  [[nodiscard]] bool is_signed() const { return signed_by && signed_by->has_value(); }
};

// Of the audit's text: lines for what failed, and what the verdict rests on; empty: nothing was asked for.
std::string vouching_lines(const Vouching& vouching);
std::string vouching_rests(const Vouching& vouching);
// `signed_by` and `stamped`; null where not asked for.
void add_vouching(const Vouching& vouching, nlohmann::ordered_json& json);

}  // namespace takt::lab
