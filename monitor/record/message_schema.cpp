// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/message_schema.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <utility>

namespace takt::monitor {
namespace {

constexpr std::size_t kLongestSchema = 256 << 10;
constexpr std::size_t kMostFields = 2048;
constexpr std::string_view kText = "string";

// 0: no type that our messages have.
std::size_t element_size(std::string_view type) {
  constexpr std::array<std::pair<std::string_view, std::size_t>, 13> kSizes{{{"bool", 1},
                                                                             {"byte", 1},
                                                                             {"char", 1},
                                                                             {"int8", 1},
                                                                             {"uint8", 1},
                                                                             {"int16", 2},
                                                                             {"uint16", 2},
                                                                             {"int32", 4},
                                                                             {"uint32", 4},
                                                                             {"float32", 4},
                                                                             {"int64", 8},
                                                                             {"uint64", 8},
                                                                             {"float64", 8}}};
  const auto* const found = std::ranges::find(kSizes, type, [](const auto& one) { return one.first; });
  return found == kSizes.end() ? 0 : found->second;
}

std::string_view word(std::string_view& line) {
  line.remove_prefix(std::min(line.find_first_not_of(" \t\r"), line.size()));
  const std::string_view taken = line.substr(0, line.find_first_of(" \t\r"));
  line.remove_prefix(taken.size());
  return taken;
}

std::optional<std::uint64_t> number(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// "uint8[7]", "float32[]", "string". False: not said so that one could read it.
bool read_type(std::string_view said, MessageField& field) {
  const std::size_t bracket = said.find('[');
  field.type = said.substr(0, bracket);
  if (bracket == std::string_view::npos) return true;
  const std::string_view count = said.substr(bracket + 1, said.size() - bracket - 2);
  field.is_sequence = !said.ends_with(']') || count.empty() || count.starts_with("<=");
  if (field.is_sequence) return said.ends_with(']');
  const auto fixed = number(count);
  field.fixed_count = static_cast<std::size_t>(fixed.value_or(0));
  return field.fixed_count > 0 && field.fixed_count <= 4096;
}

std::string said(const MessageField& field) {
  if (field.is_sequence) return field.type + "[]";
  return field.fixed_count == 1 ? field.type : fmt::format("{}[{}]", field.type, field.fixed_count);
}

constexpr std::string_view kReserved = "reserved";

bool is_wider(std::string_view to, std::string_view from) {
  constexpr std::string_view kUnsigned = "uint";
  return to.starts_with(kUnsigned) && from.starts_with(kUnsigned) && element_size(to) > element_size(from);
}

}  // namespace

std::expected<MessageSchema, std::string> message_schema_of(std::string_view text) {
  MessageSchema schema;
  if (text.size() > kLongestSchema) return std::unexpected("has a description of more than 256 KiB");
  while (!text.empty()) {
    std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
    line = line.substr(0, line.find('#'));
    if (line.starts_with("===")) break;  // types that are used further up follow
    const std::string_view type = word(line), name = word(line);
    if (type.empty()) continue;
    if (const std::size_t equals = name.find('='); equals != std::string_view::npos) {
      if (const auto value = number(name.substr(equals + 1)))
        schema.constants.push_back({std::string(name.substr(0, equals)), *value});
      continue;
    }
    MessageField field{.type = {}, .name = std::string(name)};
    if (name.empty() || !read_type(type, field)) return std::unexpected("has a description that cannot be read");
    schema.fields.push_back(std::move(field));
    if (schema.fields.size() + schema.constants.size() > kMostFields)
      return std::unexpected("has a description of too many fields");
  }
  return schema;
}

std::expected<Relayout, std::string> Relayout::make(MessageSchema from, MessageSchema to) {
  Relayout made;
  const auto is_alike = [](const MessageField& a, const MessageField& b) {
    return a.name == b.name && said(a) == said(b);
  };
  made.is_needed_ = !std::ranges::equal(from.fields, to.fields, is_alike);
  for (const MessageField& field : from.fields)
    if (made.is_needed_ && field.type != kText && element_size(field.type) == 0)
      return std::unexpected(fmt::format("has `{}` as {}, which this version does not read", field.name, field.type));
  for (const MessageField& field : to.fields) {
    // Reserved bytes mean nothing, however many they were.
    const auto found =
        field.name == kReserved ? from.fields.end() : std::ranges::find(from.fields, field.name, &MessageField::name);
    made.source_.push_back(found == from.fields.end() ? kLacking
                                                      : static_cast<std::size_t>(found - from.fields.begin()));
    if (found == from.fields.end()) continue;
    MessageField as_read = *found;
    if (is_wider(field.type, found->type)) as_read.type = field.type;
    if (said(as_read) != said(field))
      return std::unexpected(
          fmt::format("has `{}` as {}, this version reads {}", field.name, said(*found), said(field)));
  }
  if (!to.fields.empty() && made.source_.front() == kLacking)
    return std::unexpected(fmt::format("lacks `{}`", to.fields.front().name));
  made.values_.resize(from.fields.size());
  made.from_ = std::move(from);
  made.to_ = std::move(to);
  return made;
}

std::span<const std::byte> Relayout::operator()(std::span<const std::byte> message) {
  CdrReader in(message);
  for (std::size_t i = 0; i < from_.fields.size(); ++i) {
    const MessageField& field = from_.fields[i];
    Value& value = values_[i];
    const std::size_t size = std::max<std::size_t>(element_size(field.type), 1);
    value.count = field.is_sequence ? in.get_count(message.size() / size) : field.fixed_count;
    if (field.type == kText) {
      if (field.is_sequence || field.fixed_count != 1) return {};
      const std::string text = in.get_string();
      const auto bytes = std::as_bytes(std::span(text));
      value.elements.assign(bytes.begin(), bytes.end());
      continue;
    }
    value.elements.resize(value.count * size);
    in.get_column(value.elements.data(), size, size, value.count);
    if (!in.ok()) return {};
  }
  if (!in.ok()) return {};
  out_.clear();
  for (std::size_t i = 0; i < to_.fields.size(); ++i) {
    const MessageField& field = to_.fields[i];
    const Value* const value = source_[i] == kLacking ? nullptr : &values_[source_[i]];
    if (field.type == kText) {
      out_.put_string(value == nullptr ? std::string_view{}
                                       : std::string_view(reinterpret_cast<const char*>(value->elements.data()),
                                                          value->elements.size()));
      continue;
    }
    const std::size_t count = value != nullptr ? value->count : field.is_sequence ? 0 : field.fixed_count;
    if (field.is_sequence) out_.put_count(count);
    const std::size_t size = value == nullptr ? 0 : element_size(from_.fields[source_[i]].type);
    for (std::size_t k = 0; k < count; ++k) {
      std::array<std::byte, 8> wide{};  // little-endian: what a narrower number lacks is zero
      if (value != nullptr) std::copy_n(value->elements.data() + k * size, size, wide.data());
      out_.put_raw(wide.data(), element_size(field.type));
    }
  }
  return out_.bytes();
}

}  // namespace takt::monitor
