// SPDX-License-Identifier: Apache-2.0
// Goal: what a perturbation becomes with real processes is understood by the programs that are told, names the right
// victim at the right time, and is drawn from the seed; what has no mechanism says so. Method: every kind at its
// moderate dose, through the readers of `takt run --at`, of the simulator's scenarios and of the policy host's faults.
#include "evidence/rollout/real_perturbation.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "cli/run/scenario.hpp"
#include "config/load.hpp"
#include "evidence/rollout/troubled_dynamics.hpp"
#include "policy_host/host_faults.hpp"
#include "simulation/scenario.hpp"

namespace takt::lab {
namespace {

class RealPerturbation : public ::testing::Test {
 protected:
  void SetUp() override {
    auto robot = config::load("config/arm6.yaml");
    ASSERT_TRUE(robot.has_value()) << robot.error();
    robot_ = std::move(*robot);
  }
  static evidence::Perturbation moderate(const trouble::Row& kind) {
    return {kind.as<evidence::Trouble>(), kind.dose.moderate, seconds(3), seconds(2)};
  }
  std::vector<cli::Event> events_of(const evidence::Perturbation& perturbation, std::uint64_t seed = 1) {
    const auto trouble = evidence::real_trouble_of(perturbation, robot_, seed);
    EXPECT_TRUE(trouble.has_value()) << trouble.error();
    const auto events = cli::parse_scenario(trouble->actions);
    EXPECT_TRUE(events.has_value()) << events.error();
    return *events;
  }
  config::RobotConfig robot_;
};

// Those that a machine cannot do to a robot, or not every machine.
bool is_refused(evidence::Trouble trouble) {
  return trouble == evidence::Trouble::estimator_delay || trouble == evidence::Trouble::gpu_contention;
}

TEST_F(RealPerturbation, EveryMechanismIsUnderstoodAndActsInsideItsWindow) {
  for (const trouble::Row& kind : evidence::perturbation_kinds().subspan(1)) {
    if (is_refused(kind.as<evidence::Trouble>())) continue;
    const auto trouble = evidence::real_trouble_of(moderate(kind), robot_, 1);
    ASSERT_TRUE(trouble.has_value()) << kind.name << ": " << trouble.error();
    EXPECT_EQ(!trouble->actions.empty() + !trouble->plant_scenario.empty() + !trouble->policy_faults.empty(), 1)
        << kind.name;
    for (const cli::Event& event : events_of(moderate(kind))) {
      EXPECT_GE(event.at, seconds(3)) << kind.name;
      EXPECT_LE(event.at, seconds(5)) << kind.name;
    }
    const auto faults = policy_host::parse_host_faults(trouble->policy_faults);
    ASSERT_TRUE(faults.has_value()) << faults.error();
    for (const policy_host::HostFaultWindow& fault : *faults) {
      EXPECT_EQ(fault.from, seconds(3)) << kind.name;
      EXPECT_EQ(fault.length, seconds(2)) << kind.name;
    }
    if (trouble->plant_scenario.empty()) continue;
    const auto scenario = simulation::parse_scenario(trouble->plant_scenario, std::string(kind.name), robot_);
    ASSERT_TRUE(scenario.has_value()) << scenario.error();
    for (const simulation::FaultEvent& event : scenario->events) {
      EXPECT_GE(event.at, seconds(3)) << kind.name;
      EXPECT_LT(event.at, seconds(5)) << kind.name;
      EXPECT_TRUE(event.after_enabled) << kind.name;
      EXPECT_TRUE(event.lasts.has_value()) << kind.name;
    }
  }
}

TEST_F(RealPerturbation, WhatHasNoMechanismIsRefusedByName) {
  for (const trouble::Row& kind : evidence::perturbation_kinds()) {
    if (!is_refused(kind.as<evidence::Trouble>())) continue;
    const auto trouble = evidence::real_trouble_of(moderate(kind), robot_, 1);
    ASSERT_FALSE(trouble.has_value()) << kind.name;
    EXPECT_EQ(trouble.error().find(std::string(kind.name) + ": "), 0U) << trouble.error();
  }
}

// Goal: what acts besides is refused and not left out. Method: lost frames beside a crash.
TEST_F(RealPerturbation, WhatActsBesidesIsRefused) {
  evidence::Perturbation both = moderate(*evidence::find_perturbation("policy_crash"));
  both.with = {moderate(*evidence::find_perturbation("can_loss"))};
  const auto trouble = evidence::real_trouble_of(both, robot_, 1);
  ASSERT_FALSE(trouble.has_value());
  EXPECT_EQ(trouble.error(), "policy_crash: its `with` acts in virtual time only");
}

TEST_F(RealPerturbation, SensorsSufferWhereTheSimulatorPlaysThem) {
  const evidence::Perturbation lies = moderate(*evidence::find_perturbation("sensor_lies"));
  EXPECT_EQ(evidence::simulated_sensors(robot_), std::vector<std::string>{"target"});
  robot_.simulation->camera_sensor.clear();
  EXPECT_EQ(evidence::real_trouble_of(lies, robot_, 1).error(),
            "sensor_lies: the simulator plays none of the robot's sensors");
  const config::RobotConfig balancer = config::load("config/balancer.yaml").value();
  EXPECT_EQ(evidence::simulated_sensors(balancer), std::vector<std::string>{"base_imu"})
      << "a person's command is none of its";
  for (const char* kind : {"sensor_lies", "sensor_burst", "sensor_dropout", "camera_freeze"}) {
    const auto trouble = evidence::real_trouble_of(moderate(*evidence::find_perturbation(kind)), balancer, 1);
    ASSERT_TRUE(trouble) << trouble.error();
    EXPECT_NE(trouble->plant_scenario.find("sensor: base_imu"), std::string::npos) << trouble->plant_scenario;
  }
}

TEST_F(RealPerturbation, ThePushIsTheOneOfVirtualTime) {
  const auto trouble = evidence::real_trouble_of(moderate(*evidence::find_perturbation("push")), robot_, 7);
  ASSERT_TRUE(trouble.has_value()) << trouble.error();
  const auto scenario = simulation::parse_scenario(trouble->plant_scenario, "push", robot_);
  ASSERT_EQ(scenario.value().events.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const simulation::FaultEvent& event = scenario->events[i];
    EXPECT_EQ(event.at, seconds(3) + evidence::kRepeat * static_cast<std::int64_t>(i));
    EXPECT_EQ(event.dose, 30);
    const config::Vector3 drawn = evidence::push_direction(7, static_cast<std::int64_t>(i) + 1);
    for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_NEAR(event.along[axis], drawn[axis], 1e-12);
  }
}

TEST_F(RealPerturbation, TheHogComesEveryTenthOfASecond) {
  const auto events = events_of(moderate(*evidence::find_perturbation("cpu_hog")), 3);
  ASSERT_EQ(events.size(), 20U);
  for (std::size_t i = 0; i < events.size(); ++i) {
    EXPECT_EQ(events[i].process, cli::ProcessName::executive);
    EXPECT_EQ(events[i].length, milliseconds(20));
    if (i > 0) {
      EXPECT_EQ((events[i].at - events[i - 1].at).ns / 1000, evidence::kHogEvery.ns / 1000);
    }
  }
}

TEST_F(RealPerturbation, NominalRolloutsAreLeftAlone) {
  const auto trouble = evidence::real_trouble_of({}, robot_, 1);
  ASSERT_TRUE(trouble.has_value());
  EXPECT_TRUE(trouble->actions.empty() && trouble->plant_scenario.empty() && trouble->policy_faults.empty());
}

TEST_F(RealPerturbation, PreemptionHitsTheControlThreadAtInstantsOfTheSeed) {
  const evidence::Perturbation perturbation = moderate(*evidence::find_perturbation("scheduler_preemption"));
  const auto events = events_of(perturbation, 1);
  EXPECT_EQ(events.size(), 20U);  // ten per second
  for (const cli::Event& event : events) {
    EXPECT_EQ(event.action, cli::ActionKind::hog);
    EXPECT_EQ(event.process, cli::ProcessName::executive);
    EXPECT_EQ(event.length, milliseconds(8));
  }
  const auto same = [](const cli::Event& a, const cli::Event& b) { return a.at == b.at; };
  EXPECT_TRUE(std::ranges::equal(events, events_of(perturbation, 1), same));
  EXPECT_FALSE(std::ranges::equal(events, events_of(perturbation, 2), same));
}

TEST_F(RealPerturbation, ACrashedPolicyComesBackAfterTheDose) {
  const auto events = events_of(moderate(*evidence::find_perturbation("policy_crash")));
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[0].action, cli::ActionKind::kill);
  EXPECT_EQ(events[1].action, cli::ActionKind::start);
  EXPECT_EQ(events[1].at, seconds(5));
}

TEST_F(RealPerturbation, DosesThatNoRealMachineCanTakeAreRefused) {
  const auto refused = [&](evidence::Trouble trouble, double dose) {
    return !evidence::real_trouble_of({trouble, dose, seconds(3), seconds(2)}, robot_, 1).has_value();
  };
  EXPECT_TRUE(refused(evidence::Trouble::scheduler_preemption, 51));
  EXPECT_TRUE(refused(evidence::Trouble::inference_stall, 1000));
  EXPECT_TRUE(refused(evidence::Trouble::inference_mean_shift, 1));
  EXPECT_TRUE(refused(evidence::Trouble::cpu_hog, 51));
  EXPECT_TRUE(refused(evidence::Trouble::rt_throttling, 300)) << "the kernel keeps 50 ms";
  EXPECT_TRUE(refused(evidence::Trouble::queue_growth, 201));
  EXPECT_TRUE(refused(evidence::Trouble::publish_delay, 0));
  EXPECT_TRUE(refused(evidence::Trouble::can_delay, 2000)) << "the simulator delays by a second at most";
  EXPECT_FALSE(refused(evidence::Trouble::scheduler_preemption, 50));
  EXPECT_FALSE(refused(evidence::Trouble::inference_mean_shift, 65));
  EXPECT_EQ(evidence::real_trouble_of({evidence::Trouble::inference_mean_shift, 66, seconds(3), seconds(2)}, robot_, 1)
                .error(),
            "inference_mean_shift: with real processes the factor is from 2 to 65");
  EXPECT_EQ(
      evidence::real_trouble_of({evidence::Trouble::queue_growth, 201, seconds(3), seconds(2)}, robot_, 1).error(),
      "queue_growth: the policy host cannot do it: 201 callbacks is out of range; `queue_growth` takes 1 to 200 "
      "callbacks; write 'TIME for LENGTH: queue_growth CALLBACKS'");
  robot_.control.cpu.reset();
  EXPECT_TRUE(refused(evidence::Trouble::scheduler_preemption, 8));
}

}  // namespace
}  // namespace takt::lab
