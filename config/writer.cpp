// SPDX-License-Identifier: Apache-2.0
#include "config/writer.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <span>
#include <utility>

#include "config/reader.hpp"
#include "config/robot_text.hpp"

namespace takt::config {
namespace {

std::string list_of(const std::vector<double>& values, Dimension dimension, std::span<const Dimension> each = {}) {
  std::vector<std::string> items;
  for (std::size_t i = 0; i < values.size(); ++i)
    items.push_back(format_quantity(values[i], i < each.size() ? each[i] : dimension));
  return fmt::format("[{}]", fmt::join(items, ", "));
}

}  // namespace

void Writer::line(std::string_view key, std::string_view value) {
  const std::size_t indent = 2 * depth_ - (dash_ ? 2 : 0);
  out_ += fmt::format("{:{}}{}{}:{}{}\n", "", indent, dash_ ? "- " : "", key, value.empty() ? "" : " ", value);
  dash_ = false;
}

template <class Value, class Read>
bool Writer::leaves_out(const Key& key, const Value& value, Read read) const {
  if (defaults_ == Defaults::written_out || !key.otherwise || key.prefilled) return false;
  const Node nothing{};
  Problems none("default");
  Places places;
  Reader reader(nothing, "", none, places);
  Value absent{};
  read(reader, absent);
  return absent == value;
}

bool Writer::leaves_out_empty(const Key& key) const {
  return defaults_ == Defaults::left_out && key.otherwise;
}

void Writer::quantity(const Key& key, double& value, Dimension dimension, Range range) {
  if (!leaves_out(key, value, [&](Reader& r, double& v) { r.quantity(key, v, dimension, range); }))
    line(key.name, format_quantity(value, dimension));
}

void Writer::duration(const Key& key, Duration& value, Duration low, Duration high) {
  if (!leaves_out(key, value, [&](Reader& r, Duration& v) { r.duration(key, v, low, high); }))
    line(key.name, format_duration(value));
}

void Writer::whole(const Key& key, std::int64_t& value, std::int64_t low, std::int64_t high) {
  if (!leaves_out(key, value, [&](Reader& r, std::int64_t& v) { r.whole(key, v, low, high); }))
    line(key.name, fmt::format("{}", value));
}

void Writer::whole_or_none(const Key& key, std::optional<int>& value, int low, int high) {
  if (!leaves_out(key, value, [&](Reader& r, std::optional<int>& v) { r.whole_or_none(key, v, low, high); }))
    line(key.name, value ? fmt::format("{}", *value) : "none");
}

void Writer::flag(const Key& key, bool& value) {
  if (!leaves_out(key, value, [&](Reader& r, bool& v) { r.flag(key, v); })) line(key.name, value ? "true" : "false");
}

void Writer::identifier(const Key& key, std::string& value) {
  if (!leaves_out(key, value, [&](Reader& r, std::string& v) { r.identifier(key, v); })) line(key.name, value);
}

void Writer::text(const Key& key, std::string& value) {
  if (!leaves_out(key, value, [&](Reader& r, std::string& v) { r.text(key, v); })) line(key.name, in_quotes(value));
}

void Writer::one_of(const Key& key, std::string& value, Words words, std::string_view what,
                    std::string_view none_word) {
  if (!leaves_out(key, value, [&](Reader& r, std::string& v) { r.one_of(key, v, words, what, none_word); }))
    line(key.name, value.empty() ? none_word : std::string_view(value));
}

void Writer::quantities(const Key& key, std::vector<double>& values, Dimension dimension, Range range, Count count) {
  if (!leaves_out(key, values,
                  [&](Reader& r, std::vector<double>& v) { r.quantities(key, v, dimension, range, count); }))
    line(key.name, list_of(values, dimension, key.each));
}

void Writer::interval(const Key& key, double& low, double& high, Dimension dimension, Range range) {
  using Interval = std::pair<double, double>;
  if (!leaves_out(key, Interval(low, high),
                  [&](Reader& r, Interval& v) { r.interval(key, v.first, v.second, dimension, range); }))
    line(key.name, list_of({low, high}, dimension));
}

void Writer::names(const Key& key, std::vector<std::string>& values, Words words, std::string_view what) {
  if (!leaves_out(key, values, [&](Reader& r, std::vector<std::string>& v) { r.names(key, v, words, what); }))
    line(key.name, fmt::format("[{}]", fmt::join(values, ", ")));
}

void Writer::word_or_quantities(const Key& key, std::size_t& word, Words words, std::vector<double>& values,
                                Dimension dimension, Range range, Count count) {
  using Either = std::pair<std::size_t, std::vector<double>>;
  if (!leaves_out(key, Either(word, values), [&](Reader& r, Either& v) {
        r.word_or_quantities(key, v.first, words, v.second, dimension, range, count);
      }))
    line(key.name, word < words.size() ? std::string(words[word]) : list_of(values, dimension, key.each));
}

void Writer::section(const Key& key, const Body& body) {
  const std::size_t before = out_.size();
  const bool dash = dash_;
  line(key.name, "");
  const std::size_t head = out_.size();
  ++depth_;
  body(*this);
  --depth_;
  if (out_.size() != head) return;
  out_.resize(before);
  dash_ = dash;
  if (!leaves_out_empty(key)) line(key.name, "{}");
}

void Writer::optional_section(const Key& key, bool& present, const Body& body) {
  if (present) section(key, body);
}

void Writer::sequence(const Key& key, std::size_t count, std::size_t, const std::function<void(std::size_t)>&,
                      const ItemBody& item) {
  if (count == 0 && leaves_out_empty(key)) return;
  line(key.name, count == 0 ? "[]" : "");
  depth_ += 2;
  for (std::size_t i = 0; i < count; ++i) {
    dash_ = true;
    item(*this, i);
    if (dash_) out_ += fmt::format("{:{}}- {{}}\n", "", 2 * depth_ - 2);
    dash_ = false;
  }
  depth_ -= 2;
}

void Writer::named_sections(const Key& key, std::vector<std::string> names,
                            const std::function<void(const std::vector<std::string>&)>&, const ItemBody& item) {
  if (names.empty() && leaves_out_empty(key)) return;
  line(key.name, names.empty() ? "{}" : "");
  ++depth_;
  for (std::size_t i = 0; i < names.size(); ++i) section({names[i], ""}, [&](Fields& f) { item(f, i); });
  --depth_;
}

}  // namespace takt::config
