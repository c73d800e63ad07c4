// SPDX-License-Identifier: Apache-2.0
#include "evidence/attestation/attestation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "config/cautions.hpp"
#include "config/load.hpp"
#include "config/model_text.hpp"
#include "config/printable.hpp"
#include "executive/contract/version.hpp"
#include "monitor/judge/freshness_statistics.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/strict_json.hpp"

namespace takt::evidence {
namespace {

using Json = nlohmann::ordered_json;

bool is_stop(std::string_view of) {
  return of.starts_with(kStops);
}

// Sections that only record or tell; keys whose files enter by their contents, and one that moves nothing.
std::string moving_lines(const config::RobotConfig& robot) {
  constexpr std::array<std::string_view, 4> kTelling{"record:", "dds:", "prometheus:", "otlp:"};
  constexpr std::array<std::string_view, 3> kNot{"shown_by:", "file:", "signed_by:"};
  std::string text;
  bool inside = true;
  for (std::size_t at = 0; at < robot.resolved.size();) {
    const std::size_t end = std::min(robot.resolved.find('\n', at), robot.resolved.size() - 1);
    const std::string_view line = std::string_view(robot.resolved).substr(at, end + 1 - at);
    at = end + 1;
    const auto begins = [](std::string_view where) {
      return [where](std::string_view key) { return where.starts_with(key); };
    };
    if (!line.starts_with(' ')) inside = std::ranges::none_of(kTelling, begins(line));
    const std::string_view key = line.substr(std::min(line.find_first_not_of(" -"), line.size()));
    if (inside && std::ranges::none_of(kNot, begins(key))) text += line;
  }
  return text;
}

Json without_hash(const Attestation& a) {
  Json conditions = Json::array();
  for (const AttestedCondition& condition : a.conditions) {
    Json trials = Json::array();
    for (const AttestedTrial& trial : condition.trials)
      trials.push_back({{"seed", trial.seed},
                        {"replay_hash", trial.replay_hash},
                        {"row_sha256", trial.row_sha256},
                        {"seconds", trial.seconds},
                        {"stood", trial.stood}});
    conditions.push_back(
        {{"perturbation", condition.perturbation}, {"dose", condition.dose}, {"trials", std::move(trials)}});
  }
  return {{"schema", kAttestationSchema},
          {"of", a.of},
          {"says", what_it_shows(a)},
          {"robot", a.robot},
          {"moving_parts_sha256", a.parts_sha256},
          {"artifact_id", a.artifact_id},
          {"panel", a.panel},
          {"panel_sha256", config::sha256_hex(a.panel_text)},
          {"panel_text", a.panel_text},
          {"task", a.task},
          {"method", a.method},
          {"timing", a.timing},
          {"script", {{"version", a.script_version}, {"source_sha256", a.script_source_sha256}}},
          {"fell_below", a.fall.least_height},
          {"fell_beyond_rad", a.fall.most_tilt},
          {"conditions", std::move(conditions)}};
}

// One trial to a line, for readers and comparisons.
std::string written(const Json& json) {
  std::string text = "{\n";
  for (const auto& [key, value] : json.items()) {
    text += text.size() == 2 ? "" : ",\n";
    if (key != "conditions") {
      text += fmt::format("  {}: {}", Json(key).dump(), value.dump());
      continue;
    }
    text += "  \"conditions\": [";
    for (std::size_t i = 0; i < value.size(); ++i) {
      text += fmt::format("{}\n    {{\"perturbation\": {}, \"dose\": {}, \"trials\": [", i == 0 ? "" : ",",
                          value[i].at("perturbation").dump(), value[i].at("dose").dump());
      const Json& trials = value[i].at("trials");
      for (std::size_t k = 0; k < trials.size(); ++k)
        text += fmt::format("{}\n      {}", k == 0 ? "" : ",", trials[k].dump());
      text += "]}";
    }
    text += "]";
  }
  return text + "\n}\n";
}

Attestation read(const Json& json) {
  Attestation a;
  a.of = json.at("of");
  a.robot = json.at("robot");
  a.parts_sha256 = json.at("moving_parts_sha256");
  a.artifact_id = json.at("artifact_id");
  a.panel = json.at("panel");
  a.panel_text = json.at("panel_text");
  a.task = json.at("task");
  a.method = json.at("method");
  a.timing = json.at("timing");
  a.script_version = json.at("script").at("version");
  a.script_source_sha256 = json.at("script").at("source_sha256");
  a.fall = {json.at("fell_below"), json.at("fell_beyond_rad")};
  for (const Json& one : json.at("conditions")) {
    AttestedCondition condition{one.at("perturbation"), one.at("dose"), {}};
    for (const Json& trial : one.at("trials"))
      condition.trials.push_back(
          {trial.at("seed"), trial.at("replay_hash"), trial.at("row_sha256"), trial.at("seconds"), trial.at("stood")});
    a.conditions.push_back(std::move(condition));
  }
  return a;
}

std::string name_of(const AttestedCondition& condition) {
  return condition.dose == 0 ? condition.perturbation : fmt::format("{} {:g}", condition.perturbation, condition.dose);
}

double weakest(const Attestation& a) {
  double least = 1;
  for (const AttestedCondition& condition : a.conditions) least = std::min(least, condition.lower_bound());
  return a.conditions.empty() ? 0 : least;
}

bool repeats_a_seed(const AttestedCondition& condition) {
  for (std::size_t i = 1; i < condition.trials.size(); ++i)
    if (condition.trials[i].seed <= condition.trials[i - 1].seed) return true;
  return false;
}

// What does not hang on the robot.
std::string weakness(const Attestation& a) {
  if (a.script_version != release())
    return fmt::format("takt {} computed it, and this is {}; run panel {} again", a.script_version, release(), a.panel);
  if (a.fall.least_height < kLaxest.least_height || a.fall.most_tilt > kLaxest.most_tilt)
    return fmt::format(
        "its panel called a robot fallen below {:g} of its height or beyond {:g} rad only; at the "
        "latest {:g} and {:g} show something",
        a.fall.least_height, a.fall.most_tilt, kLaxest.least_height, kLaxest.most_tilt);
  if (std::ranges::any_of(a.conditions, repeats_a_seed)) return "a trial is in it twice";
  const double needed = is_stop(a.of) ? kLeastStopped_s : kLeastDegraded_s;
  for (const AttestedCondition& condition : a.conditions)
    for (const AttestedTrial& trial : condition.trials)
      if (trial.stood && trial.seconds < needed)
        return fmt::format("under {} it was watched for {:g} s, and {:g} s are asked", name_of(condition),
                           trial.seconds, needed);
  if (weakest(a) < kLeastShown) return fmt::format("{}; {:g} is asked", what_it_shows(a), kLeastShown);
  return {};
}

// Of the same release, and yet of other sources: what they changed, the trials did not see.
std::string other_sources(const Attestation& a) {
  constexpr std::size_t kShort = 12;
  if (a.script_source_sha256 == source_sha256()) return {};
  const std::string_view its = a.script_source_sha256;
  return fmt::format("; takt of {} sources ({}) computed it, this one is of {}: run panel {} again",
                     its.empty() ? "unknown" : "other", its.empty() ? "no hash" : its.substr(0, kShort),
                     source_sha256().substr(0, kShort), a.panel);
}

// What came after the stop's own time was not observed.
std::string end_not_seen(const Attestation& a, const config::RobotConfig& robot) {
  const auto stop = std::ranges::find(robot.stops, std::string_view(a.of).substr(std::min(kStops.size(), a.of.size())),
                                      &config::StopConfig::name);
  if (!is_stop(a.of) || stop == robot.stops.end() || stop->longest == Duration{}) return {};
  double seen = std::numeric_limits<double>::infinity();
  for (const AttestedCondition& condition : a.conditions)
    for (const AttestedTrial& trial : condition.trials)
      if (trial.stood) seen = std::min(seen, trial.seconds);
  if (seen >= stop->longest.seconds() + 1) return {};
  return fmt::format("; it was watched for {:.1f} s, and what follows its `for` of {:g} s was not seen", seen,
                     stop->longest.seconds());
}

}  // namespace

std::uint64_t AttestedCondition::stood() const {
  return static_cast<std::uint64_t>(std::ranges::count(trials, true, &AttestedTrial::stood));
}

double AttestedCondition::lower_bound() const {
  return 1 - monitor::clopper_pearson_upper(trials.size() - stood(), trials.size(), kShownConfidence);
}

std::expected<std::string, std::string> moving_parts_sha256(const config::RobotConfig& robot) {
  std::string text = moving_lines(robot);
  const auto add_policy = [&](const std::string& path) -> std::expected<void, std::string> {
    const auto hash = config::policy_hash(path);
    if (!hash) return std::unexpected(hash.error());
    text += fmt::format("{:016x}\n", *hash);
    return {};
  };
  if (robot.policy)
    if (auto done = add_policy(robot.policy->file); !done) return std::unexpected(done.error());
  for (const config::Fallback& fallback : robot.fallbacks)
    if (fallback.has_own_file())
      if (auto done = add_policy(fallback.file); !done) return std::unexpected(done.error());
  if (robot.simulation && robot.simulation->mujoco) {
    const auto model = config::model_bytes(robot.simulation->mujoco->model);
    if (!model) return std::unexpected(model.error());
    text += config::sha256_hex(*model) + "\n";
  }
  return config::sha256_hex(text);
}

std::string attestation_text(const Attestation& attestation) {
  Json json = without_hash(attestation);
  json["sha256"] = config::sha256_hex(json.dump());
  return written(json);
}

std::expected<Attestation, std::string> attestation_of(std::string_view text) {
  auto json = monitor::parse_strict(text);
  if (!json) return std::unexpected("is " + json.error());
  try {
    if (json->at("schema") != kAttestationSchema)
      return std::unexpected(fmt::format("has schema {}, this version reads \"{}\"",
                                         config::printable(json->at("schema").dump()), kAttestationSchema));
    const std::string hash = json->at("sha256");
    Attestation made = read(*json);
    json->erase("sha256");
    if (*json != without_hash(made) || hash != config::sha256_hex(json->dump()))
      return std::unexpected("is not as it was written; make it anew by `takt panel attest`");
    return made;
  } catch (const nlohmann::json::exception&) {
    return std::unexpected("is no attestation; make it by `takt panel attest`");
  }
}

std::string what_it_shows(const Attestation& attestation) {
  std::string text;
  for (const AttestedCondition& condition : attestation.conditions)
    text += fmt::format("{}{} of {} stood under {}", text.empty() ? "" : ", ", condition.stood(),
                        condition.trials.size(), name_of(condition));
  return fmt::format("{}: at least {:.2f} at {:g} % confidence", text, weakest(attestation), 100 * kShownConfidence);
}

std::string shortcoming(const Attestation& attestation, const config::RobotConfig& robot, const std::string& of) {
  if (attestation.of != of) return fmt::format("it is of {}", attestation.of);
  const auto parts = moving_parts_sha256(robot);
  if (!parts) return parts.error();
  if (*parts != attestation.parts_sha256)
    return attestation.robot == robot.robot
               ? fmt::format("this robot has changed since (file, policy or model); run panel {} again",
                             attestation.panel)
               : fmt::format("it is of robot {}", attestation.robot);
  return weakness(attestation);
}

Standing standing_of(const config::RobotConfig& robot) {
  Standing standing;
  for (const config::Offer& offer : config::offered_as_safe(robot)) {
    const std::string what = fmt::format("{}: {}, and the base is free: ", offer.of, offer.what);
    if (!config::is_shown(offer.shown_by)) {
      standing.not_shown.push_back(what +
                                   "nothing shows that this robot stays on its feet by it; run a panel and name what "
                                   "`takt panel attest` makes of it in shown_by");
      continue;
    }
    std::error_code missing;
    const auto text = std::filesystem::is_regular_file(offer.shown_by, missing)
                          ? monitor::read_file(offer.shown_by)
                          : std::expected<std::string, std::string>(std::unexpected("is no file"));
    const auto attestation =
        text ? attestation_of(*text) : std::expected<Attestation, std::string>(std::unexpected("cannot be read"));
    const std::string why =
        attestation ? shortcoming(*attestation, robot, offer.of) : fmt::format("it {}", attestation.error());
    if (!why.empty())
      standing.not_shown.push_back(fmt::format("{}not shown by {}: {}", what, offer.shown_by, why));
    else
      standing.shown.push_back(fmt::format("{}: {}{} ({}){}", offer.of, what_it_shows(*attestation),
                                           end_not_seen(*attestation, robot), offer.shown_by,
                                           other_sources(*attestation)));
  }
  return standing;
}

}  // namespace takt::evidence
