// SPDX-License-Identifier: Apache-2.0
#include "cli/run/status_text.hpp"

#include <fmt/format.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "config/printable.hpp"
#include "monitor/record/facts_json.hpp"

namespace takt::cli {
namespace {

std::string age_text(const SeatRecord& seat) {
  const auto age = age_of(seat);
  return age ? fmt::format("{:.1f} ms", age->milliseconds()) : "none";
}

std::string recording_text(const StatusSnapshot& status) {
  if (status.tick.recorded_through != 0) return fmt::format("recorded up to tick {}", status.tick.recorded_through);
  return status.recorder_required != 0 ? "nothing is recorded" : "nothing is recorded (record.recorder: optional)";
}

std::string peer_text(std::uint64_t pid) {
  return pid == 0 ? "not attached" : fmt::format("pid {}", pid);
}

// What answers at the socket may be anything.
template <std::size_t size>
std::string said(const char (&field)[size]) {
  return config::printable({field, strnlen(field, size)});
}

nlohmann::json incident_json(const IncidentNote& incident) {
  if (incident.tick == 0) return nullptr;
  return {{"stands", incident.stands != 0},     {"tick", incident.tick},         {"monotonic_ns", incident.at.ns},
          {"first_tick", incident.first_tick},  {"mode", name(incident.mode)},   {"cause", name(incident.cause)},
          {"asked", incident.asked != 0},       {"where", said(incident.where)}, {"error_code", incident.error_code},
          {"sentence", said(incident.sentence)}};
}

nlohmann::json candidate_json(const TickRecordHeader& tick) {
  const CandidateRecord& candidate = tick.candidate;
  const SeatRecord& seat = tick.seats[Seat::candidate];
  if (candidate.policy_hash == 0) return nullptr;
  return {{"policy", fmt::format("{:016x}", candidate.policy_hash)},
          {"in_charge", candidate.in_charge != 0},
          {"on_probation", candidate.on_probation != 0},
          {"is_asked", candidate.is_asked != 0},
          {"freshness", name(seat.freshness)},
          {"age_ns", monitor::in_ns(age_of(seat))},
          {"distance_rad", candidate.distance},
          {"last_refusal", name(seat.last_refusal)},
          {"beyond_range", candidate.beyond_range},
          {"beyond_limits", candidate.beyond_limits}};
}

}  // namespace

std::vector<std::string> sentences_of(const OperatorReply& reply) {
  const std::string all = said(reply.sentences);
  std::vector<std::string> sentences;
  for (std::size_t begin = 0; begin < all.size();) {
    const std::size_t end = std::min(all.find('\n', begin), all.size());
    if (end > begin) sentences.push_back(all.substr(begin, end - begin));
    begin = end + 1;
  }
  return sentences;
}

std::uint64_t overruns_of(const StatusSnapshot& status) {
  std::uint64_t sum = 0;
  for (std::size_t cause = 1; cause < kOverrunCauseCount; ++cause) sum += status.overruns[cause];
  return sum;
}

// "pid 12 (0123456789abcdef), beside the policy: fresh, age 12.3 ms, differs by 0.0312 rad".
std::string candidate_text(const StatusSnapshot& status) {
  const CandidateRecord& candidate = status.tick.candidate;
  const SeatRecord& seat = status.tick.seats[Seat::candidate];
  const bool plays = candidate.in_charge != 0;
  const std::string who =
      fmt::format("{} ({:016x})", peer_text(status.policy_pids[Seat::candidate]), candidate.policy_hash);
  const std::string where = !plays ? "beside the policy"
                                   : fmt::format("IN CHARGE{}; beside it the robot's own",
                                                 candidate.on_probation != 0 ? ", on probation" : "");
  return fmt::format("{}, {}: command {}, age {}, differs by {:.4f} rad{}", who, where, name(seat.freshness),
                     age_text(seat), candidate.distance, candidate.is_asked != 0 ? "; a change is asked for" : "");
}

std::string incident_sentence(const IncidentNote& incident) {
  return incident.stands == 0 ? "" : said(incident.sentence);
}

std::string status_text(const StatusSnapshot& status, const IncidentNote& incident) {
  const TickRecordHeader& tick = status.tick;
  const bool falls_back = tick.player == Player::fallback;
  std::string text = fmt::format("mode       {}{}\n", name(tick.mode), falls_back ? ", by the fallback policy" : "");
  if (incident.tick != 0)
    text +=
        fmt::format("incident   {}{}\n", incident.stands != 0 ? "" : "none now; the last: ", said(incident.sentence));
  text += fmt::format("command    {}, age {}\n", name(tick.seats[Seat::policy].freshness),
                      age_text(tick.seats[Seat::policy]));
  text += fmt::format("misses     {} of the last {} ticks\n", tick.window_misses, tick.window_ticks);
  text += fmt::format("ticks      {}, {} overruns, {} periods skipped\n", status.ticks, overruns_of(status),
                      tick.skipped_periods);
  for (std::size_t cause = 1; cause < kOverrunCauseCount; ++cause)
    if (status.overruns[cause] != 0)
      text += fmt::format("           {} {}\n", status.overruns[cause], name(static_cast<OverrunCause>(cause)));
  text += fmt::format("messages   {} accepted, {} refused, {} integration errors\n",
                      status.arrivals[static_cast<std::size_t>(Arrival::accepted)], tick.refused_commands,
                      tick.integration_errors);
  for (std::size_t arrival = 2; arrival < kArrivalCount; ++arrival)
    if (status.arrivals[arrival] != 0)
      text += fmt::format("           {} {}\n", status.arrivals[arrival], name(static_cast<Arrival>(arrival)));
  const bool hot = (tick.causes_active >> static_cast<unsigned>(Cause::temperature_high) & 1U) != 0;
  const bool behind = (tick.causes_active >> static_cast<unsigned>(Cause::following_error) & 1U) != 0;
  const std::string enabled = status.enabled_drives == 0 ? "disabled"
                              : status.enabled_drives == status.drive_count
                                  ? "enabled"
                                  : fmt::format("{} of {} enabled, the others have no power (takt top says which)",
                                                status.enabled_drives, status.drive_count);
  text += fmt::format("drives     {}{}{}\n", enabled,
                      hot ? "; hotter than a warning of limits.temperature (takt top says which)" : "",
                      behind ? "; a joint is behind its reference (takt top says which)" : "");
  text += fmt::format("policy     {}\n", peer_text(status.policy_pids[Seat::policy]));
  if (status.policy_pids[Seat::fallback] != 0 || tick.seats[Seat::fallback].freshness != Freshness::missing)
    text += fmt::format("fallback   {}, command {}, age {}\n", peer_text(status.policy_pids[Seat::fallback]),
                        name(tick.seats[Seat::fallback].freshness), age_text(tick.seats[Seat::fallback]));
  if (tick.candidate.policy_hash != 0) text += fmt::format("candidate  {}\n", candidate_text(status));
  text += fmt::format("monitor    {}, {}\n", peer_text(status.monitor_pid), recording_text(status));
  text += fmt::format("real time  {}\n", status.realtime != 0 ? "yes" : "no (--allow-non-realtime)");
  return text;
}

std::string status_line(const StatusSnapshot& status, Duration max_age) {
  const TickRecordHeader& tick = status.tick;
  std::string limit = max_age.ns > 0 ? fmt::format(" / {:.0f} ms", max_age.milliseconds()) : "";
  const std::string_view mode = tick.player != Player::fallback  ? name(tick.mode)
                                : tick.mode == Mode::damped_stop ? "stop/fallback"
                                                                 : "fallback";
  return fmt::format("{:<13} age {:>9}{}  {:<7}  misses {}/{}  overruns {}{}", mode, age_text(tick.seats[Seat::policy]),
                     limit, name(tick.seats[Seat::policy].freshness), tick.window_misses, tick.window_ticks,
                     overruns_of(status), status.realtime != 0 ? "" : "  (not real time)");
}

nlohmann::json status_json(const StatusSnapshot& status, const IncidentNote& incident) {
  const TickRecordHeader& tick = status.tick;
  nlohmann::ordered_json json = monitor::facts_json(tick);
  json.update({{"overruns", monitor::counts_json<OverrunCause>(status.overruns, 1)},
               {"arrivals", monitor::counts_json<Arrival>(status.arrivals, 1)},
               {"incident", incident_json(incident)},
               {"drive_count", status.drive_count},
               {"enabled_drives", status.enabled_drives},
               {"policy_pid", status.policy_pids[Seat::policy]},
               {"fallback_pid", status.policy_pids[Seat::fallback]},
               {"fallback_freshness", name(tick.seats[Seat::fallback].freshness)},
               {"fallback_age_ns", monitor::in_ns(age_of(tick.seats[Seat::fallback]))},
               {"candidate_pid", status.policy_pids[Seat::candidate]},
               {"candidate", candidate_json(tick)},
               {"monitor_pid", status.monitor_pid},
               {"recorder_required", status.recorder_required != 0},
               {"realtime", status.realtime != 0}});
  return json;
}

}  // namespace takt::cli
