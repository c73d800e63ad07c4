// SPDX-License-Identifier: Apache-2.0
#include "config/trouble/kinds.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <vector>

#include "config/nearest.hpp"

namespace takt::trouble {
namespace {

constexpr std::array<std::string_view, 5> kProcesses{"plant", "executive", "monitor", "policy", "fallback"};
constexpr std::array<std::string_view, 4> kStruck{"joint", "bus", "sensor", "body"};
constexpr std::array<std::string_view, 2> kCores{"control", "policy"}, kJointOrSensor{"joint", "sensor"};
constexpr std::span kAnyOfThese(kStruck);
constexpr Targets kNoTarget{}, kProcess{"PROCESS", kProcesses}, kAnyCore{"control|policy", kCores},
    kControl{"control", std::span(kCores).first(1)}, kPolicy{"policy", std::span(kCores).last(1)},
    kJoint{"a drive", kAnyOfThese.first(1)}, kBus{"a bus", kAnyOfThese.subspan(1, 1)},
    kSensor{"a sensor", kAnyOfThese.subspan(2, 1)}, kBody{"the robot's body", kAnyOfThese.last(1)},
    kDriveOrSensor{"a drive", kJointOrSensor}, kWhatTalks{"a drive", kAnyOfThese.first(3)};
constexpr Dose kNoDose{}, kOnce{"times", 1, 1, 1};
constexpr Duration kNoLength{}, kLongestWindow = seconds(1'000'000);

constexpr Dose of(std::string_view unit, double least, double most, double moderate = 0) {
  return {unit, least, most, moderate};
}
constexpr Dose above(double least, std::string_view unit, double most) {
  return {.unit = unit, .least = least, .most = most, .more_than_least = true};
}
constexpr Dose count(std::string_view unit, double most) {
  return {.unit = unit, .least = 1, .most = most, .whole = true};
}
constexpr Row row(ActionKind kind, std::string_view name, Targets strikes, Dose dose, Duration longest,
                  std::string_view effect) {
  return {.place = Place::run,
          .kind = static_cast<std::uint8_t>(kind),
          .name = name,
          .strikes = strikes,
          .dose = dose,
          .longest = longest,
          .effect = effect,
          .takes_command = kind == ActionKind::load};
}
constexpr Row row(HostFault kind, std::string_view name, Dose dose, std::string_view effect) {
  return {.place = Place::policy_host,
          .kind = static_cast<std::uint8_t>(kind),
          .name = name,
          .dose = dose,
          .longest = kLongestTime,
          .effect = effect};
}
constexpr Row row(FaultKind kind, std::string_view name, Targets strikes, Dose dose, std::string_view effect) {
  return {.place = Place::plant,
          .kind = static_cast<std::uint8_t>(kind),
          .name = name,
          .strikes = strikes,
          .dose = dose,
          .longest = kind == FaultKind::error || kind == FaultKind::down ? kNoLength : kLongestWindow,
          .effect = effect};
}
constexpr Row row(Trouble kind, std::string_view name, Dose dose, Real real, std::string_view effect) {
  return {.place = Place::panel,
          .kind = static_cast<std::uint8_t>(kind),
          .name = name,
          .dose = dose,
          .longest = kLongestWindow,
          .effect = effect,
          .real = real};
}

constexpr Real not_done(std::string_view why) {
  return {.as = why};
}
constexpr Real by_run(std::string_view as, When when, std::string_view then = {}) {
  return {Place::run, as, then, when};
}
constexpr Real by_host(std::string_view as) {
  return {Place::policy_host, as};
}
constexpr Real by_plant(std::string_view as, Whom whom, When when = When::window) {
  return {Place::plant, as, {}, when, whom};
}

constexpr std::array kRun{
    row(ActionKind::freeze, "freeze", kProcess, kNoDose, kLongestTime, "SIGSTOP, then SIGCONT"),
    row(ActionKind::kill, "kill", kProcess, kNoDose, kNoLength, "SIGKILL"),
    row(ActionKind::start, "start", kProcess, kNoDose, kNoLength, "a new process for one that died"),
    row(ActionKind::hog, "hog", kAnyCore, kNoDose, seconds(1),
        "control: a process above the control thread's priority on its core; policy: on every core one below the "
        "control thread's and above the policy host's"),
    row(ActionKind::throttle, "throttle", kControl, kNoDose, seconds(60),
        "the real-time budget of the control thread's core is used up from below it"),
    row(ActionKind::crowd, "crowd", kPolicy, count("copies", 64), kLongestTime,
        "so many ordinary processes, as nice as the policy host, on every core"),
    row(ActionKind::load, "load", kNoTarget, count("copies", 64), kLongestTime,
        "the user's own command, so many times at once, for a device that only it knows"),
    row(ActionKind::arm, "arm", kNoTarget, kNoDose, kNoLength, "as `takt arm`"),
    row(ActionKind::stop, "stop", kNoTarget, kNoDose, kNoLength, "as `takt stop`"),
    row(ActionKind::reset, "reset", kNoTarget, kNoDose, kNoLength, "as `takt reset`"),
};

constexpr std::array kHost{
    row(HostFault::publish_delay, "publish_delay", above(0, "ms", 10'000), "commands are published this much later"),
    row(HostFault::queue_growth, "queue_growth", of("callbacks", 1, 200),
        "observations queue up instead of replacing one another, and once per second this many callbacks of 2 ms come "
        "before them; so many that the host still notices within half a second that it is to end"),
    row(HostFault::bad_actions_nan, "bad_actions_nan", of("share", 0, 1), "this share of commands holds a NaN"),
    row(HostFault::bad_actions_range, "bad_actions_range", of("share", 0, 1),
        "this share of commands asks one joint for 10 rad more"),
    row(HostFault::wrong_joint_order, "wrong_joint_order", of("places", 1, 63),
        "positions go to joints this many places further on"),
};

constexpr std::array kPlant{
    row(FaultKind::error, "error", kJoint, kNoDose,
        "the drive found an error; stays until the host clears it, so it has no length"),
    row(FaultKind::power_cycle, "power_cycle", kJoint, kNoDose, "supply off; the drive boots when it ends"),
    row(FaultKind::silent, "silent", kJoint, kNoDose, "the drive obeys and is not heard"),
    row(FaultKind::deaf, "deaf", kJoint, kNoDose, "the drive hears nothing"),
    row(FaultKind::repeat, "repeat", kJoint, kNoDose, "everything that the drive says arrives twice"),
    row(FaultKind::delay, "delay", kJoint, of("ms", 0.001, 1000), "answers arrive this much later"),
    row(FaultKind::drop, "drop", kWhatTalks, above(0, "share", 1),
        "share of frames or samples lost; on a bus of everything that crosses it"),
    row(FaultKind::foreign_commands, "foreign_commands", kJoint, kNoDose,
        "a second host enables the drive and commands position zero without stiffness"),
    row(FaultKind::error_passive, "error_passive", kBus, kNoDose, "every controller is error passive"),
    row(FaultKind::bus_off, "bus_off", kBus, kNoDose, "every controller is off the bus"),
    row(FaultKind::down, "down", kBus, kNoDose, "the bus is gone, for good"),
    row(FaultKind::babble, "babble", kBus, kNoDose, "a stranger fills the bus with frames that no node listens to"),
    row(FaultKind::frozen_position, "frozen_position", kJoint, kNoDose,
        "the position that the drive says stays; the rest is true"),
    row(FaultKind::reversed, "reversed", kJoint, kNoDose,
        "the position that the drive says goes the other way; the rest is true"),
    row(FaultKind::wrap, "wrap", kJoint, kNoDose, "the position that the drive says is a turn off"),
    row(FaultKind::jump, "jump", kJoint, of("rad", -100, 100), "the position that the drive says is off by this"),
    row(FaultKind::scale, "scale", kJoint, above(0, "factor", 100),
        "the position that the drive says goes this many times as far"),
    row(FaultKind::freeze, "freeze", kDriveOrSensor, kNoDose,
        "all that it says of its motion stays; samples repeat an old value under fresh stamps"),
    row(FaultKind::burst, "burst", kSensor, of("ms", 1, 10'000),
        "samples are held back and delivered together, this often"),
    row(FaultKind::lies, "lies", kSensor, above(0, "share", 1), "share of samples that say the opposite"),
    row(FaultKind::push, "push", kBody, above(0, "N", 10'000), "force at the tool, or at a body of the model"),
    row(FaultKind::payload, "payload", kBody, above(0, "kg", 1000),
        "point mass at the tool, or at a body of the model"),
    row(FaultKind::friction, "friction", kBody, above(0, "factor", 1000), "factor on the joints' friction"),
};

constexpr std::array kPanel{
    row(Trouble::none, "none", kNoDose, {}, "nothing: the nominal rollout"),
    row(Trouble::sensor_burst, "sensor_burst", of("ms", 1, 1000, 120), by_plant("burst", Whom::each_sensor),
        "samples are held back and delivered together, once per dose"),
    row(Trouble::sensor_dropout, "sensor_dropout", of("share", 0, 1, 0.7), by_plant("drop", Whom::each_sensor),
        "each sample is lost with this probability"),
    row(Trouble::camera_freeze, "camera_freeze", of("ms", 1, 1000, 500),
        by_plant("freeze", Whom::each_sensor, When::each_second_within),
        "for this long out of every second samples repeat an old value under fresh stamps"),
    row(Trouble::sensor_lies, "sensor_lies", of("share", 0, 1, 0.3), by_plant("lies", Whom::each_sensor),
        "each sample says the opposite with this probability: values negated, images in negative"),
    row(Trouble::estimator_delay, "estimator_delay", of("ms", 0, 1000, 10),
        not_done("the executive decodes replies itself, and nothing outside can make it slower"),
        "replies of the drives are decoded this much later, stamped when they arrived"),
    row(Trouble::inference_stall, "inference_stall", of("ms", 1, 10'000, 400), by_run("hog policy", When::each_second),
        "once per second one inference takes this much longer"),
    row(Trouble::inference_mean_shift, "inference_mean_shift", of("factor", 0.01, 1000, 6),
        by_run("crowd policy", When::window), "every inference takes this many times as long"),
    row(Trouble::gpu_contention, "gpu_contention", of("loads", 1, 64, 8), by_run("load", When::window),
        "the inference device is shared with this many other loads: an inference takes, drawn evenly, from 1 to 1 + 2 "
        "dose times as long"),
    row(Trouble::queue_growth, "queue_growth", of("callbacks", 1, 10'000, 150), by_host("queue_growth"),
        "observations queue up instead of replacing one another, and once per second this many callbacks of 2 ms each "
        "queue up before them"),
    row(Trouble::publish_delay, "publish_delay", of("ms", 0, 10'000, 100), by_host("publish_delay"),
        "commands arrive this much later"),
    row(Trouble::policy_crash, "policy_crash", of("ms", 1, 600'000, 2000),
        by_run("kill policy", When::for_dose, "start policy"),
        "the policy process dies at the start of the window; another one takes its place after this long"),
    row(Trouble::policy_freeze, "policy_freeze", of("ms", 1, 600'000, 400), by_run("freeze policy", When::for_dose),
        "the policy process stands still for this long, then goes on"),
    row(Trouble::bad_actions_nan, "bad_actions_nan", of("share", 0, 1, 0.5), by_host("bad_actions_nan"),
        "a command holds a NaN with this probability"),
    row(Trouble::bad_actions_range, "bad_actions_range", of("share", 0, 1, 0.5), by_host("bad_actions_range"),
        "a command asks one joint for 10 rad (a slide for 10 m) more with this probability"),
    row(Trouble::wrong_joint_order, "wrong_joint_order", of("places", 1, 63, 1), by_host("wrong_joint_order"),
        "the policy's outputs go to joints this many places further on"),
    row(Trouble::scheduler_preemption, "scheduler_preemption", of("ms", 0.1, 1000, 8),
        by_run("hog control", When::at_random),
        "ten times per second, at random, the control thread wakes this much later and loses periods"),
    row(Trouble::cpu_hog, "cpu_hog", of("ms", 0.1, 99, 20), by_run("hog control", When::each_tenth_of_a_second),
        "every 100 ms, from an instant drawn once, a process above the control thread's priority has its core for this "
        "long"),
    row(Trouble::rt_throttling, "rt_throttling", of("ms", 1, 999, 50), by_run("throttle control", When::window),
        "the real-time budget of the control thread's core is used up: the kernel stops the thread for this long out "
        "of every second, from an instant drawn once"),
    row(Trouble::can_loss, "can_loss", of("share", 0, 1, 0.1), by_plant("drop", Whom::each_bus),
        "each frame, in either direction, is lost with this probability"),
    row(Trouble::can_delay, "can_delay", of("ms", 0, 1000, 4), by_plant("delay", Whom::each_joint),
        "replies arrive, and are stamped, this much later"),
    row(Trouble::bus_off, "bus_off", of("ms", 1, 600'000, 100), by_plant("bus_off", Whom::first_bus, When::for_dose),
        "the first bus carries nothing for this long, and its controller says bus-off"),
    row(Trouble::feedback_frozen, "feedback_frozen", kOnce, by_plant("frozen_position", Whom::one_joint),
        "of one joint, drawn once, the drive says the position that it had; the rest is true"),
    row(Trouble::feedback_repeated, "feedback_repeated", kOnce, by_plant("freeze", Whom::one_joint),
        "of one joint, drawn once, the drive says the position, velocity and torque that it had"),
    row(Trouble::feedback_reversed, "feedback_reversed", kOnce, by_plant("reversed", Whom::one_joint),
        "of one joint, drawn once, the position that the drive says goes the other way"),
    row(Trouble::feedback_jump, "feedback_jump", of("rad", 0.001, 100, 0.3), by_plant("jump", Whom::one_joint),
        "of one joint, drawn once, the position that the drive says is off by this (6.2832: an encoder that wraps)"),
    row(Trouble::feedback_scale, "feedback_scale", of("factor", 0.01, 100, 3), by_plant("scale", Whom::one_joint),
        "of one joint, drawn once, the position that the drive says goes this many times as far"),
    row(Trouble::push, "push", of("N", 0, 10'000, 30), by_plant("push", Whom::body, When::push_each_second),
        "a force in a random direction at the tool, for 100 ms of every second"),
    row(Trouble::payload, "payload", of("kg", 0, 1000, 1), by_plant("payload", Whom::body),
        "a point mass sits at the tool"),
    row(Trouble::friction, "friction", of("factor", 0.01, 1000, 4), by_plant("friction", Whom::body),
        "joint friction is multiplied"),
    row(Trouble::operator_stop, "operator_stop", kOnce, by_run("stop", When::once),
        "a person stops the robot at the start of the window"),
};

constexpr bool is_in_order(std::span<const Row> rows) {
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (rows[i].kind != i) return false;
  return true;
}
static_assert(is_in_order(kRun) && is_in_order(kHost) && is_in_order(kPlant) && is_in_order(kPanel));
static_assert(kPanel.size() == kTroubleCount);

constexpr std::array<Place, 4> kPlaces{Place::run, Place::policy_host, Place::plant, Place::panel};
constexpr std::array<std::string_view, 4> kWritten{"--at of `takt run`", "--fault of takt-policy-host",
                                                   "a scenario of takt-plant", "a panel"};

std::string capitals(std::string_view text) {
  std::string all(text);
  for (char& c : all) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return all;
}

}  // namespace

config::Dimension Dose::dimension() const {
  if (unit == "ms") return config::Dimension::time;
  if (unit == "rad") return config::Dimension::angle;
  if (unit == "N") return config::Dimension::force;
  return unit == "kg" ? config::Dimension::mass : config::Dimension::none;
}

double Dose::in_base() const {
  return unit == "ms" ? 1e6 : 1;
}

config::Range Dose::range() const {
  return {.low = least * in_base(), .high = most * in_base(), .low_open = more_than_least};
}

std::span<const Row> rows(Place place) {
  switch (place) {
    case Place::run:
      return kRun;
    case Place::policy_host:
      return kHost;
    case Place::plant:
      return kPlant;
    case Place::panel:
      return kPanel;
  }
  return {};
}

const Row* find(Place place, std::string_view name) {
  const std::span<const Row> all = rows(place);
  const auto found = std::ranges::find(all, name, &Row::name);
  return found == all.end() ? nullptr : &*found;
}

std::string form(const Row& row) {
  std::string text(row.name);
  if (!row.strikes.words.empty()) text += fmt::format(" {}", row.strikes.told);
  if (!row.dose.unit.empty())
    text += " " + (row.dose.dimension() == config::Dimension::time ? "TIME" : capitals(row.dose.unit));
  if (row.place == Place::run && row.longest.ns > 0) text += " DURATION";
  if (row.takes_command) text += " COMMAND";
  return text;
}

std::string forms(Place place) {
  std::vector<std::string> all;
  for (const Row& row : rows(place)) all.push_back(form(row));
  return fmt::format("{}", fmt::join(all, "; "));
}

std::string known_kinds(Place place, std::string_view name) {
  std::vector<std::string_view> names;
  for (const Row& row : rows(place)) names.push_back(row.name);
  for (const Place other : kPlaces)
    if (other != place && find(other, name) != nullptr)
      return fmt::format("is written in {}; here stands one of: {}", kWritten[static_cast<std::size_t>(other)],
                         fmt::join(names, ", "));
  const std::string_view meant = config::nearest(name, names);
  return fmt::format("is not known; {}write one of: {}", meant.empty() ? "" : fmt::format("did you mean `{}`? ", meant),
                     fmt::join(names, ", "));
}

}  // namespace takt::trouble
