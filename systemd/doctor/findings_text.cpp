// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "systemd/doctor/judge.hpp"
#include "systemd/doctor/wakeup_probe.hpp"

namespace takt::doctor {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kBarLength = 40;

std::string histogram(const WakeupLatency& latency) {
  const std::string rarest = latency.p99999_ns
                                 ? fmt::format("p99.999 {} us ({} of {} later)", *latency.p99999_ns / 1000,
                                               latency.beyond_p99999, latency.samples)
                                 : fmt::format("p99.999 wants {} wake-ups (--for 20min)", kFewestForP99999);
  std::string text = fmt::format("\nwake-ups, {}, {}: p50 {} us, p99 {} us, p99.9 {} us, {}, worst {} us\n",
                                 latency.real_time ? "real time" : "WITHOUT real-time priority",
                                 latency.held_awake ? "kept awake" : "SLEEP STATES ALLOWED", latency.p50_ns / 1000,
                                 latency.p99_ns / 1000, latency.p999_ns / 1000, rarest, latency.max_ns / 1000);
  const std::uint64_t most = latency.histogram.empty() ? 0 : *std::ranges::max_element(latency.histogram);
  for (std::size_t bucket = 0; bucket < latency.histogram.size(); ++bucket) {
    const std::uint64_t count = latency.histogram[bucket];
    const auto length = most == 0 ? 0 : (kBarLength * count + most - 1) / most;
    text += fmt::format("  < {:>7} us {:>8} {}\n", std::uint64_t{2} << bucket, count, std::string(length, '#'));
  }
  return text;
}

template <typename Count>
Json or_null(const std::optional<Count>& count) {
  return count ? Json(*count) : Json(nullptr);
}

Json others_busy(const Interference& interference) {
  if (!interference.others || interference.others->all_ticks <= 0) return nullptr;
  return static_cast<double>(interference.others->busy_ticks) / static_cast<double>(interference.others->all_ticks);
}

Json wakeup_of(const Snapshot& snapshot) {
  if (!snapshot.wakeup) return nullptr;
  const WakeupLatency& latency = *snapshot.wakeup;
  return {{"real_time", latency.real_time},
          {"held_awake", latency.held_awake},
          {"samples", latency.samples},
          {"p50_ns", latency.p50_ns},
          {"p99_ns", latency.p99_ns},
          {"p999_ns", latency.p999_ns},
          {"p99999_ns", or_null(latency.p99999_ns)},
          {"beyond_p99999", latency.beyond_p99999},
          {"max_ns", latency.max_ns},
          {"histogram_log2_us", latency.histogram},
          {"smis", or_null(smis_counted(snapshot))},
          {"stolen_ms", or_null(latency.interference.stolen_ms)},
          {"own_load", latency.own_load},
          {"others_busy", others_busy(latency.interference)}};
}

}  // namespace

std::vector<Finding> diagnose(const Snapshot& snapshot, const config::RobotConfig* robot) {
  const Case of{snapshot, robot};
  Findings findings;
  judge_processor(of, findings);
  judge_neighbourhood(of, findings);
  judge_rights(of, findings);
  judge_robot(of, findings);
  judge_measurement(of, findings);
  return findings;
}

Verdict worst(const std::vector<Finding>& findings) {
  Verdict verdict = Verdict::ok;
  for (const Finding& finding : findings) verdict = std::max(verdict, finding.verdict);
  return verdict;
}

std::string text_of(const std::vector<Finding>& findings, const Snapshot& snapshot) {
  std::string text = fmt::format("takt {} on {}\n", snapshot.takt_version, snapshot.kernel_release);
  for (const Finding& finding : findings) {
    text += fmt::format("{:<5} {:<14} {} [{}]\n", name(finding.verdict), finding.check, finding.found, finding.where);
    if (!finding.cure.empty()) text += fmt::format("{:20} -> {}\n", "", finding.cure);
  }
  if (snapshot.wakeup) text += histogram(*snapshot.wakeup);
  const auto count = [&findings](Verdict verdict) { return std::ranges::count(findings, verdict, &Finding::verdict); };
  return text + fmt::format("\n{} to correct, {} to improve, {} fine: {}\n", count(Verdict::fail), count(Verdict::warn),
                            count(Verdict::ok),
                            worst(findings) == Verdict::fail ? "not fit for hard real time" : "fit for hard real time");
}

std::string json_of(const std::vector<Finding>& findings, const Snapshot& snapshot) {
  Json all = Json::array();
  for (const Finding& finding : findings)
    all.push_back({{"check", finding.check},
                   {"verdict", name(finding.verdict)},
                   {"found", finding.found},
                   {"where", finding.where},
                   {"correct", finding.cure}});
  return Json{{"schema", "takt.doctor/1"},           {"verdict", name(worst(findings))},
              {"examined_at", snapshot.examined_at}, {"takt", snapshot.takt_version},
              {"kernel", snapshot.kernel_release},   {"findings", all},
              {"wakeup", wakeup_of(snapshot)}}
      .dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace takt::doctor
