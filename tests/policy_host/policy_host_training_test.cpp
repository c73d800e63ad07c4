// SPDX-License-Identifier: Apache-2.0
// Goal: each committed network, its training report and its robot file belong together. Method: hash the network, write
// down again every number of the robot file that training read, and run the report's own examples through our engine.
// When this fails after a change to a robot file: train again, the report holds the command.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "policy_host/flow/flow_policy.hpp"
#include "policy_host/observation_builder.hpp"
#include "policy_host/onnx_policy.hpp"
#include "policy_host/policy_fit.hpp"
#include "tests/support/files.hpp"

namespace takt::policy_host {
namespace {

using test::text_of;

std::string numbers(std::initializer_list<double> values) {
  std::string line;
  for (const double value : values) line += fmt::format(" {:.9g}", value);
  return line;
}

std::string numbers(const config::Vector3& v) {
  return numbers({v[0], v[1], v[2]});
}

// The lines that train_reach.py's facts() writes.
std::vector<std::string> facts(const config::RobotConfig& robot) {
  std::vector<std::string> lines;
  for (const config::Joint& joint : robot.joints) {
    const config::Limits& limits = joint.limits;
    lines.push_back("joint " + joint.name +
                    numbers({joint.home, limits.q_min + limits.position_margin, limits.q_max - limits.position_margin,
                             limits.velocity}));
  }
  for (const config::Link& link : robot.model->links) {
    lines.push_back(fmt::format("link {} {}", link.joint, link.parent) + numbers(link.origin_xyz) +
                    numbers(link.origin_rpy) + numbers(link.axis));
  }
  lines.push_back(fmt::format("tool {}", robot.model->tool_link) + numbers(robot.model->tool_xyz));
  const config::Policy& policy = *robot.policy;
  lines.push_back("policy" + numbers({policy.period.seconds(), policy.step_period.seconds()}) +
                  fmt::format(" {} {} {}", policy.steps, policy.input, policy.output));
  for (const config::ObservationTerm& term : policy.observation) {
    lines.push_back(fmt::format("term {} {}", config::name(term.kind), term.sensor.empty() ? "-" : term.sensor) +
                    numbers({term.scale.front()}) + fmt::format(" {}", term.history));
  }
  const config::Simulation& simulation = *robot.simulation;
  lines.push_back("camera" + numbers({simulation.camera_period.seconds(), simulation.camera_delay.seconds(),
                                      simulation.camera_jitter.seconds()}));
  lines.push_back("centre" + numbers(simulation.target_centre));
  lines.push_back("amplitude" + numbers(simulation.target_amplitude));
  lines.push_back("frequency" + numbers(simulation.target_frequency));
  return lines;
}

void expect_examples(Policy& network, const nlohmann::json& report, double tolerance) {
  const auto inputs = report["examples"]["inputs"].get<std::vector<std::vector<float>>>();
  const auto outputs = report["examples"]["outputs"].get<std::vector<std::vector<double>>>();
  ASSERT_GE(inputs.size(), 4U);
  ASSERT_EQ(inputs.size(), outputs.size());
  std::vector<float> result(network.output_size());
  for (std::size_t example = 0; example < inputs.size(); ++example) {
    ASSERT_EQ(inputs[example].size(), network.input_size());
    network.infer(inputs[example], result);
    ASSERT_EQ(outputs[example].size(), result.size());
    for (std::size_t i = 0; i < result.size(); ++i) {
      const double wanted = outputs[example][i];
      EXPECT_NEAR(static_cast<double>(result[i]), wanted, tolerance * std::max(1.0, std::abs(wanted)))
          << "example " << example << " value " << i;
    }
  }
}

void expect_examples(const config::RobotConfig& robot, const nlohmann::json& report) {
  ASSERT_TRUE(check_policy_section(robot));
  auto policy = load_robot_policy(robot);
  ASSERT_TRUE(policy) << policy.error();
  const auto fits = check_fit(robot, **policy);
  ASSERT_TRUE(fits) << fits.error();
  auto network = load_onnx_policy(robot.policy->file, network_input(*robot.policy), robot.policy->output);
  ASSERT_TRUE(network) << network.error();
  // A flow's velocity is a difference of two chunks over what is left of the time.
  expect_examples(**network, report, robot.policy->sampler ? 1e-3 : 1e-5);
}

// A robot file and a training report of config/, without their endings.
class Report {
 protected:
  void read(const std::string& robot, const std::string& report) {
    auto loaded = config::load("config/" + robot + ".yaml");
    ASSERT_TRUE(loaded) << loaded.error();
    robot_ = *std::move(loaded);
    ASSERT_NO_THROW(report_ = nlohmann::json::parse(text_of("config/" + report + ".training.json")));
  }
  config::RobotConfig robot_;
  nlohmann::json report_;
};

// The parameter: an arm's robot file.
class TrainingReport : public testing::TestWithParam<const char*>, protected Report {
 protected:
  void SetUp() override { read(GetParam(), std::string(GetParam()) + "_reach"); }
};

TEST_P(TrainingReport, DescribesThisNetwork) {
  EXPECT_EQ(config::sha256_hex(text_of(robot_.policy->file)), report_["onnx_sha256"].get<std::string>());
}

TEST_P(TrainingReport, DescribesThisRobot) {
  const auto lines = facts(robot_);
  EXPECT_EQ(lines, report_["configuration"].get<std::vector<std::string>>());
  std::string joined;
  for (const std::string& line : lines) joined += (joined.empty() ? "" : "\n") + line;
  EXPECT_EQ(config::sha256_hex(joined), report_["configuration_sha256"].get<std::string>());
}

TEST_P(TrainingReport, ItsExamplesComeOutOfOurEngine) {
  expect_examples(robot_, report_);
}

// The lines that cart_pole_model.py's facts_of() writes.
std::vector<std::string> cart_pole_facts(const config::RobotConfig& robot) {
  std::vector<std::string> lines;
  for (const config::Joint& joint : robot.joints) lines.push_back("joint " + joint.name + numbers({joint.home}));
  const config::Joint& cart = robot.joints[0];
  lines.push_back("drive" + numbers({cart.kp, cart.kd, cart.limits.torque, cart.inertia}));
  const config::Simulation& simulation = *robot.simulation;
  const config::CartPole& machine = *simulation.cart_pole;
  lines.push_back("cart_pole" + numbers({machine.pulley_radius, machine.cart_mass, machine.pole_mass, machine.pole_com,
                                         machine.pole_inertia}));
  const config::Policy& policy = *robot.policy;
  lines.push_back("policy" + numbers({policy.period.seconds(), policy.step_period.seconds()}) +
                  fmt::format(" {} {} {}", policy.steps, policy.input, policy.output));
  for (const config::ObservationTerm& term : policy.observation)
    lines.push_back(fmt::format("term {} {}", config::name(term.kind), term.sensor.empty() ? "-" : term.sensor) +
                    numbers({term.scale.front()}));
  lines.push_back("camera" + numbers({simulation.camera_period.seconds(), simulation.camera_delay.seconds(),
                                      simulation.camera_jitter.seconds()}));
  lines.push_back("steps" + numbers({simulation.step_amplitude, simulation.step_period.seconds()}));
  return lines;
}

class CartPoleReport : public testing::Test, protected Report {
 protected:
  void SetUp() override { read("cart_pole", "cart_pole_balance"); }
};

TEST_F(CartPoleReport, DescribesThisNetworkAndThisRobot) {
  EXPECT_EQ(config::sha256_hex(text_of(robot_.policy->file)), report_["onnx_sha256"].get<std::string>());
  EXPECT_EQ(cart_pole_facts(robot_), report_["configuration"].get<std::vector<std::string>>());
}

TEST_F(CartPoleReport, ItsExamplesComeOutOfOurEngine) {
  expect_examples(robot_, report_);
}

TEST_F(CartPoleReport, TheFallbackIsTheRegulatorOfTheseMechanics) {
  const auto gains = report_["fallback_gains"].get<std::vector<double>>();
  const config::FeedbackRow& row = robot_.fallbacks.at(0).gains.at(0);
  for (std::size_t joint = 0; joint < 2; ++joint) {
    EXPECT_NEAR(row.position.at(joint), gains.at(joint), 0.01 * std::abs(gains.at(joint)));
    EXPECT_NEAR(row.velocity.at(joint), gains.at(2 + joint), 0.01 * std::abs(gains.at(2 + joint)));
  }
}

TEST_F(CartPoleReport, ClaimsABalancingPolicy) {
  const auto& evaluation = report_["evaluation"];
  EXPECT_EQ(evaluation["policy"]["fell"].get<double>(), 0.0);
  EXPECT_EQ(evaluation["hold"]["fell"].get<double>(), 1.0);
  EXPECT_LT(evaluation["policy"]["rms_m"].get<double>(), 1.1 * evaluation["teacher"]["rms_m"].get<double>());
}

// What the attribute holds that follows `place` in the MJCF.
std::string attribute(const std::string& model, std::string_view place, const std::string& name) {
  const std::size_t begin = model.find(" " + name + "=\"", model.find(place)) + name.size() + 3;
  return model.substr(begin, model.find('"', begin) - begin);
}

// The lines that balancer_model.py's load() writes.
std::vector<std::string> balancer_facts(const config::RobotConfig& robot) {
  const std::string model = text_of(robot.simulation->mujoco->model);
  constexpr const char *kBase = "<inertial", *kWheel = "left_wheel_body";
  std::vector<std::string> lines{
      "mass " + attribute(model, kBase, "mass"),
      "inertia " + attribute(model, kBase, "diaginertia"),
      "wheel " + attribute(model, kWheel, "pos"),
      "wheel_mass " + attribute(model, kWheel, "mass"),
      "wheel_inertia " + attribute(model, kWheel, "diaginertia"),
      "armature " + attribute(model, kWheel, "armature"),
      "size " + attribute(model, kWheel, "size"),
  };
  const config::Joint& wheel = robot.joints[0];
  lines.push_back("drive" + numbers({wheel.kd, wheel.limits.torque}));
  const config::Policy& policy = *robot.policy;
  lines.push_back("policy" + numbers({policy.period.seconds()}) + fmt::format(" {} {}", policy.input, policy.output) +
                  numbers({policy.action.scale.front()}));
  for (const config::ObservationTerm& term : policy.observation)
    lines.push_back(fmt::format("term {} {}", config::name(term.kind), term.sensor.empty() ? "-" : term.sensor) +
                    numbers({term.scale.front()}));
  const config::CommandLimits& command = *robot.sensors.back().command;
  std::string limits = "command";
  for (const auto& values : {command.minimum, command.maximum})
    for (const double value : values) limits += numbers({value});
  lines.push_back(limits);
  return lines;
}

class BalancerReport : public testing::Test, protected Report {
 protected:
  void SetUp() override { read("balancer", "balancer"); }
};

TEST_F(BalancerReport, DescribesThisNetworkAndThisRobot) {
  EXPECT_EQ(config::sha256_hex(text_of(robot_.policy->file)), report_["onnx_sha256"].get<std::string>());
  EXPECT_EQ(balancer_facts(robot_), report_["configuration"].get<std::vector<std::string>>());
}

TEST_F(BalancerReport, ItsExamplesComeOutOfOurEngine) {
  expect_examples(robot_, report_);
}

TEST_F(BalancerReport, ClaimsABalancingPolicy) {
  for (const char* latency : {"10 ms", "20 ms", "40 ms"})
    EXPECT_EQ(report_["evaluation"][latency]["fell"].get<int>(), 0) << latency;
}

// A policy that denoises: what make_flow.py read is what the others read, the scale of the outputs, and how far its two
// ways are apart.
class FlowReport : public testing::Test, protected Report {
 protected:
  void SetUp() override { read("cart_pole_flow", "cart_pole_flow"); }
};

TEST_F(FlowReport, DescribesThisNetworkAndThisRobot) {
  EXPECT_EQ(config::sha256_hex(text_of(robot_.policy->file)), report_["onnx_sha256"].get<std::string>());
  const auto lines = cart_pole_facts(robot_);
  auto read = report_["configuration"].get<std::vector<std::string>>();
  ASSERT_EQ(read.size(), lines.size() + 1);
  EXPECT_EQ(read.back().find("flow" + numbers({robot_.policy->action.scale.front()}) + " "), 0U) << read.back();
  read.pop_back();
  EXPECT_EQ(lines, read);
}

TEST_F(FlowReport, ItsExamplesComeOutOfOurEngine) {
  expect_examples(robot_, report_);
}

TEST_F(FlowReport, ClaimsTwoWaysAndToKeepToTheOneThatIsBeingGone) {
  const auto& ways = report_["evaluation"]["ways"];
  EXPECT_GT(ways["prefix 0"]["second_way"].get<double>(), 0.3);
  EXPECT_LT(ways["prefix 0"]["second_way"].get<double>(), 0.7);
  EXPECT_LT(ways["prefix 0"]["kept_way"].get<double>(), 0.7) << "without a prefix it cannot know";
  EXPECT_GT(ways["prefix 10"]["kept_way"].get<double>(), 0.95);
  for (const char* prefix : {"prefix 0", "prefix 10"})
    EXPECT_LT(ways[prefix]["from_the_nearer"].get<double>(), 0.05 * ways[prefix]["between_the_ways"].get<double>());
  const auto& loop = report_["evaluation"]["closed_loop"];
  EXPECT_EQ(loop["delay 0"]["fell"].get<double>(), 0.0);
  EXPECT_GT(loop["delay 10"]["fell"].get<double>(), 0.5);
  EXPECT_EQ(loop["delay 10, prefix"]["fell"].get<double>(), 0.0);
}

// The same of arms: what make_arm_flow.py read is what train_reach.py reads, and the joint that tells the postures
// apart.
class ArmFlowReport : public testing::TestWithParam<const char*>, protected Report {
 protected:
  void SetUp() override { read(GetParam(), GetParam()); }
};

TEST_P(ArmFlowReport, DescribesThisNetworkAndThisRobot) {
  EXPECT_EQ(config::sha256_hex(text_of(robot_.policy->file)), report_["onnx_sha256"].get<std::string>());
  auto read = report_["configuration"].get<std::vector<std::string>>();
  EXPECT_EQ(read.back().find("flow" + numbers({robot_.policy->action.scale.front()}) + " "), 0U) << read.back();
  read.pop_back();
  EXPECT_EQ(facts(robot_), read);
}

TEST_P(ArmFlowReport, ItsExamplesComeOutOfOurEngine) {
  expect_examples(robot_, report_);
}

TEST_P(ArmFlowReport, ClaimsTwoPosturesOnTheTargetAndToKeepToTheOneThatIsBeingGoneTo) {
  const auto& evaluation = report_["evaluation"];
  for (const auto& missed : evaluation["demonstrator_p95_m"]) EXPECT_LT(missed.get<double>(), 0.002);
  const auto& ways = evaluation["ways"];
  EXPECT_GT(ways["prefix 0 ms"]["second_way"].get<double>(), 0.2);
  EXPECT_LT(ways["prefix 0 ms"]["second_way"].get<double>(), 0.8);
  EXPECT_GT(ways["prefix 200 ms"]["kept_way"].get<double>(), 0.95);
  for (const char* prefix : {"prefix 0 ms", "prefix 200 ms"})
    EXPECT_LT(ways[prefix]["from_the_nearer"].get<double>(), 0.05 * ways[prefix]["between_the_ways"].get<double>());
  const auto& loop = evaluation["closed_loop"];
  EXPECT_LT(loop["200 ms, prefix"]["rms_m"].get<double>(), 0.5 * loop["200 ms"]["rms_m"].get<double>());
}

INSTANTIATE_TEST_SUITE_P(Arms, ArmFlowReport, testing::Values("arm6_flow", "arm6_visuomotor_flow"),
                         [](const auto& robot) { return std::string(robot.param); });

TEST_P(TrainingReport, ClaimsATrackingPolicy) {
  const auto& evaluation = report_["evaluation"]["robot_file_target"];
  EXPECT_LT(evaluation["policy"]["median_m"].get<double>(), 0.02);
  EXPECT_LT(evaluation["policy"]["median_m"].get<double>(), 0.1 * evaluation["hold_home"]["median_m"].get<double>());
}

INSTANTIATE_TEST_SUITE_P(Arms, TrainingReport, testing::Values("arm6", "arm6_visuomotor"),
                         [](const auto& robot) { return std::string(robot.param); });

// docs/examples/python-sensor/look.onnx: images as the camera of that example draws them, through the observation that
// a robot file describes.
TEST(LookReport, TheNetworkFindsTheSpotAndItsExamplesComeOutOfOurEngine) {
  constexpr std::size_t kHeight = 48, kWidth = 64, kSpot = 8;
  const std::string folder = "docs/examples/python-sensor/";
  const auto report = nlohmann::json::parse(text_of(folder + "look.training.json"));
  EXPECT_EQ(config::sha256_hex(text_of(folder + "look.onnx")), report["onnx_sha256"].get<std::string>());
  EXPECT_LT(report["evaluation"]["median_pixels"], 1.0);
  config::RobotConfig robot = config::load("config/arm6.yaml").value();
  robot.sensors.push_back({.name = "cam0", .timeout = milliseconds(100), .image = config::ImageShape{48, 64, 1}});
  config::Policy& policy = *robot.policy;
  policy.file = folder + "look.onnx";
  policy.input = "obs,image";
  policy.observation.resize(1);  // q - home
  config::ObservationTerm& image = policy.observation.emplace_back(policy.observation.front());
  image.kind = config::TermKind::sensor;
  image.sensor = "cam0";
  const auto network = load_robot_policy(robot);
  ASSERT_TRUE(network) << network.error();
  ASSERT_TRUE(check_fit(robot, **network));
  ObservationBuilder builder(robot);
  std::vector<SensorSample> samples(robot.sensors.size());
  std::vector<std::span<const std::uint8_t>> images(robot.sensors.size());
  std::vector<float> output((*network)->output_size());
  for (const auto& example : report["examples"]) {
    std::vector<std::uint8_t> pixels(kHeight * kWidth, 16);
    for (std::size_t row = example["row"]; row < example["row"].get<std::size_t>() + kSpot; ++row)
      std::fill_n(pixels.begin() + static_cast<std::ptrdiff_t>(row * kWidth + example["column"].get<std::size_t>()),
                  kSpot, std::uint8_t{240});
    images.back() = pixels;
    ++samples.back().sequence;
    Observation observation;
    for (std::size_t j = 0; j < robot.joints.size(); ++j)
      observation.q[j] = static_cast<float>(robot.joints[j].home) + example["q"][j].get<float>();
    (*network)->infer(builder.build(observation, samples, {}, images), output);
    for (std::size_t i = 0; i < output.size(); ++i)
      EXPECT_NEAR(output[i], example["outputs"][i].get<float>(), 1e-5F) << example["column"] << " value " << i;
  }
}

}  // namespace
}  // namespace takt::policy_host
