// SPDX-License-Identifier: Apache-2.0
#include "config/document.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <set>
#include <sstream>
#include <streambuf>

#include "config/printable.hpp"
#include "config/read_all.hpp"

namespace takt::config {
namespace {

constexpr std::size_t kMaxBytes = 1U << 20U;

Place place_of(const YAML::Mark& mark) {
  if (mark.line < 0) return {};
  return {mark.line + 1, mark.column + 1};
}

Node node_at(const YAML::Mark& mark, Node::Kind kind) {
  Node node;
  node.kind = kind;
  node.place = place_of(mark);
  return node;
}

// Builds the tree from the parser's events; the parser's own tree forgets aliases and duplicates.
class TreeBuilder : public YAML::EventHandler {
 public:
  TreeBuilder(Tags tags, Problems& problems) : tags_(tags), problems_(problems) {}

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    refuse_anchor(mark, anchor);
    place_value(node_at(mark, Node::Kind::null));
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
    problems_.add(place_of(mark), "an alias (*name) is not allowed; write the value out");
    place_value(node_at(mark, Node::Kind::null));
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    refuse_anchor(mark, anchor);
    const bool quoted = tag == "!";
    Node node = node_at(mark, Node::Kind::scalar);
    node.text = value;
    node.quoted = quoted;
    if (printable(value) != value)  // by an escape such as "\e": it would reach terminals and logs
      problems_.add(place_of(mark), "holds a control character; remove it");
    read_tag(mark, tag, node);
    if (!quoted && (value.empty() || value == "~" || value == "null")) node.kind = Node::Kind::null;
    place_value(std::move(node));
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    open(Node::Kind::sequence, mark, tag, anchor);
  }
  void OnSequenceEnd() override { close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    open(Node::Kind::map, mark, tag, anchor);
  }
  void OnMapEnd() override { close(); }

  Node take_root() { return std::move(root_); }

 private:
  struct Open {
    Node node;
    Node key;
    bool has_key = false;
  };

  void refuse_anchor(const YAML::Mark& mark, YAML::anchor_t anchor) {
    if (anchor != YAML::NullAnchor)
      problems_.add(place_of(mark), "an anchor (&name) is not allowed; write the value out where it is used");
  }
  void read_tag(const YAML::Mark& mark, const std::string& tag, Node& node) {
    if (tag.empty() || tag == "?" || tag == "!") return;
    if (tags_ == Tags::refuse)
      problems_.add(place_of(mark), fmt::format("the tag `{}` is not allowed; remove it", tag));
    else
      node.tag = tag;
  }
  void open(Node::Kind kind, const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor) {
    refuse_anchor(mark, anchor);
    Node node = node_at(mark, kind);
    read_tag(mark, tag, node);
    open_.push_back({.node = std::move(node), .key = {}});
  }
  void close() {
    Node done = std::move(open_.back().node);
    open_.pop_back();
    place_value(std::move(done));
  }
  void place_value(Node node) {
    if (open_.empty()) {
      root_ = std::move(node);
      return;
    }
    Open& parent = open_.back();
    if (parent.node.kind == Node::Kind::sequence) {
      parent.node.items.push_back(std::move(node));
    } else if (!parent.has_key) {
      parent.key = std::move(node);
      parent.has_key = true;
    } else {
      parent.has_key = false;
      add_entry(parent.node, std::move(parent.key), std::move(node));
    }
  }
  void add_entry(Node& map, Node key, Node value) {
    if (key.kind != Node::Kind::scalar) {
      problems_.add(key.place, "a key must be a plain word; write `name: value`");
      return;
    }
    if (key.text == "<<") {
      problems_.add(key.place, "a merge key (<<) is not allowed; write the values out");
      return;
    }
    const auto same = std::ranges::find_if(map.entries, [&](const auto& entry) { return entry.key.text == key.text; });
    if (same != map.entries.end()) {
      problems_.add(key.place, fmt::format("duplicate key `{}`, first written in line {}; keep one of the two",
                                           key.text, same->key.place.line));
      return;
    }
    if (value.kind == Node::Kind::null) value.place = key.place;  // the parser's mark is behind it
    map.entries.push_back({std::move(key), std::move(value)});
  }

  Tags tags_;
  Problems& problems_;
  std::vector<Open> open_;
  Node root_;
};

// The library says what it found; which slips of a person end there.
std::string_view cure_of(std::string_view found) {
  struct Row {
    std::string_view found, cure;
  };
  constexpr std::array rows{
      Row{"end of map not found", "is this line indented as those above that belong with it?"},
      Row{"end of sequence not found", "is this line indented as those above that belong with it?"},
      Row{"end of map flow not found", "is a `}` or a comma missing before it?"},
      Row{"end of sequence flow not found", "is a `]` or a comma missing before it?"},
      Row{"illegal map value", "is a blank missing behind a `:`, or is this line indented too far?"},
      Row{"alias not found after *", "put the text in quotes"},
      Row{"the referenced anchor is not defined", "put the text in quotes"},
      Row{"illegal flow end", "is a `{` or `[` missing before it?"},
  };
  const auto row = std::ranges::find(rows, found, &Row::found);
  return row == rows.end() ? "correct the syntax here" : row->cure;
}

bool refuse_characters(std::string_view text, Problems& problems) {
  if (text.find('\0') != std::string_view::npos) {
    problems.add({}, "is a binary file; name one of YAML text");
    return false;
  }
  Place place{1, 1};
  bool fine = true, is_utf8 = true;
  std::size_t read_to = 0;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    const std::size_t length = at < read_to ? 1 : utf8_length(text.substr(at));
    read_to = std::max(read_to, at + length);
    if (is_utf8 && length == 0) {
      problems.add(place,
                   fmt::format("byte 0x{:02x} is no UTF-8; save the file as UTF-8", static_cast<unsigned char>(c)));
      fine = is_utf8 = false;
    }
    if (c == '\t') {
      problems.add(place, "tab character; indent and separate with spaces");
      fine = false;
    } else if ((static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\r') || c == '\x7f') {
      problems.add(place, fmt::format("control character 0x{:02x}; remove it", static_cast<unsigned char>(c)));
      fine = false;
    }
    place = c == '\n' ? Place{place.line + 1, 1} : Place{place.line, place.column + 1};
  }
  return fine;
}

// "joints[3].limits.torque" and "joints[4].limits.torque" are the same problem where both are written in one place.
std::string without_index(const std::string& sentence) {
  const std::size_t open = sentence.find('[');
  const std::size_t close = sentence.find(']', open);
  return close == std::string::npos ? sentence : sentence.substr(0, open) + sentence.substr(close + 1);
}

}  // namespace

void Problems::add(Place place, std::string_view sentence) {
  found_.emplace_back(place, sentence);
}

void Problems::share(const std::vector<Place>& places, const std::string& whose) {
  for (const Place& place : places) shared_.insert_or_assign(place, whose);
}

std::string Problems::text() const {
  auto sorted = found_;
  std::ranges::stable_sort(sorted, {}, [](const auto& problem) {
    return std::pair{problem.first.in_base, problem.first};
  });
  std::string all;
  std::set<std::pair<Place, std::string>> told;
  for (const auto& [place, sentence] : sorted) {
    const auto whose = shared_.find(place);
    if (whose != shared_.end() && !told.emplace(place, without_index(sentence)).second) continue;
    if (!all.empty()) all += '\n';
    const std::string& file = place.in_base ? base_ : file_;
    all += place.line == 0 ? fmt::format("{}: {}", file, sentence)
                           : fmt::format("{}:{}:{}: {}", file, place.line, place.column, sentence);
    if (whose != shared_.end()) all += fmt::format(" ({})", whose->second);
  }
  return printable(all);
}

const Node* Node::find(std::string_view key) const {
  const auto entry = std::ranges::find_if(entries, [&](const auto& e) { return e.key.text == key; });
  return entry == entries.end() ? nullptr : &entry->value;
}

Entry* Node::entry_of(std::string_view key) {
  const auto entry = std::ranges::find_if(entries, [key](const Entry& one) { return one.key.text == key; });
  return entry == entries.end() ? nullptr : &*entry;
}

void Node::add_missing(const Node& other) {
  for (const Entry& given : other.entries) {
    Entry* const own = entry_of(given.key.text);
    if (own == nullptr)
      entries.push_back(given);
    else if (own->value.kind == Kind::map && given.value.kind == Kind::map)
      own->value.add_missing(given.value);
  }
}

Node read_document(std::string_view text, Tags tags, Problems& problems) {
  if (text.size() > kMaxBytes) {
    problems.add({}, fmt::format("holds {} bytes; a robot file has at most {}", text.size(), kMaxBytes));
    return {};
  }
  if (!refuse_characters(text, problems)) return {};
  std::istringstream stream{std::string(text)};
  TreeBuilder builder(tags, problems);
  try {
    YAML::Parser parser(stream);
    if (!parser.HandleNextDocument(builder)) return {};
    Node root = builder.take_root();
    TreeBuilder second(tags, problems);
    if (parser.HandleNextDocument(second))
      problems.add(second.take_root().place, "a second document begins (---); keep one per file");
    return root;
  } catch (const YAML::Exception& error) {
    problems.add(place_of(error.mark), fmt::format("YAML cannot be read: {}; {}", error.msg, cure_of(error.msg)));
    return {};
  }
}

std::expected<std::string, std::string> read_file(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0)
    return std::unexpected(fmt::format("{}: cannot be read: {}; check the path", path, std::strerror(errno)));
  if (!S_ISREG(status.st_mode)) return std::unexpected(fmt::format("{}: is not a regular file; name a file", path));
  if (status.st_size > static_cast<off_t>(kMaxBytes))
    return std::unexpected(fmt::format("{}: holds {} bytes; at most {} are read: is this the right file?", path,
                                       status.st_size, kMaxBytes));
  std::ifstream stream(path, std::ios::binary);
  if (!stream)
    return std::unexpected(fmt::format("{}: cannot be read: {}; check its permissions", path, std::strerror(errno)));
  auto text = read_all(stream);
  if (!text)
    return std::unexpected(fmt::format("{}: reading it failed: {}; check the medium", path, std::strerror(errno)));
  return *std::move(text);
}

std::string_view kind_name(Node::Kind kind) {
  switch (kind) {
    case Node::Kind::null:
      return "nothing";
    case Node::Kind::scalar:
      return "a single value";
    case Node::Kind::sequence:
      return "a list";
    case Node::Kind::map:
      return "a section";
  }
  return "nothing";
}

}  // namespace takt::config
