// SPDX-License-Identifier: Apache-2.0
// Goal: a LEAPP bundle becomes a robot file without a guess, runs as its author's network does, and is refused where a
// value would be another term's. Method: a bundle of the shapes of a published one, made by make_bundle.py; its robot
// file as imported, filled in; ONNX Runtime fed by hand, tensor by tensor, over 10,000 observations with a reset; one
// deviation at a time.
#include <gtest/gtest.h>

#include <cctype>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>
#include <random>

#include "config/hash.hpp"
#include "executive/contract/imu_of_sample.hpp"
#include "policy_host/binding.hpp"
#include "policy_host/chunk_builder.hpp"
#include "policy_host/engines/load_policy.hpp"
#include "policy_host/leapp/leapp_graph.hpp"
#include "policy_host/metadata_comparison.hpp"
#include "policy_host/onnx_policy.hpp"
#include "policy_host/onnx_runtime/onnx_runtime.hpp"
#include "policy_host/policy_fit.hpp"
#include "policy_host/responder.hpp"
#include "tests/policy_host/installed_onnx_runtime.hpp"
#include "tests/policy_host/leapp/walker.hpp"
#include "tests/support/files.hpp"
#include "tests/support/shared_files.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host {
namespace {

using config::RobotConfig;
using onnx_runtime::Tensor;

constexpr int kObservations = 10'000, kResetAt = 5'000;
constexpr double kTolerance = 1e-5;

class LeappPolicy : public testing::Test {
 protected:
  // Its joints as the robot's motors might stand: not in the policy's order.
  static std::vector<std::string> motors(const std::string& yaml) {
    std::vector<std::string> joints = described_bundle(yaml).inputs[4].joints;
    std::ranges::sort(joints);
    return joints;
  }
  RobotConfig robot(const std::string& text) { return loaded(directory_.path(), text); }

  test::TemporaryDirectory directory_;
  const std::string yaml_ = make_bundle(directory_.path());
  const std::string filled_ = filled_in(imported_bundle(yaml_, motors(yaml_)));
};

TEST_F(LeappPolicy, IsImportedWithoutAGuess) {
  const std::string text = imported_bundle(yaml_);
  for (const char* const line : {
           "input: \"base_velocity, robot_root_lin_vel_b, robot_root_ang_vel_b, robot_root_quat_w, robot_joint_pos, "
           "robot_joint_vel\"",
           "output: \"joint_pos\"",
           "  period: 20 ms\n",
           "    - { term: command, sensor: base_velocity }   # base_velocity\n",
           "    - { term: sensor, sensor: FILL_IN }   # robot_root_lin_vel_b, 3 values: state/body/linear_velocity; no "
           "robot says it of itself: name a sensor whose unit is m/s and whose frame is base\n",
           "    - { term: base_angular_velocity }   # robot_root_ang_vel_b\n",
           "    - { term: base_orientation, order: xyzw }   # robot_root_quat_w\n",
           "    - { term: joint_position }   # robot_joint_pos\n",
           "    - { term: joint_velocity }   # robot_joint_vel\n",
           "  - name: base_velocity   # which value is which the export does not say\n    values: 4\n",
           "    scale: 1\n    offset: zero\n    joints: [left_hip_pitch_joint, right_hip_pitch_joint, "
           "left_hip_roll_joint,",
           "    outputs: { kp: \"joint_pos_kp_gains\", kd: \"joint_pos_kd_gains\" }\n",
           "# Note: base_velocity: 3 names for 4 values; which is which the file does not say\n",
       })
    EXPECT_NE(text.find(line), std::string::npos) << line << "\n" << text;
  const auto refused = config::parse(text, "walker.yaml");
  ASSERT_FALSE(refused);
  for (const char* const key : {"policy.observation[1].sensor", "sensors[0].command.when_absent", "joints[0].gains.kp",
                                "imu.tilt", "freshness.max_age"})
    EXPECT_NE(refused.error().find(key), std::string::npos) << key << "\n" << refused.error();
}

// What ONNX Runtime is fed, by the names in the YAML; start values as the file's last bytes have them.
class ByHand {
 public:
  ByHand(const std::string& folder, const std::filesystem::path& library)
      : runtime_(onnx_runtime::OnnxRuntime::open(library).value()),
        session_(runtime_.load(folder + "/walk.onnx").value()) {
    std::ifstream file(folder + "/walk_initial_values.safetensors", std::ios::binary);
    file.seekg(-static_cast<std::streamoff>(4 * start_.size()), std::ios::end);
    file.read(reinterpret_cast<char*>(start_.data()), 4 * std::ssize(start_));
    reset();
  }
  std::vector<float>& in(const std::string& name) { return find(session_.inputs(), name); }
  std::vector<float>& out(const std::string& name) { return find(session_.outputs(), name); }
  void reset() { std::ranges::copy(start_, in("last_action_in").begin()); }
  void run() {
    if (const auto ran = session_.run(); !ran) throw std::runtime_error(ran.error());
    in("last_action_in") = out("last_action_out");
  }

 private:
  static std::vector<float>& find(std::span<Tensor> tensors, const std::string& name) {
    return std::ranges::find(tensors, name, &Tensor::name)->values;
  }
  onnx_runtime::OnnxRuntime runtime_;
  onnx_runtime::Session session_;
  std::array<float, 12> start_{};
};

MonoTime g_now;
MonoTime clock_now() {
  return g_now;
}

TEST_F(LeappPolicy, AnswersAsOnnxRuntimeDoesOverTenThousandObservations) {
  const auto library = installed_onnx_runtime();
  if (!library) GTEST_SKIP() << "NOT TESTED: ONNX Runtime is not installed (./dev test installs it)";
  const RobotConfig walker = robot(filled_);
  ASSERT_TRUE(check_policy_section(walker));
  const auto policy = load_robot_policy(walker);
  ASSERT_TRUE(policy) << policy.error();
  const auto fits = check_fit(walker, **policy);
  ASSERT_TRUE(fits) << fits.error();
  EXPECT_TRUE((*policy)->is_recurrent());
  Responder responder(walker, 1, **policy);
  responder.start_session();
  ByHand theirs(directory_.path(), *library);

  const DescribedPolicy said = described_bundle(yaml_);
  const std::vector<std::string>&joints = said.inputs[4].joints, &legs = said.outputs[0].joints;
  std::map<std::string, std::size_t> place;
  for (std::size_t j = 0; j < walker.joints.size(); ++j) place[walker.joints[j].name] = j;
  ASSERT_EQ(place.size(), 29U);

  std::mt19937 random(11);
  std::uniform_real_distribution<float> value(-1, 1);
  std::vector<SensorSample> samples(walker.sensors.size());
  double largest = 0;
  for (int i = 1; i <= kObservations; ++i) {
    g_now = MonoTime{} + milliseconds(20) * i;
    Observation observation;
    // A reset: more observations missed than a history can bear.
    observation.id = static_cast<std::uint64_t>(i < kResetAt ? i : i + 100);
    observation.published_at = g_now;
    observation.joint_count = 29;
    for (std::size_t j = 0; j < 29; ++j) {
      observation.q[j] = value(random);
      observation.dq[j] = 5 * value(random);
    }
    for (float& each : observation.imu.rotation) each = value(random);
    for (float& each : observation.imu.angular_velocity) each = value(random);
    for (SensorSample& sample : samples) {
      sample.sequence = static_cast<std::uint64_t>(i);
      sample.sensed_at = g_now;
      for (float& each : std::span(sample.values, 4)) each = value(random);
    }
    if (i == kResetAt) theirs.reset();
    const auto sensor = [&](const char* name) {
      const auto at = std::ranges::find(walker.sensors, name, &config::Sensor::name) - walker.sensors.begin();
      return samples[static_cast<std::size_t>(at)].values;
    };
    std::copy_n(sensor("base_velocity"), 4, theirs.in("base_velocity").begin());
    std::copy_n(sensor("odometry"), 3, theirs.in("robot_root_lin_vel_b").begin());
    std::copy_n(observation.imu.angular_velocity, 3, theirs.in("robot_root_ang_vel_b").begin());
    const auto [w, x, y, z] = observation.imu.rotation;
    theirs.in("robot_root_quat_w") = {x, y, z, w};
    for (std::size_t k = 0; k < 29; ++k) {
      theirs.in("robot_joint_pos")[k] = observation.q[place[joints[k]]];
      theirs.in("robot_joint_vel")[k] = observation.dq[place[joints[k]]];
    }
    theirs.run();

    const CommandChunk& chunk = responder.answer(observation, samples, g_now, clock_now);
    ASSERT_EQ(responder.inference().after_reset, i == 1 || i == kResetAt) << i;
    const auto compare = [&](CommandField field, const char* output) {
      for (std::size_t k = 0; k < legs.size(); ++k) {
        const float own = chunk.values[value_index(chunk.header, field, 0, place[legs[k]])];
        const float other = theirs.out(output)[k];
        largest = std::max(largest, static_cast<double>(std::abs(own - other)) / std::max(1.0F, std::abs(other)));
      }
    };
    compare(CommandField::q, "joint_pos");
    compare(CommandField::kp, "joint_pos_kp_gains");
    compare(CommandField::kd, "joint_pos_kd_gains");
  }
  EXPECT_LE(largest, kTolerance);
  RecordProperty("largest_difference", std::to_string(largest));
  std::printf("largest difference from ONNX Runtime in %d observations: %.3g\n", kObservations, largest);
}

TEST_F(LeappPolicy, BothEnginesTakeIt) {
  const auto library = installed_onnx_runtime();
  if (!library) GTEST_SKIP() << "NOT TESTED: ONNX Runtime is not installed (./dev test installs it)";
  RobotConfig walker = robot(filled_);
  const auto own = load_robot_policy(walker);
  config::Engine& engine = walker.policy->engine.emplace();
  engine.name = "onnxruntime";
  engine.library = std::filesystem::absolute(*library);
  const auto theirs = load_policy(walker);
  ASSERT_TRUE(own && theirs) << (own ? "" : own.error()) << (theirs ? "" : theirs.error());
  std::vector<float> input((*own)->input_size(), 0.25F), a((*own)->output_size()), b(a);
  for (int i = 0; i < 3; ++i) {
    (*own)->infer(input, a);
    (*theirs)->infer(input, b);
    for (std::size_t k = 0; k < a.size(); ++k) EXPECT_NEAR(a[k], b[k], 1e-5 * std::max(1.0F, std::abs(b[k]))) << k;
  }
}

// Of a bundle that is one network: the largest difference of its answers from ONNX Runtime's, whose feedback is fed by
// hand, over 500 observations with two resets. Nothing: there is no ONNX Runtime.
std::optional<double> difference_from_onnx_runtime(const std::string& folder, const std::string& yaml,
                                                   const RobotConfig& walker, Policy& policy) {
  const auto library = installed_onnx_runtime();
  if (!library) return std::nullopt;
  const auto runtime = onnx_runtime::OnnxRuntime::open(*library).value();
  auto session = runtime.load(folder + "/walk.onnx").value();
  const auto tensor = [](std::span<Tensor> tensors, const std::string& name) -> std::vector<float>& {
    return std::ranges::find(tensors, name, &Tensor::name)->values;
  };
  const auto bundle = read_leapp_bundle(config::read_file(yaml).value(), yaml).value();
  EXPECT_EQ(bundle.feedback.size(), 7U);
  const auto graph = load_leapp_graph(yaml, walker.policy->input, walker.policy->output, load_onnx_network);
  const auto start = [&] {
    for (const Wiring::State& state : graph->wiring.states)
      std::ranges::copy(state.start,
                        tensor(session.inputs(), graph->networks[0]->inputs()[state.to.tensor].name).begin());
  };
  std::mt19937 random(3);
  std::uniform_real_distribution<float> value(-1, 1);
  std::vector<float> input(policy.input_size()), output(policy.output_size());
  double largest = 0;
  for (int i = 0; i < 500; ++i) {
    if (i % 200 == 0) {
      policy.reset();
      start();
    }
    std::ranges::generate(input, [&] { return value(random); });
    policy.infer(input, output);
    auto from = input.begin();
    for (const LeappPort& port : bundle.inputs) {
      std::vector<float>& to = tensor(session.inputs(), port.tensor);
      std::copy_n(from, to.size(), to.begin());
      from += std::ssize(to);
    }
    if (const auto ran = session.run(); !ran) throw std::runtime_error(ran.error());
    for (const LeappFlow& flow : bundle.feedback)
      tensor(session.inputs(), flow.to.tensor) = tensor(session.outputs(), flow.from.tensor);
    auto own = output.begin();
    for (const char* const name : {"joint_pos", "joint_pos_kp_gains", "joint_pos_kd_gains"})
      for (const float other_value : tensor(session.outputs(), name))
        largest = std::max(largest,
                           static_cast<double>(std::abs(*own++ - other_value)) / std::max(1.0F, std::abs(other_value)));
  }
  return largest;
}

// Five instants of what the network saw, as feedback of its own.
TEST_F(LeappPolicy, AHistoryThatIsFeedbackIsKept) {
  test::TemporaryDirectory other;
  const std::string yaml = make_bundle(other.path(), "history");
  const std::string text = imported_bundle(yaml);
  for (const char* const line :
       {"# Note: base_velocity: no names for 4 values; which is which the file does not say\n",
        "  - name: base_velocity   # which value is which the export does not say\n    values: 4\n",
        "input: \"base_velocity, robot_root_ang_vel_b, robot_root_quat_w, robot_joint_pos, robot_joint_vel\"",
        "    - { term: base_orientation, order: xyzw }   # robot_root_quat_w\n",
        "    outputs: { kp: \"joint_pos_kp_gains\", kd: \"joint_pos_kd_gains\" }\n"})
    EXPECT_NE(text.find(line), std::string::npos) << line << "\n" << text;
  const RobotConfig walker = loaded(other.path(), filled_in(text));
  const auto policy = load_robot_policy(walker);
  ASSERT_TRUE(policy) << policy.error();
  ASSERT_TRUE(check_fit(walker, **policy));
  ASSERT_TRUE((*policy)->is_recurrent());
  const auto largest = difference_from_onnx_runtime(other.path(), yaml, walker, **policy);
  if (!largest) GTEST_SKIP() << "NOT COMPARED: ONNX Runtime is not installed (./dev test installs it)";
  EXPECT_LE(*largest, kTolerance);
}

// Of 23 joints, its feedback between the inputs, gains and poses beside them.
TEST_F(LeappPolicy, ABundleOfT1sShapesIsTaken) {
  test::TemporaryDirectory other;
  const std::string yaml = make_bundle(other.path(), "t1");
  const std::string text = imported_bundle(yaml);
  for (const char* const line :
       {"input: \"robot_root_ang_vel_b, robot_root_quat_w, base_velocity, robot_joint_pos, robot_joint_vel\"",
        "  - name: base_velocity   # lin_vel_x, lin_vel_y, ang_vel_z\n    values: 3\n",
        "    - { term: base_angular_velocity }   # robot_root_ang_vel_b\n",
        "    - { term: base_orientation, order: xyzw }   # robot_root_quat_w\n", "  - name: AAHead_yaw\n",
        "gains: { kp: 100 Nm/rad, kd: 2.5 Nms/rad, damping: 2.5 Nms/rad }", "home: 0.4000000059604645 rad\n",
        "    joints: [Left_Hip_Pitch, Right_Hip_Pitch, Left_Hip_Roll,",
        "    outputs: { kp: \"joint_pos_kp_gains\", kd: \"joint_pos_kd_gains\" }\n"})
    EXPECT_NE(text.find(line), std::string::npos) << line << "\n" << text;
  EXPECT_EQ(text.find("# Note"), std::string::npos) << "nothing is left open";
  const RobotConfig walker = loaded(other.path(), filled_in(text));
  ASSERT_EQ(walker.joints.size(), 23U);
  const auto policy = load_robot_policy(walker);
  ASSERT_TRUE(policy) << policy.error();
  ASSERT_TRUE(check_fit(walker, **policy));
  EXPECT_EQ(joint_differences(described_bundle(yaml).joints, walker, 1e-5, "it"), std::vector<std::string>());

  const auto renamed = load_robot_policy(loaded(other.path(), replaced(filled_in(text), "Left_", "L_")));
  ASSERT_FALSE(renamed);
  EXPECT_NE(renamed.error().find("of 10 joints that "), std::string::npos) << renamed.error();
  EXPECT_NE(renamed.error().find("does not have, the first is Left_Shoulder_Pitch; "), std::string::npos);

  const auto largest = difference_from_onnx_runtime(other.path(), yaml, walker, **policy);
  if (!largest) GTEST_SKIP() << "NOT COMPARED: ONNX Runtime is not installed (./dev test installs it)";
  EXPECT_LE(*largest, kTolerance);
}

// Goal: what a kind fixes is asked of whatever is bound to it. Method: the linear velocity's input by other kinds.
TEST_F(LeappPolicy, AKindsQuantityIsAskedOfTheSensor) {
  const std::string good = config::read_file(yaml_).value();
  const auto refusal = [&](const std::string& kind, const std::string& connection, const std::string& sensor) {
    std::ofstream(yaml_) << replaced(replaced(good, "kind: state/body/linear_velocity", "kind: " + kind),
                                     "isaaclab_connection: state:robot:root_lin_vel_b", connection);
    const auto policy = load_robot_policy(robot(replaced(filled_, "unit: m/s, frame: base", sensor)));
    return policy ? "" : policy.error();
  };
  const std::string by_name = "isaaclab_connection: state:robot:";
  const auto wants = [](const std::string& refused, const char* what) {
    EXPECT_NE(refused.find(what), std::string::npos) << refused;
  };
  wants(refusal("state/wrench", by_name + "wrench", "unit: kg"), "wants a sensor whose unit is N, Nm;");
  EXPECT_EQ(refusal("state/wrench", by_name + "wrench", "unit: \"N, Nm\""), "");
  wants(refusal("state/body/linear_velocity", by_name + "root_lin_vel_w", "unit: m/s"),
        "wants a sensor whose unit is m/s and whose frame is world;");
  EXPECT_EQ(refusal("state/body/linear_velocity", by_name + "root_lin_vel_w", "unit: m/s, frame: world"), "");
  wants(refusal("state/body/linear_acceleration", by_name + "body_lin_acc_b", "unit: m/s2"),
        "and whose frame is body;");
  EXPECT_EQ(refusal("state/body/linear_acceleration", by_name + "body_lin_acc_b", "unit: m/s^2, frame: body"), "");
  // Whose it is the bundle does not say; what it is, it does.
  wants(refusal("state/body/position", "isaaclab_connection: null", "unit: kg"), "wants a sensor whose unit is m;");
  EXPECT_EQ(refusal("state/body/position", "isaaclab_connection: null", "unit: m"), "");
  EXPECT_EQ(refusal("state/vector3d", by_name + "target", "unit: kg"), "") << "no quantity";
}

TEST_F(LeappPolicy, ABundleMayBeCalledYml) {
  const std::string yml = directory_.path("walk.yml");
  std::filesystem::copy_file(yaml_, yml);
  const auto policy = load_robot_policy(robot(replaced(filled_, yaml_, yml)));
  ASSERT_TRUE(policy) << policy.error();
  EXPECT_EQ(config::policy_files(yml).size(), 3U) << "networks and start values are in its hash";
  EXPECT_FALSE(load_robot_policy(robot(replaced(replaced(filled_, yaml_, yml), "order: xyzw", "order: wxyz"))));
}

TEST_F(LeappPolicy, SaysWhatEachInputIsBoundTo) {
  EXPECT_EQ(binding_lines(described_bundle(yaml_), robot(filled_)),
            (std::vector<std::string>{
                "base_velocity: command base_velocity, 4 values",
                "robot_root_lin_vel_b: sensor odometry, 3 values, m/s, frame base",
                "robot_root_ang_vel_b: base_angular_velocity by sensor imu, rad/s, base frame",
                "robot_root_quat_w: base_orientation by sensor imu, base in world, x y z w",
                "robot_joint_pos: joint_position of 29 joints, rad",
                "robot_joint_vel: joint_velocity of 29 joints, rad/s",
            }));
}

TEST_F(LeappPolicy, ABindingThatContradictsTheExporterIsRefused) {
  const struct {
    const char *when, *from, *to, *says;
  } deviations[] = {
      {"an input that nothing feeds", "base_velocity, robot_root_lin_vel_b, ", "base_velocity, ",
       "input robot_root_lin_vel_b is bound to nothing"},
      {"two inputs exchanged", "robot_root_lin_vel_b, robot_root_ang_vel_b",
       "robot_root_ang_vel_b, robot_root_lin_vel_b",
       "input robot_root_ang_vel_b is the base's angular velocity, rad/s, base frame (state/body/angular_velocity), "
       "and wants a term base_angular_velocity, or a sensor whose unit is rad/s"},
      {"the quaternion in another order", "order: xyzw", "order: wxyz", "in the order xyzw, the term says wxyz"},
      {"a sensor of another unit", "unit: m/s", "unit: km/h", "wants a sensor whose unit is m/s"},
      {"a sensor of no unit", ", unit: m/s", "", "wants a sensor whose unit is m/s"},
      {"a sensor of no frame", ", frame: base", "", "wants a sensor whose unit is m/s and whose frame is base"},
      {"a sensor of another frame", "frame: base", "frame: world", "and whose frame is base"},
      {"a joint that the robot does not have", "left_knee_joint", "left_shin",
       "does not have, the first is left_knee_joint; call the robot's joints there as the policy does"},
      {"positions from home", "term: joint_position }", "term: joint_position_relative }",
       "wants a term joint_position"},
      {"scaled", "term: joint_velocity }", "term: joint_velocity, scale: 0.1 }", "wants it as it is: drop scale"},
      {"clipped", "term: joint_velocity }", "term: joint_velocity, clip: [-1, 1] }", "wants it as it is: drop scale"},
      {"joints exchanged", "joint_order: [left_hip_pitch_joint, right_hip_pitch_joint",
       "joint_order: [right_hip_pitch_joint, left_hip_pitch_joint",
       "left_hip_pitch_joint at place 1, right_hip_pitch_joint in the robot's file"},
      {"gains that go nowhere", "kp: \"joint_pos_kp_gains\", ", "",
       "output joint_pos_kp_gains (kp) goes nowhere: name it in policy.action.outputs.kp"},
      {"legs exchanged", "    joints: [left_hip_pitch_joint, right_hip_pitch_joint",
       "    joints: [right_hip_pitch_joint, left_hip_pitch_joint",
       "output joint_pos is of left_hip_pitch_joint at place 1"},
      {"targets from home", "offset: zero", "offset: home", "gives targets as they are"},
      {"another period", "  period: 20 ms", "  period: 10 ms", "exported to infer every 20 ms, policy.period is 10 ms"},
      {"a term across two inputs", "robot_joint_pos, robot_joint_vel", "robot_joint_vel, robot_joint_pos",
       "input robot_joint_vel is joint velocities"},
      {"no such output", "output: \"joint_pos\"", "output: \"joints\"", "no output named joints"},
  };
  for (const auto& deviation : deviations) {
    SCOPED_TRACE(deviation.when);
    const auto policy = load_robot_policy(robot(replaced(filled_, deviation.from, deviation.to)));
    ASSERT_FALSE(policy);
    EXPECT_NE(policy.error().find(deviation.says), std::string::npos) << policy.error();
    EXPECT_EQ(policy.error().find('\n'), std::string::npos);
  }
}

TEST_F(LeappPolicy, ABundleThatIsNotAsItWasExportedIsRefused) {
  const std::string good = config::read_file(yaml_).value();
  const RobotConfig walker = robot(filled_);
  const auto refusal = [&](const std::string& text) {
    std::ofstream(yaml_) << text;
    const auto policy = load_robot_policy(walker);
    return policy ? std::string("none") : policy.error();
  };
  const struct {
    const char *when, *from, *to, *says;
  } deviations[] = {
      {"no hash", "sha256sum:", "sha1sum:", "has no sha256sum of walk.onnx"},
      {"another backend", "backend: onnx", "backend: jit", "is for backend jit, which is not run here"},
      {"a network elsewhere", "model_path: walk.onnx", "model_path: ../walk.onnx",
       "model_path ../walk.onnx is not beside it"},
      {"a network that is gone", "model_path: walk.onnx", "model_path: walk2.onnx", "walk2.onnx: is not there"},
      {"no start values", "  initial_values: walk_initial_values.safetensors\n", "",
       "has feedback and no initial_values"},
      {"integers", "name: last_action_in\n      dtype: float32", "name: last_action_in\n      dtype: int64",
       "is int64; only float32 is read"},
      {"another shape", "- 4\n      type: tensor\n      kind: command", "- 5\n      type: tensor\n      kind: command",
       "input base_velocity of model walk has another shape in walk.onnx"},
      {"another name", "base_velocity", "basis_velocity", "input basis_velocity of model walk is not in walk.onnx"},
  };
  for (const auto& deviation : deviations) {
    SCOPED_TRACE(deviation.when);
    const std::string said = refusal(replaced(good, deviation.from, deviation.to));
    EXPECT_NE(said.find(deviation.says), std::string::npos) << said;
  }
  ASSERT_EQ(refusal(good), "none");
  const std::string sha256 = good.substr(good.find("sha256sum: ") + 11, 64);
  std::string upper = sha256;
  for (char& c : upper) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  EXPECT_EQ(refusal(replaced(good, sha256, upper)), "none") << "hexadecimal, in either case";
  const std::string model = directory_.path("walk.onnx");
  std::ofstream(model, std::ios::app | std::ios::binary) << '\0';
  EXPECT_NE(refusal(good).find("is not the bundle's"), std::string::npos) << refusal(good);
}

TEST_F(LeappPolicy, StartValuesAreReadOrRefused) {
  const std::string start = directory_.path("walk_initial_values.safetensors");
  const std::string good = test::text_of(start);
  const RobotConfig walker = robot(filled_);
  const auto refusal = [&](const std::string& bytes) {
    std::ofstream(start, std::ios::binary) << bytes;
    const auto policy = load_robot_policy(walker);
    return policy ? std::string("none") : policy.error();
  };
  EXPECT_NE(refusal("").find("no safetensors file"), std::string::npos);
  EXPECT_NE(refusal(good.substr(0, 40)).find("cut short"), std::string::npos);
  EXPECT_NE(refusal(good.substr(0, good.size() - 4)).find("points outside the file"), std::string::npos);
  EXPECT_NE(refusal(replaced(good, "F32", "F64")).find("is no float32 tensor"), std::string::npos);
  EXPECT_NE(refusal(replaced(good, "last_action_in", "last_action_on"))
                .find("has no start value of its shape for "
                      "walk/last_action_in"),
            std::string::npos);
  std::string broken = good;
  const float not_a_number = NAN;
  std::memcpy(broken.data() + broken.size() - 4, &not_a_number, 4);
  EXPECT_NE(refusal(broken).find("holds a value that is NaN"), std::string::npos);
  EXPECT_EQ(refusal(good), "none");
}

TEST_F(LeappPolicy, ItsHashCoversNetworksAndStartValues) {
  const auto before = config::policy_hash(yaml_).value();
  EXPECT_EQ(config::policy_files(yaml_),
            (std::vector<std::string>{yaml_, directory_.path("walk.onnx"),
                                      directory_.path("walk_initial_values.safetensors")}));
  std::ofstream(directory_.path("walk_initial_values.safetensors"), std::ios::app) << ' ';
  EXPECT_NE(config::policy_hash(yaml_).value(), before);
}

TEST_F(LeappPolicy, APublishedOneIsImportedLikeIt) {
  const std::string published = "../shared/policies/agile_leapp/Velocity-G1-v0.yaml";
  TAKT_NEEDS_SHARED(published);
  test::TemporaryDirectory other;
  const std::string yaml = make_bundle(other.path(), published);
  // But for names, the same text: shapes, kinds, joints and what is left open.
  std::string text = imported_bundle(published);
  std::string own = imported_bundle(yaml_);
  const auto without_file = [](std::string& robot) {
    robot.erase(robot.find("  file: "), robot.find("  period: ") - robot.find("  file: "));
  };
  without_file(text), without_file(own);
  EXPECT_EQ(text, own);
  const RobotConfig walker = loaded(other.path(), filled_in(imported_bundle(yaml)));
  const auto policy = load_robot_policy(walker);
  ASSERT_TRUE(policy) << policy.error();
  EXPECT_TRUE(check_fit(walker, **policy));
}

}  // namespace
}  // namespace takt::policy_host
