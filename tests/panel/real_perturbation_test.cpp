// Goal: what a perturbation becomes with real processes is understood by the programs that are told, names the right
// victim at the right time, and is drawn from the seed; what has no mechanism says so. Method: every kind at its
// moderate dose, through the readers of `takt run --at` and of the simulator's scenarios.
#include "monitor/panel/real_perturbation.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "config/load.hpp"
#include "drivers/plant/scenario.hpp"
#include "monitor/cli/scenario.hpp"

namespace takt::panel {
namespace {

class RealPerturbation : public ::testing::Test {
 protected:
  void SetUp() override {
    auto robot = config::load("config/arm6.yaml");
    ASSERT_TRUE(robot.has_value()) << robot.error();
    robot_ = std::move(*robot);
  }
  static Perturbation moderate(const PerturbationKind& kind) {
    return {kind.trouble, kind.moderate, seconds(3), seconds(2)};
  }
  std::vector<cli::Event> events_of(const Perturbation& perturbation, std::uint64_t seed = 1) {
    const auto trouble = real_trouble_of(perturbation, robot_, seed);
    EXPECT_TRUE(trouble.has_value()) << trouble.error();
    const auto events = cli::parse_scenario(trouble->actions);
    EXPECT_TRUE(events.has_value()) << events.error();
    return *events;
  }
  config::RobotConfig robot_;
};

TEST_F(RealPerturbation, EveryMechanismIsUnderstoodAndActsInsideItsWindow) {
  for (const PerturbationKind& kind : perturbation_kinds().subspan(1)) {
    if (!has_real_mechanism(kind.trouble)) continue;
    const auto trouble = real_trouble_of(moderate(kind), robot_, 1);
    ASSERT_TRUE(trouble.has_value()) << kind.name << ": " << trouble.error();
    EXPECT_NE(trouble->actions.empty(), trouble->plant_scenario.empty()) << kind.name;
    for (const cli::Event& event : events_of(moderate(kind))) {
      EXPECT_GE(event.at, seconds(3)) << kind.name;
      EXPECT_LE(event.at, seconds(5)) << kind.name;
    }
    if (trouble->plant_scenario.empty()) continue;
    const auto scenario = plant::parse_scenario(trouble->plant_scenario, std::string(kind.name), robot_);
    ASSERT_TRUE(scenario.has_value()) << scenario.error();
    for (const plant::FaultEvent& event : scenario->events) {
      EXPECT_EQ(event.at, seconds(3)) << kind.name;
      EXPECT_TRUE(event.after_enabled) << kind.name;
      EXPECT_TRUE(event.lasts.has_value()) << kind.name;
    }
  }
}

TEST_F(RealPerturbation, NominalRolloutsAreLeftAlone) {
  const auto trouble = real_trouble_of({}, robot_, 1);
  ASSERT_TRUE(trouble.has_value());
  EXPECT_TRUE(trouble->actions.empty() && trouble->plant_scenario.empty());
}

TEST_F(RealPerturbation, PreemptionHitsTheControlThreadAtInstantsOfTheSeed) {
  const Perturbation perturbation = moderate(*find_perturbation("scheduler_preemption"));
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
  const auto events = events_of(moderate(*find_perturbation("policy_crash")));
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[0].action, cli::ActionKind::kill);
  EXPECT_EQ(events[1].action, cli::ActionKind::start);
  EXPECT_EQ(events[1].at, seconds(5));
}

TEST_F(RealPerturbation, DosesThatNoRealMachineCanTakeAreRefused) {
  const auto refused = [&](Trouble trouble, double dose) {
    return !real_trouble_of({trouble, dose, seconds(3), seconds(2)}, robot_, 1).has_value();
  };
  EXPECT_TRUE(refused(Trouble::scheduler_preemption, 51));
  EXPECT_TRUE(refused(Trouble::inference_stall, 1000));
  EXPECT_TRUE(refused(Trouble::inference_mean_shift, 1));
  EXPECT_FALSE(refused(Trouble::scheduler_preemption, 50));
  robot_.control.cpu.reset();
  EXPECT_TRUE(refused(Trouble::scheduler_preemption, 8));
}

}  // namespace
}  // namespace takt::panel
