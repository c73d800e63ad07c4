// SPDX-License-Identifier: Apache-2.0
// Goal: a world in another process is the same world, bit for bit; one that hangs, dies, answers nonsense or gives up
// is a named end, at once and for good. Method: the demo arm's own dynamics behind the C header in a forked child,
// against the same in process; then children that spoil one thing each, some through the header, some as a raw socket.
#include "simulation/world_link.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "simulation/arm_dynamics.hpp"
#include "simulation/outside_mechanics.hpp"
#include "simulation/robot_plant.hpp"
#include "tests/simulation/forked_world.hpp"
#include "tests/simulation/plant_robots.hpp"

namespace takt::simulation {
namespace {

using test::ForkedWorld;
using testing::HasSubstr;

const WorldLink::Robot kPendulum{"pendulum", {"pivot"}, milliseconds(1)};
constexpr WorldLink::Patience kPatience{seconds(10), seconds(10)};
constexpr WorldLink::Patience kImpatience{milliseconds(50), milliseconds(50)};

void play_arm(const std::string& path) {
  const config::RobotConfig robot = test::demo_arm();
  const auto arm = ArmDynamics::make(robot).value();
  ArmState now{Eigen::VectorXd::Zero(6), Eigen::VectorXd::Zero(6)};
  test::play(path, TAKT_WORLD_POINT, [&](const takt_world& world, takt_world_state& state) {
    if (world.kind == TAKT_WORLD_RESET) {
      now = {Eigen::Map<const Eigen::VectorXd>(world.reset.q, 6), Eigen::VectorXd::Zero(6)};
    } else {
      std::vector<Friction> friction(6);
      for (std::size_t i = 0; i < 6; ++i) friction[i] = {world.step.viscous[i], world.step.coulomb[i]};
      arm->integrate(now, Eigen::Map<const Eigen::VectorXd>(world.step.torque, 6), friction, robot.simulation->step);
    }
    const config::Vector3 tool = arm->tool_position(now.q);
    for (Eigen::Index i = 0; i < 6; ++i) {
      state.q[i] = now.q[i];
      state.dq[i] = now.dq[i];
    }
    std::ranges::copy(tool, state.point);
    return true;
  });
}

bool same_bits(const ArmState& a, const ArmState& b) {
  return std::memcmp(a.q.data(), b.q.data(), sizeof(double) * 6) == 0 &&
         std::memcmp(a.dq.data(), b.dq.data(), sizeof(double) * 6) == 0;
}

TEST(WorldLink, TheArmInAnotherProcessIsTheSameArmBitForBit) {
  const config::RobotConfig robot = test::demo_arm();
  const ForkedWorld process(play_arm);
  auto outside = OutsideMechanics::connect(robot, process.path(), 1, kPatience);
  ASSERT_TRUE(outside) << outside.error().sentence;
  EXPECT_TRUE((*outside)->link().is_over_shared_memory());
  const auto inside = ArmDynamics::make(robot).value();
  ArmState here = (*outside)->begin(), there = here;
  EXPECT_EQ(here.q[2], robot.joints[2].home);
  const std::vector<Friction> friction(6, Friction{0.15, 0.1});
  for (int step = 0; step < 2000; ++step) {
    const Eigen::VectorXd torque =
        Eigen::VectorXd::NullaryExpr(6, [step](Eigen::Index i) { return std::sin(0.01 * step + double(i)); });
    inside->integrate(here, torque, friction, robot.simulation->step);
    (*outside)->integrate(there, torque, friction, robot.simulation->step);
    ASSERT_TRUE(same_bits(here, there)) << step;
  }
  EXPECT_GT(here.dq.norm(), 1e-3) << "it moved";
  EXPECT_EQ((*outside)->tool_position(there.q), inside->tool_position(here.q));
  EXPECT_FALSE((*outside)->end());
}

TEST(WorldLink, APlantInAWorldIsTheSamePlantBitForBit) {
  const config::RobotConfig robot = test::demo_arm();
  const ForkedWorld process(play_arm);
  auto outside = OutsideMechanics::connect(robot, process.path(), 1, kPatience);
  ASSERT_TRUE(outside) << outside.error().sentence;
  auto there = RobotPlant::make_in(std::move(*outside), robot);
  auto here = RobotPlant::make(robot);
  ASSERT_TRUE(there && here);
  there->set_trouble({.friction = 3});
  here->set_trouble({.friction = 3});
  for (int step = 0; step < 500; ++step) {
    there->step();
    here->step();
    ASSERT_TRUE(same_bits(here->state(), there->state())) << step;
  }
}

// --- through the header, one thing spoilt each ---

struct Spoilt {
  const char* when;
  std::function<void(takt_world_state&)> how;
  WorldEndKind kind;
  const char* says;
};
const double kNaN = std::numeric_limits<double>::quiet_NaN();
const std::vector<Spoilt> kSpoilt{
    {"a joint that is nowhere", [](auto& s) { s.q[0] = kNaN; }, WorldEndKind::invalid_answer, "joint 0 at nan rad"},
    {"a joint infinitely fast", [](auto& s) { s.dq[0] = -INFINITY; }, WorldEndKind::invalid_answer, "-inf rad/s"},
    {"a joint faster than any", [](auto& s) { s.dq[0] = 1e6; }, WorldEndKind::invalid_answer, "1000000 rad/s"},
    {"a state of another time", [](auto& s) { s.time_ns += 1; }, WorldEndKind::invalid_answer, "expected 1000000 ns"},
    {"no rotation", [](auto& s) { s.orientation[0] = 0.9; }, WorldEndKind::invalid_answer, "length is not 1"},
    {"a rotation of NaN", [](auto& s) { s.orientation[1] = kNaN; }, WorldEndKind::invalid_answer, "length is not 1"},
    {"no acceleration", [](auto& s) { s.acceleration[2] = kNaN; }, WorldEndKind::invalid_answer, "acceleration"},
    {"no angular velocity", [](auto& s) { s.angular_velocity[0] = kNaN; }, WorldEndKind::invalid_answer,
     "angular velocity"},
    {"a point that is nowhere", [](auto& s) { s.point[1] = kNaN; }, WorldEndKind::invalid_answer, "no place"},
    {"a base that is nowhere", [](auto& s) { s.base_position[2] = kNaN; }, WorldEndKind::invalid_answer,
     "base is no place"},
    {"a base that is no rotation", [](auto& s) { s.base_orientation[0] = 0; }, WorldEndKind::invalid_answer,
     "base's orientation is no rotation"},
    {"an error below nothing", [](auto& s) { s.error = -1e-9; }, WorldEndKind::invalid_answer,
     "the task's error is -1e-09"},
    {"an error of NaN", [](auto& s) { s.error = kNaN; }, WorldEndKind::invalid_answer, "the task's error is nan"},
    {"a sample out of turn", [](auto& s) { s.sensor_sequence = 2; }, WorldEndKind::invalid_answer,
     "sample 2 of sensor eye"},
    {"a sample of nothing",
     [](auto& s) {
       s.sensor_sequence = 1;
       s.sensor[1] = INFINITY;
     },
     WorldEndKind::invalid_answer, "sensor eye says inf"},
    {"an outcome that is none", [](auto& s) { s.outcome = 77; }, WorldEndKind::invalid_answer, "outcome 77"},
    {"success", [](auto& s) { s.outcome = TAKT_WORLD_SUCCEEDED; }, WorldEndKind::succeeded, "the task is done"},
    {"a fall",
     [](auto& s) {
       s.outcome = TAKT_WORLD_FAILED;
       strcpy(s.reason, "fell\n");
     },
     WorldEndKind::failed, "beyond help: fell?"},
    {"a reason that moves the cursor",
     [](auto& s) {
       s.outcome = TAKT_WORLD_FAILED;
       strcpy(s.reason, "fell\x1b[2J\xC2\x9b\xFF");
     },
     WorldEndKind::failed, "beyond help: fell?[2J\\xc2\\x9b\\xff"},
    {"physics that diverged",
     [](auto& s) {
       s.outcome = TAKT_WORLD_UNABLE;
       std::memset(s.reason, '!', sizeof s.reason);  // no end
     },
     WorldEndKind::unable, "cannot go on: !!!"},
};

TEST(WorldLink, WhatCannotBeIsANamedEndForGood) {
  for (const Spoilt& spoilt : kSpoilt) {
    const ForkedWorld process([&spoilt](const std::string& path) {
      const std::uint32_t gives = TAKT_WORLD_POINT | TAKT_WORLD_IMU | TAKT_WORLD_BASE | TAKT_WORLD_ERROR;
      const auto spoil = [&](const takt_world& world, takt_world_state& state) {
        if (world.kind == TAKT_WORLD_STEP) spoilt.how(state);
        return true;
      };
      test::play(path, gives, spoil, "eye", 2);
    });
    auto link = WorldLink::connect(process.path(), kPendulum, kPatience);
    ASSERT_TRUE(link) << spoilt.when << ": " << link.error().sentence;
    const std::vector<double> zero{0};
    ASSERT_TRUE(link->reset(1, zero)) << spoilt.when;
    const auto state = link->step({zero, zero, zero});
    ASSERT_FALSE(state) << spoilt.when;
    EXPECT_EQ(name(state.error().kind), name(spoilt.kind)) << spoilt.when;
    EXPECT_THAT(state.error().sentence, HasSubstr(spoilt.says)) << spoilt.when;
    EXPECT_THAT(state.error().sentence, HasSubstr(process.path() + " (forked)"));
    const auto again = link->reset(1, zero);
    ASSERT_FALSE(again) << spoilt.when;
    EXPECT_EQ(again.error().sentence, state.error().sentence);
  }
}

TEST(WorldLink, ASampleThatIsTakenBackIsOutOfTurn) {
  const ForkedWorld process([](const std::string& path) {
    test::play(
        path, 0,
        [](const takt_world& world, takt_world_state& state) {
          state.sensor_sequence = world.kind == TAKT_WORLD_RESET ? 1 : 0;
          return true;
        },
        "eye", 2);
  });
  auto link = WorldLink::connect(process.path(), kPendulum, kPatience);
  ASSERT_TRUE(link) << link.error().sentence;
  const std::vector<double> zero{0};
  ASSERT_TRUE(link->reset(1, zero));
  const auto state = link->step({zero, zero, zero});
  ASSERT_FALSE(state);
  EXPECT_THAT(state.error().sentence, HasSubstr("sample 0 of sensor eye after 1"));
}

// Goal: what a world does not say it gives is nowhere. Method: a point of NaN, unannounced.
TEST(WorldLink, APointThatIsNotGivenIsNotRead) {
  const ForkedWorld process([](const std::string& path) {
    test::play(path, 0, [](const takt_world&, takt_world_state& state) {
      state.point[0] = kNaN;
      return true;
    });
  });
  const auto outside = OutsideMechanics::connect(test::demo_arm(), process.path(), 1, kPatience);
  ASSERT_TRUE(outside) << outside.error().sentence;
  EXPECT_EQ((*outside)->tool_position((*outside)->begin().q), (config::Vector3{}));
}

// The reset answered, then this.
WorldEnd end_after(const std::function<bool()>& then, const WorldLink::Patience& patience) {
  const ForkedWorld process([&then](const std::string& path) {
    test::play(path, 0,
               [&](const takt_world& world, takt_world_state&) { return world.kind == TAKT_WORLD_RESET || then(); });
  });
  auto link = WorldLink::connect(process.path(), kPendulum, {kPatience.greeting, patience.answer});
  if (!link) return link.error();
  const std::vector<double> zero{0};
  if (auto first = link->reset(1, zero); !first) return first.error();
  auto state = link->step({zero, zero, zero});
  return state ? WorldEnd{WorldEndKind::succeeded, "answered"} : state.error();
}

TEST(WorldLink, AWorldThatEndsOrHangsIsNotWaitedFor) {
  const WorldEnd died = end_after([] { return false; }, kPatience);
  EXPECT_EQ(name(died.kind), "died");
  EXPECT_THAT(died.sentence, HasSubstr("question 3"));
  const WorldEnd hung = end_after([] { return pause() == 0; }, {seconds(10), milliseconds(500)});
  EXPECT_EQ(name(hung.kind), "hung");
  EXPECT_THAT(hung.sentence, HasSubstr("in time"));
}

// Goal: one sentence for a world that is gone, whenever it went. Method: it is killed and waited for between an answer
// and the next question, so that asking fails; the test above kills it between question and answer.
TEST(WorldLink, AWorldKilledBetweenQuestionsWentAwayToo) {
  ForkedWorld process(
      [](const std::string& path) { test::play(path, 0, [](const takt_world&, takt_world_state&) { return true; }); });
  auto link = WorldLink::connect(process.path(), kPendulum, kPatience);
  ASSERT_TRUE(link) << link.error().sentence;
  const std::vector<double> zero{0};
  ASSERT_TRUE(link->reset(1, zero));
  process.kill();
  const auto state = link->step({zero, zero, zero});
  ASSERT_FALSE(state);
  EXPECT_EQ(name(state.error().kind), "died");
  EXPECT_THAT(state.error().sentence, HasSubstr("went away before it answered question 3"));
}

TEST(WorldLink, WhereNobodyListensItSaysSo) {
  const auto link = WorldLink::connect("/tmp/takt-no-such-world.sock", kPendulum, kImpatience);
  ASSERT_FALSE(link);
  EXPECT_EQ(name(link.error().kind), "absent");
  EXPECT_THAT(link.error().sentence, HasSubstr("start the world first"));
  const auto nowhere = WorldLink::connect(std::string(200, 'x'), kPendulum, kPatience);
  ASSERT_FALSE(nowhere);
  EXPECT_THAT(nowhere.error().sentence, HasSubstr("1 to 107 bytes"));
}

// --- images ---

const WorldLink::Robot kFilmed{"pendulum", {"pivot"}, milliseconds(1), {{"left", {2, 3, 1}}, {"right", {4, 5, 3}}}};
const std::vector<takt_world_camera> kCameras{{"right", 4, 5, 3, 0}, {"left", 2, 3, 1, 0}};  // in another order

// A world's right camera sees with every third step, its left one with the first, which it did 1 ms before.
bool film(takt_world& world, takt_world_state& state) {
  const bool begins = world.kind == TAKT_WORLD_RESET;
  const std::uint64_t step = state.time_ns / 1'000'000;
  if (!begins && step % 3 == 0) {
    std::memset(takt_world_pixels(&world, 0), static_cast<int>(step), 4 * 5 * 3);
    takt_world_show(&world, 0, state.time_ns);
  }
  if (step == 1) {
    std::memset(takt_world_pixels(&world, 1), 200, 2 * 3);
    takt_world_show(&world, 1, 0);
  }
  return true;
}

TEST(WorldLink, ImagesComeWithTheStateThatHasThem) {
  const ForkedWorld process([](const std::string& path) { test::play(path, 0, film, nullptr, 0, kCameras); });
  auto link = WorldLink::connect(process.path(), kFilmed, kPatience);
  ASSERT_TRUE(link) << link.error().sentence;
  EXPECT_EQ(link->cameras(), (std::vector<std::size_t>{0, 1}));
  const std::vector<double> zero{0};
  for (int simulation = 0; simulation < 2; ++simulation) {
    ASSERT_TRUE(link->reset(1, zero));
    EXPECT_TRUE(link->images().empty());
    for (int step = 1; step <= 30; ++step) {
      const auto state = link->step({zero, zero, zero});
      ASSERT_TRUE(state) << state.error().sentence;
      const auto images = link->images();
      ASSERT_EQ(images.size(), step % 3 == 0 || step == 1 ? 1U : 0U) << step;
      if (images.empty()) continue;
      EXPECT_EQ(images[0].camera, step == 1 ? 0U : 1U);
      EXPECT_EQ(images[0].sequence, step == 1 ? 1U : static_cast<unsigned>(step) / 3) << "from 1 after each reset";
      EXPECT_EQ(images[0].sensed_at.ns, step == 1 ? 0 : 1'000'000 * step);
      EXPECT_EQ(*images[0].pixels, step == 1 ? std::vector<std::uint8_t>(6, 200)
                                             : std::vector<std::uint8_t>(60, static_cast<std::uint8_t>(step)));
    }
  }
}

TEST(WorldLink, AWorldOfOtherCamerasIsRefused) {
  const std::vector<std::pair<takt_world_camera, const char*>> bad{
      {{"behind", 4, 5, 3, 0}, "the robot has no sensor behind of images"},
      {{"right", 5, 4, 3, 0},
       "images of sensor right are 5 x 4 x 3 here, 4 x 5 x 3 in the robot file: make them equal"},
  };
  for (const auto& [camera, says] : bad) {
    const ForkedWorld process([&](const std::string& path) { test::play(path, 0, film, nullptr, 0, {camera}); });
    const auto link = WorldLink::connect(process.path(), kFilmed, kPatience);
    ASSERT_FALSE(link) << says;
    EXPECT_EQ(name(link.error().kind), "refused") << says;
    EXPECT_THAT(link.error().sentence, HasSubstr(says));
  }
}

TEST(WorldLink, AnImageThatCannotBeIsNonsense) {
  // The second image of the right camera, spoilt; the first came with the step before.
  const std::vector<std::pair<std::function<void(takt_world&)>, const char*>> bad{
      {[](takt_world& w) { w.to_show[0].bytes = 59; }, "an image of 59 bytes of sensor right, expected 60"},
      {[](takt_world& w) { w.to_show[0].sequence = 3; }, "image 3 of sensor right after 1"},
      {[](takt_world& w) { w.to_show[0].sequence = 1; }, "image 1 of sensor right after 1"},
      {[](takt_world& w) { w.to_show[0].time_ns = 2'000'001; }, "sensed at 2000001 ns, after the state's 2000000 ns"},
      {[](takt_world& w) { w.to_show[0].time_ns = 1'000'000; }, "sensed at 1000000 ns, the one before at 1000000 ns"},
      {[](takt_world& w) { w.to_show[0].camera = 0; }, "an image of camera 0, which it does not play"},
      {[](takt_world& w) { w.to_show[0].camera = 1000; }, "an image of camera 1000, which it does not play"},
      {[](takt_world& w) {
         takt_world_show(&w, 0, 2'000'000);
         w.to_show[1].time_ns = 2'000'000;
       },
       "with the same state"},
      {[](takt_world& w) { w.to_show_count = 3; }, "3 images with one state"},
  };
  for (const auto& [spoil, says] : bad) {
    const ForkedWorld process([&](const std::string& path) {
      const auto fill = [&](takt_world& world, takt_world_state& state) {
        if (world.kind == TAKT_WORLD_RESET) return true;
        takt_world_show(&world, 0, state.time_ns);
        if (state.time_ns > 1'000'000) spoil(world);
        return true;
      };
      test::play(path, 0, fill, nullptr, 0, {kCameras[0]});
    });
    auto link = WorldLink::connect(process.path(), kFilmed, kPatience);
    ASSERT_TRUE(link) << link.error().sentence;
    const std::vector<double> zero{0};
    ASSERT_TRUE(link->reset(1, zero));
    ASSERT_TRUE(link->step({zero, zero, zero})) << says;
    const auto state = link->step({zero, zero, zero});
    ASSERT_FALSE(state) << says;
    EXPECT_EQ(name(state.error().kind), "nonsense") << says;
    EXPECT_THAT(state.error().sentence, HasSubstr(says));
  }
}

// --- as a raw socket: the header would not let these happen ---

void play_raw(const std::string& path, const std::function<void(takt_world&)>& greet_and_go_on) {
  takt_world world;
  if (takt_world_listen(&world, path.c_str()) != 0) return;
  world.peer = accept(world.listener, nullptr, nullptr);
  if (takt_world_receive_hello(&world) == 0) greet_and_go_on(world);
  pause();
}

template <class Message>
void say(const takt_world& world, const Message& message) {
  send(world.peer, &message, sizeof message, MSG_NOSIGNAL);
}

takt_world_welcome welcome_of(const takt_world& world) {
  takt_world_welcome welcome{};
  welcome.header = world.hello.header;
  welcome.header.bytes = sizeof welcome;
  welcome.header.kind = TAKT_WORLD_WELCOME;
  return welcome;
}

struct BadWelcome {
  const char* when;
  std::function<void(takt_world_welcome&)> how;
  WorldEndKind kind;
  const char* says;
};

TEST(WorldLink, AWelcomeThatIsNoneIsANamedEnd) {
  const std::vector<BadWelcome> bad{
      {"refusal", [](auto& w) { strcpy(w.refusal, "two arms wanted"); }, WorldEndKind::refused, "two arms wanted"},
      {"protocol", [](auto& w) { w.header.protocol = 2; }, WorldEndKind::invalid_answer, "speaks protocol 2, Takt 3"},
      {"kind", [](auto& w) { w.header.kind = TAKT_WORLD_STATE; }, WorldEndKind::invalid_answer, "kind 5"},
      {"length", [](auto& w) { w.header.bytes = 8; }, WorldEndKind::invalid_answer, "with 8 bytes"},
      {"cameras", [](auto& w) { w.camera_count = 9; }, WorldEndKind::invalid_answer, "9 cameras; it has at most 8"},
      {"sequence", [](auto& w) { w.header.sequence = 9; }, WorldEndKind::invalid_answer,
       "answers question 9, asked was 1"},
  };
  for (const BadWelcome& one : bad) {
    const ForkedWorld process([&one](const std::string& path) {
      play_raw(path, [&one](takt_world& world) {
        takt_world_welcome welcome = welcome_of(world);
        one.how(welcome);
        say(world, welcome);
      });
    });
    const auto link = WorldLink::connect(process.path(), kPendulum, kPatience);
    ASSERT_FALSE(link) << one.when;
    EXPECT_EQ(name(link.error().kind), name(one.kind)) << one.when;
    EXPECT_THAT(link.error().sentence, HasSubstr(one.says)) << one.when;
  }
}

TEST(WorldLink, OneThatAcceptsAndSaysNothingHangs) {
  const ForkedWorld process([](const std::string& path) { play_raw(path, [](takt_world&) {}); });
  const auto link = WorldLink::connect(process.path(), kPendulum, {milliseconds(500), seconds(10)});
  ASSERT_FALSE(link);
  EXPECT_EQ(name(link.error().kind), "hung");
}

TEST(WorldLink, OneThatHalfAnswersAndDiesHasDied) {
  ForkedWorld process([](const std::string& path) {
    play_raw(path, [](takt_world& world) {
      say(world, welcome_of(world));
      takt_world_reset question{};
      recv(world.peer, &question, sizeof question, MSG_WAITALL);
      say(world, question.header);
      _exit(0);
    });
  });
  auto link = WorldLink::connect(process.path(), kPendulum, kPatience);
  ASSERT_TRUE(link) << link.error().sentence;
  EXPECT_FALSE(link->is_over_shared_memory());
  const std::vector<double> zero{0};
  const auto state = link->reset(1, zero);
  ASSERT_FALSE(state);
  EXPECT_EQ(name(state.error().kind), "died");
}

// Goal: whatever a world does to what it was given, Takt waits no longer than it is patient. Method: one that takes
// O_NONBLOCK off its files and rings once, one that rings without an end, one that reads no ring; none answers.
TEST(WorldLink, NothingThatAWorldDoesToItsFilesHangsTakt) {
  const auto make_blocking = [](int file) { fcntl(file, F_SETFL, fcntl(file, F_GETFL) & ~O_NONBLOCK); };
  const std::vector<std::function<void(takt_world&)>> tricks{
      [&](takt_world& world) {
        make_blocking(world.peer);
        make_blocking(world.memory);
        const char ring = 1;
        send(world.peer, &ring, 1, MSG_NOSIGNAL);
      },
      [](takt_world& world) {
        const char rings[512]{};
        while (send(world.peer, rings, sizeof rings, MSG_NOSIGNAL) > 0) {
        }
      },
      [&](takt_world& world) { make_blocking(world.peer); }};
  for (std::size_t trick = 0; trick < tricks.size(); ++trick) {
    const ForkedWorld process([&](const std::string& path) {
      play_raw(path, [&](takt_world& world) {
        takt_world_welcome welcome = welcome_of(world);
        welcome.gives = TAKT_WORLD_SHARED_MEMORY;
        say(world, welcome);
        tricks[trick](world);
        pause();
      });
    });
    auto link = WorldLink::connect(process.path(), kPendulum, {seconds(10), milliseconds(50)});
    ASSERT_TRUE(link) << link.error().sentence;
    const std::vector<double> zero{0};
    const auto state = link->reset(1, zero);
    ASSERT_FALSE(state) << trick;
    EXPECT_EQ(name(state.error().kind), trick == 2 ? "hung" : "nonsense") << trick;
    EXPECT_FALSE(link->step({zero, zero, zero})) << "for good";
  }
}

TEST(WorldLink, OneThatChoseMemoryAndSpeaksByTheSocketIsRefused) {
  const ForkedWorld process([](const std::string& path) {
    play_raw(path, [](takt_world& world) {
      takt_world_welcome welcome = welcome_of(world);
      welcome.gives = TAKT_WORLD_SHARED_MEMORY;
      say(world, welcome);
      say(world, welcome);
    });
  });
  auto link = WorldLink::connect(process.path(), kPendulum, kPatience);
  ASSERT_TRUE(link) << link.error().sentence;
  const std::vector<double> zero{0};
  const auto state = link->reset(1, zero);
  ASSERT_FALSE(state);
  EXPECT_EQ(name(state.error().kind), "nonsense") << "a byte there says that the answer is in the memory";
}

// Goal: a sample is as old as the state that had it first, however late it is asked for. Method: one sample, in the
// second of five steps, asked for after the fifth.
TEST(OutsideMechanics, TheWorldsSampleIsAsOldAsItsState) {
  config::RobotConfig robot = test::pendulum(2, 0.5);
  config::Sensor eye;
  eye.name = "eye";
  eye.values = 3;
  robot.sensors.push_back(eye);
  const ForkedWorld process([](const std::string& path) {
    test::play(
        path, 0,
        [](const takt_world& world, takt_world_state& state) {
          if (world.kind == TAKT_WORLD_STEP && world.step.time_ns == world.step.step_ns) state.sensor_sequence = 1;
          return true;
        },
        "eye", 3);
  });
  auto outside = OutsideMechanics::connect(robot, process.path(), 1, kPatience);
  ASSERT_TRUE(outside) << outside.error().sentence;
  ArmState state = (*outside)->begin();
  const Duration step = robot.simulation->step;
  for (int i = 0; i < 5; ++i) (*outside)->integrate(state, Eigen::VectorXd::Zero(1), {{0, 0}}, step);
  const MonoTime now{1'000'000'000};
  const auto sample = (*outside)->sample(now);
  ASSERT_TRUE(sample);
  EXPECT_EQ(sample->sensed_at, now - step * 3);
  EXPECT_EQ(sample->published_at, now);
}

// Goal: what a world does not give is nothing. Method: one that judges, gives no error, and has NaN where it would be.
TEST(OutsideMechanics, AnErrorThatTheWorldDoesNotGiveIsNone) {
  const config::RobotConfig robot = test::pendulum(2, 0.5);
  const ForkedWorld process([](const std::string& path) {
    test::play(path, TAKT_WORLD_DONE, [](const takt_world&, takt_world_state& state) {
      state.error = std::numeric_limits<double>::quiet_NaN();
      return true;
    });
  });
  auto outside = OutsideMechanics::connect(robot, process.path(), 1, kPatience);
  ASSERT_TRUE(outside) << outside.error().sentence;
  EXPECT_EQ((*outside)->error(), 0);
}

// Goal: what the world sees, the policy is given once per sample; a sensor that the robot file has otherwise is
// refused. Method: a world that says a new sample in every second step.
TEST(OutsideMechanics, TheWorldsSensorIsSampledOnce) {
  config::RobotConfig robot = test::pendulum(2, 0.5);
  config::Sensor eye;
  eye.name = "eye";
  eye.values = 3;
  robot.sensors.push_back(eye);
  const auto play = [](std::uint32_t values) {
    return [values](const std::string& path) {
      test::play(
          path, 0,
          [](const takt_world& world, takt_world_state& state) {
            if (world.kind == TAKT_WORLD_STEP && world.step.time_ns / world.step.step_ns % 2 == 0)
              ++state.sensor_sequence;
            state.sensor[2] = 0.5 * static_cast<double>(state.sensor_sequence);
            return true;
          },
          "eye", values);
    };
  };
  const ForkedWorld process(play(3));
  auto outside = OutsideMechanics::connect(robot, process.path(), 1, kPatience);
  ASSERT_TRUE(outside) << outside.error().sentence;
  ArmState state = (*outside)->begin();
  EXPECT_FALSE((*outside)->sample(MonoTime{5})) << "none yet";
  std::uint64_t samples = 0;
  for (int step = 0; step < 6; ++step) {
    (*outside)->integrate(state, Eigen::VectorXd::Zero(1), {{0, 0}}, robot.simulation->step);
    const auto sample = (*outside)->sample(MonoTime{10 + step});
    EXPECT_EQ(sample.has_value(), step % 2 == 0) << step;
    EXPECT_FALSE((*outside)->sample(MonoTime{10 + step})) << "once";
    if (!sample) continue;
    EXPECT_EQ(sample->sequence, ++samples);
    EXPECT_EQ(sample->sensed_at, MonoTime{10 + step});
    ASSERT_EQ(sample->value_count, 3U);
    EXPECT_EQ(sample->values[2], 0.5F * static_cast<float>(samples));
  }
  const ForkedWorld narrow(play(2)), none(play(0));
  const auto refused = OutsideMechanics::connect(robot, narrow.path(), 1, kPatience);
  ASSERT_FALSE(refused);
  EXPECT_EQ(name(refused.error().kind), "refused");
  EXPECT_THAT(refused.error().sentence, HasSubstr("sensor eye has 3 values in arm6, 2 here"));
  const auto empty = OutsideMechanics::connect(robot, none.path(), 1, kPatience);
  ASSERT_FALSE(empty);
  EXPECT_THAT(empty.error().sentence, HasSubstr("sensor eye of 0 values"));
}

TEST(OutsideMechanics, WhenTheWorldEndsTheRobotStaysWhereItWas) {
  const config::RobotConfig robot = test::demo_arm();
  ForkedWorld process(play_arm);
  auto outside = OutsideMechanics::connect(robot, process.path(), 1, kPatience);
  ASSERT_TRUE(outside) << outside.error().sentence;
  ArmState state = (*outside)->begin();
  const std::vector<Friction> friction(6);
  for (int step = 0; step < 50; ++step)
    (*outside)->integrate(state, Eigen::VectorXd::Zero(6), friction, robot.simulation->step);
  ASSERT_GT(state.dq.norm(), 0.01) << "it falls";
  process.kill();
  const Eigen::VectorXd q = state.q;
  for (int step = 0; step < 3; ++step) {
    (*outside)->integrate(state, Eigen::VectorXd::Zero(6), friction, robot.simulation->step);
    EXPECT_EQ(state.q, q);
    EXPECT_EQ(state.dq.norm(), 0);
  }
  ASSERT_TRUE((*outside)->end());
  EXPECT_EQ(name((*outside)->end()->kind), "died");
}

}  // namespace
}  // namespace takt::simulation
