// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/tick_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cstring>
#include <string_view>

#include "monitor/record/tick_schema.hpp"

namespace takt::monitor {
namespace {

constexpr std::size_t kMostWords = 64;

std::string upper(std::string_view text) {
  std::string result(text);
  std::ranges::transform(result, result.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return result;
}

// "CAUSE_" for what has CAUSE values or a bit for each; empty: no words.
std::string prefix_of(const TickField& field) {
  if (!field.values.empty()) return upper(field.name) + "_";
  for (const std::string_view how : {" values", " value", " constants"}) {
    const std::size_t end = field.note.find(how);
    if (end == std::string_view::npos) continue;
    const std::size_t space = field.note.rfind(' ', end - 1);
    const std::string_view word = field.note.substr(space == std::string_view::npos ? 0 : space + 1,
                                                    end - (space == std::string_view::npos ? 0 : space + 1));
    if (!word.empty() && std::ranges::all_of(word, [](char c) { return (c >= 'A' && c <= 'Z') || c == '_'; }))
      return std::string(word) + "_";
  }
  return {};
}

bool is_mask(const TickField& field) {
  return field.note.starts_with("bit ");
}

// Those of `prefix`; of masks that are written as such (1, 2, 4, ...) by the bit.
template <class Each>
void for_words(const MessageSchema& schema, std::string_view prefix, bool by_bit, Each each) {
  for (const MessageConstant& constant : schema.constants) {
    if (!constant.name.starts_with(prefix)) continue;
    if (by_bit && !std::has_single_bit(constant.value)) continue;
    const std::uint64_t at = by_bit ? static_cast<std::uint64_t>(std::countr_zero(constant.value)) : constant.value;
    if (at < kMostWords) each(constant.name, at);
  }
}

}  // namespace

TickWords::TickWords(const MessageSchema& recorded) {
  look_at(header_fields(), Change::Group::header, recorded);
  look_at(bus_fields(), Change::Group::bus, recorded);
  look_at(joint_fields(), Change::Group::joint, recorded);
}

void TickWords::look_at(std::span<const TickField> fields, Change::Group group, const MessageSchema& recorded) {
  static const MessageSchema ours = message_schema_of(tick_schema()).value();
  for (const TickField& field : fields) {
    const std::string prefix = prefix_of(field);
    const bool by_bit = prefix == "INTERVENTION_";
    if (prefix.empty()) continue;
    Change change{.field = &field, .group = group, .is_mask = is_mask(field), .words = {}};
    for_words(recorded, prefix, by_bit, [&](const std::string& name, std::uint64_t at) {
      change.words.resize(std::max<std::size_t>(change.words.size(), at + 1));
      change.words[at].name = name;
    });
    for_words(ours, prefix, by_bit, [&](const std::string& name, std::uint64_t at) {
      for (Word& word : change.words)
        if (word.name == name) word.ours = at;
    });
    bool differs = false;
    for (std::size_t at = 0; at < change.words.size(); ++at) differs |= change.words[at].ours != at;
    if (differs) changes_.push_back(std::move(change));
  }
}

std::expected<void, std::string> TickWords::translate(const Change& change, std::byte* value) {
  const std::size_t size = size_of(change.field->type);
  std::uint64_t recorded = 0, ours = 0;
  std::memcpy(&recorded, value, size);
  const auto ours_of = [&](std::uint64_t at) -> std::expected<std::uint64_t, std::string> {
    if (at < change.words.size() && change.words[at].ours) return *change.words[at].ours;
    return std::unexpected(fmt::format("`{}` {} of `{}`",
                                       at < change.words.size() ? change.words[at].name : std::to_string(at),
                                       change.is_mask ? "among the bits" : "as the value", change.field->name));
  };
  if (!change.is_mask) {
    const auto found = ours_of(recorded);
    if (!found) return std::unexpected(found.error());
    ours = *found;
  }
  for (std::uint64_t rest = recorded; change.is_mask && rest != 0; rest &= rest - 1) {
    const auto found = ours_of(static_cast<std::uint64_t>(std::countr_zero(rest)));
    if (!found) return std::unexpected(found.error());
    ours |= std::uint64_t{1} << *found;
  }
  std::memcpy(value, &ours, size);
  return {};
}

std::expected<void, std::string> TickWords::translate(TickRecord& record) const {
  auto* const base = std::as_writable_bytes(std::span(&record, 1)).data();
  for (const Change& change : changes_) {
    const bool is_bus = change.group == Change::Group::bus, is_header = change.group == Change::Group::header;
    const std::size_t rows = is_header ? 1 : is_bus ? record.header.bus_count : record.header.joint_count;
    const std::size_t row_size = is_bus ? sizeof(BusHealth) : sizeof(JointRecord);
    const std::size_t begin = is_header ? 0 : is_bus ? offsetof(TickRecordHeader, buses) : sizeof(TickRecordHeader);
    for (std::size_t row = 0; row < rows; ++row)
      if (auto done = translate(change, base + begin + row * row_size + change.field->offset); !done) return done;
  }
  return {};
}

}  // namespace takt::monitor
