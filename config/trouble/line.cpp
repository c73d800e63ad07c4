// SPDX-License-Identifier: Apache-2.0
#include "config/trouble/line.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "config/printable.hpp"

namespace takt::trouble {
namespace {

using config::Dimension;
constexpr std::string_view kBlanks = " \t\n";

std::unexpected<std::string> no(std::string sentence) {
  return std::unexpected(std::move(sentence));
}

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) + 1 - begin);
}

// How a line is written at the place, with the kind that is meant.
std::string how_to(Place place, std::string_view kind) {
  return fmt::format("write '{}: {}'", place == Place::run ? "TIME" : "TIME for LENGTH", kind);
}

class Words {
 public:
  explicit Words(std::string_view text) : rest_(trimmed(text)) {}
  [[nodiscard]] bool any() const { return !rest_.empty(); }
  [[nodiscard]] std::string_view next() const { return rest_.substr(0, rest_.find_first_of(kBlanks)); }
  std::string_view take() {
    const std::string_view word = next();
    rest_ = trimmed(rest_.substr(word.size()));
    return word;
  }
  bool take(std::string_view word) {
    if (next() != word) return false;
    take();
    return true;
  }
  // A number and its unit, in one word or in two.
  std::expected<double, std::string> take_quantity(Dimension dimension) {
    const std::string word(take());
    auto value = config::parse_quantity(word, dimension);
    if (value || dimension == Dimension::none || !any() || next() == "for" || !config::parse_number(word)) return value;
    return config::parse_quantity(fmt::format("{} {}", word, take()), dimension);
  }

 private:
  std::string_view rest_;
};

std::expected<Duration, std::string> take_time(Words& words) {
  const auto time = words.take_quantity(Dimension::time);
  if (!time) return no(time.error());
  if (*time < 0 || *time > static_cast<double>(kLongestTime.ns))
    return no(fmt::format("{:g} s is out of range; write a time up to {}", *time / 1e9,
                          config::format_duration(kLongestTime)));
  return Duration{std::llround(*time)};
}

std::expected<double, std::string> take_dose(Words& words, const Row& row) {
  const Dose& dose = row.dose;
  const auto value = words.take_quantity(dose.dimension());
  if (!value) return value;
  if (!dose.range().contains(*value))
    return no(fmt::format("{:g} {} is out of range; `{}` takes {}{:g} to {:g} {}", *value / dose.in_base(), dose.unit,
                          row.name, dose.more_than_least ? "more than " : "", dose.least, dose.most, dose.unit));
  if (dose.whole && *value != std::floor(*value)) return no(fmt::format("{:g} is not a whole number", *value));
  return value;
}

std::expected<void, std::string> take_length(Words& words, Line& line) {
  const auto length = take_time(words);
  if (!length) return no(length.error());
  line.length = *length;
  if (line.length <= line.row->longest) return {};
  return no(fmt::format("a `{}` may last {}", line.row->name, config::format_duration(line.row->longest)));
}

// What follows the kind.
std::expected<void, std::string> read_rest(Words& words, bool has_length, Line& line) {
  const Row& row = *line.row;
  const auto missing = [&](std::string_view what) { return no(fmt::format("`{}` lacks its {}", row.name, what)); };
  if (!row.strikes.words.empty()) {
    line.target = words.take();
    if (std::ranges::find(row.strikes.words, line.target) == row.strikes.words.end())
      return no(
          fmt::format("`{}` strikes one of {}, not `{}`", row.name, fmt::join(row.strikes.words, ", "), line.target));
  }
  if (!row.dose.unit.empty()) {
    if (!words.any()) return missing("dose");
    const auto dose = take_dose(words, row);
    if (!dose) return no(dose.error());
    line.dose = *dose;
  }
  if (row.longest.ns > 0 && !has_length) {
    words.take("for");
    if (!words.any()) return missing("length");
    if (auto length = take_length(words, line); !length) return length;
  }
  while (row.takes_command && words.any()) line.command.emplace_back(words.take());
  if (row.takes_command && line.command.empty()) return missing("command");
  if (words.any()) return no(fmt::format("`{}` does not belong there", words.take()));
  return {};
}

}  // namespace

std::expected<Duration, std::string> parse_time(std::string_view text) {
  Words words(text);
  const auto time = take_time(words);
  if (time && !words.any()) return time;
  if (!time && config::parse_number(text)) return no(time.error());
  return no(fmt::format("`{}` is not a time; write such as 300ms or 20s", config::printable(text)));
}

std::expected<Line, std::string> parse_line(std::string_view text, Place place) {
  if (text.size() > kMostCharacters)
    return no(fmt::format("has {} characters; write at most {}", text.size(), kMostCharacters));
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos) return no(how_to(place, "KIND") + ", KIND one of: " + forms(place));
  Words head(text.substr(0, colon)), body(text.substr(colon + 1));
  const std::string_view name = body.take();
  Line line;
  line.row = find(place, name);
  if (line.row == nullptr && name.empty()) return no("names no kind; write one of: " + forms(place));
  if (line.row == nullptr) return no(fmt::format("`{}` {}", config::printable(name), known_kinds(place, name)));
  const auto refuse = [&](const std::string& why) {
    return no(fmt::format("{}; {}", config::printable(why), how_to(place, form(*line.row))));
  };
  const auto at = take_time(head);
  if (!at) return refuse(at.error());
  line.at = *at;
  const bool has_length = head.take("for");
  if (has_length && line.row->longest.ns == 0) return refuse(fmt::format("`{}` takes no length", line.row->name));
  if (has_length)
    if (const auto length = take_length(head, line); !length) return refuse(length.error());
  if (head.any()) return refuse(fmt::format("`{}` does not belong there", head.take()));
  if (const auto rest = read_rest(body, has_length, line); !rest) return refuse(rest.error());
  return line;
}

std::string text_of(const Line& line) {
  std::string text(line.row->name);
  if (!line.target.empty()) text += " " + line.target;
  if (line.row->dose.dimension() != Dimension::none)
    text += " " + config::format_quantity(line.dose, line.row->dose.dimension());
  else if (!line.row->dose.unit.empty())
    text += fmt::format(" {}", line.dose);
  if (line.row->longest.ns > 0) text += " for " + config::format_duration(line.length);
  for (const std::string& word : line.command) text += " " + word;
  return text;
}

}  // namespace takt::trouble
