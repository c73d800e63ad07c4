// SPDX-License-Identifier: Apache-2.0
// Goal: a file of exploy's is a whole environment, and runs as ONNX Runtime runs it: memory fed back, its step count
// kept, a reset forgotten. Method: the two forms of such a file, made by make_exploy.py; the robot file as imported,
// filled in; ONNX Runtime fed by hand, tensor by tensor, over 400 observations with a reset.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>

#include "config/deploy_import.hpp"
#include "policy_host/described_import.hpp"
#include "policy_host/engines/load_policy.hpp"
#include "policy_host/exploy/exploy_description.hpp"
#include "policy_host/onnx_engine/model.hpp"
#include "policy_host/onnx_policy.hpp"
#include "policy_host/onnx_runtime/onnx_runtime.hpp"
#include "policy_host/policy_fit.hpp"
#include "policy_host/responder.hpp"
#include "tests/policy_host/installed_onnx_runtime.hpp"
#include "tests/policy_host/leapp/walker.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host {
namespace {

using config::RobotConfig;
using onnx_runtime::Tensor;

constexpr int kObservations = 400, kResetAt = 203;
constexpr float kTolerance = 1e-5F;

// What the owner of a robot of one bus adds.
std::string completed(std::string text) {
  for (const auto& [from, to] : std::initializer_list<std::pair<const char*, const char*>>{
           {"max_age: FILL_IN", "max_age: 60 ms"},
           {"epsilon: FILL_IN", "epsilon: 0.05"},
           {"recover_after: FILL_IN", "recover_after: 100 ms"},
           {"stop_after: FILL_IN", "stop_after: 400 ms"},
           {"behaviour: FILL_IN", "behaviour: hold, after: 10 ms"},
           {"feedback: { timeout: FILL_IN }", "feedback: { timeout: 30 ms }\ncontrol: { period: 1 ms }"},
           {"- { name: FILL_IN, interface: FILL_IN }", "- { name: bus0, interface: can0, when_missing: loopback }"},
           {"protocol: FILL_IN, variant: FILL_IN, model: FILL_IN",
            "protocol: mit, variant: damiao, position_range: 12.5 rad, velocity_range: 60 rad/s, torque_range: 200 Nm, "
            "kp_range: 500 Nm/rad, kd_range: 100 Nms/rad"},
           {"position_margin: FILL_IN", "position_margin: 1 rad"},
           {"velocity: FILL_IN", "velocity: 20 rad/s"},
           {"velocity_hard: FILL_IN", "velocity_hard: 55 rad/s"},
           {"acceleration: FILL_IN", "acceleration: 500 rad/s2"},
           {"torque_rate: FILL_IN", "torque_rate: 200000 Nm/s"},
           {"position: [FILL_IN, FILL_IN]", "position: [-4 rad, 4 rad]"},
           {"torque: FILL_IN, kp: FILL_IN, kd: FILL_IN", "torque: 150 Nm, kp: 100 Nm/rad, kd: 42 Nms/rad"},
           {"torque: FILL_IN", "torque: 150 Nm"},  // of joints whose gains the file says
           {"gains: { kp: FILL_IN, kd: FILL_IN, damping: FILL_IN }",
            "gains: { kp: 40 Nm/rad, kd: 4 Nms/rad, damping: 4 Nms/rad }"},
           {"inertia: FILL_IN", "inertia: 0.1 kgm2"},
           {"home: FILL_IN", "home: 0.1 rad"},
           {"values: 3\n    timeout: FILL_IN", "values: 3\n    timeout: 50 ms"},
           {"name: imu, values: 10, timeout: FILL_IN", "name: imu, values: 10, timeout: 40 ms"},
           {"tilt: FILL_IN", "tilt: 1 rad"}})
    text = replaced(std::move(text), from, to);
  for (int joint = 1; text.find("bus: FILL_IN") != std::string::npos; ++joint) {
    const std::string open = "bus: FILL_IN\n    drive: { id: FILL_IN, reply_id: FILL_IN }";
    text.replace(text.find(open), open.size(),
                 fmt::format("bus: bus0\n    drive: {{ id: {}, reply_id: {} }}", joint, joint + 16));
  }
  return text;
}

MonoTime g_now;
MonoTime clock_now() {
  return g_now;
}

// "step": infers every time; "whole": every fourth time, by its step count.
class ExployPolicy : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const std::string command = "/usr/bin/python3 tests/policy_host/exploy/make_exploy.py " + directory_.path();
    ASSERT_EQ(std::system(command.c_str()), 0) << "it needs python3-onnx and python3-numpy";
    file_ = directory_.path(std::string(GetParam()) + ".onnx");
  }
  // Its joints stand in another order than the policy's.
  [[nodiscard]] RobotConfig robot() const {
    const auto model = onnx_engine::load(file_);
    if (!model) throw std::runtime_error(model.error());
    const auto said = describe_exploy(model->metadata(), model->inputs(), model->outputs());
    std::vector<std::string> joints{"ankle", "knee", "hip"};
    const auto deploy = deploy_file_of(said.value().value(), joints);
    const auto text = config::import_deploy_file(
        deploy.value(), {.robot = "three", .policy_file = file_, .joint_names = joints, .source = file_});
    return loaded(directory_.path(), completed(text.value()));
  }

  test::TemporaryDirectory directory_;
  std::string file_;
};

TEST_P(ExployPolicy, InfersAsOftenAsItsSimulationDid) {
  EXPECT_EQ(robot().policy->period, GetParam() == std::string("whole") ? milliseconds(5) : milliseconds(20));
}

TEST_P(ExployPolicy, AnswersAsOnnxRuntimeDoesWithItsMemoryFedBack) {
  const auto library = installed_onnx_runtime();
  if (!library) GTEST_SKIP() << "NOT TESTED: ONNX Runtime is not installed (./dev test installs it)";
  RobotConfig three = robot();
  ASSERT_TRUE(check_policy_section(three));
  const auto built_in = load_robot_policy(three);
  ASSERT_TRUE(built_in) << built_in.error();
  ASSERT_TRUE(check_fit(three, **built_in));
  config::Engine& engine = three.policy->engine.emplace();
  engine.name = "onnxruntime";
  engine.library = std::filesystem::absolute(*library);
  const auto plugin = load_policy(three);
  ASSERT_TRUE(plugin) << plugin.error();
  Responder responders[] = {Responder(three, 1, **built_in), Responder(three, 1, **plugin)};
  for (Responder& responder : responders) responder.start_session();

  const auto runtime = onnx_runtime::OnnxRuntime::open(*library);
  ASSERT_TRUE(runtime) << runtime.error();
  auto session = runtime->load(file_);
  ASSERT_TRUE(session) << session.error();
  const auto tensor = [](std::span<Tensor> tensors, const std::string& name) -> std::vector<float>& {
    return std::ranges::find(tensors, name, &Tensor::name)->values;
  };
  const auto in = [&](const std::string& name) -> std::vector<float>& { return tensor(session->inputs(), name); };
  const auto out = [&](const std::string& name) -> std::vector<float>& { return tensor(session->outputs(), name); };
  const bool counts = std::ranges::find(session->inputs(), "ctx.step_count", &Tensor::name) != session->inputs().end();
  EXPECT_EQ(counts, GetParam() == std::string("whole"));

  std::mt19937 random(5);
  std::uniform_real_distribution<float> value(-0.4F, 0.4F);
  std::vector<SensorSample> samples(three.sensors.size());
  const auto command = static_cast<std::size_t>(
      std::ranges::find(three.sensors, "cmd_se2_velocity_base", &config::Sensor::name) - three.sensors.begin());
  ASSERT_LT(command, samples.size());
  float largest = 0, largest_step = 0, before = 0;
  for (int i = 1, steps = 0; i <= kObservations; ++i, ++steps) {
    g_now = MonoTime{} + three.policy->period * i;
    Observation observation;
    // A reset: more observations missed than a history can bear.
    observation.id = static_cast<std::uint64_t>(i < kResetAt ? i : i + 100);
    observation.published_at = g_now;
    observation.joint_count = 3;
    for (std::size_t j = 0; j < 3; ++j) {
      observation.q[j] = value(random);
      observation.dq[j] = 5 * value(random);
    }
    float length = 0;
    for (float& each : observation.imu.rotation) {
      each = value(random);
      length += each * each;
    }
    for (float& each : observation.imu.rotation) each /= std::sqrt(length);
    for (float& each : observation.imu.angular_velocity) each = value(random);
    samples[command].sequence = static_cast<std::uint64_t>(i);
    samples[command].sensed_at = g_now;
    for (float& each : std::span(samples[command].values, 3)) each = value(random);
    if (i == kResetAt) {
      steps = 0;
      std::ranges::fill(in("memory.actions.in"), 0.0F);
      std::ranges::fill(in("memory.history.in"), 0.0F);
    }
    if (counts) in("ctx.step_count")[0] = static_cast<float>(steps);
    // The policy's hip, knee, ankle are the robot's last, middle and first.
    in("obj.robot.joints.pos") = {observation.q[2], observation.q[1], observation.q[0]};
    in("obj.robot.joints.vel") = {observation.dq[2], observation.dq[1], observation.dq[0]};
    std::ranges::copy(observation.imu.rotation, in("obj.robot.pelvis.w_Q_b").begin());
    std::ranges::copy(observation.imu.angular_velocity, in("obj.robot.pelvis.ang_vel_b_rt_w_in_b").begin());
    std::copy_n(samples[command].values, 3, in("cmd.se2_velocity.base").begin());
    const auto ran = session->run();
    ASSERT_TRUE(ran) << ran.error();
    in("memory.actions.in") = out("memory.actions.out");
    in("memory.history.in") = out("memory.history.out");

    for (Responder& responder : responders) {
      const CommandChunk& chunk = responder.answer(observation, samples, g_now, clock_now);
      ASSERT_EQ(responder.inference().after_reset, i == 1 || i == kResetAt) << i;
      for (const auto& [field, name] : {std::pair{CommandField::q, "pos"}, std::pair{CommandField::dq, "vel"},
                                        std::pair{CommandField::tau_ff, "effort"}}) {
        const std::vector<float>& theirs = out(std::string("output.joint_targets.legs.") + name);
        // It commands ankle and hip.
        for (const auto& [joint, k] : {std::pair{0U, 0U}, std::pair{2U, 1U}}) {
          const float ours = chunk.values[value_index(chunk.header, field, 0, joint)];
          ASSERT_TRUE(std::isfinite(ours) && std::isfinite(theirs[k])) << i;
          largest = std::max(largest, std::abs(ours - theirs[k]));
        }
      }
    }
    const float target = out("output.joint_targets.legs.pos")[0];
    largest_step = std::max(largest_step, std::abs(target - std::exchange(before, target)));
  }
  EXPECT_LE(largest, kTolerance);
  EXPECT_GT(largest_step, 0.1F) << "the policy hardly moves: nothing was compared";
  std::printf("%s: largest difference from ONNX Runtime in %d observations: %.3g\n", GetParam(), kObservations,
              static_cast<double>(largest));
}

INSTANTIATE_TEST_SUITE_P(Forms, ExployPolicy, testing::Values("step", "whole"));

}  // namespace
}  // namespace takt::policy_host
