// SPDX-License-Identifier: Apache-2.0
// The tags of an XML text in the order in which they stand, for those who change a text where it stands and must keep
// its lines. Not a parser: whether the text is well-formed is the reader's business that is given it afterwards.
// One pass: the time grows with the text's length, whatever stands in it. Pure.
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

namespace takt::config {

struct XmlAttribute {
  std::string_view name, value;    // value: between the quotes, entities as they stand
  std::size_t begin = 0, end = 0;  // of both, in the text: from the name to behind the closing quote
};

struct XmlTag {
  std::string_view name;
  std::vector<XmlAttribute> attributes;
  std::size_t begin = 0, end = 0;  // from "<" to behind ">"
  bool closes = false;             // </name>
  bool is_empty = false;           // <name/>
  [[nodiscard]] const XmlAttribute* find(std::string_view attribute) const;
};

// The first whole tag that begins at `from` or later; nothing: there is none. The views point into the text. What
// begins like a tag and is none (no ">" before the next "<", a quote that does not close) is passed over, as are
// <!...> and <?...>. Comments count as text: blank them first.
std::optional<XmlTag> next_tag(std::string_view text, std::size_t from);

}  // namespace takt::config
