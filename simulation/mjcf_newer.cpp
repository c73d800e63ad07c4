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

namespace takt::simulation {
namespace {

constexpr std::string_view kForces = "the drives' own torque limits hold";
constexpr std::string_view kActuators = "torque comes from the drives alone";
constexpr std::string_view kSolver = "MuJoCo 2.2.2 solves in its own way";
constexpr std::string_view kDrawing = "nothing is drawn";
constexpr std::string_view kFiles = "a file's name tells what it holds";
constexpr std::string_view kHulls = "a mesh collides as the hull of all its corners";
constexpr std::string_view kInertia = "a mesh weighs as a solid";
constexpr std::string_view kPullsInFull = "gravity pulls there in full";
constexpr std::string_view kSensors = "no sensor of the model is read";
constexpr std::string_view kMemory = "MuJoCo 2.2.2 chooses its memory itself";
constexpr std::string_view kBase = "a free base keeps its own axes";
constexpr std::string_view kNothing = "nothing depends on it";
constexpr std::string_view kSurfaces = "no surface moves or sticks by itself";
constexpr std::string_view kGround = "the ground there is flat";
constexpr std::string_view kPlugins = "no plugin is loaded";
constexpr std::string_view kSoft = "nothing is soft";

constexpr std::string_view kActuatorElements =
    " general motor position velocity intvelocity damper cylinder muscle adhesion ";
constexpr std::string_view kSensorElements =
    " touch accelerometer velocimeter gyro force torque magnetometer rangefinder jointpos jointvel tendonpos tendonvel "
    "actuatorpos actuatorvel actuatorfrc ballquat ballangvel jointlimitpos jointlimitvel jointlimitfrc tendonlimitpos "
    "tendonlimitvel tendonlimitfrc framepos framequat framexaxis frameyaxis framezaxis framelinvel frameangvel "
    "framelinacc frameangacc subtreecom subtreelinvel subtreeangmom clock ";
// Of the kinds that stand for an actuator that 2.2.2 does not know.
constexpr std::string_view kMotorAttributes =
    " name class group ctrllimited forcelimited ctrlrange forcerange lengthrange gear cranklength user joint "
    "jointinparent tendon slidersite cranksite site refsite ";

// Names of elements and attributes with a space on either side.
struct NewerRow {
  std::string_view elements, attributes, instead;
};

// From MuJoCo's own lists of changes, versions 2.3.0 to 3.3 (mujoco.readthedocs.io, "Changelog"), and its table of
// elements and attributes of 2026 (google-deepmind/mujoco, src/xml/generated/mjcf_table.inc).
constexpr auto kAttributes = std::to_array<NewerRow>({
    {" joint ", " actuatorfrcrange actuatorfrclimited ", kForces},
    {" joint ", " actuatorgravcomp ", kActuators},
    {" spatial fixed tendon ", " actuatorfrcrange actuatorfrclimited armature ", kForces},
    {kActuatorElements,
     " kv dampratio inheritrange timeconst actdim actearly actlimited actrange armature damping nsample interp delay "
     "input posrange velrange ffrange tausmooth ",
     kActuators},
    {" option ",
     " ls_iterations ls_tolerance sdf_iterations sdf_initpoints ccd_iterations ccd_tolerance o_friction "
     "actuatorgroupdisable sleep_tolerance ",
     kSolver},
    {" flag ", " eulerdamp autoreset island nativeccd invdiscrete midphase spring damper sleep diagexact ipc ",
     kSolver},
    {" pair ", " solreffriction ", kSolver},
    {" size ", " memory ", kMemory},
    {" compiler ", " alignfree saveinertial inertiashell conflict ", kNothing},
    {" freejoint ", " align ", kBase},
    {" body ", " gravcomp ", kPullsInFull},
    {" body ", " sleep simple fuse ", kNothing},
    {" geom pair ", " surfacevel adhesion ", kSurfaces},
    {" site ", " mesh ", kDrawing},
    {" hfield ", " elevation ", kGround},
    {kSensorElements, " nsample interp delay interval ", kSensors},
    {" mesh ", " maxhullvert octree_maxdepth needsdf ", kHulls},
    {" mesh ", " inertia ", kInertia},
    {" mesh ", " material ", kDrawing},
    {" mesh texture hfield skin ", " content_type ", kFiles},
    {" texture ", " colorspace nchannel ", kDrawing},
    {" material ", " roughness metallic ", kDrawing},
    {" camera ", " focal focalpixel principal principalpixel sensorsize resolution orthographic projection output ",
     kDrawing},
    {" light ", " bulbradius intensity range type texture softness ", kDrawing},
    {" global ", " cameraid orthographic ellipsoidinertia bvactive realtime treedepth ", kDrawing},
    {" headlight map quality scale rgba ", " frustum bv bvactive ", kDrawing},
});

constexpr auto kElements = std::to_array<NewerRow>({
    {" jointactuatorfrc tendonactuatorfrc ", "", kForces},
    {" contact distance normal fromto camprojection e_potential e_kinetic insidesite tactile geomdist geomnormal "
     "geomfromto ",
     "sensor", kSensors},
    {" layer ", "material", kDrawing},
    {" dcmotor pid orientation ", "default", kActuators},
    {" orientation ", "actuator", kActuators},
    {" flex flexvert flexstrain ", "equality", kSoft},
    {" flexcomp deformable ", "", kSoft},
    {" extension plugin ", "", kPlugins},
});
// In the section of actuators these are taken as motors: their order is that of the robot's motors.
constexpr std::string_view kAsMotors = " dcmotor pid plugin ";

// A word for a newer one that means the same to 2.2.2.
struct Word {
  std::string_view element, attribute, newer, older;
};
constexpr auto kWords =
    std::to_array<Word>({{"option", "integrator", "implicitfast", "implicit"}, {"site", "type", "mesh", "sphere"}});

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
    std::size_t at = 0;
    while (const auto tag = config::next_tag(text_, at)) {
      at = tag->end;
      if (tag->closes) {
        if (!open_.empty()) open_.pop_back();
        continue;
      }
      const std::size_t end = end_of(*tag);
      if (take_as_motor(*tag, end) || leave_out(*tag, end)) {
        at = end;
        continue;
      }
      look_at_attributes(*tag);
      if (!tag->is_empty) open_.push_back(tag->name);
    }
    return std::move(changes_);
  }

 private:
  [[nodiscard]] bool is_in(std::string_view element) const { return !open_.empty() && open_.back() == element; }

  [[nodiscard]] const NewerRow* row_of(const config::XmlTag& tag) const {
    const auto row = std::ranges::find_if(kElements, [&](const NewerRow& one) {
      return holds(one.elements, tag.name) && (one.attributes.empty() || is_in(one.attributes));
    });
    return row == kElements.end() ? nullptr : &*row;
  }

  // Behind what closes it, of those that may be left out whole; 0: nothing closes it.
  std::size_t end_of(const config::XmlTag& tag) {
    if (tag.is_empty) return tag.end;
    if ((row_of(tag) == nullptr && !holds(kAsMotors, tag.name)) || !all_close_) return 0;
    std::size_t depth = 1;
    for (auto inner = config::next_tag(text_, tag.end); inner; inner = config::next_tag(text_, inner->end)) {
      if (inner->is_empty) continue;
      depth += inner->closes ? std::size_t(-1) : std::size_t{1};
      if (depth == 0) return inner->end;
    }
    all_close_ = false;  // looked for to the end once, not again for each
    return 0;
  }

  bool leave_out(const config::XmlTag& tag, std::size_t end) {
    const NewerRow* const row = row_of(tag);
    if (row == nullptr || end == 0) return false;
    changes_.push_back({tag.begin, end, tag.name, "", "", row->instead});
    return true;
  }

  bool take_as_motor(const config::XmlTag& tag, std::size_t end) {
    if (!is_in("actuator") || !holds(kAsMotors, tag.name) || end == 0) return false;
    changes_.push_back({tag.begin + 1, tag.begin + 1 + tag.name.size(), tag.name, "actuator", "motor", kActuators});
    for (const config::XmlAttribute& attribute : tag.attributes)
      if (!holds(kMotorAttributes, attribute.name))
        changes_.push_back({attribute.begin, attribute.end, attribute.name, tag.name, "", kActuators});
    if (!tag.is_empty) changes_.push_back({tag.end - 1, end, "", "", "/>", kActuators});
    return true;
  }

  void look_at_attributes(const config::XmlTag& tag) {
    for (const config::XmlAttribute& attribute : tag.attributes) {
      const auto row = std::ranges::find_if(kAttributes, [&](const NewerRow& one) {
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
  bool all_close_ = true;
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
    if (change.what.empty()) continue;  // of the one before
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

}  // namespace takt::simulation
