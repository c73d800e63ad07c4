// SPDX-License-Identifier: Apache-2.0
// Goal: no tool for the person at the robot calls a drive fine that is set up otherwise than the robot file says: a
// scan and a jog name what is wrong, in the words that the row has, and neither ends well. Method: the rows of
// misconfigured_drives.hpp, and those that only the tools see: other numbers, reply ids and frames, two drives with one
// number, drives that are not there. Scan and jog in virtual time, host driver against simulated drive.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>

#include "commissioning/discovery.hpp"
#include "commissioning/joint_jog.hpp"
#include "drivers/protocol/seen_angle.hpp"
#include "tests/simulation/drive_loop.hpp"
#include "tests/simulation/misconfigured_drives.hpp"

namespace takt::simulation {
namespace {

using commissioning::BusScan;
using config::Drive;
using drivers::CanFrame;
using misconfigured::Row;

constexpr Duration kTick = milliseconds(1);

config::Bus bench() {
  return {.name = "bench", .interface = "can0", .bitrate = 1'000'000, .fd = true, .data_bitrate = 5'000'000};
}

config::RobotConfig robot_with(const Drive& drive) {
  config::RobotConfig robot;
  robot.control.period = kTick;
  robot.buses.push_back(bench());
  robot.joints.resize(1);
  config::Joint& joint = robot.joints[0];
  joint.name = "elbow";
  joint.drive = drive;
  joint.observer_bandwidth = 200;
  joint.kp = 20;
  joint.kd = 1;
  joint.limits = {.q_min = -3, .q_max = 3, .position_margin = 0.1, .velocity = 2, .velocity_hard = 4, .torque = 2};
  return robot;
}

// A bus with drives on it, and a person's tool.
class Bench {
 public:
  using Plant = std::function<misconfigured::Planted(const Drive&)>;
  Bench(const Drive& file, const std::vector<Plant>& plants) : robot_(robot_with(file)) {
    for (const Plant& plant : plants) planted_.push_back(plant(file));
    driver_ = drivers::make_joint_driver(robot_, 0).value();
  }

  // As takt bus scan: every number is asked, then the drive of the file is set up, disabled.
  std::vector<std::string> scan() {
    const Drive& file = robot_.joints[0].drive;
    BusScan scan({file.protocol}, file.protocol == config::DriveProtocol::odrive ? 0 : 1, 127);
    for (const CanFrame& question : commissioning::own_questions(file, robot_.buses[0])) scan.also_ask(question);
    for (int ms = 0; ms < 600; ++ms) hear({}, [&scan](const CanFrame& frame) { scan.take(frame); });
    while (const auto question = scan.next_question())
      hear(std::span(&*question, 1), [&scan](const CanFrame& frame) { scan.take(frame); });
    std::array<CanFrame, drivers::kMaxFramesPerDrive> out;
    for (int ms = 0; ms < 3000; ++ms) {
      const std::size_t sent = driver_->encode(false, {}, now_, {}, out);
      hear(std::span(out).first(sent), [this](const CanFrame& frame) { driver_->decode({frame, now_}); });
    }
    const auto found = scan.found();
    const auto is_ours = [&file](const BusScan::Drive& one) { return one.id == file.id; };
    const auto ours = std::ranges::find_if(found, is_ours);
    return commissioning::differences(robot_.joints[0], ours == found.end() ? nullptr : &*ours, driver_->feedback());
  }

  // Why it was cut short; empty: it moved as asked.
  std::string jog() {
    commissioning::JointJog jog = jogged();
    return jog.failure();
  }
  // What a jog says of the joint's scale: its drive, its velocity, the eye of a person beside it. Empty: nothing wrong.
  std::string wrong_scale(bool with_an_eye) {
    const double before = q_;
    const commissioning::JointJog jog = jogged();
    std::string said = jog.failure();
    if (const auto own = jog.own_scale(); own && own->verdict == commissioning::OwnScale::Verdict::wrong)
      said += own->sentence;
    if (jog.velocity_scale().verdict == commissioning::VelocityScale::Verdict::wrong)
      said += jog.velocity_scale().sentence;
    if (with_an_eye)
      said += drivers::contradicted_by_eye(robot_.joints[0], {.moved = jog.moved(), .seen = q_ - before});
    if (said.empty() && !with_an_eye && !jog.believed().empty()) said = "not judged: " + jog.believed();
    return said;
  }

 private:
  commissioning::JointJog jogged() {
    commissioning::JointJog jog(robot_.joints[0], {.by = 0.1, .speed = 0.2, .torque = 1}, *driver_);
    std::array<CanFrame, drivers::kMaxFramesPerDrive> out;
    while (!jog.ended()) {
      const std::size_t sent = jog.tick(now_, out);
      hear(std::span(out).first(sent), [this, &jog](const CanFrame& frame) {
        jog.take(frame);
        driver_->decode({frame, now_});
      });
    }
    return jog;
  }

  void hear(std::span<const CanFrame> sent, const std::function<void(const CanFrame&)>& take) {
    now_ = now_ + kTick;
    double torque = 0;
    Frames said;
    for (misconfigured::Planted& one : planted_) {
      Frames own;
      for (CanFrame frame : sent)
        if (!one.on_the_way || one.on_the_way(frame)) one.device->receive(frame, now_, own);
      torque = one.device->update({q_, dq_}, now_, kTick, own);
      for (CanFrame& frame : own)
        if (!one.on_the_way || one.on_the_way(frame)) said.push_back(frame);
    }
    dq_ += torque / test::DriveLoop::kInertia * kTick.seconds();
    q_ += dq_ * kTick.seconds();
    for (const CanFrame& frame : said) take(frame);
  }

  config::RobotConfig robot_;
  std::vector<misconfigured::Planted> planted_;
  std::unique_ptr<drivers::JointDriver> driver_;
  MonoTime now_{1};
  double q_ = 0, dq_ = 0;
};

std::string joined(const std::vector<std::string>& sentences) {
  std::string all;
  for (const std::string& one : sentences) all += one + "\n";
  return all;
}

// What no driver alone can see, or none may move.
struct ForTools {
  const char* when;
  Drive file;
  std::vector<Bench::Plant> plants;
  const char* sentence;
};

std::vector<ForTools> rows_for_tools() {
  using namespace misconfigured;
  const auto other_number = built([](Drive& d) { d.id = 4; });
  const auto classic = built([](Drive& d) { d.fd_bitrate = 0; });
  const Drive in_fd = with(damiao(), [](Drive& d) { d.fd_bitrate = 5'000'000; });
  const Bench::Plant answers_classic = saying([](CanFrame& frame) {
    if (frame.id == 0x13) frame.fd = frame.bit_rate_switch = false;
    return true;
  });
  return {
      {"damiao with another reply id", damiao(), {built([](Drive& d) { d.reply_id = 0x14; })}, "replies on 0x14"},
      {"damiao with another number", damiao(), {other_number}, "no answer"},
      {"damiao, two with one number", damiao(), {as_delivered(), as_delivered()}, "two drives have the number 3"},
      {"damiao, two with one number and two reply ids",
       damiao(),
       {as_delivered(), built([](Drive& d) { d.reply_id = 0x14; })},
       "replies on 0x14"},
      {"damiao in classic frames, the file says CAN FD", in_fd, {classic}, "classic frames"},
      {"damiao that answers CAN FD in classic frames", in_fd, {answers_classic}, "classic frames"},
      {"damiao in CAN FD, the file says classic frames",
       damiao(),
       {built([](Drive& d) { d.fd_bitrate = 5'000'000; })},
       "write fd_bitrate"},
      {"t-motor with another number", tmotor(), {other_number}, "no answer"},
      {"t-motor, two with one number", tmotor(), {as_delivered(), as_delivered()}, "two drives have the number 3"},
      {"robstride with another number", robstride(), {other_number}, "no answer"},
      {"robstride, two with one number", robstride(), {as_delivered(), as_delivered()}, "two drives have the number 3"},
      {"odrive with another number", odrive(), {other_number}, "no answer"},
      {"odrive, two with one number", odrive(), {as_delivered(), as_delivered()}, "two drives have the number 3"},
      {"moteus with another number", moteus(), {other_number}, "no answer"},
      {"moteus, two with one number", moteus(), {as_delivered(), as_delivered()}, "two drives have the number 3"},
      {"servo with another number", servo(), {other_number}, "no answer"},
      {"servo, two with one number", servo(), {as_delivered(), as_delivered()}, "two drives have the number 3"},
      {"no drive at all", damiao(), {}, "no answer"},
  };
}

TEST(PlantedForTools, AScanNamesEveryDifference) {
  int planted = 0, named = 0, fine = 0;
  const auto expect = [&](const char* when, const std::vector<std::string>& said, const char* sentence) {
    ++planted;
    named += joined(said).find(sentence) != std::string::npos ? 1 : 0;
    fine += said.empty() ? 1 : 0;
    EXPECT_NE(joined(said).find(sentence), std::string::npos) << when << ": " << joined(said);
  };
  for (const Row& row : misconfigured::rows()) {
    const auto said = Bench(row.file, {row.plant}).scan();
    // Only a drive that is driven shows that it ignores what it is told; one that forgot its home is as the file has
    // it.
    const std::string sentence = row.sentence;
    const bool shows_at_rest =
        sentence.find("bit 12") == std::string::npos && sentence.find("where the joint is") == std::string::npos &&
        sentence.find("lost its supply") == std::string::npos && sentence.find("home") == std::string::npos;
    if (*row.sentence == '\0')
      EXPECT_EQ(joined(said), "") << row.when;
    else if (shows_at_rest)
      expect(row.when, said, row.sentence);
  }
  for (const ForTools& row : rows_for_tools()) expect(row.when, Bench(row.file, row.plants).scan(), row.sentence);
  std::printf("%d planted, %d named, %d called fine\n", planted, named, fine);
  EXPECT_GE(planted, 60);
  EXPECT_EQ(fine, 0);
}

TEST(PlantedForTools, AJogOfADriveThatDiffersIsNoSuccess) {
  for (const Row& row : misconfigured::rows()) {
    // What such a drive was told depends on the joint's limits, which the row does not know.
    const bool was_told_home = row.file.position_after_power_up == config::PositionAfterPowerUp::unknown;
    if (was_told_home && *row.sentence == '\0') continue;
    // An ODrive is asked for its version while it is disabled, which a jog leaves at once; 0.5 shows in its heartbeat.
    if (std::string(row.when) == "odrive that tells a version before 0.6") continue;
    const std::string failure = Bench(row.file, {row.plant}).jog();
    EXPECT_NE(failure.find(row.sentence), std::string::npos) << row.when << ": " << failure;
    EXPECT_EQ(failure.empty(), *row.sentence == '\0') << row.when << ": " << failure;
  }
}

// What scales every number of a drive alike: twice and half the counts of CiA 402 drives, in each mode and with each
// way of telling it, and a gear that no drive has.
struct WrongScale {
  const char* when;
  Drive file;
  Bench::Plant plant;
  bool with_an_eye;
  const char* sentence;
};

std::vector<WrongScale> wrong_scales() {
  using namespace misconfigured;
  std::vector<WrongScale> rows;
  const auto servo_that = [](double counts, const std::function<void(Cia402Profile&)>& tells) -> Bench::Plant {
    return [=](const Drive& file) {
      const Drive real = with(file, [=](Drive& drive) {
        drive.counts_per_turn = static_cast<std::uint32_t>(std::lround(counts * file.counts_per_turn));
      });
      Cia402Profile profile = profile_of(real);
      tells(profile);
      return Planted{std::make_unique<Cia402Device>(real, Duration{}, profile), {}};
    };
  };
  const auto encoder = [](Cia402Profile& profile) { profile.feed.reset(); };
  const auto velocity = [](Cia402Profile& profile) {
    profile.feed.reset();
    profile.encoder.reset();
    profile.speed_counts = 60'000;
    profile.velocity_unit = 0xFDB4'4700;
  };
  const auto nothing = [](Cia402Profile& profile) {
    profile.feed.reset();
    profile.encoder.reset();
    profile.velocity_unit.reset();
  };
  for (const double counts : {2.0, 0.5}) {
    for (const auto mode : {config::Cia402Mode::cst, config::Cia402Mode::csp, config::Cia402Mode::csv})
      rows.push_back({"counts, told by 6092", servo(mode), servo_that(counts, [](Cia402Profile&) {}), false,
                      "counts per motor turn (6092, 6091)"});
    rows.push_back({"counts, told by 608F", servo(), servo_that(counts, encoder), false, "(608F)"});
    rows.push_back({"counts, told by 606C", servo(), servo_that(counts, velocity), false, "velocity (606C)"});
    rows.push_back({"counts, not told", servo(), servo_that(counts, nothing), false, "not judged: counts_per_turn"});
    rows.push_back(
        {"counts, not told, seen", servo(), servo_that(counts, nothing), true, "counts_per_turn is another"});
  }
  const auto geared = [](Drive drive) { return with(std::move(drive), [](Drive& one) { one.gear_ratio = 3; }); };
  for (const Drive& file : {damiao(), tmotor(), robstride(), odrive(), moteus(), servo()})
    rows.push_back({"gear", geared(file), as_delivered(), true, "gear_ratio is 1 by that, the robot file says 3"});
  return rows;
}

TEST(PlantedForTools, AScaleThatIsWrongIsFoundAndNeverCalledFine) {
  int planted = 0, found = 0;
  for (const WrongScale& row : wrong_scales()) {
    const std::string said = Bench(row.file, {row.plant}).wrong_scale(row.with_an_eye);
    ++planted;
    found += said.find(row.sentence) != std::string::npos ? 1 : 0;
    EXPECT_NE(said.find(row.sentence), std::string::npos)
        << row.when << ", " << config::name(row.file.protocol) << ": " << said;
  }
  std::printf("%d scales planted, %d found\n", planted, found);
  EXPECT_EQ(planted, 20);
  // The same without a gear, and with the file's counts.
  for (const Drive& file : {misconfigured::damiao(), misconfigured::robstride(), misconfigured::odrive(),
                            misconfigured::moteus(), misconfigured::servo()}) {
    EXPECT_EQ(Bench(file, {misconfigured::as_delivered()}).wrong_scale(true), "") << config::name(file.protocol);
    EXPECT_EQ(Bench(file, {misconfigured::as_delivered()}).wrong_scale(false), "") << config::name(file.protocol);
  }
}

}  // namespace
}  // namespace takt::simulation
