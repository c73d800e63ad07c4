// SPDX-License-Identifier: Apache-2.0
#include "simulation/mjcf_newer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <string_view>
#include <utility>

#include "config/xml_tags.hpp"

namespace takt::plant {
namespace {

constexpr std::string_view kForces = "the drives' own torque limits hold";
constexpr std::string_view kActuators = "torque comes from the drives alone";
constexpr std::string_view kSolver = "MuJoCo 2.2.2 solves in its own way";
constexpr std::string_view kDrawing = "nothing is drawn";
constexpr std::string_view kFiles = "a file's name tells what it holds";
constexpr std::string_view kHulls = "a mesh collides as the hull of all its corners";
constexpr std::string_view kInertia = "a mesh weighs as a solid";
constexpr std::string_view kGravity = "gravity pulls there in full";
constexpr std::string_view kSensors = "no sensor of the model is read";
constexpr std::string_view kMemory = "MuJoCo 2.2.2 chooses its memory itself";
constexpr std::string_view kBase = "a free base keeps its own axes";
constexpr std::string_view kNothing = "nothing depends on it";

constexpr std::string_view kActuatorElements =
    " general motor position velocity intvelocity damper cylinder muscle adhesion ";

// Names of elements and attributes with a space on either side.
struct Row {
  std::string_view elements, attributes, instead;
};

// From MuJoCo's own lists of changes, versions 2.3.0 to 3.3 (mujoco.readthedocs.io, "Changelog").
constexpr auto kAttributes = std::to_array<Row>({
    {" joint ", " actuatorfrcrange actuatorfrclimited ", kForces},
    {" joint ", " actuatorgravcomp ", kActuators},
    {" spatial fixed tendon ", " actuatorfrcrange actuatorfrclimited armature ", kForces},
    {kActuatorElements,
     " kv dampratio inheritrange timeconst actdim actearly actlimited actrange armature damping nsample interp delay ",
     kActuators},
    {" option ",
     " ls_iterations ls_tolerance sdf_iterations sdf_initpoints ccd_iterations ccd_tolerance o_friction "
     "actuatorgroupdisable sleep_tolerance ",
     kSolver},
    {" flag ", " eulerdamp autoreset island nativeccd invdiscrete midphase spring damper sleep diagexact ", kSolver},
    {" pair ", " solreffriction ", kSolver},
    {" size ", " memory ", kMemory},
    {" compiler ", " alignfree saveinertial inertiashell ", kNothing},
    {" freejoint ", " align ", kBase},
    {" body ", " gravcomp ", kGravity},
    {" body ", " sleep ", kNothing},
    {" mesh ", " maxhullvert octree_maxdepth needsdf ", kHulls},
    {" mesh ", " inertia ", kInertia},
    {" mesh ", " material ", kDrawing},
    {" mesh texture hfield skin ", " content_type ", kFiles},
    {" texture ", " colorspace nchannel ", kDrawing},
    {" material ", " roughness metallic ", kDrawing},
    {" camera ", " focal focalpixel principal principalpixel sensorsize resolution orthographic projection output ",
     kDrawing},
    {" light ", " bulbradius intensity range type texture ", kDrawing},
    {" global ", " cameraid orthographic ellipsoidinertia bvactive realtime treedepth ", kDrawing},
    {" headlight map quality scale rgba ", " frustum bv bvactive ", kDrawing},
});

constexpr auto kElements = std::to_array<Row>({
    {" jointactuatorfrc tendonactuatorfrc ", "", kForces},
    {" contact distance normal fromto camprojection e_potential e_kinetic insidesite tactile geomdist geomnormal "
     "geomfromto ",
     "sensor", kSensors},
    {" layer ", "material", kDrawing},
});

// A word for a newer one that means the same to 2.2.2.
struct Word {
  std::string_view element, attribute, newer, older;
};
constexpr auto kWords = std::to_array<Word>({{"option", "integrator", "implicitfast", "implicit"}});

bool holds(std::string_view words, std::string_view word) {
  for (std::size_t at = 0; (at = words.find(word, at)) != std::string_view::npos; ++at)
    if (at > 0 && words[at - 1] == ' ' && at + word.size() < words.size() && words[at + word.size()] == ' ')
      return true;
  return false;
}

struct Change {
  std::size_t begin = 0, end = 0;
  std::string_view what;  // one kind's name, a view of the text as it was
  std::string_view of;
  std::string_view by;
  std::string_view instead;
};

bool is_space(char letter) {
  return std::string_view(" \t\n\v\f\r").find(letter) != std::string_view::npos;
}

class NewerThings {
 public:
  explicit NewerThings(const std::string& text) : text_(text) {}

  std::vector<Change> find() {
    for (auto tag = config::next_tag(text_, 0); tag; tag = config::next_tag(text_, tag->end)) {
      if (tag->closes) {
        if (!open_.empty()) open_.pop_back();
        continue;
      }
      if (!leave_out(*tag)) look_at_attributes(*tag);
      if (!tag->is_empty) open_.push_back(tag->name);
    }
    return std::move(changes_);
  }

 private:
  bool leave_out(const config::XmlTag& tag) {
    const auto row = std::ranges::find_if(kElements, [&](const Row& one) {
      return holds(one.elements, tag.name) &&
             (one.attributes.empty() || (!open_.empty() && open_.back() == one.attributes));
    });
    if (row == kElements.end() || !tag.is_empty) return false;
    changes_.push_back({tag.begin, tag.end, tag.name, "", "", row->instead});
    return true;
  }

  void look_at_attributes(const config::XmlTag& tag) {
    for (const config::XmlAttribute& attribute : tag.attributes) {
      const auto row = std::ranges::find_if(kAttributes, [&](const Row& one) {
        return holds(one.elements, tag.name) && holds(one.attributes, attribute.name);
      });
      if (row != kAttributes.end() && !is_older(tag.name, attribute.name)) {
        Change change{attribute.begin, attribute.end, attribute.name, tag.name, "", row->instead};
        while (change.begin > tag.begin && is_space(text_[change.begin - 1])) --change.begin;
        changes_.push_back(change);
      }
      for (const Word& word : kWords)
        if (tag.name == word.element && attribute.name == word.attribute && attribute.value == word.newer) {
          const auto at = static_cast<std::size_t>(attribute.value.data() - text_.data());
          changes_.push_back({at, at + attribute.value.size(), word.newer, word.attribute, word.older, kSolver});
        }
    }
  }

  // Names that one of several elements had from the beginning.
  static bool is_older(std::string_view element, std::string_view attribute) {
    return (attribute == "kv" && (element == "velocity" || element == "damper")) ||
           (attribute == "timeconst" && (element == "cylinder" || element == "muscle")) ||
           ((attribute == "actlimited" || attribute == "actrange") && (element == "general")) ||
           (attribute == "actrange" && element == "intvelocity");
  }

  const std::string& text_;
  std::vector<std::string_view> open_;
  std::vector<Change> changes_;
};

std::string newlines_in(std::string_view text) {
  return std::string(static_cast<std::size_t>(std::ranges::count(text, '\n')), '\n');
}

std::string sentence_of(std::span<const Change> kind, std::size_t line) {
  const Change& first = kind.front();
  const std::string what =
      first.of.empty() ? fmt::format("element {}", first.what) : fmt::format("{} of {}", first.what, first.of);
  const std::string times = kind.size() == 1 ? "" : fmt::format("{} times, ", kind.size());
  if (!first.by.empty())
    return fmt::format("{} taken as {}, {}first in line {}: MuJoCo 2.2.2 does not know it", what, first.by, times,
                       line);
  return fmt::format("{} left out, {}first in line {}: MuJoCo 2.2.2 does not know it, and {}", what, times, line,
                     first.instead);
}

}  // namespace

std::vector<std::string> leave_out_newer(std::string& text) {
  const std::vector<Change> changes = NewerThings(text).find();
  std::vector<std::string> sentences;
  std::vector<std::pair<std::string, std::vector<Change>>> kinds;
  for (const Change& change : changes) {
    const std::string kind = fmt::format("{} {}", change.what, change.of);
    auto found = std::ranges::find(kinds, kind, &std::pair<std::string, std::vector<Change>>::first);
    if (found == kinds.end()) found = kinds.insert(kinds.end(), {kind, {}});
    found->second.push_back(change);
  }
  for (const auto& [kind, all] : kinds)
    sentences.push_back(
        sentence_of(all, 1 + static_cast<std::size_t>(std::count(
                                 text.begin(), text.begin() + static_cast<std::ptrdiff_t>(all.front().begin), '\n'))));
  std::string kept;
  std::size_t from = 0;
  for (const Change& change : changes) {
    kept += text.substr(from, change.begin - from) + std::string(change.by);
    if (change.by.empty()) kept += newlines_in(std::string_view(text).substr(change.begin, change.end - change.begin));
    from = change.end;
  }
  text = kept + text.substr(from);
  return sentences;
}

}  // namespace takt::plant
