// SPDX-License-Identifier: Apache-2.0
// The one declaration of a rollout row's fields: name, place, allowed values, unit, meaning. JSON Lines, JSON Schema,
// Parquet columns and documentation are loops over this table; none of them names a field by itself.
//
// A dot in a name is a nested object in JSON ("age_per_tick.total.p95_ms") and an underscore in the Parquet column
// ("age_per_tick_total_p95_ms"). Names below "host." are what the machine measured: never compared, never hashed.
#pragma once

#include <cstdint>
#include <expected>
#include <functional>
#include <limits>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "evidence/rollout/rollout_row.hpp"

namespace takt::lab {

// What a text field may hold.
enum class TextFormat : std::uint8_t {
  schema,           // exactly kRolloutSchema
  token,            // a-z 0-9 _ - . ; at least one
  label,            // a-z 0-9 _ ; may be empty
  fault,            // a name in monitor::kFaultNames; may be empty
  sha256,           // 64 lower-case hex digits
  optional_sha256,  // or empty
  hex,              // lower-case hex digits; may be empty
  version,          // printable ASCII without space; at least one
  path,             // printable ASCII, relative, without ".."; may be empty
};

// Bounds of a number, both included.
struct Range {
  double low = -std::numeric_limits<double>::max();
  double high = std::numeric_limits<double>::max();
};

// Whole numbers must survive a reader that keeps every number as a double.
inline constexpr std::uint64_t kLargestCount = (std::uint64_t{1} << 53U) - 1;

using FieldPlace = std::variant<bool*, std::uint64_t*, double*, std::optional<double>*, std::string*, Mode*, Cause*>;

struct RolloutField {
  std::string name;
  std::string unit;  // "ms", "Nm", "1" for shares and counts, empty for texts
  std::string meaning;
  std::function<FieldPlace(evidence::RolloutRow&)> place;
  TextFormat format = TextFormat::token;  // of texts
  Range range = {};                       // of numbers
  bool is_added = false;                  // rows of earlier programs lack it
  [[nodiscard]] bool is_host() const { return name.starts_with("host."); }
};

// In file order.
const std::vector<RolloutField>& rollout_fields();
// Where the field lies in a row that is only read.
FieldPlace place_in(const RolloutField& field, const evidence::RolloutRow& row);

// An added field of a row that an earlier program wrote.
bool is_lacking(const RolloutField& field, const evidence::RolloutRow& row);

bool matches(TextFormat format, std::string_view text);
// The same rule as an ECMA 262 regular expression, for the JSON Schema.
std::string_view pattern_of(TextFormat format);

// "integer", "number", "number or null", "true or false", "text", "name of a mode", "name of a cause".
std::string_view type_name(const FieldPlace& place);
// Every field within its range or format, and the fields consistent with one another; one sentence otherwise.
std::expected<void, std::string> check(const evidence::RolloutRow& row);

}  // namespace takt::lab
