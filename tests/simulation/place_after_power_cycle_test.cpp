// SPDX-License-Identifier: Apache-2.0
// Goal: no joint is armed whose reading is off from where it truly stands by more than 0.05 rad, whenever its drive was
// without supply; a drive that knows its place is armed without a question.
// Method: tick, drivers and simulated drives in virtual time, one joint on a flywheel; every kind of drive, places at
// random inside the joint's limits, a power cycle before a run, between two (the joint moved by hand meanwhile) and
// during one. Zeros are set as `takt bus zero` sets them. Where a drive needs a user's word it gets a true one, once,
// as the executive takes notes. The oracle is the plant's true position.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <random>
#include <string>

#include "commissioning/discovery.hpp"
#include "commissioning/home_place.hpp"
#include "config/load.hpp"
#include "drivers/protocol/home_note.hpp"
#include "simulation/free_inertias.hpp"
#include "simulation/robot_plant.hpp"
#include "tests/simulation/whole_loop.hpp"

namespace takt::simulation {
namespace {

using config::PositionAfterPowerUp;

struct Kind {
  const char* name;
  std::size_t joint;  // of config/dual_arm12.yaml
  PositionAfterPowerUp worth;
  bool takes_zero = false;  // has a frame for it
  double limit = 0;         // rad, both ways; 0: the file's
  const char* model = "";   // "": the file's
  bool knows = true;        // its place, but for turns that its limits tell apart
};
constexpr auto kAbsolute = PositionAfterPowerUp::absolute, kUnknown = PositionAfterPowerUp::unknown,
               kTurn = PositionAfterPowerUp::within_a_turn, kSeveral = PositionAfterPowerUp::one_of_several;
constexpr Kind kKinds[] = {
    {"damiao", 0, kTurn, true},    {"damiao, 400 deg", 0, kTurn, true, 3.49, "", false},
    {"t-motor", 2, kAbsolute},     {"t-motor, one encoder", 2, kSeveral, false, 0, "", false},
    {"robstride", 3, kTurn, true}, {"cybergear", 3, kUnknown, false, 0, "CyberGear", false},
    {"odrive", 4, kAbsolute},      {"odrive, incremental", 4, kUnknown, false, 0, "", false},
    {"cia402", 7, kAbsolute},      {"cia402, incremental", 7, kUnknown, false, 0, "", false},
    {"moteus", 9, kAbsolute},
};

config::RobotConfig lone(const Kind& kind) {
  config::RobotConfig robot = config::load("config/dual_arm12.yaml").value();
  robot.joints = {robot.joints[kind.joint]};
  robot.buses = {robot.buses[robot.joints[0].bus]};
  config::Joint& only = robot.joints[0];
  only.bus = 0;
  only.drive.position_after_power_up = kind.worth;
  only.drive.places_per_turn = 9;
  if (*kind.model != '\0') only.drive.model = kind.model;
  if (kind.limit > 0) {
    only.limits.q_min = -kind.limit;
    only.limits.q_max = kind.limit;
  }
  only.home = 0;
  robot.fallbacks.clear();
  robot.degraded.fallback = "none";
  robot.model.reset();
  return robot;
}

// One joint and its drive, over several runs of an executive.
class Bench {
 public:
  explicit Bench(const Kind& kind) : robot_(lone(kind)), plant_(Plant::on_free_inertias(robot_).value()) {
    loop().run(300);
  }
  [[nodiscard]] const config::Limits& limits() const { return robot_.joints[0].limits; }

  // Joint side, as a right reading has it.
  void stand_at(double place) {
    ArmState state = plant_.state();
    state.q[0] = place + zero_;
    plant_.set_state(state);
  }
  [[nodiscard]] double place() const { return plant_.state().q[0] - zero_; }
  void power_cycle() { plant_.drive(0).power_cycle(plant_.now()); }
  // While no executive runs.
  void power_cycle_unheard() {
    power_cycle();
    Frames unheard;
    for (int i = 0; i < 400; ++i) {
      plant_.step();
      plant_.collect(plant_.bus_of(0), unheard);
    }
  }

  // As `takt bus zero` does, or without the frame that saves.
  void set_zero_here(bool and_save = true) {
    const auto frames = commissioning::zero_frames(robot_.joints[0].drive);
    Frames said;
    plant_.step();
    for (std::size_t i = 0; i < (and_save ? frames.size() : 1); ++i) plant_.receive(plant_.bus_of(0), frames[i], said);
    zero_ = plant_.state().q[0];
  }

  // As `takt joint home` does, by a user who is right. False: refused.
  bool home() {
    auto heard = loop();
    heard.run(600);
    const config::Joint& joint = robot_.joints[0];
    if (const auto frame = commissioning::home_frame(joint, place())) {
      Frames said;
      plant_.receive(plant_.bus_of(0), *frame, said);
      return true;
    }
    const auto shift = commissioning::shift_between(joint, double{heard.joint(0).feedback.q}, place());
    if (!shift) return false;
    note_ = drivers::HomeNote{.shift = *shift, .left_at = double{heard.joint(0).feedback.q} + *shift};
    return true;
  }

  // A start of the executive, which uses up what was said before it.
  test::WholeLoop loop() {
    const std::optional<drivers::HomeNote> notes[] = {std::exchange(note_, {})};
    test::WholeLoop made(drivers::homed_robot(robot_, notes), plant_);
    if (notes[0])
      made.driver(0).assume_home(static_cast<float>(notes[0]->left_at), drivers::may_have_moved(robot_.joints[0]));
    return made;
  }
  [[nodiscard]] double off(const test::WholeLoop& loop) const {
    return std::abs(double{loop.joint(0).feedback.q} - place());
  }

 private:
  config::RobotConfig robot_;
  Plant plant_;
  double zero_ = 0;
  std::optional<drivers::HomeNote> note_;
};

enum class When { before, between, during };

struct Outcome {
  bool armed = false;
  double off = 0;                // rad
  std::string why;               // it was not
  bool asks_with_right = false;  // it was moved while an executive did not hear it
};

// Its drive boots, an executive starts, and arming is tried; `when` a run is over, or goes on, again.
Outcome power_cycle_and_arm(const Kind& kind, When when, std::mt19937& random) {
  Bench bench(kind);
  const auto somewhere = [&] {
    return std::uniform_real_distribution<double>(bench.limits().q_min, bench.limits().q_max)(random);
  };
  const auto arm = [&bench](test::WholeLoop& loop) {
    Outcome outcome;
    outcome.armed = loop.arm();
    outcome.off = bench.off(loop);
    if (!outcome.armed) outcome.why = loop.blockers();
    EXPECT_TRUE(outcome.armed || outcome.why.find("its drive") != std::string::npos ||
                outcome.why.find("the drive reports a fault") != std::string::npos)
        << outcome.why;
    return outcome;
  };
  if (kind.takes_zero && random() % 2 == 0) {
    bench.stand_at(somewhere());
    bench.set_zero_here();
  }
  bench.stand_at(somewhere());
  bench.power_cycle_unheard();
  if (!kind.knows) {
    bench.stand_at(bench.place() + (bench.place() > 0 ? -0.3 : 0.3));
    EXPECT_TRUE(bench.home()) << kind.name;
  }
  auto first = bench.loop();
  Outcome outcome = arm(first);
  EXPECT_TRUE(outcome.armed) << kind.name << " was told or knows: " << outcome.why;
  if (when == When::before) return outcome;
  EXPECT_LE(outcome.off, 0.05) << kind.name;
  if (when == When::between) {
    bench.stand_at(somewhere());
    bench.power_cycle_unheard();
    auto second = bench.loop();
    return arm(second);
  }
  const bool is_moved = random() % 2 == 0;
  bench.power_cycle();
  if (is_moved) bench.stand_at(somewhere());
  first.run(1500);
  first.tick(OperatorRequest::reset);
  first.run(100);
  EXPECT_EQ(first.mode(), Mode::standby) << kind.name;
  outcome = arm(first);
  outcome.asks_with_right = is_moved;
  return outcome;
}

TEST(PlaceAfterPowerCycle, NoJointIsArmedThatReadsElsewhere) {
  struct Count {
    int armed = 0, wrong = 0, asked = 0, cases = 0;
  };
  std::mt19937 random(7);
  std::map<std::string, Count> counts;
  Count all, knowing;
  for (int i = 0; i < 200; ++i) {
    const Kind& kind = kKinds[static_cast<std::size_t>(i) % std::size(kKinds)];
    for (const When when : {When::before, When::between, When::during}) {
      const Outcome outcome = power_cycle_and_arm(kind, when, random);
      const bool wrong = outcome.armed && outcome.off > 0.05;
      EXPECT_FALSE(wrong) << kind.name << ", case " << i << ", off by " << outcome.off;
      for (Count* const count :
           {&all, &counts[kind.name], kind.knows && !outcome.asks_with_right ? &knowing : nullptr}) {
        if (count == nullptr) continue;
        ++count->cases;
        count->armed += outcome.armed ? 1 : 0;
        count->wrong += wrong ? 1 : 0;
        count->asked += outcome.armed ? 0 : 1;
      }
    }
  }
  for (const auto& [name, count] : counts)
    std::printf("%-22s %3d power cycles: %3d armed, %d elsewhere\n", name.c_str(), count.cases, count.armed,
                count.wrong);
  std::printf("%d power cycles: %d armed, %d elsewhere; of %d of drives that know their place %d asked\n", all.cases,
              all.armed, all.wrong, knowing.cases, knowing.asked);
  EXPECT_EQ(all.wrong, 0);
  EXPECT_LE(20 * knowing.asked, knowing.cases);
}

// Goal: what `takt bus zero` sets is there again, and what another tool set and did not save is missed.
TEST(PlaceAfterPowerCycle, AZeroThatWasSavedIsThereAgain) {
  for (const bool is_saved : {true, false}) {
    Bench bench(kKinds[4]);  // RobStride
    bench.stand_at(0.8);
    auto loop = bench.loop();
    loop.run(500);
    bench.set_zero_here(is_saved);
    loop.run(500);
    bench.stand_at(0.4);
    loop.run(500);
    bench.power_cycle();
    loop.run(1000);
    EXPECT_EQ(loop.arm(), is_saved);
    EXPECT_EQ(bench.off(loop) <= 0.01, is_saved) << bench.off(loop);
  }
}

// As delivered a RobStride begins at 0 to 2 pi: a joint below its zero reads a turn more.
TEST(PlaceAfterPowerCycle, AJointBelowZeroIsArmedAndHeldWhereItStands) {
  for (const std::size_t kind : {0U, 4U}) {
    Bench bench(kKinds[kind]);
    bench.stand_at(-0.7);
    bench.power_cycle();
    auto loop = bench.loop();
    loop.pose[0] = -0.7F;
    ASSERT_TRUE(loop.arm()) << kKinds[kind].name;
    loop.run(2000);
    EXPECT_NEAR(bench.place(), -0.7, 0.02) << kKinds[kind].name;
    EXPECT_EQ(loop.mode(), Mode::tracking) << kKinds[kind].name;
  }
}

// The report that began it: +-200 deg, at -190 deg it says 170 deg.
TEST(PlaceAfterPowerCycle, AJointThatMayStandInTwoTurnsWaitsForAWord) {
  const Kind& wide = kKinds[1];
  Bench bench(wide);
  bench.stand_at(-3.316);
  bench.power_cycle();
  auto loop = bench.loop();
  EXPECT_FALSE(loop.arm());
  EXPECT_NEAR(double{loop.joint(0).feedback.q}, 2.967, 0.01) << "what it says";
  EXPECT_EQ(drivers::kind_of(loop.joint(0).feedback.error_code), drivers::SetupFault::home_unknown);
  ASSERT_TRUE(bench.home());
  auto again = bench.loop();
  again.pose[0] = -3.3F;
  EXPECT_TRUE(again.arm());
  EXPECT_LE(bench.off(again), 0.01);
}

// What lets it be told is that it moves to where one turn alone is possible.
TEST(PlaceAfterPowerCycle, InDoubtAJointMayBeMovedByHandToWhereThereIsNone) {
  Bench bench(kKinds[1]);
  bench.stand_at(-3.316);
  bench.power_cycle();
  auto loop = bench.loop();
  loop.run(1000);
  for (double place = -3.3; place < -1; place += 0.01) {
    bench.stand_at(place);
    loop.run(2);
  }
  loop.run(1000);
  EXPECT_TRUE(loop.arm());
  EXPECT_LE(bench.off(loop), 0.01);
}

// Goal: a word on a drive that counts from where it was switched on does not outlive its supply. Method: the word, then
// a power cycle and another place before the start.
TEST(PlaceAfterPowerCycle, AWordOnADriveThatWasSwitchedOffSinceIsNone) {
  for (const Kind& kind : {kKinds[5], kKinds[7], kKinds[9]}) {
    Bench bench(kind);
    bench.power_cycle();
    bench.loop().run(600);
    if (kind.joint != 4) {
      EXPECT_FALSE(bench.home()) << kind.name << ": it reads what it would read anywhere";
    }
    bench.stand_at(0.5);
    ASSERT_TRUE(bench.home()) << kind.name;
    bench.power_cycle();
    bench.stand_at(-0.4);
    auto loop = bench.loop();
    EXPECT_FALSE(loop.arm()) << kind.name;
    bench.stand_at(-0.1);
    ASSERT_TRUE(bench.home()) << kind.name;
    auto again = bench.loop();
    EXPECT_TRUE(again.arm()) << kind.name;
    EXPECT_LE(bench.off(again), 0.01) << kind.name;
  }
}

}  // namespace
}  // namespace takt::simulation
