#include "config/writer.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "config/robot_text.hpp"

namespace takt::config {
namespace {

std::string list_of(const std::vector<double>& values, Dimension dimension) {
  std::vector<std::string> items;
  for (const double value : values) items.push_back(format_quantity(value, dimension));
  return fmt::format("[{}]", fmt::join(items, ", "));
}

}  // namespace

void Writer::line(std::string_view key, std::string_view value) {
  const std::size_t indent = 2 * depth_ - (dash_ ? 2 : 0);
  out_ += fmt::format("{:{}}{}{}:{}{}\n", "", indent, dash_ ? "- " : "", key, value.empty() ? "" : " ", value);
  dash_ = false;
}

void Writer::quantity(const Key& key, double& value, Dimension dimension, Range) {
  line(key.name, format_quantity(value, dimension));
}

void Writer::duration(const Key& key, Duration& value, Duration, Duration) {
  line(key.name, format_duration(value));
}

void Writer::whole(const Key& key, std::int64_t& value, std::int64_t, std::int64_t) {
  line(key.name, fmt::format("{}", value));
}

void Writer::whole_or_none(const Key& key, std::optional<int>& value, int, int) {
  line(key.name, value ? fmt::format("{}", *value) : "none");
}

void Writer::flag(const Key& key, bool& value) {
  line(key.name, value ? "true" : "false");
}

void Writer::identifier(const Key& key, std::string& value) {
  line(key.name, value);
}

void Writer::text(const Key& key, std::string& value) {
  line(key.name, in_quotes(value));
}

void Writer::newer_text(const Key& key, std::string& value) {
  if (value != key.otherwise) text(key, value);
}

void Writer::one_of(const Key& key, std::string& value, Words, std::string_view, std::string_view none_word) {
  line(key.name, value.empty() ? none_word : std::string_view(value));
}

void Writer::quantities(const Key& key, std::vector<double>& values, Dimension dimension, Range, Count) {
  line(key.name, list_of(values, dimension));
}

void Writer::interval(const Key& key, double& low, double& high, Dimension dimension, Range) {
  line(key.name, list_of({low, high}, dimension));
}

void Writer::names(const Key& key, std::vector<std::string>& values, Words, std::string_view) {
  line(key.name, fmt::format("[{}]", fmt::join(values, ", ")));
}

void Writer::word_or_quantities(const Key& key, std::size_t& word, Words words, std::vector<double>& values,
                                Dimension dimension, Range, Count) {
  line(key.name, word < words.size() ? std::string(words[word]) : list_of(values, dimension));
}

void Writer::section(const Key& key, const Body& body) {
  line(key.name, "");
  ++depth_;
  body(*this);
  --depth_;
}

void Writer::optional_section(const Key& key, bool& present, const Body& body) {
  if (present) section(key, body);
}

void Writer::sequence(const Key& key, std::size_t count, std::size_t, const std::function<void(std::size_t)>&,
                      const ItemBody& item) {
  line(key.name, count == 0 ? "[]" : "");
  depth_ += 2;
  for (std::size_t i = 0; i < count; ++i) {
    dash_ = true;
    item(*this, i);
  }
  depth_ -= 2;
}

void Writer::named_sections(const Key& key, std::vector<std::string> names,
                            const std::function<void(const std::vector<std::string>&)>&, const ItemBody& item) {
  line(key.name, names.empty() ? "{}" : "");
  ++depth_;
  for (std::size_t i = 0; i < names.size(); ++i) section({names[i], ""}, [&](Fields& f) { item(f, i); });
  --depth_;
}

}  // namespace takt::config
