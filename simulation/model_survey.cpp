// SPDX-License-Identifier: Apache-2.0
#include "simulation/model_survey.hpp"

#ifndef TAKT_HAS_MUJOCO

namespace takt::simulation {

std::expected<config::ModelFacts, std::string> survey_model(const std::string& path, const std::string&) {
  return std::unexpected(path + ": this build has no MuJoCo to read it; install libmujoco-dev and build again");
}

std::expected<std::string, std::string> model_with_whole_paths(const std::string& path, const std::string&) {
  return std::unexpected(path + ": this build has no MuJoCo to read it; install libmujoco-dev and build again");
}

}  // namespace takt::simulation

#else

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "config/robot_text.hpp"
#include "config/units.hpp"
#include "config/xml_tags.hpp"
#include "simulation/mjcf_file.hpp"
#include "simulation/mujoco_model.hpp"

namespace takt::simulation {
namespace {

using config::ModelJoint;

std::string name_of(const mjModel& model, int type, int id) {
  const char* const name = mj_id2name(&model, type, id);
  return name == nullptr ? "" : name;
}

// What MuJoCo 2.2.2 does not know of a joint it keeps as the joint's user data, defaults of classes and all.
std::string with_forces_as_user_data(const std::string& text) {
  std::string renamed;
  std::size_t from = 0;
  for (auto tag = config::next_tag(text, 0); tag; tag = config::next_tag(text, tag->end))
    for (const config::XmlAttribute& attribute : tag->attributes) {
      if (attribute.name != "actuatorfrcrange") continue;
      renamed += text.substr(from, attribute.begin - from) + "user";
      from = attribute.begin + attribute.name.size();
    }
  return renamed + text.substr(from);
}

std::optional<double> smaller_end(const mjtNum* range) {
  const double least = std::min(std::abs(range[0]), std::abs(range[1]));
  return least > 0 ? std::optional(least) : std::nullopt;
}

std::optional<double> actuator_torque(const mjModel& model, int joint) {
  for (int i = 0; i < model.nu; ++i) {
    if (model.actuator_trntype[i] != mjTRN_JOINT || model.actuator_trnid[std::ptrdiff_t{2} * i] != joint) continue;
    const double gear = std::abs(model.actuator_gear[std::ptrdiff_t{6} * i]);
    const bool is_motor = model.actuator_biastype[i] == mjBIAS_NONE;
    const auto force =
        model.actuator_forcelimited[i] != 0 ? smaller_end(model.actuator_forcerange + std::ptrdiff_t{2} * i)
        : is_motor && model.actuator_ctrllimited[i] != 0 ? smaller_end(model.actuator_ctrlrange + std::ptrdiff_t{2} * i)
                                                         : std::nullopt;
    if (force) return *force * gear;
  }
  return std::nullopt;
}

bool is_moved(const mjModel& model, int joint) {
  return model.jnt_type[joint] == mjJNT_HINGE || model.jnt_type[joint] == mjJNT_SLIDE;
}

std::vector<std::string> motors_of(const mjModel& model, int root) {
  std::vector<std::string> motors;
  for (int i = 0; i < model.nu; ++i) {
    const int joint = model.actuator_trnid[std::ptrdiff_t{2} * i];
    const int kind = model.actuator_trntype[i];
    if ((kind != mjTRN_JOINT && kind != mjTRN_JOINTINPARENT) || !is_moved(model, joint)) continue;
    if (model.body_rootid[model.jnt_bodyid[joint]] != root || is_led(model, joint)) continue;
    const std::string name = name_of(model, mjOBJ_JOINT, joint);
    if (std::ranges::find(motors, name) == motors.end()) motors.push_back(name);
  }
  return motors;
}

double effective_inertia(const mjModel& model, mjData& data, int joint) {
  std::vector<mjtNum> torque(static_cast<std::size_t>(model.nv), 0.0), answer(static_cast<std::size_t>(model.nv));
  const int dof = model.jnt_dofadr[joint];
  torque[static_cast<std::size_t>(dof)] = 1;
  mj_solveM(&model, &data, answer.data(), torque.data(), 1);
  return 1 / answer[static_cast<std::size_t>(dof)];
}

std::optional<double> number_of(const config::XmlTag& tag, std::string_view attribute) {
  const config::XmlAttribute* const written = tag.find(attribute);
  if (written == nullptr) return std::nullopt;
  const auto number = config::parse_number(written->value);
  return number ? std::optional(*number) : std::nullopt;
}

std::optional<double> positive(const config::XmlTag& tag, std::string_view attribute) {
  const auto number = number_of(tag, attribute);
  return number && *number > 0 ? number : std::nullopt;
}

// URDF's <limit effort velocity>, which MuJoCo 2.2.2 passes over. An empty <joint name="..."/> is a transmission's.
// Error: one sentence on a range that is none.
std::expected<void, std::string> read_urdf_limits(const std::string& text, std::vector<ModelJoint>& joints) {
  auto joint = joints.end();
  for (auto tag = config::next_tag(text, 0); tag; tag = config::next_tag(text, tag->end)) {
    if (tag->name == "joint") {
      const config::XmlAttribute* const name = tag->closes || tag->is_empty ? nullptr : tag->find("name");
      joint = name == nullptr ? joints.end() : std::ranges::find(joints, name->value, &ModelJoint::name);
    } else if (tag->name == "limit" && joint != joints.end()) {
      joint->torque = positive(*tag, "effort");
      joint->velocity = positive(*tag, "velocity");
      const auto lower = number_of(*tag, "lower"), upper = number_of(*tag, "upper");
      if (lower && upper && *lower > *upper)
        return std::unexpected(fmt::format("joint {} has its lower limit {} above its upper one {}; exchange them",
                                           joint->name, *lower, *upper));
    }
  }
  return {};
}

std::string imu_site_of(const mjModel& model) {
  for (int i = 0; i < model.nsensor; ++i)
    if (model.sensor_type[i] == mjSENS_GYRO) return name_of(model, mjOBJ_SITE, model.sensor_objid[i]);
  for (int i = 0; i < model.nsite; ++i)
    if (const std::string name = name_of(model, mjOBJ_SITE, i); name.find("imu") != std::string::npos) return name;
  return {};
}

int keyframe_of(const mjModel& model) {
  for (const char* name : {"home", "stand"})
    if (const int id = mj_name2id(&model, mjOBJ_KEY, name); id >= 0) return id;
  return model.nkey > 0 && !name_of(model, mjOBJ_KEY, 0).empty() ? 0 : -1;
}

ModelJoint joint_of(const mjModel& model, mjData& data, int id) {
  ModelJoint joint;
  joint.name = name_of(model, mjOBJ_JOINT, id);
  if (model.jnt_type[id] == mjJNT_SLIDE) joint.kind = config::JointKind::slide;
  joint.inertia = effective_inertia(model, data, id);
  const mjtNum* const range = model.jnt_range + std::ptrdiff_t{2} * id;
  if (model.jnt_limited[id] != 0) joint.position = {range[0], range[1]};
  joint.home = data.qpos[model.jnt_qposadr[id]];
  if (joint.position) joint.home = std::clamp(joint.home, range[0], std::max(range[0], range[1]));
  if (model.nuser_jnt >= 2) joint.torque = smaller_end(model.jnt_user + std::ptrdiff_t{model.nuser_jnt} * id);
  if (!joint.torque) joint.torque = actuator_torque(model, id);
  return joint;
}

int root_of(const mjModel& model, int joint) {
  return model.body_rootid[model.jnt_bodyid[joint]];
}

// The tree of bodies with the most joints that a drive could move; -1: none.
int root_of_robot(const mjModel& model) {
  std::vector<int> joints(static_cast<std::size_t>(model.nbody), 0);
  for (int id = 0; id < model.njnt; ++id)
    if (is_moved(model, id)) ++joints[static_cast<std::size_t>(root_of(model, id))];
  const auto most = std::ranges::max_element(joints);
  return most == joints.end() || *most == 0 ? -1 : static_cast<int>(most - joints.begin());
}

void sort_joints(const mjModel& model, mjData& data, int root, config::ModelFacts& facts) {
  std::vector<std::string> others, led;
  for (int id = 0; id < model.njnt; ++id) {
    if (!is_moved(model, id)) continue;
    const std::string name = name_of(model, mjOBJ_JOINT, id);
    if (root_of(model, id) != root)
      others.push_back(name);
    else if (is_led(model, id))
      led.push_back(name);
    else
      facts.joints.push_back(joint_of(model, data, id));
  }
  if (!others.empty())
    facts.remarks.push_back(
        fmt::format("joints of other objects than the robot are not the robot's: {}", fmt::join(others, ", ")));
  if (!led.empty())
    facts.remarks.push_back(
        fmt::format("joints that follow another one have no drive of their own: {}", fmt::join(led, ", ")));
  if (falls_for_ever(model, root))
    facts.remarks.emplace_back("the base is free and nothing of the world collides: in simulation the robot falls");
}

std::vector<std::string> remarks_on_weight(const mjModel& model) {
  std::vector<std::string> remarks;
  for (int body = 1; body < model.nbody; ++body)
    if (model.body_mass[body] < kLeastLinkMass * 100 && model.body_jntnum[body] > 0)
      remarks.push_back(fmt::format("link {} has no mass: taken as {:g} kg; write its inertial",
                                    name_of(model, mjOBJ_BODY, body), kLeastLinkMass));
  return remarks;
}

std::expected<config::ModelFacts, std::string> survey(const std::string& path, const std::string& mesh_path) {
  auto model_text = config::read_model_text(path);
  if (!model_text) return std::unexpected(model_text.error());
  const std::string text = model_text->text;
  model_text->text = with_forces_as_user_data(text);
  const auto loaded = load_model(*model_text, mesh_path);
  if (!loaded) return std::unexpected(loaded.error());
  const mjModel& model = *loaded->model;
  const std::unique_ptr<mjData, DeleteData> data(mj_makeData(&model));
  const int keyframe = keyframe_of(model), root = root_of_robot(model);
  if (keyframe >= 0) mj_resetDataKeyframe(&model, data.get(), keyframe);
  mj_forward(&model, data.get());
  config::ModelFacts facts;
  if (root >= 0) sort_joints(model, *data, root, facts);
  for (std::string& remark : remarks_on_weight(model)) facts.remarks.push_back(std::move(remark));
  facts.motors = motors_of(model, root);
  if (facts.joints.empty()) return std::unexpected(path + ": has no hinge or slide that a drive could move");
  if (text.find("<robot") != std::string::npos)
    if (const auto read = read_urdf_limits(text, facts.joints); !read)
      return std::unexpected(fmt::format("{}: {}", path, read.error()));
  if (keyframe >= 0) facts.keyframe = name_of(model, mjOBJ_KEY, keyframe);
  facts.imu_site = imu_site_of(model);
  return facts;
}

}  // namespace

std::expected<config::ModelFacts, std::string> survey_model(const std::string& path, const std::string& mesh_path) {
  auto facts = survey(path, mesh_path);
  if (!facts) return std::unexpected(config::on_one_line(facts.error()));
  for (std::string& remark : facts->remarks) remark = config::on_one_line(remark);
  return facts;
}

std::expected<std::string, std::string> model_with_whole_paths(const std::string& path, const std::string& mesh_path) {
  const auto text = config::read_model_text(path);
  if (!text) return std::unexpected(text.error());
  return with_whole_paths(*text, mesh_path);
}

}  // namespace takt::simulation

#endif
