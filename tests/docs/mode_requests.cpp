// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <limits>

#include "config/load.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "tests/docs/mode_robot.hpp"
#include "tests/docs/mode_situations.hpp"

namespace takt::docs {
namespace {

using namespace pipeline;
using pipeline::testing::Rig;

void arm_slowly(Robot& robot) {
  robot.drives[1].never_enables = true;
  robot.go(40);
  robot.go(10, OperatorRequest::arm);
}

// A robot without a load, so that each mode is reached and kept.
TickConfig plain() {
  TickConfig config = pipeline::testing::robot(3);
  config.freshness.stop_after = seconds(60);
  config.freshness.recover_after = seconds(60);
  config.enable_timeout = seconds(60);
  return config;
}

struct Start {
  Mode mode;
  void (*reach)(Robot&);
};
constexpr std::array<Start, kModeCount> kStarts{{
    {Mode::standby, [](Robot& robot) { robot.go(100); }},
    {Mode::arming, arm_slowly},
    {Mode::tracking, [](Robot& robot) { robot.track(); }},
    {Mode::degraded, [](Robot& robot) { robot.degrade(); }},
    {Mode::damped_stop, [](Robot& robot) { robot.stop(); }},
    {Mode::fault_latched,
     [](Robot& robot) {
       robot.track();
       robot.drives[1].fault = true;
       robot.go(20);
     }},
}};

struct Request {
  std::string_view words;
  void (*prepare)(Robot&);
  void (*ask)(Robot&);
};

void nothing(Robot& /*robot*/) {}

void press_twice(Robot& robot, int ticks_between) {
  robot.go(ticks_between, OperatorRequest::press_stop);
  robot.go(1, OperatorRequest::press_stop);
}

void come_to_rest(Robot& robot) {
  for (int i = 0; i < 2000; ++i) {
    for (Rig::Drive& drive : robot.drives) drive.dq *= 0.9F;
    robot.go(1);
  }
}

void ask_for_reset(Robot& robot) {
  robot.go(1, OperatorRequest::reset);
}

const Request kRequests[] = {
    {"arm", nothing, [](Robot& robot) { robot.go(1, OperatorRequest::arm); }},
    {"stop, by a program", nothing, [](Robot& robot) { robot.go(1, OperatorRequest::stop); }},
    {"the same for 1 s", nothing,
     [](Robot& robot) {
       for (int i = 0; i < 1000; ++i) robot.go(1, OperatorRequest::stop);
     }},
    {"first press", nothing, [](Robot& robot) { robot.go(1, OperatorRequest::press_stop); }},
    {"second press after 0.15 s", nothing, [](Robot& robot) { press_twice(robot, 150); }},
    {"second press after 0.2 s", nothing, [](Robot& robot) { press_twice(robot, 200); }},
    {"no power", nothing, [](Robot& robot) { robot.go(1, OperatorRequest::deenergise); }},
    {"SIGTERM", nothing, [](Robot& robot) { robot.go(1, OperatorRequest::shutdown); }},
    {"reset while a joint with power moves",
     [](Robot& robot) {
       robot.drives[0].dq = 1.0F;
       robot.go(5);
       robot.drives[0].dq = 1.0F;
     },
     ask_for_reset},
    {"reset at rest, the drive still reports its fault", come_to_rest, ask_for_reset},
    {"reset at rest, a joint is silent",
     [](Robot& robot) {
       come_to_rest(robot);
       robot.drives[2].silent = true;
       robot.go(30);
     },
     ask_for_reset},
};

struct LimitSetup {
  std::string_view key, how, proof;
  void (*exceed)(Robot&);
};

const LimitSetup kLimits[] = {
    {"joints[].limits.position_margin", "a measured angle further outside `limits.position`",
     "pipeline_test Faults.EachLeadsToItsMode",
     [](Robot& robot) {
       robot.config.feedback = {0, 0, {}};
       robot.drives[0].q = robot.config.joints[0].limits.q_max + robot.config.joints[0].limits.q_hard_margin + 0.05F;
     }},
    {"joints[].limits.velocity_hard", "a measured speed above it", "pipeline_test Faults.EachLeadsToItsMode",
     [](Robot& robot) {
       robot.config.feedback = {0, 0, {}};
       robot.drives[0].q = -1.0F;
       robot.drives[0].dq = robot.config.joints[0].limits.velocity_hard + 4.0F;
     }},
    {"freshness.bad_command_limit", "more invalid messages within `freshness.window`",
     "pipeline_test Commands.RepeatedRefusalsStopTheRobot",
     [](Robot& robot) { robot.wants = std::numeric_limits<float>::quiet_NaN(); }},
    {"freshness.clamped_share",
     "positions beyond `limits.target_margin`, velocities or torques beyond their limit, or gains beyond twice theirs, "
     "in a larger share of the window's ticks",
     "pipeline_test OutOfRange.MoreThanTheShareOfTheWindowStopsTheRobot", [](Robot& robot) { robot.wants = 5.0F; }},
};

}  // namespace

std::expected<std::vector<RequestRow>, std::string> measure_requests() {
  std::vector<RequestRow> rows;
  for (const Request& request : kRequests) {
    RequestRow row{request.words, {}};
    for (const Start& start : kStarts) {
      Robot robot(plain());
      start.reach(robot);
      if (robot.mode() != start.mode)
        return std::unexpected(failed(name(start.mode), request.words, fmt::format("reached {}", name(robot.mode()))));
      request.prepare(robot);
      std::string& leads_to = row.leads_to.at(static_cast<std::size_t>(start.mode));
      const Mode from = robot.mode();
      request.ask(robot);
      leads_to = from != start.mode ? "not there" : robot.mode() == from ? "stays" : name(robot.mode());
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

std::expected<std::vector<Instant>, std::string> measure_silence() {
  const auto file = config::load("config/arm6.yaml");
  if (!file) return std::unexpected(file.error());
  TickConfig config = setup::tick_config_of(*file, 0);
  config.policy.needs_outside_stamp = false;
  config.unrecorded_limit = 0;
  Robot robot(config);
  robot.track();
  robot.speaks = false;
  const std::uint64_t answered = robot.header().seats[Seat::policy].observation_answered;
  std::vector<Instant> instants;
  const auto note = [&](std::string_view what) {
    instants.push_back({(robot.now - robot.sensed_at[answered]).milliseconds(), what});
  };
  for (int tick = 0; tick < 3000 && instants.size() < 4; ++tick) {
    robot.go(1);
    if (instants.empty() && robot.header().seats[Seat::policy].freshness == Freshness::aging) note("aging");
    if (instants.size() == 1 && !is_usable(robot.header().seats[Seat::policy].freshness)) note("stale");
    if (instants.size() == 2 && robot.header().cause == Cause::command_late) note("command_late");
    if (instants.size() == 3 && robot.header().cause == Cause::command_lost) note("command_lost");
  }
  if (instants.size() != 4) return std::unexpected("mode_page: config/arm6.yaml: its silence has other instants");
  return instants;
}

std::expected<std::vector<Exceeded>, std::string> measure_limits() {
  std::vector<Exceeded> found;
  for (const LimitSetup& limit : kLimits) {
    TickConfig config = plain();
    config.degraded = DegradedBehaviour::slow;
    config.freshness.epsilon = 0.9;
    Robot robot(config);
    robot.track();
    limit.exceed(robot);
    Exceeded row{limit.key, limit.how, "", "", true, limit.proof};
    for (int tick = 0; tick < 3000 && row.mode.empty(); ++tick) {
      robot.go(1);
      if (robot.mode() != Mode::tracking) row.mode = name(robot.mode()), row.cause = name(robot.header().cause);
    }
    for (std::size_t j = 0; j < config.joint_count; ++j) row.keeps_power &= robot.out->drive_enabled[j];
    if (row.mode.empty()) return std::unexpected(failed(limit.key, limit.how, "nothing happened"));
    found.push_back(std::move(row));
  }
  return found;
}

}  // namespace takt::docs
