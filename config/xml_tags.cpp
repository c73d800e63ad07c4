// SPDX-License-Identifier: Apache-2.0
#include "config/xml_tags.hpp"

#include <algorithm>

namespace takt::config {
namespace {

bool is_space(char letter) {
  return letter == ' ' || letter == '\t' || letter == '\n' || letter == '\r' || letter == '\v' || letter == '\f';
}

bool ends_name(char letter) {
  return is_space(letter) || letter == '=' || letter == '/' || letter == '>' || letter == '<';
}

class TagScan {
 public:
  TagScan(std::string_view text, std::size_t at) : text_(text), begin_(at), at_(at + 1) {}

  std::optional<XmlTag> read() {
    XmlTag tag;
    tag.begin = begin_;
    tag.closes = skip('/');
    tag.name = name();
    if (tag.name.empty()) return std::nullopt;
    while (true) {
      skip_spaces();
      if (skip('>')) break;
      if (skip('/')) {
        tag.is_empty = true;
        continue;
      }
      auto attribute = read_attribute();
      if (!attribute) return std::nullopt;
      tag.attributes.push_back(*attribute);
    }
    tag.end = at_;
    return tag;
  }

 private:
  std::optional<XmlAttribute> read_attribute() {
    XmlAttribute attribute;
    attribute.begin = at_;
    attribute.name = name();
    skip_spaces();
    if (attribute.name.empty() || !skip('=')) return std::nullopt;
    skip_spaces();
    if (at_ >= text_.size() || (text_[at_] != '"' && text_[at_] != '\'')) return std::nullopt;
    const std::size_t closes = text_.find(text_[at_], at_ + 1);
    if (closes == std::string_view::npos) return std::nullopt;
    attribute.value = text_.substr(at_ + 1, closes - at_ - 1);
    attribute.end = at_ = closes + 1;
    return attribute;
  }
  std::string_view name() {
    const std::size_t from = at_;
    while (at_ < text_.size() && !ends_name(text_[at_])) ++at_;
    return text_.substr(from, at_ - from);
  }
  bool skip(char letter) {
    if (at_ >= text_.size() || text_[at_] != letter) return false;
    ++at_;
    return true;
  }
  void skip_spaces() {
    while (at_ < text_.size() && is_space(text_[at_])) ++at_;
  }

  std::string_view text_;
  std::size_t begin_, at_;
};

}  // namespace

const XmlAttribute* XmlTag::find(std::string_view attribute) const {
  const auto found = std::ranges::find(attributes, attribute, &XmlAttribute::name);
  return found == attributes.end() ? nullptr : &*found;
}

std::optional<XmlTag> next_tag(std::string_view text, std::size_t from) {
  for (std::size_t at = text.find('<', from); at != std::string_view::npos; at = text.find('<', at + 1))
    if (auto tag = TagScan(text, at).read()) return tag;
  return std::nullopt;
}

}  // namespace takt::config
