// SPDX-License-Identifier: Apache-2.0
#include "config/key_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <utility>
#include <vector>

#include "config/fields.hpp"
#include "config/schema.hpp"

namespace takt::config {
namespace {

// In the base unit: "0..10", ">0..1", "≥0".
std::string range_symbols(Range range) {
  const std::string low = std::isfinite(range.low) ? fmt::format("{}{}", range.low_open ? ">" : "", range.low) : "";
  const std::string high = std::isfinite(range.high) ? fmt::format("{}{}", range.high_open ? "<" : "", range.high) : "";
  if (!low.empty() && !high.empty()) return fmt::format("{}..{}", low, high);
  if (!low.empty()) return range.low_open ? low : "≥" + low;
  return high.empty() || range.high_open ? high : "≤" + high;
}

std::string unit_text(const Key& key, Dimension dimension) {
  const std::string_view unit = dimension == Dimension::none ? "number" : base_symbol(dimension);
  if (!key.other) return std::string(unit);
  std::string others(base_symbol(key.other->dimension));
  for (const Dimension mixed : key.mixed) others += fmt::format(", {}", base_symbol(mixed));
  return fmt::format("{} (slide: {})", unit, others);
}

// One row per key; a section that may be left out gives a row, and every section a longer path.
class TableMaker final : public Fields {
 public:
  std::string result() {
    return fmt::format("| key | value; `default`, else required | meaning |\n|---|---|---|\n{}", rows_);
  }

  void quantity(const Key& key, double&, Dimension dimension, Range range) override {
    const std::string bounds = range_symbols(range);
    row(key, dimension == Dimension::none && !bounds.empty() ? bounds : joined(unit_text(key, dimension), bounds));
  }
  void duration(const Key& key, Duration&, Duration low, Duration high) override {
    row(key, fmt::format("{}..{}", format_duration(low), format_duration(high)));
  }
  void whole(const Key& key, std::int64_t&, std::int64_t low, std::int64_t high) override {
    row(key, high == std::numeric_limits<std::int64_t>::max() ? fmt::format("integer, ≥{}", low)
                                                              : fmt::format("integer, {}..{}", low, high));
  }
  void whole_or_none(const Key& key, std::optional<int>&, int low, int high) override {
    row(key, fmt::format("integer, {}..{}, or none", low, high));
  }
  void flag(const Key& key, bool&) override { row(key, "true, false"); }
  void identifier(const Key& key, std::string&) override { row(key, "name"); }
  void text(const Key& key, std::string&) override { row(key, "text"); }
  void one_of(const Key& key, std::string&, Words words, std::string_view what, std::string_view none_word) override {
    const bool are_outside = !key.if_unknown.empty();
    const std::string choices =
        words.empty() || are_outside ? fmt::format("name of a {}", what) : fmt::format("{}", fmt::join(words, ", "));
    row(key, none_word.empty() ? choices : fmt::format("{}, {}", choices, none_word));
  }
  void quantities(const Key& key, std::vector<double>&, Dimension dimension, Range range, Count count) override {
    const std::string list = count.of == "joint"    ? "list, one per joint"
                             : count.of == "axis"   ? "list of 3"
                             : count.single_allowed ? "one value or a list"
                                                    : "list";
    row(key, joined(fmt::format("{}, {}", list, unit_text(key, dimension)), range_symbols(range)));
  }
  void interval(const Key& key, double&, double&, Dimension dimension, Range) override {
    row(key, fmt::format("[min, max], {}", unit_text(key, dimension)));
  }
  void names(const Key& key, std::vector<std::string>&, Words, std::string_view what) override {
    row(key, fmt::format("names of {}s", what));
  }
  void word_or_quantities(const Key& key, std::size_t&, Words words, std::vector<double>&, Dimension dimension, Range,
                          Count) override {
    row(key, fmt::format("{}, or a list, {}", fmt::join(words, ", "), unit_text(key, dimension)));
  }
  void section(const Key& key, const Body& body) override {
    if (key.otherwise)
      row(key, "section");
    else
      note(key);
    inside(fmt::format("{}{}.", prefix_, key.name), body);
  }
  void optional_section(const Key& key, bool&, const Body& body) override {
    row({key.name, key.doc, "absent"}, "section");
    inside(fmt::format("{}{}.", prefix_, key.name), body);
  }
  void sequence(const Key& key, std::size_t, std::size_t most, const std::function<void(std::size_t)>& resize,
                const ItemBody& item) override {
    row(key, fmt::format("up to {} sections", most));
    resize(1);
    inside(fmt::format("{}{}[].", prefix_, key.name), [&](Fields& f) { item(f, 0); });
    resize(0);
  }
  void named_sections(const Key& key, std::vector<std::string>,
                      const std::function<void(const std::vector<std::string>&)>& set_names,
                      const ItemBody& item) override {
    row(key, "named sections");
    set_names({"NAME"});
    inside(fmt::format("{}{}.NAME.", prefix_, key.name), [&](Fields& f) { item(f, 0); });
    set_names({});
  }
  [[nodiscard]] bool shows_all() const override { return true; }
  [[nodiscard]] const std::vector<std::pair<std::string, std::string>>& meanings() const { return meanings_; }

 private:
  static std::string joined(const std::string& what, const std::string& range) {
    return range.empty() ? what : what + ", " + range;
  }
  void note(const Key& key) { meanings_.emplace_back(fmt::format("{}{}", prefix_, key.name), key.doc); }
  void row(const Key& key, const std::string& value) {
    note(key);
    rows_ += fmt::format("| `{}{}` | {}{} | {} |\n", prefix_, key.name, value,
                         key.otherwise ? fmt::format("; `{}`", *key.otherwise) : "", key.doc);
  }
  void inside(std::string prefix, const Body& body) {
    prefix.swap(prefix_);
    body(*this);
    prefix_ = std::move(prefix);
  }

  std::vector<std::pair<std::string, std::string>> meanings_;  // of paths
  std::string prefix_;
  std::string rows_;
};

// "joints[3].drive" and "joints[].drive", "stops.tilt.how" and "stops.NAME.how".
bool is_of_row(std::string_view path, std::string_view row) {
  const auto begin_of = [](std::string_view part) { return part.substr(0, part.find('[')); };
  while (true) {
    const std::size_t end = path.find('.'), end_of_row = row.find('.');
    const std::string_view wanted = row.substr(0, end_of_row);
    if (wanted != "NAME" && begin_of(path.substr(0, end)) != begin_of(wanted)) return false;
    const bool is_last = end == std::string_view::npos, is_last_of_row = end_of_row == std::string_view::npos;
    if (is_last || is_last_of_row) return is_last && is_last_of_row;
    path.remove_prefix(end + 1);
    row.remove_prefix(end_of_row + 1);
  }
}

}  // namespace

std::string_view meaning_of_key(std::string_view path) {
  static const std::vector<std::pair<std::string, std::string>> all = [] {
    TableMaker table;
    RobotConfig robot;
    describe(table, robot);
    return table.meanings();
  }();
  for (const auto& [row, meaning] : all)
    if (is_of_row(path, row)) return meaning;
  return {};
}

std::string key_table() {
  TableMaker table;
  RobotConfig robot;
  describe(table, robot);
  return table.result();
}

}  // namespace takt::config
