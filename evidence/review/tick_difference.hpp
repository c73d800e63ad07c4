// SPDX-License-Identifier: Apache-2.0
// Where two tick records differ, and where a recorded one was altered. Any thread; allocates for texts only.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "monitor/record/tick_schema.hpp"

namespace takt::evidence {

// A field of a record, as replay names it.
struct FieldPlace {
  const monitor::TickField* field = nullptr;
  enum class Group : std::uint8_t { header, bus, joint } group = Group::header;
  std::size_t index = 0;   // bus or joint
  std::size_t offset = 0;  // of the value, in the record
};
// First difference at or behind `from` in table order (header, buses, joints); `from` counts calls' results.
std::optional<FieldPlace> first_difference(const TickRecord& a, const TickRecord& b);
// When exactly one flipped bit explains why the record does not match its checksum: the field it is in, and the record
// with that bit put right.
std::optional<FieldPlace> locate_flipped_bit(const monitor::RecordedTick& tick, TickRecord& mended);
// "0.125", "tracking (2)"; floats with enough digits to tell two values apart.
std::string value_text(const TickRecord& record, const FieldPlace& place);

}  // namespace takt::evidence
