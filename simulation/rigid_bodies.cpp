// SPDX-License-Identifier: Apache-2.0
#include "simulation/rigid_bodies.hpp"

#ifndef TAKT_HAS_MUJOCO

namespace takt::simulation {

std::expected<std::optional<config::Model>, std::string> rigid_bodies(const std::string&, const std::string&,
                                                                      const std::vector<std::string>&) {
  return std::nullopt;
}

}  // namespace takt::simulation

#else

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>

#include "config/units.hpp"
#include "simulation/mujoco_model.hpp"

namespace takt::simulation {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Vector3d vector_at(const mjtNum* all, int index) {
  return Eigen::Map<const Vector3d>(all + std::ptrdiff_t{3} * index);
}

Matrix3d matrix_at(const mjtNum* all, int index) {
  return Eigen::Map<const RowMajor>(all + std::ptrdiff_t{9} * index);
}

// As a person would write it.
double rounded(double value) {
  return std::abs(value) < 1e-9 ? 0 : config::parse_number(fmt::format("{:.6g}", value)).value_or(value);
}

config::Vector3 written(const Vector3d& value) {
  return {rounded(value.x()), rounded(value.y()), rounded(value.z())};
}

// Fixed-axis roll, pitch and yaw.
Vector3d rpy_of(const Matrix3d& turn) {
  const double pitch = std::asin(std::clamp(-turn(2, 0), -1.0, 1.0));
  if (std::hypot(turn(2, 1), turn(2, 2)) < 1e-9) return {0, pitch, std::atan2(-turn(0, 1), turn(1, 1))};
  return {std::atan2(turn(2, 1), turn(2, 2)), pitch, std::atan2(turn(1, 0), turn(0, 0))};
}

// World frame, every named joint at zero.
struct Carried {
  double mass = 0;
  Vector3d moment = Vector3d::Zero();        // mass times centre
  Matrix3d about_origin = Matrix3d::Zero();  // inertia about the world's origin
  Vector3d anchor = Vector3d::Zero(), axis = Vector3d::Zero();
  Matrix3d body = Matrix3d::Identity();  // the joint's body's axes
  int parent = -1;

  void add(double more, const Vector3d& at, const Matrix3d& inertia) {
    mass += more;
    moment += more * at;
    about_origin += inertia + more * (at.squaredNorm() * Matrix3d::Identity() - at * at.transpose());
  }
  [[nodiscard]] Vector3d centre() const { return mass > 0 ? Vector3d(moment / mass) : anchor; }
  [[nodiscard]] Matrix3d inertia() const {
    const Vector3d at = centre();
    return about_origin - mass * (at.squaredNorm() * Matrix3d::Identity() - at * at.transpose());
  }
};

// Principal axes in the frame of `inertia`, in the order nearest to that frame's own.
Matrix3d principal_axes(const Matrix3d& inertia) {
  const Matrix3d beside = inertia - Matrix3d(inertia.diagonal().asDiagonal());
  if (beside.cwiseAbs().maxCoeff() <= 1e-6 * inertia.trace()) return Matrix3d::Identity();
  const Matrix3d found = Eigen::SelfAdjointEigenSolver<Matrix3d>(inertia).eigenvectors();
  std::array<int, 3> order{0, 1, 2}, best = order;
  const auto nearness = [&](const std::array<int, 3>& by) {
    return std::abs(found(0, by[0])) + std::abs(found(1, by[1])) + std::abs(found(2, by[2]));
  };
  while (std::ranges::next_permutation(order).found)
    if (nearness(order) > nearness(best)) best = order;
  Matrix3d axes;
  for (int i = 0; i < 3; ++i) {
    const Vector3d axis = found.col(best[static_cast<std::size_t>(i)]);
    axes.col(i) = axis(i) < 0 ? Vector3d(-axis) : axis;
  }
  if (axes.determinant() < 0) axes.col(2) = -axes.col(2);
  return axes;
}

config::Vector3 moments_of(const Matrix3d& inertia) {
  config::Vector3 moments = written(inertia.diagonal().cwiseMax(0));
  for (std::size_t i = 0; i < 3; ++i)  // rounding makes no body that cannot be
    moments[i] = std::min(moments[i], moments[(i + 1) % 3] + moments[(i + 2) % 3]);
  return moments;
}

bool is_of_a_hinge_or_slide(const mjModel& model, int body) {
  const int first = model.body_jntadr[body];
  for (int id = first; id < first + model.body_jntnum[body]; ++id)
    if (model.jnt_type[id] != mjJNT_HINGE && model.jnt_type[id] != mjJNT_SLIDE) return false;
  return true;
}

// What each joint carries; empty: a robot file cannot say it.
std::vector<Carried> carried_by(const mjModel& model, const mjData& data, const std::vector<int>& joints) {
  std::vector<Carried> carried(joints.size());
  std::vector<int> carrier(static_cast<std::size_t>(model.nbody), -1);
  const int root = model.body_rootid[model.jnt_bodyid[joints.front()]];
  for (int body = 1; body < model.nbody; ++body) {  // parents first
    if (model.body_rootid[body] == root && !is_of_a_hinge_or_slide(model, body)) return {};
    int at = carrier[static_cast<std::size_t>(model.body_parentid[body])];
    const int first = model.body_jntadr[body];
    for (int id = first; id < first + model.body_jntnum[body]; ++id) {
      const auto known = std::ranges::find(joints, id);
      if (known == joints.end()) continue;
      const int link = static_cast<int>(known - joints.begin());
      if (at > link) return {};
      Carried& here = carried[static_cast<std::size_t>(link)];
      here.parent = at;
      here.anchor = vector_at(data.xanchor, id);
      here.axis = vector_at(data.xaxis, id);
      here.body = matrix_at(data.xmat, body);
      at = link;
    }
    carrier[static_cast<std::size_t>(body)] = at;
    if (at < 0) continue;
    const Matrix3d axes = matrix_at(data.ximat, body);
    carried[static_cast<std::size_t>(at)].add(
        model.body_mass[body], vector_at(data.xipos, body),
        axes * vector_at(model.body_inertia, body).asDiagonal() * axes.transpose());
  }
  return carried;
}

config::Link link_of(const std::string& joint, const Carried& carried, const Matrix3d& axes, const Vector3d& above,
                     const Matrix3d& axes_above) {
  config::Link link;
  link.joint = joint;
  link.parent = carried.parent;
  link.origin_xyz = written(axes_above.transpose() * (carried.anchor - above));
  link.origin_rpy = written(rpy_of(axes_above.transpose() * axes));
  link.axis = written(axes.transpose() * carried.axis);
  link.mass = rounded(carried.mass);
  link.com = written(axes.transpose() * (carried.centre() - carried.anchor));
  link.inertia = moments_of(axes.transpose() * carried.inertia() * axes);
  return link;
}

}  // namespace

std::expected<std::optional<config::Model>, std::string> rigid_bodies(const std::string& path,
                                                                      const std::string& mesh_path,
                                                                      const std::vector<std::string>& joints) {
  const auto text = config::read_model_text(path);
  if (!text) return std::unexpected(text.error());
  const auto loaded = load_model(*text, mesh_path);
  if (!loaded) return std::unexpected(loaded.error());
  const mjModel& model = *loaded->model;
  const std::unique_ptr<mjData, DeleteData> data(mj_makeData(&model));
  std::vector<int> ids;
  for (const std::string& joint : joints) {
    const int id = mj_name2id(&model, mjOBJ_JOINT, joint.c_str());
    if (id < 0) return std::nullopt;
    ids.push_back(id);
    data->qpos[model.jnt_qposadr[id]] = 0;
  }
  if (ids.empty()) return std::nullopt;
  mj_kinematics(&model, data.get());
  const std::vector<Carried> carried = carried_by(model, *data, ids);
  if (carried.empty()) return std::nullopt;
  config::Model bodies;
  bodies.gravity = written(Eigen::Map<const Vector3d>(model.opt.gravity));
  std::vector<Matrix3d> axes;
  for (std::size_t i = 0; i < carried.size(); ++i) {
    const Carried& here = carried[i];
    axes.push_back(here.body * principal_axes(here.body.transpose() * here.inertia() * here.body));
    const auto above = static_cast<std::size_t>(std::max(here.parent, 0));
    const bool on_base = here.parent < 0;
    bodies.links.push_back(link_of(joints[i], here, axes.back(), on_base ? Vector3d::Zero() : carried[above].anchor,
                                   on_base ? Matrix3d::Identity() : axes[above]));
  }
  bodies.tool_link = static_cast<int>(carried.size()) - 1;
  bodies.tool_xyz = bodies.links.back().com;
  return bodies;
}

}  // namespace takt::simulation

#endif
