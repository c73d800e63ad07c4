// SPDX-License-Identifier: Apache-2.0
// How a configuration structure names its keys: once, in schema.cpp, through this interface. Three shells walk the same
// declarations: the reader (YAML in), the writer (canonical YAML out) and the key table (documentation).
//
// A key has a name, a sentence of documentation, and either a default written as YAML text or none (then it is
// required). Ranges are in base units (config/units.hpp) and inclusive unless marked open.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/robot_config.hpp"
#include "config/units.hpp"

namespace takt::config {

// What `takt config import` writes where only a person knows the value.
inline constexpr std::string_view kUnfilled = "FILL_IN";

struct Key {
  std::string_view name;
  std::string_view doc;
  std::optional<std::string_view> otherwise{};  // default, as YAML text
  bool prefilled = false;  // absent: the value already there stays; `otherwise` says where it is from
  // one_of: not empty: a word is the name of a thing outside of the file. An unknown one is answered with the known
  // ones and this way to go on, never with the nearest name: that is another thing.
  std::string_view if_unknown{};
  // What the key's values are in where the joint is of the other kind, and what makes it so: "write `kind: slide`".
  struct Other {
    Dimension dimension;
    std::string_view cure;
  };
  std::optional<Other> other{};
  std::span<const Dimension> each{};   // quantities: of each value; empty: all are in one dimension
  std::span<const Dimension> mixed{};  // that a value may be in besides, between joints of two kinds
};

struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_open = false, high_open = false;
  [[nodiscard]] bool contains(double value) const {
    return (low_open ? value > low : value >= low) && (high_open ? value < high : value <= high);
  }
};
constexpr Range any_value() {
  return {};
}
constexpr Range at_least(double low) {
  return {.low = low};
}
constexpr Range between(double low, double high) {
  return {.low = low, .high = high};
}
constexpr Range above(double low, double high = std::numeric_limits<double>::infinity()) {
  return {.low = low, .high = high, .low_open = true};
}
constexpr Range inside(double low, double high) {
  return {.low = low, .high = high, .low_open = true, .high_open = true};
}

struct Count {
  std::size_t low = 0, high = 0;
  bool single_allowed = false;    // `scale: 2` instead of `scale: [2]`
  std::string_view of = "value";  // "joint": what is counted, for messages
};

using Words = std::span<const std::string_view>;

class Fields {
 public:
  virtual ~Fields() = default;
  using Body = std::function<void(Fields&)>;
  using ItemBody = std::function<void(Fields&, std::size_t)>;

  // Leaves. The value is in base units; time in nanoseconds.
  virtual void quantity(const Key& key, double& value, Dimension dimension, Range range) = 0;
  virtual void duration(const Key& key, Duration& value, Duration low, Duration high) = 0;
  virtual void whole(const Key& key, std::int64_t& value, std::int64_t low, std::int64_t high) = 0;
  virtual void whole_or_none(const Key& key, std::optional<int>& value, int low, int high) = 0;
  virtual void flag(const Key& key, bool& value) = 0;
  virtual void identifier(const Key& key, std::string& value) = 0;  // letters, digits, _ and -, begins with a letter
  virtual void text(const Key& key, std::string& value) = 0;        // one line, not empty
  // One of `words`; `none_word` non-empty: it may also say that word, which empties the value.
  virtual void one_of(const Key& key, std::string& value, Words words, std::string_view what,
                      std::string_view none_word = {}) = 0;
  virtual void quantities(const Key& key, std::vector<double>& values, Dimension dimension, Range range,
                          Count count) = 0;
  virtual void interval(const Key& key, double& low, double& high, Dimension dimension, Range range) = 0;  // [min, max]
  virtual void names(const Key& key, std::vector<std::string>& values, Words words, std::string_view what) = 0;
  // Either one of `words` (index) or a list (index = words.size()).
  virtual void word_or_quantities(const Key& key, std::size_t& word, Words words, std::vector<double>& values,
                                  Dimension dimension, Range range, Count count) = 0;
  // Sections and lists of sections.
  virtual void section(const Key& key, const Body& body) = 0;
  virtual void optional_section(const Key& key, bool& present, const Body& body) = 0;
  virtual void sequence(const Key& key, std::size_t count, std::size_t most,
                        const std::function<void(std::size_t)>& resize, const ItemBody& item) = 0;
  virtual void named_sections(const Key& key, std::vector<std::string> names,
                              const std::function<void(const std::vector<std::string>&)>& set_names,
                              const ItemBody& item) = 0;
  // What the section's other keys mean depends on a value that is not known: none is asked for or complained about.
  virtual void leave_the_rest() {}
  // What a list of names further down in the section says in the file that is read; what is written has it already.
  [[nodiscard]] virtual std::vector<std::string> names_ahead(std::string_view /*key*/) const { return {}; }
  // True where keys that depend on another key's value are to be shown all the same (the key table).
  [[nodiscard]] virtual bool shows_all() const { return false; }

  // The same in terms of the structures' own types.
  template <class Integer>
  void integer(const Key& key, Integer& value, std::int64_t low, std::int64_t high) {
    auto wide = static_cast<std::int64_t>(value);
    whole(key, wide, low, high);
    value = static_cast<Integer>(wide);
  }
  // False: it is none of the words, nor left to be filled in; then the value is the first one's.
  template <class Enum>
  bool choice(const Key& key, Enum& value, Words words) {
    const auto index = static_cast<std::size_t>(value);
    std::string word(index < words.size() ? words[index] : "");
    one_of(key, word, words, key.name);
    const std::optional<std::size_t> known = index_of(words, word);
    value = static_cast<Enum>(known.value_or(0));
    return known.has_value() || word == kUnfilled;
  }
  template <class Index>
  void reference(const Key& key, Index& index, Words names_known, std::string_view what) {
    const auto at = static_cast<std::size_t>(index);
    std::string word(at < names_known.size() ? names_known[at] : "");
    one_of(key, word, names_known, what);
    index = static_cast<Index>(index_of(names_known, word).value_or(0));
  }
  void references(const Key& key, std::vector<std::size_t>& indices, Words names_known, std::string_view what) {
    std::vector<std::string> words;
    for (const std::size_t index : indices) words.emplace_back(names_known[index]);
    names(key, words, names_known, what);
    indices.clear();
    for (const std::string& word : words) indices.push_back(index_of(names_known, word).value_or(0));
  }
  void vector3(const Key& key, Vector3& value, Dimension dimension, Range range = any_value()) {
    std::vector<double> values(value.begin(), value.end());
    quantities(key, values, dimension, range, {.low = 3, .high = 3, .of = "axis"});
    for (std::size_t i = 0; i < 3; ++i) value[i] = i < values.size() ? values[i] : 0;
  }
  template <class Item, class Describe>
  void each(const Key& key, std::vector<Item>& items, std::size_t most, Describe describe) {
    sequence(
        key, items.size(), most, [&items](std::size_t n) { items.resize(n); },
        [&items, &describe](Fields& fields, std::size_t i) { describe(fields, items[i]); });
  }
  template <class Item, class Describe>
  void each_named(const Key& key, std::vector<Item>& items, Describe describe) {
    std::vector<std::string> known;
    for (const Item& item : items) known.push_back(item.name);
    named_sections(
        key, std::move(known),
        [&items](const std::vector<std::string>& given) {
          items.clear();
          for (const std::string& one : given) items.emplace_back().name = one;
        },
        [&items, &describe](Fields& fields, std::size_t i) { describe(fields, items[i]); });
  }

 private:
  static std::optional<std::size_t> index_of(Words words, std::string_view word) {
    for (std::size_t i = 0; i < words.size(); ++i)
      if (words[i] == word) return i;
    return std::nullopt;
  }
};

}  // namespace takt::config
