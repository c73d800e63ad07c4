// SPDX-License-Identifier: Apache-2.0
#include "simulation/mjcf_frames.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>
#include <vector>

#include "config/units.hpp"
#include "config/xml_tags.hpp"

namespace takt::simulation {
namespace {

using config::XmlAttribute;
using config::XmlTag;
using Eigen::Isometry3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr std::size_t kDeepest = 64;
constexpr std::array<std::string_view, 5> kOrientations{"quat", "euler", "axisangle", "xyaxes", "zaxis"};

bool is_one_of(std::string_view word, std::initializer_list<std::string_view> words) {
  return std::ranges::find(words, word) != words.end();
}

// Numbers with spaces between them; nothing: there are others than `count`.
std::optional<std::vector<double>> numbers_of(std::string_view text, std::size_t count) {
  std::vector<double> numbers;
  constexpr std::string_view kSpaces = " \t\r\n";
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(kSpaces), text.size()));
    if (text.empty()) break;
    const std::size_t end = std::min(text.find_first_of(kSpaces), text.size());
    const auto number = config::parse_number(text.substr(0, end));
    if (!number || numbers.size() == count) return std::nullopt;
    numbers.push_back(*number);
    text.remove_prefix(end);
  }
  if (numbers.size() != count) return std::nullopt;
  return numbers;
}

std::optional<Vector3d> vector_of(const XmlTag& tag, std::string_view attribute, const Vector3d& otherwise) {
  const XmlAttribute* const written = tag.find(attribute);
  if (written == nullptr) return otherwise;
  const auto three = numbers_of(written->value, 3);
  if (!three) return std::nullopt;
  return Vector3d((*three)[0], (*three)[1], (*three)[2]);
}

// How the file writes angles.
struct Angles {
  double unit = M_PI / 180;
  std::string sequence = "xyz";
};

Angles angles_of(const std::string& text) {
  Angles angles;
  for (auto tag = config::next_tag(text, 0); tag; tag = config::next_tag(text, tag->end)) {
    if (tag->name != "compiler") continue;
    if (const XmlAttribute* const angle = tag->find("angle")) angles.unit = angle->value == "radian" ? 1 : M_PI / 180;
    if (const XmlAttribute* const order = tag->find("eulerseq")) angles.sequence = order->value;
  }
  return angles;
}

// Of a letter in lower case about the axis as it has been turned, in upper case about the fixed one.
std::optional<Quaterniond> from_euler(const std::vector<double>& euler, const Angles& angles) {
  if (angles.sequence.size() != 3) return std::nullopt;
  Quaterniond turned = Quaterniond::Identity();
  for (std::size_t i = 0; i < 3; ++i) {
    const char letter = angles.sequence[i];
    const bool is_fixed = letter >= 'X' && letter <= 'Z';
    const int axis = letter - (is_fixed ? 'X' : 'x');
    if (axis < 0 || axis > 2) return std::nullopt;
    const Quaterniond turn(Eigen::AngleAxisd(euler[i] * angles.unit, Vector3d::Unit(axis)));
    turned = is_fixed ? turn * turned : turned * turn;
  }
  return turned;
}

std::optional<Quaterniond> orientation_of(const XmlTag& tag, const Angles& angles) {
  for (const std::string_view kind : kOrientations) {
    const XmlAttribute* const written = tag.find(kind);
    if (written == nullptr) continue;
    const std::size_t count = kind == "quat" || kind == "axisangle" ? 4 : kind == "xyaxes" ? 6 : 3;
    const auto numbers = numbers_of(written->value, count);
    if (!numbers) return std::nullopt;
    const std::vector<double>& n = *numbers;
    if (kind == "quat") return Quaterniond(n[0], n[1], n[2], n[3]).normalized();
    if (kind == "euler") return from_euler(n, angles);
    if (kind == "axisangle")
      return Quaterniond(Eigen::AngleAxisd(n[3] * angles.unit, Vector3d(n[0], n[1], n[2]).normalized()));
    if (kind == "zaxis") return Quaterniond::FromTwoVectors(Vector3d::UnitZ(), Vector3d(n[0], n[1], n[2]));
    Eigen::Matrix3d axes;
    axes.col(0) = Vector3d(n[0], n[1], n[2]).normalized();
    const Vector3d y(n[3], n[4], n[5]);
    axes.col(1) = (y - axes.col(0).dot(y) * axes.col(0)).normalized();
    axes.col(2) = axes.col(0).cross(axes.col(1));
    return Quaterniond(axes);
  }
  return Quaterniond::Identity();
}

std::optional<Isometry3d> pose_of(const XmlTag& tag, const Angles& angles) {
  const auto at = vector_of(tag, "pos", Vector3d::Zero());
  const auto turned = orientation_of(tag, angles);
  if (!at || !turned || !turned->coeffs().allFinite()) return std::nullopt;
  Isometry3d pose = Isometry3d::Identity();
  pose.linear() = turned->toRotationMatrix();
  pose.translation() = *at;
  return pose;
}

std::string text_of(const Vector3d& v) {
  return fmt::format("{:.17g} {:.17g} {:.17g}", v.x(), v.y(), v.z());
}

// A tag's text with some of its attributes out and others in.
class TagEdit {
 public:
  TagEdit(const std::string& text, const XmlTag& tag) : text_(text), tag_(tag) {}
  void set(std::string_view attribute, const std::string& value) {
    drop(attribute);
    added_ += fmt::format(" {}=\"{}\"", attribute, value);
  }
  void drop(std::string_view attribute) { dropped_.push_back(attribute); }
  [[nodiscard]] std::string result() const {
    std::string made = text_.substr(tag_.begin, tag_.name.size() + 1) + added_;
    std::size_t from = tag_.begin + tag_.name.size() + 1;
    for (const XmlAttribute& attribute : tag_.attributes) {
      if (std::ranges::find(dropped_, attribute.name) == dropped_.end()) continue;
      made += text_.substr(from, attribute.begin - from);
      from = attribute.end;
    }
    return made + text_.substr(from, tag_.end - from);
  }

 private:
  const std::string& text_;
  const XmlTag& tag_;
  std::string added_;
  std::vector<std::string_view> dropped_;
};

struct Frame {
  Isometry3d pose = Isometry3d::Identity();  // in the body, outer frames included
  bool moves = false;
  std::string childclass;
};

void add_class(TagEdit& edit, const XmlTag& tag, const std::string& childclass) {
  if (childclass.empty() || tag.name == "inertial" || tag.name == "freejoint") return;
  const char* const attribute = tag.name == "body" ? "childclass" : "class";
  if (tag.find(attribute) == nullptr) edit.set(attribute, childclass);
}

// False: it has no place that could be moved, or none that can be read.
bool move(TagEdit& edit, const XmlTag& tag, const Frame& frame, const Angles& angles) {
  if (!frame.moves) return true;
  if (const XmlAttribute* const ends = tag.find("fromto")) {
    const auto n = numbers_of(ends->value, 6);
    if (!n) return false;
    edit.set("fromto", text_of(frame.pose * Vector3d((*n)[0], (*n)[1], (*n)[2])) + " " +
                           text_of(frame.pose * Vector3d((*n)[3], (*n)[4], (*n)[5])));
    return true;
  }
  if (is_one_of(tag.name, {"joint", "light"})) {
    const char* const way = tag.name == "joint" ? "axis" : "dir";
    const auto at = vector_of(tag, "pos", Vector3d::Zero());
    const auto along = vector_of(tag, way, Vector3d(0, 0, tag.name == "joint" ? 1 : -1));
    if (!at || !along) return false;
    edit.set("pos", text_of(frame.pose * *at));
    edit.set(way, text_of(frame.pose.linear() * *along));
    return true;
  }
  if (!is_one_of(tag.name, {"body", "geom", "site", "camera", "inertial"})) return false;
  const auto own = pose_of(tag, angles);
  if (!own) return false;
  const Isometry3d pose = frame.pose * *own;
  const Quaterniond turned(pose.linear());
  for (const std::string_view kind : kOrientations) edit.drop(kind);
  edit.set("pos", text_of(pose.translation()));
  edit.set("quat", fmt::format("{:.17g} {:.17g} {:.17g} {:.17g}", turned.w(), turned.x(), turned.y(), turned.z()));
  return true;
}

// Classes' places and orientations are not looked up.
bool defaults_move(const std::string& text) {
  std::size_t depth = 0;
  for (auto tag = config::next_tag(text, 0); tag; tag = config::next_tag(text, tag->end)) {
    if (tag->name == "default" && !tag->is_empty) depth = tag->closes ? depth - (depth > 0 ? 1 : 0) : depth + 1;
    if (depth == 0 || tag->name == "default") continue;
    if (tag->find("pos") || std::ranges::any_of(kOrientations, [&](auto kind) { return tag->find(kind) != nullptr; }))
      return true;
  }
  return false;
}

// Reads the text once, and writes it without its frames.
class Unfolding {
 public:
  explicit Unfolding(const std::string& text) : text_(text), angles_(angles_of(text)) {}

  // False: a frame must stay.
  bool run() {
    for (auto tag = config::next_tag(text_, 0); tag; tag = config::next_tag(text_, tag->end))
      if (!(tag->name == "frame" ? take_out(*tag) : pass(*tag))) return false;
    made_ += text_.substr(copied_);
    return true;
  }
  [[nodiscard]] UnfoldedFrames result() && { return {std::move(made_), count_, first_line_}; }

 private:
  bool take_out(const XmlTag& tag) {
    replace(tag, std::string(
                     static_cast<std::size_t>(std::count(text_.begin() + static_cast<std::ptrdiff_t>(tag.begin),
                                                         text_.begin() + static_cast<std::ptrdiff_t>(tag.end), '\n')),
                     '\n'));
    if (tag.closes) {
      if (open_.empty() || !open_.back()) return false;
      open_.pop_back();
      return true;
    }
    if (count_++ == 0)
      first_line_ = 1 + static_cast<std::size_t>(
                            std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(tag.begin), '\n'));
    if (tag.is_empty) return true;
    const auto own = pose_of(tag, angles_);
    if (!own || open_.size() == kDeepest) return false;
    Frame frame;
    if (const Frame* const outer = innermost()) frame = *outer;
    frame.pose = frame.pose * *own;
    frame.moves = frame.moves || !own->isApprox(Isometry3d::Identity(), 0);
    if (const XmlAttribute* const given = tag.find("childclass")) frame.childclass = given->value;
    open_.emplace_back(std::move(frame));
    return true;
  }

  // Frames reach to the next element: what stands in that is placed in it.
  bool pass(const XmlTag& tag) {
    if (tag.closes) {
      if (!open_.empty() && !open_.back()) open_.pop_back();
      return true;
    }
    if (const Frame* const frame = innermost()) {
      TagEdit edit(text_, tag);
      add_class(edit, tag, frame->childclass);
      if (!move(edit, tag, *frame, angles_)) return false;
      replace(tag, edit.result());
    }
    if (!tag.is_empty && !open_.empty()) open_.emplace_back(std::nullopt);
    return true;
  }

  [[nodiscard]] const Frame* innermost() const { return open_.empty() || !open_.back() ? nullptr : &*open_.back(); }
  void replace(const XmlTag& tag, const std::string& by) {
    made_ += text_.substr(copied_, tag.begin - copied_) + by;
    copied_ = tag.end;
  }

  const std::string& text_;
  Angles angles_;
  std::vector<std::optional<Frame>> open_;  // from the outermost frame on: frames, and other elements in them
  std::string made_;
  std::size_t copied_ = 0, count_ = 0, first_line_ = 0;
};

}  // namespace

UnfoldedFrames unfold_frames(const std::string& text) {
  if (text.find("<frame") == std::string::npos || defaults_move(text)) return {text, 0, 0};
  Unfolding unfolding(text);
  if (!unfolding.run()) return {text, 0, 0};
  return std::move(unfolding).result();
}

}  // namespace takt::simulation
