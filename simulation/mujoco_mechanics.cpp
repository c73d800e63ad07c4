// SPDX-License-Identifier: Apache-2.0
#include "simulation/mujoco_mechanics.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "config/robot_text.hpp"
#include "simulation/mujoco_model.hpp"

namespace takt::simulation {
namespace {

constexpr mjtNum kHoist = 1e9;                        // kg, kg m2
constexpr int kFreeCoordinates = 7, kFreeSpeeds = 6;  // of a free joint: position and quaternion; velocity and rate

std::string name_of(const mjModel& model, int type, int id) {
  const char* const name = mj_id2name(&model, type, id);
  return name == nullptr ? fmt::format("number {}", id) : name;
}

int root_of(const mjModel& model, int joint) {
  return model.body_rootid[model.jnt_bodyid[joint]];
}

class Engine final : public MujocoMechanics {
 public:
  Engine(LoadedModel loaded, std::vector<int> joints, int keyframe, int imu_site, Duration step)
      : model_(std::move(loaded.model)),
        mended_(std::move(loaded.mended)),
        data_(mj_makeData(model_.get())),
        joints_(std::move(joints)),
        imu_site_(imu_site),
        sub_steps_(static_cast<int>(std::ceil(step.seconds() / model_->opt.timestep - 1e-9))) {
    model_->opt.timestep = step.seconds() / sub_steps_;
    model_->opt.disableflags |= mjDSBL_ACTUATION;  // torque comes from the drives alone; a servo's would pull to 0
    // What a held joint is held by acts implicitly, which of MuJoCo's integrators RK4 cannot.
    if (model_->opt.integrator == mjINT_RK4) {
      model_->opt.integrator = mjINT_EULER;
      mended_.emplace_back("integrator Euler instead of RK4, which has no implicit damping");
    }
    if (keyframe >= 0) mj_resetDataKeyframe(model_.get(), data_.get(), keyframe);
    const int root = root_of(*model_, joints_.front());
    root_body_ = root;
    for (int joint = 0; joint < model_->njnt; ++joint)
      if (model_->jnt_type[joint] == mjJNT_FREE && model_->jnt_bodyid[joint] == root) free_joint_ = joint;
    seen_from_.resize(static_cast<std::size_t>(model_->nq));
    damping_.assign(model_->dof_damping, model_->dof_damping + model_->nv);
    if (free_joint_ >= 0) {
      const mjtNum* const at = data_->qpos + model_->jnt_qposadr[free_joint_];
      began_.assign(at, at + kFreeCoordinates);
      std::copy_n(model_->dof_armature + model_->jnt_dofadr[free_joint_], kFreeSpeeds, armature_.begin());
    }
    mj_forward(model_.get(), data_.get());
  }

  void integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                 Duration) override {
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      const auto i = static_cast<Eigen::Index>(j);
      coordinate(j) = state.q[i];
      speed(j) = state.dq[i];
      data_->qfrc_applied[address(j)] = tau[i];
    }
    for (int turn = 0; turn < sub_steps_; ++turn) {
      for (std::size_t j = 0; j < joints_.size(); ++j)
        model_->dof_damping[address(j)] = damping_[static_cast<std::size_t>(address(j))] + friction[j].viscous +
                                          friction[j].coulomb / std::max(std::abs(speed(j)), kRestSpeed);
      mj_step(model_.get(), data_.get());
      if (hangs_) hang();
    }
    check_sane();
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      const auto i = static_cast<Eigen::Index>(j);
      state.q[i] = coordinate(j);
      state.dq[i] = speed(j);
    }
  }

  void hoist(bool hangs) override {
    if (free_joint_ < 0 || hangs == hangs_) return;
    hangs_ = hangs;
    set_armature(hangs);
    if (hangs_) hang();
  }

  [[nodiscard]] bool has_body(const std::string& name) const override { return body_of(name) >= 0; }

  bool push(const config::Vector3& force, const std::string& body) override {
    std::fill_n(data_->xfrc_applied + std::ptrdiff_t{6} * pushed_.id, 3, 0);
    find(pushed_, body);
    std::copy(force.begin(), force.end(), data_->xfrc_applied + std::ptrdiff_t{6} * pushed_.id);
    return true;
  }

  bool load(double mass, const std::string& body) override {
    if (mass == load_ && (mass == 0 || body == loaded_.name)) return true;
    if (load_ != 0) model_->body_mass[loaded_.id] = own_mass_;
    find(loaded_, body);
    own_mass_ = model_->body_mass[loaded_.id];
    model_->body_mass[loaded_.id] += mass;
    load_ = mass;
    const bool hangs = hangs_;
    if (hangs) set_armature(false);
    // What is derived of the masses; in data of its own, for this leaves the data at the model's initial pose.
    const std::unique_ptr<mjData, DeleteData> elsewhere(mj_makeData(model_.get()));
    mj_setConst(model_.get(), elsewhere.get());
    if (hangs) set_armature(true);
    return true;
  }

  // Where the root body is: what the world takes hold of. Of now, whatever `q`.
  config::Vector3 tool_position(const Eigen::VectorXd&) override { return base()->position; }

  [[nodiscard]] std::optional<BasePose> base() const override {
    BasePose pose;
    const mjtNum* at = data_->xpos + std::ptrdiff_t{3} * root_body_;
    const mjtNum* turned = data_->xquat + std::ptrdiff_t{4} * root_body_;
    if (free_joint_ >= 0) {  // the others are of before the last step
      at = data_->qpos + model_->jnt_qposadr[free_joint_];
      turned = at + 3;
    }
    std::copy_n(at, 3, pose.position.begin());
    std::copy_n(turned, 4, pose.orientation.begin());
    return pose;
  }

  std::optional<ImuReading> imu() override {
    if (imu_site_ < 0) return std::nullopt;
    // A reading changes nothing: mj_kinematics makes the base's quaternion anew, of length 1.
    std::copy_n(data_->qpos, model_->nq, seen_from_.begin());
    mj_kinematics(model_.get(), data_.get());
    mj_comPos(model_.get(), data_.get());
    mj_comVel(model_.get(), data_.get());
    mj_rnePostConstraint(model_.get(), data_.get());
    ImuReading reading;
    mju_mat2Quat(reading.orientation.data(), data_->site_xmat + std::ptrdiff_t{9} * imu_site_);
    mjtNum motion[6];  // rotation first, in the site's axes
    mj_objectVelocity(model_.get(), data_.get(), mjOBJ_SITE, imu_site_, motion, 1);
    std::copy_n(motion, 3, reading.angular_velocity.begin());
    mj_objectAcceleration(model_.get(), data_.get(), mjOBJ_SITE, imu_site_, motion, 1);
    std::copy_n(motion + 3, 3, reading.acceleration.begin());
    std::ranges::copy(seen_from_, data_->qpos);
    return reading;
  }

  // What was changed in the file so that MuJoCo 2.2.2 reads it.
  [[nodiscard]] std::vector<std::string> notes() const override { return mended_; }

 private:
  struct NamedBody {
    std::string name;  // empty: the root
    int id = 0;
  };
  // The model's id; empty: the root's. -1: none of the robot has that name.
  [[nodiscard]] int body_of(const std::string& name) const {
    if (name.empty()) return root_body_;
    const int id = mj_name2id(model_.get(), mjOBJ_BODY, name.c_str());
    return id >= 0 && model_->body_rootid[id] == root_body_ ? id : -1;
  }
  void find(NamedBody& body, const std::string& name) const {
    if (body.name == name && body.id != 0) return;
    body = {name, body_of(name)};
  }

  // Of the free joint. On the hoist it is so heavy that nothing moves it, and what hangs from it feels its own weight.
  void set_armature(bool hangs) {
    for (int i = 0; i < kFreeSpeeds; ++i)
      model_->dof_armature[model_->jnt_dofadr[free_joint_] + i] =
          hangs ? kHoist : armature_[static_cast<std::size_t>(i)];
  }

  [[nodiscard]] int address(std::size_t j) const { return model_->jnt_dofadr[joints_[j]]; }
  mjtNum& coordinate(std::size_t j) { return data_->qpos[model_->jnt_qposadr[joints_[j]]]; }
  mjtNum& speed(std::size_t j) { return data_->qvel[address(j)]; }

  void hang() {
    std::ranges::copy(began_, data_->qpos + model_->jnt_qposadr[free_joint_]);
    std::fill_n(data_->qvel + model_->jnt_dofadr[free_joint_], kFreeSpeeds, 0.0);
  }

  // After one of these MuJoCo has begun anew from its initial state, as if nothing had happened.
  void check_sane() const {
    for (const mjtWarning bad : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC})
      if (data_->warning[bad].number > 0)
        throw std::runtime_error(
            fmt::format("MuJoCo: the simulation diverged ({} at degree of freedom {}): shorten "
                        "simulation.step, or look for masses without inertia",
                        mju_warningText(bad, 0), data_->warning[bad].lastinfo));
    // Beyond its sizes MuJoCo leaves contacts and constraints out, and a robot that stands on them falls.
    for (const auto& [full, size] : {std::pair{mjWARN_CONTACTFULL, "nconmax"}, std::pair{mjWARN_CNSTRFULL, "njmax"}})
      if (data_->warning[full].number > 0)
        throw std::runtime_error(
            fmt::format("MuJoCo: more contacts or constraints than the model has room for ({} = {}), so that some have "
                        "no effect: put <size {}=\"{}\"/> into the model",
                        size, data_->warning[full].lastinfo, size, std::max(100, 4 * data_->warning[full].lastinfo)));
  }

  std::unique_ptr<mjModel, DeleteModel> model_;
  std::vector<std::string> mended_;
  std::unique_ptr<mjData, DeleteData> data_;
  std::vector<int> joints_;  // of the robot, in its order: the model's ids
  int imu_site_;             // -1: none
  int sub_steps_;
  int free_joint_ = -1, root_body_ = 0;
  std::vector<mjtNum> damping_;                 // the model's own, by degree of freedom
  std::array<mjtNum, kFreeSpeeds> armature_{};  // the free joint's own
  std::vector<mjtNum> began_;                   // the free joint's coordinates at the start
  bool hangs_ = false;
  NamedBody pushed_, loaded_;       // id 0, the world's: none yet
  double load_ = 0, own_mass_ = 0;  // kg; the latter of the body that is loaded
  std::vector<mjtNum> seen_from_;   // work space: all coordinates
};

// What a person may not expect of the model. One sentence each.
std::vector<std::string> surprises_of(const mjModel& model, const std::vector<int>& driven) {
  std::vector<std::string> surprises;
  if (falls_for_ever(model, root_of(model, driven.front())))
    surprises.emplace_back(
        "the base is free and nothing of the world collides: the robot falls; add a floor to the "
        "model");
  for (int joint = 0; joint < model.njnt; ++joint)
    if (model.jnt_type[joint] == mjJNT_SLIDE && root_of(model, joint) == root_of(model, driven.front()) &&
        !is_led(model, joint) && std::ranges::find(driven, joint) == driven.end())
      surprises.push_back(fmt::format("slide {} has no drive, and moves freely", name_of(model, mjOBJ_JOINT, joint)));
  return surprises;
}

// By its name, or by what an import makes of one that a robot file cannot have; -1: none, or several.
int joint_called(const mjModel& model, const std::string& name) {
  if (const int id = mj_name2id(&model, mjOBJ_JOINT, name.c_str()); id >= 0) return id;
  int found = -1;
  for (int joint = 0; joint < model.njnt; ++joint) {
    if (config::joint_names_of({name_of(model, mjOBJ_JOINT, joint)}).front() != name) continue;
    if (found >= 0) return -1;
    found = joint;
  }
  return found;
}

// Which of the model's joints the robot's are. Error: one sentence.
std::expected<std::vector<int>, std::string> find_joints(const mjModel& model, const config::RobotConfig& robot) {
  std::vector<int> found;
  std::vector<std::string> missing, others, forgotten, turn, slide;
  for (const config::Joint& joint : robot.joints) {
    const int id = joint_called(model, joint.name);
    if (id < 0)
      missing.push_back(joint.name);
    else if (model.jnt_type[id] != mjJNT_HINGE && model.jnt_type[id] != mjJNT_SLIDE)
      others.push_back(joint.name);
    else if ((model.jnt_type[id] == mjJNT_SLIDE) != (joint.kind == config::JointKind::slide))
      (joint.kind == config::JointKind::slide ? turn : slide).push_back(joint.name);
    found.push_back(id);
  }
  const std::string where = robot.simulation->mujoco->model;
  if (!missing.empty())
    return std::unexpected(fmt::format("{}: has no joint {}; rename the robot file's joints or the model's", where,
                                       fmt::join(missing, ", ")));
  if (!others.empty())
    return std::unexpected(
        fmt::format("{}: {} has no axis; a drive's joint is a hinge or a slide", where, fmt::join(others, ", ")));
  if (!slide.empty())
    return std::unexpected(fmt::format("{}: {} slides, and turns in the robot file; write `kind: slide` there", where,
                                       fmt::join(slide, ", ")));
  if (!turn.empty())
    return std::unexpected(fmt::format("{}: {} turns, and slides in the robot file; leave `kind: slide` out there",
                                       where, fmt::join(turn, ", ")));
  for (int joint = 0; joint < model.njnt; ++joint)
    if (model.jnt_type[joint] == mjJNT_HINGE && root_of(model, joint) == root_of(model, found.front()) &&
        std::ranges::find(found, joint) == found.end() && !is_led(model, joint))
      forgotten.push_back(name_of(model, mjOBJ_JOINT, joint));
  if (!forgotten.empty())
    return std::unexpected(
        fmt::format("{}: {} of the same robot: in the robot file no joint has that name; add it (`passive: true` "
                    "without a drive of its own), or take it out of the model",
                    where, fmt::join(forgotten, ", ")));
  return found;
}

// Of a name that may be empty: -1 then. Error: one sentence.
std::expected<int, std::string> find_named(const mjModel& model, int type, const std::string& name, const char* what,
                                           const std::string& where) {
  if (name.empty()) return -1;
  const int id = mj_name2id(&model, type, name.c_str());
  if (id >= 0) return id;
  return std::unexpected(fmt::format("{}: has no {} `{}`", where, what, name));
}

}  // namespace

std::expected<std::unique_ptr<MujocoMechanics>, std::string> MujocoMechanics::make(const config::RobotConfig& robot) {
  const config::MujocoWorld& world = *robot.simulation->mujoco;
  const auto text = config::read_model_text(world.model);
  if (!text) return std::unexpected(text.error());
  auto loaded = load_model(*text);
  if (!loaded) return std::unexpected(loaded.error());
  const mjModel& model = *loaded->model;
  auto joints = find_joints(model, robot);
  if (!joints) return std::unexpected(joints.error());
  const auto keyframe = find_named(model, mjOBJ_KEY, world.keyframe, "keyframe", world.model);
  if (!keyframe) return std::unexpected(keyframe.error());
  const auto site = find_named(model, mjOBJ_SITE, world.imu_site, "site", world.model);
  if (!site) return std::unexpected(site.error());
  for (std::string& note : surprises_of(model, *joints)) loaded->mended.push_back(std::move(note));
  return std::make_unique<Engine>(std::move(*loaded), std::move(*joints), *keyframe, *site, robot.simulation->step);
}

}  // namespace takt::simulation
