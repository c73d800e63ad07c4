// SPDX-License-Identifier: Apache-2.0
// Fills a configuration structure from a YAML tree and says everything that is wrong with the tree: unknown and missing
// keys, wrong types, missing or wrong units, values out of range, unknown names, wrong counts.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "config/document.hpp"
#include "config/fields.hpp"
#include "config/nearest.hpp"

namespace takt::config {

// Where each key was written, by dotted path ("freshness.stop_after", "joints[2].limits.torque"); a key left to its
// default stands where its section does.
using Places = std::map<std::string, Place, std::less<>>;

class Reader final : public Fields {
 public:
  // `node` must be a map; `path` is empty for the whole file. All references outlive the reader.
  Reader(const Node& node, std::string path, Problems& problems, Places& places);
  // A key that is dealt with elsewhere, and no unknown one.
  void knows(std::string_view key) { declared_.emplace_back(key); }
  // Reports the keys that were not asked for. Call once, after the description was walked.
  void finish();

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
  [[nodiscard]] std::vector<std::string> names_ahead(std::string_view key) const override;
  void leave_the_rest() override { rest_is_left_ = true; }

 private:
  // The key's node; a default's text parsed in its place; nullptr when it is missing (reported) or prefilled.
  const Node* look_up(const Key& key);
  const Node* scalar(const Key& key);
  bool expect(const Node& node, Node::Kind kind, const Key& key, std::string_view example);
  void complain(const Node& node, const Key& key, std::string_view sentence);
  std::optional<double> read_quantity(const Node& node, const Key& key, Dimension dimension, Range range);
  std::optional<std::int64_t> read_whole(const Node& node, const Key& key, std::int64_t low, std::int64_t high);
  bool check_word(const Node& node, const Key& key, Words words, std::string_view what, std::string_view none_word);
  void read_list(const Node& node, const Key& key, std::vector<double>& values, Dimension dimension, Range range,
                 Count count);
  void refuse_repeated_names(const Node& list, const Key& key);
  void read_section(const Node& node, const Key& key, const std::string& path, const Body& body);
  [[nodiscard]] std::string path_of(std::string_view key) const;

  const Node& node_;
  std::string path_;
  Problems& problems_;
  Places& places_;
  std::vector<std::string> declared_;
  bool rest_is_left_ = false;
  std::map<std::string, Node, std::less<>> defaults_;  // parsed defaults, kept alive
};

// Letters, digits, _ and -, begins with a letter, at most 63 of them.
bool is_identifier(std::string_view text);

}  // namespace takt::config
