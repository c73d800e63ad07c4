// SPDX-License-Identifier: Apache-2.0
// Goal: whatever strikes and whenever, the wire and the true motion keep the contract (oracles.hpp). Method: the
// executive's own loop and drivers in a simulated world, many seeded schedules of ten simulated seconds; what breaks a
// promise is shortened to the events that it takes, and told with one command. Faults planted between executive and
// bus, and in what the tick is told of stops, show that each oracle bites.
//
// Before, each happening strikes alone, whatever it can strike: so every cause of the reaction table is met, but for
// our own bugs. Which cause led out of which mode, is printed.
//
// TAKT_SEED=N explores one schedule, TAKT_KEEP=0,2 only these of its events; TAKT_SEEDS=N how many (default 150).
// TAKT_SHORTEN=0 leaves out the shortening, for who only asks which promises break (tests/mutants).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <ctime>
#include <numeric>
#include <random>
#include <sstream>
#include <string_view>

#include "executive/pipeline/mode_machine.hpp"
#include "tests/exploration/oracles.hpp"

namespace takt::exploration {
namespace {

constexpr Duration kLasting = seconds(10);

using Seen = std::set<std::pair<Mode, Cause>>;

std::string explore(const config::RobotConfig& robot, std::uint64_t seed, const std::vector<Event>& events,
                    Seen* seen = nullptr, Planted planted = Planted::none, StopBook::Met* ways = nullptr) {
  World world(robot, events, seed, planted);
  const Oracles oracles(world);
  world.run(kLasting);
  if (seen != nullptr) seen->insert(oracles.seen().begin(), oracles.seen().end());
  if (ways != nullptr) ways->insert(oracles.ways().begin(), oracles.ways().end());
  return oracles.broken();
}

std::vector<Event> chosen(const std::vector<Event>& all, const std::vector<std::size_t>& keep) {
  std::vector<Event> events;
  for (const std::size_t i : keep) events.push_back(all.at(i));
  return events;
}

// Leaves out what the broken promise does not need, one event after the other.
std::vector<std::size_t> shortened(const config::RobotConfig& robot, std::uint64_t seed,
                                   const std::vector<Event>& all) {
  std::vector<std::size_t> keep(all.size());
  std::iota(keep.begin(), keep.end(), 0);
  for (std::size_t i = 0; i < all.size(); ++i) {
    std::vector<std::size_t> fewer = keep;
    std::erase(fewer, i);
    if (!explore(robot, seed, chosen(all, fewer)).empty()) keep = std::move(fewer);
  }
  return keep;
}

std::string story(const config::RobotConfig& robot, std::uint64_t seed, const std::vector<Event>& all) {
  const std::vector<std::size_t> keep = shortened(robot, seed, all);
  std::string list, events;
  for (const std::size_t i : keep) {
    list += (list.empty() ? "" : ",") + std::to_string(i);
    events += "\n  " + text(all[i]);
  }
  return fmt::format(
      "seed {}, {} of {} events:{}\nagain: TAKT_SEED={} TAKT_KEEP={} build/release/bin/exploration_test "
      "--gtest_filter=*{}",
      seed, keep.size(), all.size(), events, seed, list, testing::UnitTest::GetInstance()->current_test_info()->name());
}

const char* setting(const char* name) {
  return std::getenv(name);
}

// Each row of the table that reacts anywhere does so in some mode, but for our own bugs.
void expect_every_cause(const Seen& seen) {
  for (const pipeline::Reaction& row : pipeline::kReactions) {
    const auto is_met = [&row](const std::pair<Mode, Cause>& one) { return one.second == row.cause; };
    // fallback_spent: TwoPoliciesKeepTheContract; the next two: ARobotThatMindsKeepsTheContract; feedback_implausible:
    // no drive lies here, see WrongFeedback of simulated_drives_test; following: ARobotThatMindsKeepsTheContract, too;
    // contract_violated: APolicyThatIsLateAgainAndAgainKeepsTheContract.
    if (row.severity == 0 || row.cause == Cause::internal_error || row.cause == Cause::fallback_spent ||
        row.cause == Cause::temperature_high || row.cause == Cause::degraded_spent ||
        row.cause == Cause::feedback_implausible || row.cause == Cause::following_error ||
        row.cause == Cause::following_lost || row.cause == Cause::contract_violated)
      continue;
    EXPECT_TRUE(std::ranges::any_of(seen, is_met)) << name(row.cause) << " was never met";
  }
}

// Seeds of a test: those that were asked for, else `usual` of them.
std::pair<std::uint64_t, std::uint64_t> seeds(std::uint64_t usual) {
  if (setting("TAKT_SEED") != nullptr) return {std::stoull(setting("TAKT_SEED")), 1};
  return {1, setting("TAKT_SEEDS") != nullptr ? std::stoull(setting("TAKT_SEEDS")) : usual};
}

// Of a drawn schedule, the events that were asked for.
std::vector<Event> kept(const std::vector<Event>& events) {
  const char* const keep = setting("TAKT_KEEP");
  if (keep == nullptr) return events;
  std::vector<std::size_t> numbers;
  std::istringstream list(keep);
  for (std::string number; std::getline(list, number, ',');) numbers.push_back(std::stoull(number));
  return chosen(events, numbers);
}

std::string told(const std::string& problem, const config::RobotConfig& robot, std::uint64_t seed,
                 const std::vector<Event>& events) {
  const bool shortens = setting("TAKT_SHORTEN") == nullptr || std::string_view(setting("TAKT_SHORTEN")) != "0";
  return problem + "\n" + (shortens ? story(robot, seed, events) : "");
}

TEST(Exploration, EveryScheduleKeepsTheContract) {
  const config::RobotConfig robot = small_robot();
  const auto [first, count] = seeds(150);
  Seen seen;
  int broken = 0;
  double explored = 0;
  const std::clock_t began = std::clock();
  for (std::uint64_t seed = first; seed < first + count; ++seed) {
    const std::vector<Event> events = kept(draw(seed, robot.joints.size(), robot.buses.size(), kLasting));
    const std::string problem = explore(robot, seed, events, &seen);
    ++explored;
    if (problem.empty()) continue;
    ADD_FAILURE() << told(problem, robot, seed, events);
    if (++broken == 5) break;
  }
  // Ten simulated seconds are ten thousand ticks: what bounds it is the executive's own tick and its records.
  const double taken_s = static_cast<double>(std::clock() - began) / CLOCKS_PER_SEC;
  fmt::print("{:.0f} schedules per minute and core, {:.1f} us a tick; {} pairs of mode and cause were met:\n",
             60 * explored / taken_s, 1e6 * taken_s / explored * robot.control.period.seconds() / kLasting.seconds(),
             seen.size());
  for (const auto& [mode, cause] : seen) fmt::print("  {} by {}\n", name(mode), name(cause));
}

// A general schedule, some of whose events are such as stop a robot in one way or another, or end a way of stopping.
std::vector<Event> draw_stops(std::uint64_t seed, const config::RobotConfig& robot) {
  constexpr std::array kStopping{
      Happening::operator_stop,   Happening::policy_nonsense,  Happening::late_wake_ups, Happening::policy_silent,
      Happening::fallback_silent, Happening::base_leans,       Happening::imu_silent,    Happening::recorder_ends,
      Happening::drive_hot,       Happening::bus_has_stranger, Happening::shove};
  std::vector<Event> events = draw(seed, robot.joints.size(), robot.buses.size(), kLasting);
  std::mt19937_64 random(~seed);
  for (std::size_t i = 0; i < events.size(); i += random() % 3 == 0 ? 2U : 1U) {
    events[i].what = kStopping.at(random() % kStopping.size());
    if (!is_of_joint(events[i].what) && !is_of_bus(events[i].what)) continue;
    events[i].index %= is_of_bus(events[i].what) ? robot.buses.size() : robot.joints.size();
  }
  return events;
}

// Goal: however a robot file says that its robot stops, the stop goes on as the file and docs/design.md say, for as
// long as they say, and nothing else is lost. Method: the same oracles and those of stop_book.hpp; robot and schedule
// are drawn from one seed. Every way of stopping is met, as is the end by its time of each that has one.
TEST(Exploration, EveryWayOfStoppingKeepsTheContract) {
  using config::StopHow;
  StopBook::Met ways;
  Seen seen;
  int broken = 0;
  const auto [first, count] = seeds(200);
  for (std::uint64_t seed = first; seed < first + count && broken < 5; ++seed) {
    const config::RobotConfig robot = robot_that_stops(seed);
    const std::vector<Event> events = kept(draw_stops(seed, robot));
    const std::string problem = explore(robot, seed, events, &seen, Planted::none, &ways);
    if (problem.empty()) continue;
    ADD_FAILURE() << told(problem, robot, seed, events);
    ++broken;
  }
  if (setting("TAKT_SEED") != nullptr || setting("TAKT_SEEDS") != nullptr) return;
  for (const StopHow how : {StopHow::rest, StopHow::damping, StopHow::hold, StopHow::policy})
    EXPECT_TRUE(ways.contains({how, false})) << static_cast<int>(how);
  for (const StopHow how : {StopHow::hold, StopHow::policy})
    EXPECT_TRUE(ways.contains({how, true})) << static_cast<int>(how) << " never ended by its time";
  EXPECT_TRUE(seen.contains({Mode::degraded, Cause::degraded_spent}));
}

// Goal: gains that a policy leaves out, hands that hold a joint and let go, candidates, joins and every way of stopping
// do not make a joint move but as its limits say. Method: the same oracles, above all those on true motion; robot and
// schedule are drawn from one seed.
TEST(Exploration, NoJointIsThrown) {
  Seen seen;
  int broken = 0;
  const auto [first, count] = seeds(100);
  for (std::uint64_t seed = first; seed < first + count && broken < 5; ++seed) {
    const config::RobotConfig robot = robot_at_random(seed);
    const std::vector<Event> events =
        kept(draw_motion(seed, robot.joints.size(), robot.buses.size(), kLasting, {.candidate = seed % 3 == 0}));
    const std::string problem = explore(robot, seed, events, &seen);
    if (problem.empty()) continue;
    ADD_FAILURE() << told(problem, robot, seed, events);
    ++broken;
  }
}

// Goal: a joint whose feedback lies moves the robot out of no frame's limits, and stops it no worse. Method: as above,
// with a lie in each schedule. A lie that shows has to be found; of the others the joint's own motion is not judged.
TEST(Exploration, ALieInFeedbackKeepsTheContract) {
  Seen seen;
  int broken = 0;
  const auto [first, count] = seeds(60);
  for (std::uint64_t seed = first; seed < first + count && broken < 5; ++seed) {
    const config::RobotConfig robot = robot_at_random(seed);
    const std::vector<Event> events =
        kept(draw_motion(seed, robot.joints.size(), robot.buses.size(), kLasting, {.lies = true}));
    const std::string problem = explore(robot, seed, events, &seen);
    if (problem.empty()) continue;
    ADD_FAILURE() << told(problem, robot, seed, events);
    ++broken;
  }
}

TEST(Exploration, EveryHappeningAloneKeepsTheContractAndEveryCauseIsMet) {
  const config::RobotConfig robot = small_robot();
  Seen seen;
  for (unsigned i = 0; i < kHappenings; ++i) {
    const auto what = static_cast<Happening>(i);
    // What is drawn for motion says nothing new of a joint that another joint does not say.
    const bool is_of_each = what < Happening::no_stiffness;
    const std::size_t count = is_of_bus(what)                   ? robot.buses.size()
                              : is_of_joint(what) && is_of_each ? robot.joints.size()
                                                                : 1;
    for (std::size_t nth = 0; nth < count; ++nth) {
      const std::size_t index = is_of_each ? nth : i % robot.joints.size();
      // Before arming; while the policy moves the robot, shortly and for long.
      for (const Event& event :
           {Event{what, {}, milliseconds(2500), index}, Event{what, seconds(3), milliseconds(160), index},
            Event{what, seconds(3), milliseconds(2500), index}})
        EXPECT_EQ(explore(robot, i, {event}, &seen), "") << text(event);
    }
  }
  expect_every_cause(seen);
}

// Goal: a drive written to every few ticks changes none of that. Method: the same oracles and schedules.
TEST(Exploration, DrivesAtADividedRateKeepTheContract) {
  const config::RobotConfig robot = robot_with_turns();
  Seen seen;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const std::vector<Event> events = draw(seed, robot.joints.size(), robot.buses.size(), kLasting);
    EXPECT_EQ(explore(robot, seed, events, &seen), "") << story(robot, seed, events);
  }
  EXPECT_TRUE(seen.contains({Mode::tracking, Cause::operator_stop}));
}

// Goal: nor does a robot that heat degrades, that is degraded for so long only, and that stops where a joint is held.
// Method: as above, with its drives hot, its policy silent, a joint in a hand.
TEST(Exploration, ARobotThatMindsKeepsTheContract) {
  const config::RobotConfig robot = robot_that_minds();
  Seen seen;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    std::vector<Event> events = draw(seed, robot.joints.size(), robot.buses.size(), kLasting);
    for (std::size_t i = 0; i < events.size(); ++i) {
      events[i].what = (seed + i) % 3 == 0 ? Happening::drive_hot : Happening::policy_silent;
      events[i].index = 0;
    }
    EXPECT_EQ(explore(robot, seed, events, &seen), "") << story(robot, seed, events);
  }
  const std::vector<Event> silent{{Happening::policy_silent, seconds(3), seconds(3)}};
  EXPECT_EQ(explore(robot, 1, silent, &seen), "");
  const std::vector<Event> held{{Happening::hand_holds, seconds(3), seconds(3)},
                                {Happening::asks_far, milliseconds(3100), seconds(2)}};
  EXPECT_EQ(explore(robot, 1, held, &seen), "");
  for (const auto& [mode, cause] :
       {std::pair{Mode::degraded, Cause::degraded_spent}, std::pair{Mode::tracking, Cause::temperature_high},
        std::pair{Mode::tracking, Cause::following_lost}})
    EXPECT_TRUE(seen.contains({mode, cause})) << name(mode) << " by " << name(cause);
}

// Goal: with a second policy nothing of that is lost, it does take over, and the tick tells whose frames left. Method:
// the same oracles, which know each policy's gains; schedules of both falling silent, and the general ones.
TEST(Exploration, TwoPoliciesKeepTheContract) {
  const config::RobotConfig robot = robot_with_fallback();
  Seen seen;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    std::vector<Event> events = draw(seed, robot.joints.size(), robot.buses.size(), kLasting);
    for (std::size_t i = 0; i < events.size(); i += 2)
      events[i].what = (seed + i) % 3 == 0 ? Happening::fallback_silent : Happening::policy_silent;
    EXPECT_EQ(explore(robot, seed, events, &seen), "") << story(robot, seed, events);
  }
  const std::vector<Event> both{{Happening::policy_silent, seconds(3), seconds(3)},
                                {Happening::fallback_silent, milliseconds(3300), seconds(3)}};
  EXPECT_EQ(explore(robot, 1, both, &seen), "");
  for (const auto& [mode, cause] :
       {std::pair{Mode::tracking, Cause::command_late}, std::pair{Mode::degraded, Cause::contract_restored},
        std::pair{Mode::degraded, Cause::command_lost}, std::pair{Mode::degraded, Cause::fallback_spent}})
    EXPECT_TRUE(seen.contains({mode, cause})) << name(mode) << " by " << name(cause);
}

// Goal: lateness that no silence shows is found, and breaks no promise. Method: a max_age of 25 ms, where each answer
// is used until its successor comes, 32 ms old.
TEST(Exploration, APolicyThatIsLateAgainAndAgainKeepsTheContract) {
  config::RobotConfig robot = small_robot();
  robot.freshness.max_age = milliseconds(25);
  Seen seen;
  EXPECT_EQ(explore(robot, 1, {}, &seen), "");
  EXPECT_TRUE(seen.contains({Mode::tracking, Cause::contract_violated}));
  EXPECT_FALSE(seen.contains({Mode::tracking, Cause::command_late}));
}

// Goal: an IMU that is cut, frozen, late or lying stops the robot as lost, and no frame on the way there leaves the
// envelope. Method: each of the four while the robot tracks, in front of every oracle.
class AnImuThatFails : public testing::TestWithParam<Happening> {};

TEST_P(AnImuThatFails, IsLostAndNoFrameLeavesTheEnvelope) {
  const config::RobotConfig robot = small_robot();
  Seen seen;
  const Event event{GetParam(), seconds(3), milliseconds(2500)};
  EXPECT_EQ(explore(robot, 1, {event}, &seen), "");
  EXPECT_TRUE(seen.contains({Mode::tracking, Cause::imu_lost}));
  EXPECT_TRUE(seen.contains({Mode::damped_stop, Cause::operator_reset})) << "and it is over when the IMU is back";
}

INSTANTIATE_TEST_SUITE_P(Each, AnImuThatFails,
                         testing::Values(Happening::imu_silent, Happening::imu_frozen, Happening::imu_late,
                                         Happening::imu_lies));

TEST(Exploration, TheSameSeedTellsTheSameStory) {
  const config::RobotConfig robot = small_robot();
  const std::vector<Event> events = draw(7, robot.joints.size(), robot.buses.size(), kLasting);
  const auto motion = [&] {
    World world(robot, events, 7);
    world.run(kLasting);
    return world.plant().state().q;
  };
  EXPECT_EQ(motion(), motion());
}

TEST(Exploration, TheLoopsEndTakesTheTorque) {
  const config::RobotConfig robot = small_robot();
  World world(robot, {}, 1);
  bool was_permitted = false;
  world.on_tick = [&](const TickRecord& record) {
    was_permitted |= record.header.mode == Mode::tracking && world.is_torque_permitted();
  };
  world.run(seconds(2));
  EXPECT_TRUE(was_permitted);
  EXPECT_FALSE(world.is_torque_permitted());
}

struct Bites {
  Planted planted;
  const char* oracle;
};

class ExplorationBites : public testing::TestWithParam<Bites> {};

TEST_P(ExplorationBites, APlantedFaultIsFound) {
  const config::RobotConfig robot = small_robot();
  std::string found;
  for (std::uint64_t seed = 1; seed <= 300 && !found.starts_with(GetParam().oracle); ++seed)
    found = explore(robot, seed, draw(seed, robot.joints.size(), robot.buses.size(), kLasting), nullptr,
                    GetParam().planted);
  EXPECT_TRUE(found.starts_with(GetParam().oracle)) << found;
}

// The same, of what the tick is told of stops.
class ExplorationBitesInStops : public testing::TestWithParam<Bites> {};

TEST_P(ExplorationBitesInStops, APlantedFaultIsFound) {
  std::string found;
  for (std::uint64_t seed = 1; seed <= 300 && !found.starts_with(GetParam().oracle); ++seed) {
    const config::RobotConfig robot = robot_that_stops(seed);
    found = explore(robot, seed, draw_stops(seed, robot), nullptr, GetParam().planted);
  }
  EXPECT_TRUE(found.starts_with(GetParam().oracle)) << found;
}

// The same, of what the tick is told of limits and rest: true motion shows it.
class ExplorationBitesInMotion : public testing::TestWithParam<Bites> {};

TEST_P(ExplorationBitesInMotion, APlantedFaultIsFound) {
  std::string found;
  for (std::uint64_t seed = 1; seed <= 300 && !found.starts_with(GetParam().oracle); ++seed) {
    const config::RobotConfig robot = robot_at_random(seed);
    found = explore(robot, seed, draw_motion(seed, robot.joints.size(), robot.buses.size(), kLasting, {}), nullptr,
                    GetParam().planted);
  }
  EXPECT_TRUE(found.starts_with(GetParam().oracle)) << found;
}

INSTANTIATE_TEST_SUITE_P(Each, ExplorationBitesInMotion,
                         testing::Values(Bites{Planted::led_when_lost, "thrown"},
                                         Bites{Planted::fast_limits, "too_fast"},
                                         Bites{Planted::sudden_limits, "too_sudden"},
                                         Bites{Planted::early_rest, "reset_rests"}));

INSTANTIATE_TEST_SUITE_P(Each, ExplorationBitesInStops,
                         testing::Values(Bites{Planted::stops_without_end, "stop_ends"},
                                         Bites{Planted::degraded_without_end, "degraded_ends"},
                                         Bites{Planted::stiff_damping, "stop_ends"},
                                         Bites{Planted::policy_in_any_stop, "stop_by_policy"}));

INSTANTIATE_TEST_SUITE_P(
    Each, ExplorationBites,
    testing::Values(Bites{Planted::old_frames, "command_age"}, Bites{Planted::sign, "too_sudden"},
                    Bites{Planted::stays_enabled, "standby_still"}, Bites{Planted::doubled_torque, "torque_slew"},
                    Bites{Planted::no_stop, "stop_wins"}, Bites{Planted::deaf_to_recorder, "recorded"},
                    Bites{Planted::wide_frames, "frame_limits"}, Bites{Planted::pushes_unheard, "no_push"},
                    Bites{Planted::swings_on, "comes_to_rest"}, Bites{Planted::keeps_torque, "torque_off"}));

}  // namespace
}  // namespace takt::exploration
