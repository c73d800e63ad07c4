// SPDX-License-Identifier: Apache-2.0
// A YAML file as a plain tree in which every key and value knows its line and column.
//
// Only the part of YAML that cannot surprise is let through: no anchors, aliases, merge keys or tags, no second
// document, no tab characters, no control characters, no duplicate keys, at most 1 MiB. Scalars keep their text:
// nothing is guessed to be a number or a boolean here. Errors: one line per problem, "file:line:column: what; how to
// correct it".
#pragma once

#include <cstdint>
#include <expected>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace takt::config {

struct Place {
  int line = 0;  // from 1; 0: the file as a whole
  int column = 0;
  bool in_base = false;  // in the file that this one is based on (config/based_on.hpp)
  friend auto operator<=>(const Place&, const Place&) = default;
};

class Problems {
 public:
  explicit Problems(std::string file) : file_(std::move(file)) {}
  void add(Place place, std::string_view sentence);
  // What places `in_base` are told with.
  void set_base(std::string file) { base_ = std::move(file); }
  // What stands at these places is meant for several parts of the file, `whose`: of the problems at one of them only
  // the first is told, and whose it is.
  void share(const std::vector<Place>& places, const std::string& whose);
  [[nodiscard]] bool empty() const { return found_.empty(); }
  [[nodiscard]] std::string text() const;  // in file order, one per line, no trailing newline, printable

 private:
  std::string file_, base_;
  std::vector<std::pair<Place, std::string>> found_;
  std::map<Place, std::string> shared_;
};

struct Entry;

struct Node {
  enum class Kind : std::uint8_t { null, scalar, sequence, map };
  Kind kind = Kind::null;
  Place place;
  std::string text;     // scalar
  bool quoted = false;  // scalar
  std::string tag;      // only when tags are read as data
  std::vector<Node> items;
  std::vector<Entry> entries;  // map

  [[nodiscard]] const Node* find(std::string_view key) const;  // nullptr: no such key, or no map
  Entry* entry_of(std::string_view key);                       // as find
  // Adds the keys of `other` that this map does not have; sections that both have are joined key by key. A list or a
  // value that this map has stays as it is.
  void add_missing(const Node& other);
};

struct Entry {
  Node key, value;
};

// How a foreign file's tags are treated; a robot file may not hold any.
enum class Tags : std::uint8_t { refuse, read_as_data };

// Null node when the text holds no YAML at all. Problems are added; the tree is usable only if none were.
Node read_document(std::string_view text, Tags tags, Problems& problems);

// The whole file, at most 1 MiB of it.
std::expected<std::string, std::string> read_file(const std::string& path);

// "sequence", "map", ... for messages.
std::string_view kind_name(Node::Kind kind);

}  // namespace takt::config
