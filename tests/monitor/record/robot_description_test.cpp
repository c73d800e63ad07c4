// SPDX-License-Identifier: Apache-2.0
// Goal: a viewer that reads /robot_description and /tf of a run sees the robot where its file says that it stands.
// Method: MuJoCo reads the URDF and places its bodies at angles drawn at random; the chain of the decoded transforms
// must end at the same places. The robots: those that are shipped, and trees of hinges and slides drawn at random. The
// cylinders must end where the joints are.
#include "monitor/record/robot_description.hpp"

#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <array>
#include <fstream>
#include <map>
#include <memory>
#include <random>

#include "config/load.hpp"
#include "config/xml_text.hpp"
#include "monitor/record/cdr.hpp"
#include "monitor/record/mcap_reader.hpp"
#include "monitor/record/recorder.hpp"
#include "tests/monitor/record/virtual_robot.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

constexpr double kSame = 1e-6;  // m, and of rotation matrices
constexpr int kPoses = 25;

struct Place {
  std::array<double, 3> at{};
  std::array<double, 4> turn{1, 0, 0, 0};  // w x y z
};

config::RobotConfig shipped(const std::string& file) {
  auto robot = config::load("config/" + file);
  EXPECT_TRUE(robot) << robot.error();
  return *robot;
}

// Frames in base, as a viewer chains a TFMessage.
std::map<std::string, Place> chained(std::span<const std::byte> message, std::int64_t unix_ns) {
  std::map<std::string, Place> places{{"base", {}}};
  CdrReader reader(message);
  for (std::size_t left = reader.get_count(100); left > 0; --left) {
    EXPECT_EQ(reader.get<std::int32_t>(), unix_ns / 1'000'000'000);
    EXPECT_EQ(reader.get<std::uint32_t>(), unix_ns % 1'000'000'000);
    const Place& parent = places.at(reader.get_string());
    const std::string child = reader.get_string();
    std::array<double, 3> at{};
    std::array<double, 4> turn{};
    for (double& value : at) value = reader.get<double>();
    for (const std::size_t k : {1U, 2U, 3U, 0U}) turn.at(k) = reader.get<double>();
    Place& here = places[child];
    mju_mulPose(here.at.data(), here.turn.data(), parent.at.data(), parent.turn.data(), at.data(), turn.data());
  }
  EXPECT_TRUE(reader.ok());
  return places;
}

class RobotDescription : public test::TemporaryFolder {
 protected:
  void read(const config::RobotConfig& robot) {
    const std::string urdf = robot_description(robot);
    ASSERT_NO_FATAL_FAILURE(load(urdf));
    // MuJoCo leaves out what only is to be seen, unless it is asked for it.
    const std::string asked =
        "<mujoco><compiler discardvisual=\"false\" inertiafromgeom=\"false\" strippath=\"false\"/></mujoco>";
    std::string seen = urdf;
    seen.insert(urdf.find('\n', urdf.find("<robot ")) + 1, asked);
    load(seen);
  }
  void load(const std::string& urdf) {
    std::ofstream(path("robot.urdf")) << urdf;
    std::array<char, 1000> error{};
    model_.reset(mj_loadXML(path("robot.urdf").c_str(), nullptr, error.data(), error.size()));
    ASSERT_TRUE(model_) << error.data() << urdf;
    data_.reset(mj_makeData(model_.get()));
  }
  [[nodiscard]] int body_of(const std::string& joint) const {
    return mj_name2id(model_.get(), mjOBJ_BODY, (joint + "_link").c_str());
  }
  [[nodiscard]] int joint_of(const std::string& name) const {
    return mj_name2id(model_.get(), mjOBJ_JOINT, name.c_str());
  }

  void expect_same_places(const config::RobotConfig& robot, std::mt19937& random) {
    ASSERT_NO_FATAL_FAILURE(read(robot));
    ASSERT_EQ(static_cast<std::size_t>(model_->njnt), robot.joints.size());
    auto record = std::make_unique<TickRecord>();
    CdrWriter out;
    for (int pose = 0; pose < kPoses; ++pose) {
      for (std::size_t i = 0; i < robot.joints.size(); ++i) {
        std::uniform_real_distribution<float> angle(static_cast<float>(robot.joints[i].limits.q_min),
                                                    static_cast<float>(robot.joints[i].limits.q_max));
        record->joints[i].feedback.q = angle(random);
        data_->qpos[model_->jnt_qposadr[joint_of(robot.joints[i].name)]] =
            static_cast<double>(record->joints[i].feedback.q);
      }
      mj_kinematics(model_.get(), data_.get());
      constexpr std::int64_t kNow = 1'700'000'000'123'456'789;
      encode_tf_message(frame_transforms(robot, *record), kNow, out);
      const auto places = chained(out.bytes(), kNow);
      for (const config::Joint& joint : robot.joints) {
        const Place& ours = places.at(joint.name + "_link");
        const int found = body_of(joint.name);
        ASSERT_GT(found, 0) << joint.name;
        const auto body = static_cast<std::size_t>(found);
        std::array<double, 9> turn{};
        mju_quat2Mat(turn.data(), ours.turn.data());
        for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(ours.at.at(k), data_->xpos[3 * body + k], kSame) << joint.name;
        for (std::size_t k = 0; k < 9; ++k) EXPECT_NEAR(turn.at(k), data_->xmat[9 * body + k], kSame) << joint.name;
      }
    }
  }

  // Of every link with one parent joint's frame in it, at zero angles.
  void expect_cylinders_between_joints(const config::RobotConfig& robot) {
    mj_resetData(model_.get(), data_.get());
    mj_kinematics(model_.get(), data_.get());
    for (const config::Link& link : robot.model->links) {
      if (std::hypot(link.origin_xyz[0], link.origin_xyz[1], link.origin_xyz[2]) < 1e-6) continue;
      const int body = body_of(link.joint);
      const int parent = link.parent < 0 ? 0 : body_of(robot.model->links[static_cast<std::size_t>(link.parent)].joint);
      bool joins = false;
      for (int geom = 0; geom < model_->ngeom; ++geom) {
        if (model_->geom_type[geom] != mjGEOM_CYLINDER || model_->geom_bodyid[geom] != parent) continue;
        double from = 0, to = 0;
        for (int k = 0; k < 3; ++k) {
          const double half = model_->geom_size[3 * geom + 1] * data_->geom_xmat[9 * geom + 3 * k + 2];
          from = std::max(from, std::abs(data_->geom_xpos[3 * geom + k] - half - data_->xpos[3 * parent + k]));
          to = std::max(to, std::abs(data_->geom_xpos[3 * geom + k] + half - data_->xpos[3 * body + k]));
        }
        joins = joins || (from < kSame && to < kSame);
      }
      EXPECT_TRUE(joins) << link.joint;
    }
  }

  struct Delete {
    void operator()(mjModel* model) const { mj_deleteModel(model); }
    void operator()(mjData* data) const { mj_deleteData(data); }
  };
  std::unique_ptr<mjModel, Delete> model_;
  std::unique_ptr<mjData, Delete> data_;
};

TEST_F(RobotDescription, ShippedRobotsStandWhereTheirFilesSay) {
  std::mt19937 random(11);
  for (const char* file : {"arm6.yaml", "arm6_visuomotor.yaml", "dual_arm12.yaml"}) {
    SCOPED_TRACE(file);
    const config::RobotConfig robot = shipped(file);
    ASSERT_NO_FATAL_FAILURE(expect_same_places(robot, random));
    expect_cylinders_between_joints(robot);
    for (const config::Link& link : robot.model->links)
      EXPECT_DOUBLE_EQ(model_->body_mass[body_of(link.joint)], link.mass);
    for (const config::Joint& joint : robot.joints) {
      EXPECT_DOUBLE_EQ(model_->jnt_range[2 * joint_of(joint.name)], joint.limits.q_min);
      EXPECT_DOUBLE_EQ(model_->jnt_range[2 * joint_of(joint.name) + 1], joint.limits.q_max);
    }
  }
}

// Every frame tilted, axes of any length and direction, branches, slides between hinges.
TEST_F(RobotDescription, TreesOfHingesAndSlidesStandWhereTheirFilesSay) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-1, 1);
  const auto vector = [&](double scale) {
    return config::Vector3{scale * any(random), scale * any(random), scale * any(random)};
  };
  for (int drawn = 0; drawn < 10; ++drawn) {
    SCOPED_TRACE(drawn);
    config::RobotConfig robot = shipped("arm6.yaml");
    for (std::size_t i = 0; i < robot.joints.size(); ++i) {
      if (any(random) < 0) robot.joints[i].kind = config::JointKind::slide;
      config::Link& link = robot.model->links[i];
      link.parent = std::uniform_int_distribution<int>(-1, static_cast<int>(i) - 1)(random);
      link.origin_xyz = vector(0.5);
      link.origin_rpy = vector(3);
      link.axis = vector(2);
      link.com = vector(0.1);
    }
    ASSERT_NO_FATAL_FAILURE(expect_same_places(robot, random));
    expect_cylinders_between_joints(robot);
  }
}

TEST_F(RobotDescription, NamesAreTextAndNothingElse) {
  config::RobotConfig robot = shipped("arm6.yaml");
  robot.robot = "\"><!-- & \x01";
  robot.joints[2].name = robot.model->links[2].joint = "el<b\"ow> & 'more'";
  ASSERT_NO_FATAL_FAILURE(read(robot));
  EXPECT_GT(body_of("el<b\"ow> & 'more'"), 0);
  EXPECT_EQ(model_->njnt, 6);
  EXPECT_EQ(config::xml_text("\x01\n<"), "?\n&lt;");
}

// A viewer opens one part alone.
TEST_F(RobotDescription, EveryPartHasItOnceAndARobotWithoutModelNone) {
  const auto counts = [](const RunFolder& folder) {
    std::map<std::string, int> messages;
    (void)McapReader::open(folder.ticks())->scan([&](const McapMessage& message) {
      if (message.topic == "/robot_description" || message.topic == "/tf") ++messages[std::string(message.topic)];
      return true;
    });
    return messages;
  };
  config::RobotConfig robot = demo_robot();
  for (const bool has_model : {true, false}) {
    SCOPED_TRACE(has_model);
    if (!has_model) robot.model.reset();
    VirtualRobot virtual_robot;
    RecordStream stream = RecordStream::attach(virtual_robot.rings(), robot.joints.size()).value();
    const RunFolder folders[] = {RunFolder::create(path(has_model ? "with" : "without")).value(),
                                 RunFolder::create(path(has_model ? "with.2" : "without.2")).value()};
    auto recorder = Recorder::start(folders[0], virtual_robot.manifest(), robot).value();
    for (const RunFolder& folder : folders) {
      virtual_robot.run(100);
      stream.drain(recorder->sink(), true);
      if (&folder == &folders[1]) break;
      auto next = recorder->begin_next(folders[1]).value();
      ASSERT_TRUE(recorder->finish(recorder->now(), "part over"));
      recorder = std::move(next);
    }
    ASSERT_TRUE(recorder->finish(recorder->now(), "test over"));
    for (std::size_t part = 0; part < 2; ++part) {
      const int transforms = part == 0 ? 2 : 3;  // of ticks 40 and 80, then 120, 160 and 200
      const std::map<std::string, int> wanted{{"/robot_description", 1}, {"/tf", transforms}};
      EXPECT_EQ(counts(folders[part]), has_model ? wanted : (std::map<std::string, int>{}));
    }
  }
}

TEST_F(RobotDescription, ALinkWithoutMassOrAngleIsNoFault) {
  config::RobotConfig robot = shipped("arm6.yaml");
  robot.model->links.back().mass = 0;
  EXPECT_EQ(robot_description(robot).find("<mass value=\"0\"/>"), std::string::npos);
  TickRecord record{};
  record.joints[3].feedback.q = std::numeric_limits<float>::quiet_NaN();
  const auto transforms = frame_transforms(robot, record);
  ASSERT_EQ(transforms.size(), 5U);
  EXPECT_EQ(transforms[3].child, robot.joints[4].name + "_link");
}

}  // namespace
}  // namespace takt::monitor
