// SPDX-License-Identifier: Apache-2.0
// The operator's half of the reception: status, arm, stop, reset, mark, swap, back. A stop has come by its own way
// already (stop_thread.hpp) when it is asked for here: this is where it is answered, and asked for again, which changes
// nothing.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <string_view>
#include <thread>

#include "config/cautions.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "executive/runtime/arming.hpp"
#include "executive/runtime/clock.hpp"
#include "executive/runtime/reception.hpp"
#include "executive/runtime/stop_thread.hpp"

namespace takt::runtime {
namespace {

// One sentence per line; what does not fit is dropped whole.
void say(OperatorReply& reply, std::string_view sentence) {
  const std::string_view said(reply.sentences);
  const std::size_t separator = said.empty() ? 0 : 1;
  if (said.size() + separator + sentence.size() >= sizeof reply.sentences) return;
  if (separator != 0) reply.sentences[said.size()] = '\n';
  sentence.copy(reply.sentences + said.size() + separator, sentence.size());
}

// The question at the end of `sentence` gives way to what the host says itself; empty: it said nothing.
std::string with_reason(std::string sentence, std::string_view question, const std::string& problem) {
  if (!problem.empty() && sentence.ends_with(question))
    sentence.replace(sentence.size() - question.size(), question.size(), problem);
  return sentence;
}
// As pipeline/arming.cpp asks.
constexpr std::string_view kIsHostRunning = "the policy host's log says why, docs/troubleshooting.md what to do";
constexpr std::string_view kIsFallbackHostRunning = "is its host running (takt-policy-host --fallback)?";

bool waits_for_command(const std::vector<std::string>& missing) {
  return std::ranges::any_of(missing, [](const std::string& sentence) {
    return sentence.starts_with("no fresh command: ") && sentence.ends_with(kIsHostRunning);
  });
}

constexpr std::string_view kStoppedSince = "a stop was asked for since this command began to ask: give it again";
constexpr std::string_view kNotNoticed = "the control thread did not answer in time: is it running? see takt status";
constexpr std::string_view kFaultDampsOnly =
    "mode fault_latched: what failed has no power, and nothing moves on purpose; again, or with --now, takes their "
    "power away: what hangs falls";

}  // namespace

OperatorReply Reception::answer(pid_t asker, const OperatorMessage& message, std::string_view text) {
  OperatorReply reply;
  const OperatorVerb verb = message.verb;
  switch (verb) {
    case OperatorVerb::status:
      reply.done = 1;
      parts_.follower.catch_up();
      if (const TickRecord& latest = parts_.follower.latest(); latest.header.mode == Mode::standby)
        for (const std::string& fault : drive_faults(latest, parts_.config, parts_.robot)) say(reply, fault);
      for (const Seat seat : kSeats)
        if (const std::string problem = words_.problem(kPolicyRoles[seat]); !problem.empty() && leases_[seat].attached)
          say(reply, fmt::format("{}: {}", name(kPolicyRoles[seat]), problem));
      for (const config::WatchdogWaiver& waiver : config::watchdog_waivers(parts_.robot))
        say(reply,
            "joint " + waiver.joint + ": its drive has no command timeout (watchdog_waiver: " + waiver.reason + ")");
      break;
    case OperatorVerb::arm:
      arm(asker, reply);
      break;
    case OperatorVerb::stop:
    case OperatorVerb::press_stop:
    case OperatorVerb::deenergise:
      pending_arms_.stop();
      stop(verb, reply);
      break;
    case OperatorVerb::reset:
      pending_arms_.forget(asker);
      reset(reply);
      break;
    case OperatorVerb::mark:
      mark(text, reply);
      break;
    case OperatorVerb::swap:
      swap(message.policy_hash, reply);
      break;
    case OperatorVerb::back:
      back(reply);
      break;
  }
  reply.status = status();
  parts_.follower.catch_up();
  reply.incident = incident();
  return reply;
}

bool Reception::wait_for(OperatorRequest request, std::uint64_t after_tick) {
  const auto give_up_at = std::chrono::steady_clock::now() + kRequestPatience;
  while (std::chrono::steady_clock::now() < give_up_at) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    parts_.follower.catch_up();
    if (parts_.follower.noticed(request, after_tick)) return true;
  }
  return false;
}

std::vector<std::string> Reception::missing() const {
  return missing_for_arming(parts_.follower.latest(), parts_.config, parts_.robot,
                            {.buses = &parts_.follower.buses(),
                             .policy_attached = leases_[seat_in_charge()].attached,
                             .realtime = realtime_,
                             .allow_non_realtime = allow_non_realtime_,
                             .shutting_down = shutting_down_,
                             .policy_in_file = parts_.robot.policy.has_value()});
}

void Reception::arm(pid_t asker, OperatorReply& reply) {
  if (pending_arms_.is_ended(asker, SystemClock().now())) return say(reply, kStoppedSince);
  parts_.follower.catch_up();
  auto missing = this->missing();
  // No command of before a reset counts after it: the next one is on its way.
  const auto give_up_at = std::chrono::steady_clock::now() + kRequestPatience;
  while (leases_[seat_in_charge()].attached && waits_for_command(missing) &&
         std::chrono::steady_clock::now() < give_up_at) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    parts_.follower.catch_up();
    missing = this->missing();
  }
  const TickRecord& latest = parts_.follower.latest();
  const Role in_charge = kPolicyRoles[seat_in_charge()];
  for (const std::string& sentence : missing)
    say(reply, with_reason(with_reason(sentence, kIsHostRunning, words_.problem(in_charge)), kIsFallbackHostRunning,
                           words_.problem(Role::fallback_policy)));
  if (const IncidentNote stop = incident(); stop.stands != 0 && stop.stop_asked != 0 && !operators_.last_stop().empty())
    say(reply, "a stop was asked for by " + operators_.last_stop());
  if (!missing.empty()) return;
  const std::uint64_t tick = latest.header.tick;
  parts_.requests.arm();
  if (!wait_for(OperatorRequest::arm, tick)) return say(reply, kNotNoticed);
  const Mode mode = parts_.follower.latest().header.mode;
  reply.done = mode == Mode::arming || mode == Mode::tracking || mode == Mode::degraded ? 1 : 0;
  if (reply.done != 0) pending_arms_.forget(asker);
  if (reply.done == 0)
    return say(reply, "something came between: " + active_causes(parts_.follower.latest().header) + ": try again");
  if (const std::string stops = config::stops_without_model(parts_.robot); !stops.empty()) say(reply, stops);
}

void Reception::stop(OperatorVerb verb, OperatorReply& reply) {
  // Not a second press: that would de-energise.
  const OperatorRequest request =
      verb == OperatorVerb::deenergise ? OperatorRequest::deenergise : OperatorRequest::stop;
  const std::uint64_t tick = parts_.follower.latest().header.tick;
  pass_on(verb == OperatorVerb::press_stop ? OperatorVerb::stop : verb, SystemClock().now(), parts_.requests);
  reply.done = 1;
  if (!wait_for(request, tick) && !parts_.follower.noticed(OperatorRequest::shutdown, tick))
    return say(reply, kNotNoticed);
  if (verb != OperatorVerb::deenergise && parts_.follower.latest().header.mode == Mode::fault_latched)
    say(reply, kFaultDampsOnly);
}

void Reception::reset(OperatorReply& reply) {
  const std::uint64_t tick = parts_.follower.latest().header.tick;
  parts_.requests.reset();
  if (!wait_for(OperatorRequest::reset, tick)) return say(reply, kNotNoticed);
  const TickRecordHeader& now = parts_.follower.latest().header;
  reply.done = now.mode == Mode::standby ? 1 : 0;
  if (reply.done != 0) return;
  const auto moves = [this] {
    return still_moves(parts_.follower.latest(), parts_.follower.asked_for_rest(), parts_.config, parts_.robot.joints);
  };
  switch (now.mode) {
    case Mode::damped_stop:
      if (now.player == Player::fallback)
        return say(reply, "the fallback policy moves the robot: hold it, then take its power (takt stop --now)");
      return say(reply, moves());
    case Mode::fault_latched:
      if ((now.causes_active & pipeline::kLastingFaults) == 0) return say(reply, moves());
      return say(reply, "the fault still holds: " + active_causes(now) + ": correct it, then reset");
    case Mode::arming:
    case Mode::tracking:
    case Mode::degraded:
      return say(reply, "the robot is armed: stop it first");
    case Mode::standby:
      return;
  }
}

void Reception::mark(std::string_view text, OperatorReply& reply) {
  const std::uint64_t tick = parts_.follower.latest().header.tick;
  parts_.requests.mark();
  if (!wait_for(OperatorRequest::mark, tick)) return say(reply, kNotNoticed);
  reply.done = 1;
  const std::uint64_t marked = parts_.follower.last_read(OperatorRequest::mark);
  say(reply, fmt::format("marked tick {}{}{}", marked, text.empty() ? "" : ": ", text));
}

void Reception::swap(std::uint64_t policy_hash, OperatorReply& reply) {
  const StatusSnapshot now = status();
  const CandidateRecord& candidate = now.tick.candidate;
  if (candidate.in_charge != 0)
    return say(reply, fmt::format("candidate {:016x} is in charge already", candidate.policy_hash));
  if (!leases_[Seat::candidate].attached)
    return say(reply, "no candidate runs beside the policy: takt policy shadow FILE starts one");
  if (policy_hash != candidate.policy_hash)
    return say(reply, fmt::format("the candidate is {:016x}, not {:016x}: takt status says who runs beside the policy",
                                  candidate.policy_hash, policy_hash));
  if (pipeline::is_latched(now.tick.mode)) return say(reply, "the robot is stopped: reset it first");
  if (!is_usable(now.tick.seats[Seat::candidate].freshness))
    return say(reply, "the candidate has no fresh command: takt status says why");
  const std::uint64_t tick = parts_.follower.latest().header.tick;
  parts_.requests.swap(policy_hash);
  if (!wait_for(OperatorRequest::swap, tick)) return say(reply, kNotNoticed);
  reply.done = 1;
}

void Reception::back(OperatorReply& reply) {
  const StatusSnapshot now = status();
  if (now.tick.candidate.in_charge == 0) return say(reply, "the robot's own policy is in charge already");
  if (!leases_[Seat::policy].attached)
    return say(reply, "the robot's own policy does not run: start its host (takt-policy-host), then try again");
  if (pipeline::is_latched(now.tick.mode)) return say(reply, "the robot is stopped: reset it first");
  const std::uint64_t tick = parts_.follower.latest().header.tick;
  parts_.requests.back();
  if (!wait_for(OperatorRequest::back, tick)) return say(reply, kNotNoticed);
  reply.done = 1;
}

}  // namespace takt::runtime
