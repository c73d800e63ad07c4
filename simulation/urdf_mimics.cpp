// SPDX-License-Identifier: Apache-2.0
#include "simulation/urdf_mimics.hpp"

#include <fmt/format.h>

#include <string_view>

#include "config/units.hpp"
#include "config/xml_tags.hpp"

namespace takt::simulation {
namespace {

double number_or(const config::XmlTag& tag, std::string_view attribute, double otherwise) {
  const config::XmlAttribute* const written = tag.find(attribute);
  return written == nullptr ? otherwise : config::parse_number(written->value).value_or(otherwise);
}

}  // namespace

std::vector<Mimic> mimics_of(const std::string& text) {
  std::vector<Mimic> mimics;
  if (text.find("<mimic") == std::string::npos) return mimics;
  std::string_view joint;
  for (auto tag = config::next_tag(text, 0); tag; tag = config::next_tag(text, tag->end)) {
    if (tag->name == "joint") {
      const config::XmlAttribute* const name = tag->closes || tag->is_empty ? nullptr : tag->find("name");
      joint = name == nullptr ? std::string_view() : name->value;
    } else if (tag->name == "mimic" && !joint.empty() && tag->find("joint")) {
      mimics.push_back({std::string(joint), std::string(tag->find("joint")->value), number_or(*tag, "multiplier", 1),
                        number_or(*tag, "offset", 0)});
    }
  }
  return mimics;
}

std::string mimics_as_equalities(const std::string& text) {
  std::string equalities;
  for (const Mimic& mimic : mimics_of(text))
    equalities += fmt::format(R"(<joint joint1="{}" joint2="{}" polycoef="{:.17g} {:.17g} 0 0 0"/>)", mimic.joint,
                              mimic.follows, mimic.offset, mimic.multiplier);
  return equalities.empty() ? equalities : "<equality>" + equalities + "</equality>";
}

}  // namespace takt::simulation
