// SPDX-License-Identifier: Apache-2.0
#include "config/reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>
#include <span>

#include "config/key_table.hpp"
#include "config/migrations.hpp"

namespace takt::config {
namespace {

// Plain words YAML 1.1 turns into booleans or nothing behind the writer's back.
bool is_boolean_by_accident(const Node& node) {
  static constexpr std::array<std::string_view, 12> kWords{"yes", "no", "on", "off", "y",   "n",
                                                           "Yes", "No", "On", "Off", "YES", "NO"};
  return !node.quoted && std::ranges::find(kWords, node.text) != kWords.end();
}

bool is_unfilled(const Node& node) {
  return node.text == kUnfilled ||
         std::ranges::any_of(node.items, [](const Node& item) { return item.text == kUnfilled; });
}

std::string digits_of(std::string_view text) {
  std::string digits;
  std::ranges::copy_if(text, std::back_inserter(digits), [](char c) { return c >= '0' && c <= '9'; });
  return digits;
}

// The word that was meant, or none. Names that differ in a digit are different things (AK80-8 and AK80-9, can0 and
// can1): one is never offered for the other.
std::string_view mistyped(std::string_view text, std::span<const std::string_view> known) {
  const std::string_view meant = nearest(text, known);
  return digits_of(meant) == digits_of(text) ? meant : std::string_view{};
}

std::string range_text(Range range, Dimension dimension) {
  const bool low = std::isfinite(range.low);
  const bool high = std::isfinite(range.high);
  const std::string lowest = low ? format_quantity(range.low, dimension) : "";
  const std::string highest = high ? format_quantity(range.high, dimension) : "";
  if (low && high)
    return fmt::format("{} {} and {} {}", range.low_open ? "above" : "at least", lowest,
                       range.high_open ? "below" : "at most", highest);
  if (low) return fmt::format("{} {}", range.low_open ? "above" : "at least", lowest);
  return fmt::format("{} {}", range.high_open ? "below" : "at most", highest);
}

}  // namespace

bool is_identifier(std::string_view text) {
  const auto letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  const auto other = [](char c) { return (c >= '0' && c <= '9') || c == '_' || c == '-'; };
  return !text.empty() && text.size() <= 63 && letter(text[0]) &&
         std::ranges::all_of(text, [&](char c) { return letter(c) || other(c); });
}

namespace {

// Of a key that its section knows beside others, and not here; empty: it does not. The top of another kind of file may
// have the name of a robot file's key.
std::string needs_another(const std::string& section, const std::string& key) {
  const std::string_view meaning = section.empty() ? "" : meaning_of_key(fmt::format("{}.{}", section, key));
  if (meaning.empty()) return {};
  const std::size_t end = meaning.find(": ");
  if (end == std::string_view::npos)
    return fmt::format("`{}` in `{}` does not apply beside the section's other keys: {}", key, section, meaning);
  return fmt::format("`{}` in `{}` needs `{}` beside it: {}", key, section, meaning.substr(0, end),
                     meaning.substr(end + 2));
}

}  // namespace

Reader::Reader(const Node& node, std::string path, Problems& problems, Places& places)
    : node_(node), path_(std::move(path)), problems_(problems), places_(places) {
  places_[path_] = node.place;
}

void Reader::finish() {
  if (rest_is_left_) return;
  const std::vector<std::string_view> known(declared_.begin(), declared_.end());
  for (const auto& [key, value] : node_.entries) {
    if (std::ranges::find(known, key.text) != known.end()) continue;
    if (const Migration* const gone = migration_of(path_of(key.text))) {
      problems_.add(key.place,
                    fmt::format("{}: gone since version {}: {}", path_of(key.text), gone->since, gone->cure));
      continue;
    }
    if (const std::string needs = needs_another(path_, key.text); !needs.empty()) {
      problems_.add(key.place, needs);
      continue;
    }
    const std::string where = path_.empty() ? "at the top" : fmt::format("in `{}`", path_);
    const std::string_view meant = nearest(key.text, known);
    problems_.add(key.place,
                  meant.empty()
                      ? fmt::format("unknown key `{}` {}; known here: {}", key.text, where, fmt::join(known, ", "))
                      : fmt::format("unknown key `{}` {}; did you mean `{}`?", key.text, where, meant));
  }
}

std::string Reader::path_of(std::string_view key) const {
  return path_.empty() ? std::string(key) : fmt::format("{}.{}", path_, key);
}

void Reader::complain(const Node& node, const Key& key, std::string_view sentence) {
  problems_.add(node.place, fmt::format("{}: {}", path_of(key.name), sentence));
}

const Node* Reader::look_up(const Key& key) {
  declared_.emplace_back(key.name);
  if (const Node* node = node_.find(key.name)) {
    places_[path_of(key.name)] = node->place;
    if (!is_unfilled(*node)) return node;
    complain(*node, key, fmt::format("is still {}; write what is true of this robot: {}", kUnfilled, key.doc));
    return nullptr;
  }
  places_[path_of(key.name)] = node_.place;
  if (key.prefilled) return nullptr;
  if (!key.otherwise) {
    problems_.add(node_.place, fmt::format("key `{}` is missing{}; add it: {}", key.name,
                                           path_.empty() ? "" : fmt::format(" in `{}`", path_), key.doc));
    return nullptr;
  }
  Problems none("default");
  return &(defaults_[std::string(key.name)] = read_document(*key.otherwise, Tags::refuse, none));
}

bool Reader::expect(const Node& node, Node::Kind kind, const Key& key, std::string_view example) {
  if (node.kind == kind) return true;
  complain(node, key, fmt::format("holds {}; write {}", kind_name(node.kind), example));
  return false;
}

const Node* Reader::scalar(const Key& key) {
  const Node* node = look_up(key);
  if (!node || !expect(*node, Node::Kind::scalar, key, "a single value")) return nullptr;
  return node;
}

std::optional<double> Reader::read_quantity(const Node& node, const Key& key, Dimension dimension, Range range) {
  if (node.kind != Node::Kind::scalar) {
    complain(node, key,
             fmt::format("holds {}; write a value such as `{}`", kind_name(node.kind),
                         dimension == Dimension::none ? "1.5" : fmt::format("1 {}", usual_symbol(dimension))));
    return std::nullopt;
  }
  if (dimension == Dimension::none && node.quoted) {
    complain(node, key, fmt::format("\"{}\" is text; write the number without quotes", node.text));
    return std::nullopt;
  }
  const auto value = parse_quantity(node.text, dimension);
  if (!value) {
    const bool is_of_other = key.other && !key.other->cure.empty() && parse_quantity(node.text, key.other->dimension);
    complain(node, key, is_of_other ? fmt::format("{}, or {}", value.error(), key.other->cure) : value.error());
    return std::nullopt;
  }
  if (!range.contains(*value)) {
    complain(node, key, fmt::format("{} is out of range; write {}", node.text, range_text(range, dimension)));
    return std::nullopt;
  }
  return *value;
}

void Reader::quantity(const Key& key, double& value, Dimension dimension, Range range) {
  if (const Node* node = look_up(key))
    if (const auto read = read_quantity(*node, key, dimension, range)) value = *read;
}

void Reader::duration(const Key& key, Duration& value, Duration low, Duration high) {
  const Range range = between(static_cast<double>(low.ns), static_cast<double>(high.ns));
  if (const Node* node = look_up(key))
    if (const auto read = read_quantity(*node, key, Dimension::time, range)) value = {std::llround(*read)};
}

std::optional<std::int64_t> Reader::read_whole(const Node& node, const Key& key, std::int64_t low, std::int64_t high) {
  const std::string_view text = node.text;
  if (node.quoted) {
    complain(node, key, fmt::format("\"{}\" is text; write the number without quotes", text));
    return std::nullopt;
  }
  std::int64_t value = 0;
  const bool hexadecimal = text.starts_with("0x") && text.size() > 2;
  const char* const begin = text.data() + (hexadecimal ? 2 : 0);
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value, hexadecimal ? 16 : 10);
  if (error != std::errc{} || end != text.data() + text.size() || (hexadecimal && *begin == '-')) {
    const auto number = parse_number(text);
    const bool has_top = high != std::numeric_limits<std::int64_t>::max();
    complain(node, key,
             number    ? fmt::format("{} is not a whole number; write one such as 3", text)
             : has_top ? fmt::format("`{}` is not a number; write a whole one, {} to {}", text, low, high)
                       : fmt::format("`{}` is not a number; write a whole one, {} or more", text, low));
    return std::nullopt;
  }
  if (!hexadecimal)
    if (const auto number = parse_number(text); !number) {  // octal-looking
      complain(node, key, number.error());
      return std::nullopt;
    }
  if (value < low || value > high) {
    complain(node, key, fmt::format("{} is out of range; write {} to {}", text, low, high));
    return std::nullopt;
  }
  return value;
}

void Reader::whole(const Key& key, std::int64_t& value, std::int64_t low, std::int64_t high) {
  if (const Node* node = scalar(key))
    if (const auto read = read_whole(*node, key, low, high)) value = *read;
}

void Reader::whole_or_none(const Key& key, std::optional<int>& value, int low, int high) {
  const Node* node = scalar(key);
  if (!node) return;
  value.reset();
  if (node->text == "none") return;
  if (const auto read = read_whole(*node, key, low, high)) value = static_cast<int>(*read);
}

void Reader::flag(const Key& key, bool& value) {
  const Node* node = scalar(key);
  if (!node) return;
  if (!node->quoted && (node->text == "true" || node->text == "false"))
    value = node->text == "true";
  else
    complain(*node, key, fmt::format("`{}` is not a boolean here; write true or false", node->text));
}

void Reader::identifier(const Key& key, std::string& value) {
  const Node* node = scalar(key);
  if (!node) return;
  value = node->text;
  if (is_boolean_by_accident(*node) || (!node->quoted && (node->text == "true" || node->text == "false")))
    complain(*node, key, fmt::format("`{}` reads as a boolean in YAML; choose another name", node->text));
  else if (!is_identifier(node->text))
    complain(
        *node, key,
        fmt::format("`{}` is no name; use up to 63 letters, digits, _ and -, beginning with a letter", node->text));
}

void Reader::text(const Key& key, std::string& value) {
  const Node* node = scalar(key);
  if (!node) return;
  value = node->text;
  if (is_boolean_by_accident(*node))
    complain(*node, key, fmt::format("`{0}` reads as a boolean in YAML; put it in quotes: \"{0}\"", node->text));
  else if (value.empty() || value.find('\n') != std::string::npos)
    complain(*node, key, "must be one line of text and not empty; write it");
}

namespace {

bool is_same_but_case(std::string_view a, std::string_view b) {
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  return std::ranges::equal(a, b, {}, lower, lower);
}

}  // namespace

bool Reader::check_word(const Node& node, const Key& key, Words words, std::string_view what,
                        std::string_view none_word) {
  if (node.kind != Node::Kind::scalar) {
    complain(node, key, fmt::format("holds {}; write a name", kind_name(node.kind)));
    return false;
  }
  if ((!none_word.empty() && node.text == none_word) || std::ranges::find(words, node.text) != words.end()) return true;
  if (const Migration* const gone = migration_of(path_of(key.name), node.text)) {
    complain(node, key, fmt::format("`{}` is gone since version {}: {}", node.text, gone->since, gone->cure));
    return false;
  }
  std::vector<std::string_view> allowed(words.begin(), words.end());
  if (!none_word.empty()) allowed.push_back(none_word);
  if (!key.if_unknown.empty()) {
    const auto same =
        std::ranges::find_if(allowed, [&](std::string_view word) { return is_same_but_case(word, node.text); });
    complain(node, key,
             same != allowed.end() ? fmt::format("{} `{}` is not known; write `{}`", what, node.text, *same)
                                   : fmt::format("{} `{}` is not known: known are {}; {}", what, node.text,
                                                 fmt::join(allowed, ", "), key.if_unknown));
    return false;
  }
  const std::string_view meant = mistyped(node.text, allowed);
  complain(node, key,
           allowed.empty() ? fmt::format("{} `{}` is not known: none is declared; add it", what, node.text)
           : meant.empty()
               ? fmt::format("{} `{}` is not known; write one of: {}", what, node.text, fmt::join(allowed, ", "))
               : fmt::format("{} `{}` is not known; did you mean `{}`?", what, node.text, meant));
  return false;
}

void Reader::one_of(const Key& key, std::string& value, Words words, std::string_view what,
                    std::string_view none_word) {
  const Node* node = look_up(key);
  if (const Node* unfilled = node_.find(key.name); unfilled && !node) value = unfilled->text;
  if (!node) return;
  check_word(*node, key, words, what, none_word);
  value = node->text == none_word ? "" : node->text;  // an unknown word too: what follows from it is no second problem
}

void Reader::read_list(const Node& node, const Key& key, std::vector<double>& values, Dimension dimension, Range range,
                       Count count) {
  values.clear();
  if (node.kind == Node::Kind::scalar && count.single_allowed) {
    if (const auto read = read_quantity(node, key, dimension, range)) values.push_back(*read);
    return;
  }
  if (!expect(node, Node::Kind::sequence, key, count.single_allowed ? "a value or a list [...]" : "a list [...]"))
    return;
  if (node.items.size() < count.low || node.items.size() > count.high)
    complain(node, key,
             count.low == count.high
                 ? fmt::format("has {} values for {}; write one per {}", node.items.size(),
                               fmt::format("{} {}{}", count.high, count.of,
                                           count.high == 1      ? ""
                                           : count.of == "axis" ? ""
                                                                : "s"),
                               count.of)
                 : fmt::format("has {} values; write {} to {}", node.items.size(), count.low, count.high));
  for (std::size_t i = 0; i < node.items.size(); ++i)
    values.push_back(
        read_quantity(node.items[i], key, i < key.each.size() ? key.each[i] : dimension, range).value_or(0));
}

void Reader::quantities(const Key& key, std::vector<double>& values, Dimension dimension, Range range, Count count) {
  if (const Node* node = look_up(key)) read_list(*node, key, values, dimension, range, count);
}

void Reader::interval(const Key& key, double& low, double& high, Dimension dimension, Range range) {
  const Node* node = look_up(key);
  if (!node || !expect(*node, Node::Kind::sequence, key, "a list [min, max]")) return;
  if (node->items.size() != 2) {
    complain(*node, key, fmt::format("has {} values; write two: [min, max]", node->items.size()));
    return;
  }
  const auto lowest = read_quantity(node->items[0], key, dimension, range);
  const auto highest = read_quantity(node->items[1], key, dimension, range);
  if (!lowest || !highest) return;
  if (*lowest >= *highest)
    complain(*node, key,
             fmt::format("min {} is not below max {}; swap them or widen the range", node->items[0].text,
                         node->items[1].text));
  low = *lowest;
  high = *highest;
}

void Reader::names(const Key& key, std::vector<std::string>& values, Words words, std::string_view what) {
  const Node* node = look_up(key);
  if (!node || !expect(*node, Node::Kind::sequence, key, "a list of names [...]")) return;
  values.clear();
  for (const Node& item : node->items) {
    if (!check_word(item, key, words, what, {})) continue;
    if (std::ranges::find(values, item.text) != values.end())
      complain(item, key, fmt::format("{} `{}` is named twice; name each once", what, item.text));
    else
      values.push_back(item.text);
  }
}

void Reader::word_or_quantities(const Key& key, std::size_t& word, Words words, std::vector<double>& values,
                                Dimension dimension, Range range, Count count) {
  const Node* node = look_up(key);
  if (!node) return;
  if (node->kind == Node::Kind::sequence) {
    word = words.size();
    read_list(*node, key, values, dimension, range, count);
    return;
  }
  values.clear();
  if (!check_word(*node, key, words, key.name, {})) return;
  word = static_cast<std::size_t>(std::ranges::find(words, node->text) - words.begin());
}

std::vector<std::string> Reader::names_ahead(std::string_view key) const {
  std::vector<std::string> names;
  if (const Node* node = node_.find(key))
    for (const Node& item : node->items) names.push_back(item.text);
  return names;
}

void Reader::read_section(const Node& node, const Key& key, const std::string& path, const Body& body) {
  if (!expect(node, Node::Kind::map, key, "its keys below it, indented, or {key: value}")) return;
  Reader reader(node, path, problems_, places_);
  body(reader);
  reader.finish();
}

void Reader::section(const Key& key, const Body& body) {
  if (const Node* node = look_up(key)) read_section(*node, key, path_of(key.name), body);
}

void Reader::optional_section(const Key& key, bool& present, const Body& body) {
  declared_.emplace_back(key.name);
  const Node* node = node_.find(key.name);
  present = node != nullptr;
  if (node) read_section(*node, key, path_of(key.name), body);
}

void Reader::refuse_repeated_names(const Node& list, const Key& key) {
  std::map<std::string_view, int> first_line;
  for (const Node& item : list.items) {
    const Node* name = item.find("name");
    if (!name || name->kind != Node::Kind::scalar) continue;
    const auto [first, is_new] = first_line.try_emplace(name->text, name->place.line);
    if (!is_new)
      problems_.add(name->place, fmt::format("{}: `{}` is also the name in line {}; rename one", path_of(key.name),
                                             name->text, first->second));
  }
}

void Reader::sequence(const Key& key, std::size_t, std::size_t most, const std::function<void(std::size_t)>& resize,
                      const ItemBody& item) {
  const Node* node = look_up(key);
  resize(0);
  if (!node || !expect(*node, Node::Kind::sequence, key, "a list, one `- ` per entry")) return;
  const bool required = !key.otherwise;
  if ((required && node->items.empty()) || node->items.size() > most) {
    complain(*node, key, fmt::format("has {} entries; write {} to {}", node->items.size(), required ? 1 : 0, most));
    return;
  }
  resize(node->items.size());
  refuse_repeated_names(*node, key);
  for (std::size_t i = 0; i < node->items.size(); ++i)
    read_section(node->items[i], key, fmt::format("{}[{}]", path_of(key.name), i), [&](Fields& f) { item(f, i); });
}

void Reader::named_sections(const Key& key, std::vector<std::string>,
                            const std::function<void(const std::vector<std::string>&)>& set_names,
                            const ItemBody& item) {
  const Node* node = look_up(key);
  if (!node || !expect(*node, Node::Kind::map, key, "named sections below it, indented")) return;
  std::vector<std::string> given;
  for (const auto& [name, value] : node->entries) {
    if (!is_identifier(name.text) || is_boolean_by_accident(name))
      problems_.add(name.place, fmt::format("`{}` is no name; use letters, digits, _ and -", name.text));
    given.push_back(name.text);
  }
  set_names(given);
  for (std::size_t i = 0; i < node->entries.size(); ++i)
    read_section(node->entries[i].value, key, fmt::format("{}.{}", path_of(key.name), given[i]),
                 [&](Fields& f) { item(f, i); });
}

}  // namespace takt::config
