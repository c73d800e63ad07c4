// SPDX-License-Identifier: Apache-2.0
#include "lab/panel/registration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <ranges>
#include <set>

#include "config/load.hpp"
#include "lab/artifact/envelope.hpp"
#include "lab/artifact/time_stamp.hpp"
#include "lab/panel/panel_promise.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/json_error.hpp"
#include "monitor/record/run_manifest.hpp"

namespace takt::lab {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kPredicateType = "urn:takt:registration:1";
constexpr const char* kPanelFile = "panel.yaml";
constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;

struct Registration {
  std::int64_t unix_ns = 0;  // by the signer's clock
  PanelPromise promise;
  ArtifactManifest manifest;
  std::optional<RegisteredComparison> comparison;
};

std::expected<Registration, std::string> registration_of(const Json& statement) {
  if (text_at(statement, "predicateType") != kPredicateType)
    return std::unexpected(fmt::format("{} registers no panel", ArtifactFolder::kRegistration));
  try {
    const Json& said = statement.at("predicate");
    Registration made;
    made.unix_ns = said.at("registered").at("unix_ns").get<std::int64_t>();
    const auto text = said.at("panel").get<std::string>();
    auto promise = panel_promise_of(text, kPanelFile);
    if (!promise) return std::unexpected(promise.error());
    made.promise = std::move(*promise);
    auto manifest = artifact_manifest_of(said.at("manifest"));
    if (!manifest) return std::unexpected(manifest.error());
    made.manifest = std::move(*manifest);
    if (config::sha256_hex(text) != made.manifest.panel_sha256)
      return std::unexpected("what is registered contradicts itself: its manifest is of another panel");
    if (const Json& comparison = said.at("comparison"); !comparison.is_null())
      made.comparison = {comparison.at("a"), comparison.at("b"), comparison.at("margin")};
    return made;
  } catch (const Json::exception& error) {
    return std::unexpected(
        fmt::format("{} is not as it was written: {}", ArtifactFolder::kRegistration, monitor::sentence_of(error)));
  }
}

// What is in one set and not in the other, in sentences.
class Differences {
 public:
  void add(std::string sentence) { sentences_.push_back(std::move(sentence)); }
  void add_if_other(std::string_view what, const std::string& registered, const std::string& ran) {
    if (registered != ran) add(fmt::format("{}: {} registered, {} ran", what, registered, ran));
  }
  template <class Set>
  void add_members(std::string_view what, const Set& registered, const Set& ran) {
    for (const auto& one : registered)
      if (!ran.contains(one)) add(fmt::format("{} {} was registered, and did not run", what, one));
    for (const auto& one : ran)
      if (!registered.contains(one)) add(fmt::format("{} {} ran, and was not registered", what, one));
  }
  std::vector<std::string> take() { return std::move(sentences_); }

 private:
  std::vector<std::string> sentences_;
};

std::set<std::string> conditions_of(const PanelPromise& promise) {
  std::set<std::string> all;
  for (const PanelPromise::Condition& one : promise.conditions)
    all.insert(fmt::format("{} at {:g} on {}", one.perturbation, one.dose, one.task));
  return all;
}

template <class Map>
std::set<std::string> names_of(const Map& map) {
  std::set<std::string> names;
  for (const auto& [name, value] : map) names.insert(name);
  return names;
}

std::string contract_text(const TaskFacts& facts) {
  return fmt::format("Pr(age > {:g} ms) <= {:g} at {:g}", facts.max_age_ms, facts.epsilon, facts.confidence);
}

void compare_methods(const ArtifactManifest& registered, const ArtifactManifest& ran, Differences& differences) {
  differences.add_members("method", names_of(registered.methods), names_of(ran.methods));
  for (const auto& [name, method] : registered.methods) {
    const auto other = ran.methods.find(name);
    if (other == ran.methods.end()) continue;
    for (const auto& [task, facts] : method.tasks) {
      const auto now = other->second.tasks.find(task);
      if (now == other->second.tasks.end()) continue;  // said once, as a task that did not run
      const std::string where = fmt::format("method {} on {}", name, task);
      if (now->second.config_sha256 != facts.config_sha256) differences.add(where + ": another configuration ran");
      if (now->second.policy_sha256 != facts.policy_sha256) differences.add(where + ": another policy ran");
      differences.add_if_other("contract of " + where, contract_text(facts), contract_text(now->second));
    }
  }
}

void compare_outcomes(const PanelPromise& registered, const PanelPromise& ran, Differences& differences) {
  const auto text = [](const PanelPromise::Outcome& one) {
    return fmt::format("{:g} s, {}", one.duration_s,
                       one.bound_m ? fmt::format("bound {:g} m", *one.bound_m) : "no bound");
  };
  for (const auto& [task, outcome] : registered.outcomes)
    if (const auto other = ran.outcomes.find(task); other != ran.outcomes.end())
      differences.add_if_other("rollouts of " + task, text(outcome), text(other->second));
}

// Of seeds that end when success is decided, those that ran are the first of the registered ones.
bool are_seeds_of(const ArtifactManifest& registered, const ArtifactManifest& ran) {
  if (ran.until_decided.empty()) return registered.seed_plan.seeds == ran.seed_plan.seeds;
  return ran.seed_plan.seeds.size() <= registered.seed_plan.seeds.size() &&
         std::ranges::equal(
             ran.seed_plan.seeds,
             registered.seed_plan.seeds | std::views::take(static_cast<std::ptrdiff_t>(ran.seed_plan.seeds.size())));
}

std::string decision_text(const std::vector<std::string>& until_decided) {
  return until_decided.size() == 2 ? fmt::format("until {},{} is decided", until_decided[0], until_decided[1])
                                   : "every seed";
}

std::vector<std::string> differences_of(const Registration& registered, const ArtifactManifest& ran,
                                        const PanelPromise& promise) {
  const ArtifactManifest& said = registered.manifest;
  Differences differences;
  differences.add_if_other("panel", said.panel, ran.panel);
  if (!are_seeds_of(said, ran))
    differences.add(fmt::format("seeds: {} registered, {} ran", said.seed_plan.rule, ran.seed_plan.rule));
  differences.add_if_other("end", decision_text(said.until_decided), decision_text(ran.until_decided));
  differences.add_members("task", names_of(said.plants), names_of(ran.plants));
  for (const auto& [task, plant] : said.plants)
    if (const auto other = ran.plants.find(task); other != ran.plants.end() && other->second != plant)
      differences.add(fmt::format("task {}: another plant ran", task));
  compare_methods(said, ran, differences);
  compare_outcomes(registered.promise, promise, differences);
  differences.add_members("condition", conditions_of(registered.promise), conditions_of(promise));
  if (said.claims != ran.claims) differences.add("claims: others than the registered ones");
  differences.add_if_other("takt", fmt::format("{} {:.12}", said.script_version, said.script_source_sha256),
                           fmt::format("{} {:.12}", ran.script_version, ran.script_source_sha256));
  if (contents_of(said.outside.world) != contents_of(ran.outside.world)) differences.add("another world's program ran");
  if (contents_of(said.outside.policy_host) != contents_of(ran.outside.policy_host))
    differences.add("another policy host's program ran");
  std::vector<std::string> found = differences.take();
  if (found.empty() && said.panel_sha256 != ran.panel_sha256)
    found.emplace_back("panel.yaml: another text than the registered one");
  return found;
}

}  // namespace

RegistrationFiles registration_beside(const std::string& panel_file) {
  const std::string stem = std::filesystem::path(panel_file).replace_extension().string();
  return {fmt::format("{}.{}", stem, ArtifactFolder::kRegistration),
          fmt::format("{}.{}", stem, ArtifactFolder::kRegistrationStamp)};
}

std::expected<std::string, std::string> registration_text(const Contest& contest, const ArtifactManifest& manifest,
                                                          const std::optional<RegisteredComparison>& comparison,
                                                          std::int64_t unix_ns, std::string_view private_key_pem) {
  const Panel& panel = contest.panel();
  const Json subject{{"name", kPanelFile}, {"digest", {{"sha256", panel.sha256}}}};
  Json said{{"registered", {{"utc", monitor::utc_text(unix_ns)}, {"unix_ns", unix_ns}}},
            {"comparison", nullptr},
            {"manifest", to_json(manifest)},
            {"panel", panel.text}};
  if (comparison) said["comparison"] = {{"a", comparison->a}, {"b", comparison->b}, {"margin", comparison->margin}};
  const Json statement{{"_type", kStatementType},
                       {"subject", Json::array({subject})},
                       {"predicateType", kPredicateType},
                       {"predicate", std::move(said)}};
  return seal_envelope(statement.dump(), private_key_pem);
}

std::expected<void, std::string> keep_registration(const std::string& panel_file, const ArtifactFolder& folder) {
  const RegistrationFiles from = registration_beside(panel_file);
  for (const auto& [there, here] :
       {std::pair{from.envelope, folder.registration()}, std::pair{from.stamp, folder.registration_stamp()}}) {
    if (!std::filesystem::exists(there)) return {};  // a stamp without an envelope stamps nothing
    const auto bytes = monitor::read_file(there);
    if (!bytes) return std::unexpected(bytes.error());
    if (auto kept = monitor::replace_file(here, *bytes); !kept) return kept;
  }
  return {};
}

std::expected<Registered, std::string> check_registration(const Artifact& artifact, std::string_view public_key_pem,
                                                          const std::optional<std::string>& certificates_pem) {
  const auto envelope = monitor::read_file(artifact.folder.registration());
  if (!envelope) return std::unexpected("it keeps no registration: " + envelope.error());
  const auto opened = open_envelope(*envelope, ArtifactFolder::kRegistration, public_key_pem);
  if (!opened) return std::unexpected(opened.error());
  const auto registration = registration_of(opened->statement);
  if (!registration) return std::unexpected(registration.error());
  Registered found{.key = opened->key_id,
                   .unix_ns = registration->unix_ns,
                   .stamped_by = {},
                   .first_row_unix_ns = artifact.manifest.started_unix_ns,
                   .comparison = {},
                   .differences = {}};
  std::error_code missing;
  if (certificates_pem && std::filesystem::exists(artifact.folder.registration_stamp(), missing)) {
    const auto response = monitor::read_file(artifact.folder.registration_stamp());
    if (!response) return std::unexpected(response.error());
    auto time = checked_time(*response, *envelope, ArtifactFolder::kRegistration, *certificates_pem);
    if (!time) return std::unexpected(fmt::format("{}: {}", ArtifactFolder::kRegistrationStamp, time.error()));
    found.unix_ns = time->unix_s * kNanosecondsPerSecond;
    found.stamped_by = std::move(time->by);
  }
  if (const auto& one = registration->comparison)
    found.comparison = fmt::format("{} against {}, margin {:g} %", one->b, one->a, 100 * one->margin);
  const auto promise = panel_promise(artifact.folder.panel());
  if (!promise) return std::unexpected(promise.error());
  found.differences = differences_of(*registration, artifact.manifest, *promise);
  return found;
}

}  // namespace takt::lab
