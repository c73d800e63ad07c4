// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/run_manifest.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <fstream>

#include "config/printable.hpp"
#include "executive/contract/version.hpp"
#include "monitor/record/facts_json.hpp"
#include "monitor/record/json_error.hpp"

namespace takt::monitor {
namespace {

using Json = nlohmann::ordered_json;

Json moment(MonoTime at, const ClockOffset& clock) {
  if (!at.is_set()) return nullptr;
  const std::int64_t unix_ns = at.ns + clock.monotonic_to_unix_ns;
  return {{"utc", utc_text(unix_ns)}, {"unix_ns", unix_ns}, {"monotonic_ns", at.ns}};
}

MonoTime moment_of(const Json& json) {
  return json.is_null() ? MonoTime{} : MonoTime{json.at("monotonic_ns").get<std::int64_t>()};
}

std::string text_of(const Json& json) {
  return json.is_null() ? std::string() : json.get<std::string>();
}

// What the executive says of a policy that it admits: empty, or a hash of 64 bits in hex digits.
std::string admitted_hash(const Json& executive, const char* key) {
  return executive.is_object() && executive.contains(key) ? executive.at(key).get<std::string>() : std::string();
}

Json facts_in(const Json& manifest) {
  const auto executive = manifest.find("executive");
  if (executive == manifest.end() || !executive->is_object()) return nullptr;
  return executive->value("facts", Json(nullptr));
}

bool are_hex_digits(std::string_view text) {
  return text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

std::string first_value(const char* path, std::string_view key) {
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t colon = line.find(':');
    const std::size_t value = line.find_first_not_of(" \t", colon + 1);
    return value == std::string::npos ? std::string() : line.substr(value);
  }
  return {};
}

Json losses_json(const RunManifest& manifest) {
  Json listed = Json::array();
  for (const Loss& loss : manifest.first_losses) {
    listed.push_back({{"ring", loss.ring},
                      {"reason", loss.reason},
                      {"count", loss.count},
                      {"after_tick", loss.after_tick},
                      {"before_tick", loss.before_tick}});
  }
  return {{"totals", manifest.losses}, {"first", std::move(listed)}};
}

Json waivers_json(const RunManifest& manifest) {
  Json listed = Json::array();
  for (const config::WatchdogWaiver& waiver : manifest.watchdog_waivers)
    listed.push_back({{"joint", waiver.joint}, {"reason", waiver.reason}});
  return listed;
}

}  // namespace

std::string utc_text(std::int64_t unix_ns) {
  const auto seconds = static_cast<std::time_t>(unix_ns / 1'000'000'000);
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z", fmt::gmtime(seconds), unix_ns / 1'000'000 % 1000);
}

Json host_facts() {
  utsname system{};
  (void)::uname(&system);
  const std::string version(system.version);
  return {{"name", system.nodename},
          {"kernel", fmt::format("{} {}", system.sysname, system.release)},
          {"kernel_version", version},
          {"preempt_rt", version.find("PREEMPT_RT") != std::string::npos},
          {"machine", system.machine},
          {"cpu", first_value("/proc/cpuinfo", "model name")},
          {"cpus_online", ::sysconf(_SC_NPROCESSORS_ONLN)},
          {"memory", first_value("/proc/meminfo", "MemTotal")}};
}

Json to_json(const RunManifest& manifest) {
  Json json;
  json["schema"] = kRunSchema;
  json["run_id"] = manifest.run_id;
  json["complete"] = manifest.complete;
  json["robot"] = manifest.robot;
  json["joints"] = manifest.joints;
  json["buses"] = manifest.buses;
  json["cautions"] = manifest.cautions;
  json["watchdog_waivers"] = waivers_json(manifest);
  json["config"] = {{"file", "config.yaml"}, {"sha256", manifest.config_sha256}};
  json["policy"] = manifest.policy_file.empty()
                       ? Json(nullptr)
                       : Json{{"file", manifest.policy_file}, {"sha256", text_or_null(manifest.policy_sha256)}};
  const bool known = manifest.executive.is_object() && manifest.executive.contains("realtime");
  json["executive"] = {{"pid", manifest.executive_pid},
                       {"sha256", text_or_null(manifest.executive_sha256)},
                       {"realtime", known ? manifest.executive.at("realtime") : Json(nullptr)},
                       {"facts", manifest.executive}};
  json["host"] = manifest.host;
  json["doctor"] = manifest.doctor;
  json["drives"] = manifest.drives;
  json["clock"] = {{"log_time", "CLOCK_MONOTONIC + monotonic_to_unix_ns; stamps inside messages are CLOCK_MONOTONIC"},
                   {"monotonic_to_unix_ns", manifest.clock.monotonic_to_unix_ns},
                   {"source", manifest.clock.source}};
  json["started"] = moment(manifest.started_at, manifest.clock);
  json["ended"] = moment(manifest.ended_at, manifest.clock);
  json["ended_because"] = text_or_null(manifest.ended_because);
  json["goes_on_from"] = text_or_null(manifest.goes_on_from);
  json["goes_on_from_seal_sha256"] = text_or_null(manifest.goes_on_from_seal);
  json["goes_on_in"] = text_or_null(manifest.goes_on_in);
  json["ticks"] = {{"recorded", manifest.ticks},
                   {"first", manifest.first_tick},
                   {"last", manifest.last_tick},
                   {"stood_by", manifest.stood_by_ticks},
                   {"unrecorded", manifest.unrecorded_ticks}};
  json["recording_stopped"] = text_or_null(manifest.stopped_because);
  json["losses"] = losses_json(manifest);
  return json;
}

std::string whose(const Json& executive) {
  std::string version;
  if (executive.is_object() && executive.contains("version") && executive.at("version").is_string())
    version = config::printable(executive.at("version").get<std::string>());
  return fmt::format("made by takt {}; this is takt {}", version.empty() ? "of an unknown version" : version,
                     takt::version());
}

std::expected<RunManifest, std::string> manifest_of(const Json& json) {
  try {
    if (const std::string schema = json.at("schema"); schema != kRunSchema && schema != kFirstRunSchema) {
      if (schema.starts_with("takt.artifact/"))
        return std::unexpected("is of a panel's artifact, not of a run; `takt panel --help` says what reads one");
      return std::unexpected(fmt::format("has the format {}, and {} and {} are read: {}", config::printable(schema),
                                         kFirstRunSchema, kRunSchema, whose(facts_in(json))));
    }
    RunManifest manifest;
    json.at("run_id").get_to(manifest.run_id);
    json.at("complete").get_to(manifest.complete);
    json.at("robot").get_to(manifest.robot);
    json.at("joints").get_to(manifest.joints);
    json.at("buses").get_to(manifest.buses);
    manifest.cautions = json.value("cautions", std::vector<std::string>());
    for (const Json& waiver : json.value("watchdog_waivers", Json::array()))
      manifest.watchdog_waivers.push_back({waiver.at("joint"), waiver.at("reason")});
    json.at("config").at("sha256").get_to(manifest.config_sha256);
    if (const Json& policy = json.at("policy"); !policy.is_null()) {
      policy.at("file").get_to(manifest.policy_file);
      manifest.policy_sha256 = text_of(policy.at("sha256"));
    }
    const Json& executive = json.at("executive");
    executive.at("pid").get_to(manifest.executive_pid);
    manifest.executive_sha256 = text_of(executive.at("sha256"));
    manifest.executive = executive.at("facts");
    for (const char* key : {"policy_hash", "fallback_policy_hash"})
      if (const std::string hash = admitted_hash(manifest.executive, key); hash.size() > 16 || !are_hex_digits(hash))
        return std::unexpected(fmt::format("is not a run's manifest: executive.facts.{} is no hash", key));
    if (!are_hex_digits(manifest.policy_sha256))
      return std::unexpected("is not a run's manifest: policy.sha256 is no hash");
    manifest.host = json.at("host");
    manifest.doctor = json.value("doctor", Json(nullptr));
    manifest.drives = json.value("drives", Json(nullptr));
    json.at("clock").at("monotonic_to_unix_ns").get_to(manifest.clock.monotonic_to_unix_ns);
    json.at("clock").at("source").get_to(manifest.clock.source);
    manifest.started_at = moment_of(json.at("started"));
    manifest.ended_at = moment_of(json.at("ended"));
    manifest.ended_because = text_of(json.at("ended_because"));
    manifest.goes_on_from = text_of(json.value("goes_on_from", Json(nullptr)));
    manifest.goes_on_from_seal = text_of(json.value("goes_on_from_seal_sha256", Json(nullptr)));
    manifest.goes_on_in = text_of(json.value("goes_on_in", Json(nullptr)));
    const Json& ticks = json.at("ticks");
    ticks.at("recorded").get_to(manifest.ticks);
    ticks.at("first").get_to(manifest.first_tick);
    ticks.at("last").get_to(manifest.last_tick);
    manifest.stood_by_ticks = ticks.value("stood_by", std::uint64_t{0});
    ticks.at("unrecorded").get_to(manifest.unrecorded_ticks);
    manifest.stopped_because = text_of(json.at("recording_stopped"));
    json.at("losses").at("totals").get_to(manifest.losses);
    for (const Json& loss : json.at("losses").at("first")) {
      manifest.first_losses.push_back(
          {loss.at("ring"), loss.at("reason"), loss.at("count"), loss.at("after_tick"), loss.at("before_tick")});
    }
    return manifest;
  } catch (const nlohmann::json::exception& error) {
    return std::unexpected(fmt::format("is not a run's manifest: {}", config::printable(sentence_of(error))));
  }
}

}  // namespace takt::monitor
