// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/gravity_model.hpp"

#include <cmath>

#include "executive/pipeline/sin_cos.hpp"

namespace takt::pipeline {
namespace {

using Vec = std::array<float, 3>;
using Mat = std::array<float, 9>;

Mat product(const Mat& a, const Mat& b) {
  Mat out{};
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 3; ++column)
      for (std::size_t k = 0; k < 3; ++k) out[3 * row + column] += a[3 * row + k] * b[3 * k + column];
  return out;
}

Vec times(const Mat& m, const Vec& v) {
  return {m[0] * v[0] + m[1] * v[1] + m[2] * v[2], m[3] * v[0] + m[4] * v[1] + m[5] * v[2],
          m[6] * v[0] + m[7] * v[1] + m[8] * v[2]};
}

Vec transposed_times(const Mat& m, const Vec& v) {
  return {m[0] * v[0] + m[3] * v[1] + m[6] * v[2], m[1] * v[0] + m[4] * v[1] + m[7] * v[2],
          m[2] * v[0] + m[5] * v[1] + m[8] * v[2]};
}

// axis . (moment x gravity)
float triple(const Vec& axis, const Vec& moment, const Vec& gravity) {
  return axis[0] * (moment[1] * gravity[2] - moment[2] * gravity[1]) +
         axis[1] * (moment[2] * gravity[0] - moment[0] * gravity[2]) +
         axis[2] * (moment[0] * gravity[1] - moment[1] * gravity[0]);
}

float dot(const Vec& a, const Vec& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

float length(const Vec& v) {
  return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

// One link's share of the two passes, in its own frame about its own joint.
struct Node {
  Mat rotation;
  Vec gravity;
  Vec moment;  // first moment of the mass of the whole subtree
  float mass;
};

}  // namespace

GravityModel::GravityModel(const TickConfig& config) : gravity_(config.gravity), count_(config.joint_count) {
  for (std::size_t i = 0; i < count_; ++i) {
    const LinkModel& from = config.links[i];
    const auto& [x, y, z] = from.axis;
    const Mat along{x * x, x * y, x * z, y * x, y * y, y * z, z * x, z * y, z * z};
    const Mat around{0, -z, y, z, 0, -x, -y, x, 0};
    const Mat across{1 - along[0], -along[1], -along[2], -along[3],   1 - along[4],
                     -along[5],    -along[6], -along[7], 1 - along[8]};
    Link& link = links_[i];
    link.fixed = product(from.origin_rotation, along);
    link.even = product(from.origin_rotation, across);
    link.odd = product(from.origin_rotation, around);
    link.axis = from.axis;
    link.origin = from.origin_xyz;
    link.moment = {from.mass * from.com[0], from.mass * from.com[1], from.mass * from.com[2]};
    link.mass = from.mass;
    link.parent = from.parent;
    link.slides = from.slides;
    if (link.slides) {
      link.fixed = from.origin_rotation;
      link.even = link.odd = {};
      link.way = times(link.fixed, link.axis);
    }
    // However the joints between are turned, the link's centre of mass is no further from theirs than the way along the
    // links.
    float reach = length(from.com);
    for (auto at = static_cast<std::int32_t>(i); at >= 0; at = links_[static_cast<std::size_t>(at)].parent) {
      const Link& carrier = links_[static_cast<std::size_t>(at)];
      most_[static_cast<std::size_t>(at)] += length(gravity_) * from.mass * (carrier.slides ? 1.0F : reach);
      reach += length(carrier.origin) + (carrier.slides ? config.links[static_cast<std::size_t>(at)].farthest : 0.0F);
    }
  }
}

void GravityModel::swing(std::span<const float> moves, std::span<float> swing) const {
  for (std::size_t outer = 0; outer < count_; ++outer) {
    swing[outer] = most_[outer] * moves[outer];
    for (std::int32_t at = links_[outer].parent; at >= 0; at = links_[static_cast<std::size_t>(at)].parent) {
      const auto inner = static_cast<std::size_t>(at);
      swing[outer] += most_[outer] * moves[inner];
      swing[inner] += most_[outer] * moves[outer];
    }
  }
}

void GravityModel::torques(std::span<const float> q, std::span<float> torques) const {
  std::array<Node, kMaxJoints> nodes;  // uninitialised: only count_ entries are used
  for (std::size_t i = 0; i < count_; ++i) {
    const Link& link = links_[i];
    Node& node = nodes[i];
    const SinCos angle = sin_cos(q[i]);
    for (std::size_t k = 0; k < 9; ++k)
      node.rotation[k] = link.fixed[k] + (angle.cos * link.even[k] + angle.sin * link.odd[k]);
    node.moment = link.moment;
    node.mass = link.mass;
  }
  for (std::size_t i = 0; i < count_; ++i) {
    const std::int32_t parent = links_[i].parent;
    const Vec& above = parent < 0 ? gravity_ : nodes[static_cast<std::size_t>(parent)].gravity;
    nodes[i].gravity = transposed_times(nodes[i].rotation, above);
  }
  for (std::size_t i = count_; i-- > 0;) {
    const Link& link = links_[i];
    const Node& node = nodes[i];
    torques[i] =
        link.slides ? -node.mass * dot(link.axis, node.gravity) : -triple(link.axis, node.moment, node.gravity);
    if (link.parent < 0) continue;
    Node& parent = nodes[static_cast<std::size_t>(link.parent)];
    const Vec moment = times(node.rotation, node.moment);
    const float moved = link.slides ? q[i] : 0.0F;
    for (std::size_t k = 0; k < 3; ++k)
      parent.moment[k] += moment[k] + node.mass * (link.origin[k] + moved * link.way[k]);
    parent.mass += node.mass;
  }
}

}  // namespace takt::pipeline
