// SPDX-License-Identifier: Apache-2.0
// Canonical YAML of a configuration structure: base units, shortest numbers that read back equal; and of the keys that
// have a default either all, or those that say something else. A key whose default is something of the robot's own
// (its drive's model) is always written.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/fields.hpp"

namespace takt::config {

enum class Defaults : std::uint8_t { written_out, left_out };

class Writer final : public Fields {
 public:
  explicit Writer(Defaults defaults) : defaults_(defaults) {}
  [[nodiscard]] const std::string& result() const { return out_; }

  void quantity(const Key& key, double& value, Dimension dimension, Range range) override;
  void duration(const Key& key, Duration& value, Duration low, Duration high) override;
  void whole(const Key& key, std::int64_t& value, std::int64_t low, std::int64_t high) override;
  void whole_or_none(const Key& key, std::optional<int>& value, int low, int high) override;
  void flag(const Key& key, bool& value) override;
  void identifier(const Key& key, std::string& value) override;
  void text(const Key& key, std::string& value) override;
  void one_of(const Key& key, std::string& value, Words words, std::string_view what,
              std::string_view none_word) override;
  void quantities(const Key& key, std::vector<double>& values, Dimension dimension, Range range, Count count) override;
  void interval(const Key& key, double& low, double& high, Dimension dimension, Range range) override;
  void names(const Key& key, std::vector<std::string>& values, Words words, std::string_view what) override;
  void word_or_quantities(const Key& key, std::size_t& word, Words words, std::vector<double>& values,
                          Dimension dimension, Range range, Count count) override;
  void section(const Key& key, const Body& body) override;
  void optional_section(const Key& key, bool& present, const Body& body) override;
  void sequence(const Key& key, std::size_t count, std::size_t most, const std::function<void(std::size_t)>& resize,
                const ItemBody& item) override;
  void named_sections(const Key& key, std::vector<std::string> names,
                      const std::function<void(const std::vector<std::string>&)>& set_names,
                      const ItemBody& item) override;

 private:
  void line(std::string_view key, std::string_view value);
  // `read` reads the key into a value of this type. True: that would be the same without the key.
  template <class Value, class Read>
  [[nodiscard]] bool leaves_out(const Key& key, const Value& value, Read read) const;
  // Of a section or a list that holds nothing.
  [[nodiscard]] bool leaves_out_empty(const Key& key) const;
  Defaults defaults_;
  std::string out_;
  std::size_t depth_ = 0;
  bool dash_ = false;  // the next line begins a list entry
};

}  // namespace takt::config
