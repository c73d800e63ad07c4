// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/signature.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "config/load.hpp"
#include "lab/artifact/envelope.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::lab {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kPredicateType = "https://in-toto.io/attestation/test-result/v0.1";
constexpr const char* kSeal = "seal.json";
constexpr const char* kPostMortems = "postmortems/";

std::expected<Json, std::string> subject_of(const std::string& folder, const std::string& name) {
  const auto hash = config::file_sha256(folder + "/" + name);
  if (!hash) return std::unexpected(fmt::format("{}: {}", name, hash.error()));
  return Json{{"name", name}, {"digest", {{"sha256", *hash}}}};
}

std::vector<std::string> post_mortems(const ArtifactFolder& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder.post_mortems(), error))
    names.push_back(kPostMortems + entry.path().filename().string());
  std::ranges::sort(names);
  return names;
}

// seal.json, or a file right in postmortems/: a subject leads nowhere else.
bool may_be_subject(const std::string& name) {
  if (name == kSeal) return true;
  if (!name.starts_with(kPostMortems)) return false;
  const std::string file = name.substr(std::string_view(kPostMortems).size());
  return !file.empty() && file != "." && file != ".." && file.find_first_of(std::string_view("/\0", 2)) == file.npos;
}

// Why the files are not those of the statement; empty: they are.
std::string broken_subjects(const std::string& folder, const Json& statement) {
  if (text_at(statement, "predicateType") != kPredicateType || !statement.contains("subject") ||
      !statement.at("subject").is_array())
    return fmt::format("what {} signs is no statement about a seal", kSignatureFile);
  bool has_seal = false;
  for (const Json& subject : statement.at("subject")) {
    const std::string name = subject.is_object() ? text_at(subject, "name") : std::string();
    if (!may_be_subject(name)) return "the signed statement names a file that is no part of a seal";
    const auto now = subject_of(folder, name);
    if (!now) return now.error();
    if (*now != subject) return fmt::format("{} is not the file that was signed", name);
    has_seal |= name == kSeal;
  }
  return has_seal ? std::string() : "the signed statement does not name seal.json";
}

struct Configuration {
  const char* file;
  const std::string& sha256;
};

std::expected<std::string, std::string> sign_files(const std::string& folder, const std::vector<std::string>& names,
                                                   const Configuration& configuration, SignedResult result,
                                                   std::string_view private_key_pem) {
  Json subjects = Json::array();
  for (const std::string& name : names) {
    auto subject = subject_of(folder, name);
    if (!subject) return std::unexpected(subject.error());
    subjects.push_back(std::move(*subject));
  }
  const Json configured{{"name", configuration.file}, {"digest", {{"sha256", configuration.sha256}}}};
  const std::string statement = Json{{"_type", kStatementType},
                                     {"subject", std::move(subjects)},
                                     {"predicateType", kPredicateType},
                                     {"predicate",
                                      {{"result", result == SignedResult::passed ? "PASSED" : "WARNED"},
                                       {"configuration", Json::array({configured})}}}}
                                    .dump();
  return seal_envelope(statement, private_key_pem);
}

}  // namespace

std::expected<std::string, std::string> sign(const Artifact& artifact, SignedResult result,
                                             std::string_view private_key_pem) {
  std::vector<std::string> names = post_mortems(artifact.folder);
  names.insert(names.begin(), kSeal);
  return sign_files(artifact.folder.path(), names, {"panel.yaml", artifact.manifest.panel_sha256}, result,
                    private_key_pem);
}

std::expected<std::string, std::string> sign(const monitor::RecordedRun& run, SignedResult result,
                                             std::string_view private_key_pem) {
  return sign_files(run.folder.path(), {kSeal}, {"config.yaml", run.manifest.config_sha256}, result, private_key_pem);
}

std::expected<std::string, std::string> check_signature(const std::string& folder, std::string_view public_key_pem) {
  const auto text = monitor::read_file(folder + "/" + kSignatureFile);
  if (!text) return std::unexpected(text.error());
  const auto opened = open_envelope(*text, kSignatureFile, public_key_pem);
  if (!opened) return std::unexpected(opened.error());
  if (const std::string broken = broken_subjects(folder, opened->statement); !broken.empty())
    return std::unexpected(broken);
  return opened->key_id;
}

std::expected<TimeStamp, std::string> check_time(const std::string& folder, std::string_view certificates_pem) {
  const auto envelope = monitor::read_file(folder + "/" + kSignatureFile);
  const auto response = monitor::read_file(folder + "/" + kTimeStampFile);
  if (!envelope || !response) return std::unexpected(envelope ? response.error() : envelope.error());
  auto time = checked_time(*response, *envelope, kSignatureFile, certificates_pem);
  if (!time) return std::unexpected(fmt::format("{}: {}", kTimeStampFile, time.error()));
  return time;
}

}  // namespace takt::lab
