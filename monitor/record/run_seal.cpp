// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/run_seal.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>

#include "config/sha256.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/run_events.hpp"
#include "monitor/record/run_manifest.hpp"

namespace takt::monitor {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<std::string_view, 4> kGrown{"ticks.mcap", "can.log.zst", "transitions.jsonl", kEventsFile};
// Of earlier versions: the same lines, plain.
constexpr std::string_view kPlainFrames = "can.log";
constexpr std::array<std::string_view, 3> kWhole{"manifest.json", "config.yaml", "drives.json"};
constexpr std::string_view kImages = "images/";
constexpr std::uintmax_t kLargestSeal = 64U << 20U;

std::vector<std::string> closed_files(const RunFolder& folder) {
  std::error_code error;
  std::vector<std::string> names;
  for (const std::string_view name : kWhole)
    if (std::filesystem::exists(folder.path() + "/" + std::string(name), error)) names.emplace_back(name);
  std::set<std::string> images;
  for (const auto& entry : std::filesystem::directory_iterator(folder.images(), error))
    images.insert(std::string(kImages) + entry.path().filename().string());
  names.insert(names.end(), images.begin(), images.end());
  return names;
}

bool may_be_sealed(const std::string& name) {
  if (std::ranges::count(kWhole, name) != 0) return true;
  const std::string image = name.starts_with(kImages) ? name.substr(kImages.size()) : std::string();
  return !image.empty() && image != "." && image != ".." &&
         image.find_first_of(std::string_view("/\0", 2)) == std::string::npos;
}

struct ReadSeal {
  bool closed = false;
  std::vector<std::pair<std::string, std::string>> files;  // name, SHA-256
  std::vector<std::pair<std::string, std::vector<SealedSegment>>> grown;
};

std::optional<ReadSeal> read(const Json& json, std::string_view text) {
  ReadSeal seal;
  try {
    if (json.at("schema") != kRunSealSchema || json.size() != 5 || text != json.dump(2) + "\n") return std::nullopt;
    (void)json.at("run_id").get<std::string>();
    seal.closed = json.at("closed").get<bool>();
    for (const auto& [name, hash] : json.at("files").get_ref<const Json::object_t&>()) {
      if (!may_be_sealed(name)) return std::nullopt;
      seal.files.emplace_back(name, hash.get<std::string>());
    }
    for (const auto& [name, segments] : json.at("segments").get_ref<const Json::object_t&>()) {
      if (std::ranges::count(kGrown, name == kPlainFrames ? kGrown[1] : name) == 0) return std::nullopt;
      seal.grown.emplace_back(name, std::vector<SealedSegment>());
      for (const Json& one : segments.get_ref<const Json::array_t&>()) {
        if (!one.at("bytes").is_number_unsigned() || !one.at("until_unix_ns").is_number_integer()) return std::nullopt;
        seal.grown.back().second.push_back({one.at("bytes").get<std::uint64_t>(),
                                            one.at("until_unix_ns").get<std::int64_t>(),
                                            one.at("sha256").get<std::string>()});
      }
    }
  } catch (const Json::exception&) {
    return std::nullopt;
  }
  return seal.grown.size() == kGrown.size() ? std::optional(seal) : std::nullopt;
}

// SHA-256 of the next `bytes` of the file; empty: it ends before.
std::string next_segment(std::ifstream& in, std::uint64_t bytes) {
  config::Sha256 sha;
  std::array<char, 65536> buffer{};
  while (bytes > 0) {
    in.read(buffer.data(), static_cast<std::streamsize>(std::min<std::uint64_t>(bytes, buffer.size())));
    const auto got = static_cast<std::size_t>(in.gcount());
    if (got == 0) return {};
    sha.add(std::as_bytes(std::span(buffer).first(got)));
    bytes -= got;
  }
  return sha.hex();
}

// Empty: as it was recorded.
std::string altered_segment(const RunFolder& folder, const std::string& name,
                            const std::vector<SealedSegment>& segments, bool closed) {
  const std::string path = folder.path() + "/" + name;
  const bool goes_on = name == kEventsFile;
  std::error_code error;
  if (goes_on && segments.empty()) return {};
  if (!std::filesystem::is_regular_file(path, error)) return name + " is not there";
  std::ifstream in(path, std::ios::binary);
  std::uint64_t from = 0;
  std::string since = "its beginning";
  for (const SealedSegment& segment : segments) {
    const std::string until = utc_text(segment.until_unix_ns);
    if (next_segment(in, segment.bytes) != segment.sha256)
      return fmt::format("{} is not as it was recorded from {} to {} (from byte {} on)", name, since, until, from);
    from += segment.bytes;
    since = until;
  }
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  return closed && !goes_on && size != from ? fmt::format("{} has {} bytes that were not recorded", name, size - from)
                                            : std::string();
}

// What the supervisor wrote so far. It may say more later: how its processes ended.
Json sealed_events(const RunFolder& folder, std::int64_t until_unix_ns) {
  Json segments = Json::array();
  const auto text = read_file(folder.path() + "/" + std::string(kEventsFile));
  if (!text || text->empty()) return segments;
  config::Sha256 sha;
  sha.add(std::as_bytes(std::span(*text)));
  segments.push_back({{"bytes", text->size()}, {"until_unix_ns", until_unix_ns}, {"sha256", sha.hex()}});
  return segments;
}

std::uint64_t bytes_of(const std::vector<SealedSegment>& segments) {
  std::uint64_t bytes = 0;
  for (const SealedSegment& one : segments) bytes += one.bytes;
  return bytes;
}

// The text of seal.json, read; the error as check_run_seal has it.
std::expected<ReadSeal, std::string> read_seal(const RunFolder& folder) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(folder.seal(), error);
  if (error)
    return std::unexpected("it has no seal.json: an earlier version recorded it, or a monitor that was killed");
  if (size > kLargestSeal) return std::unexpected("seal.json is too large");
  const auto text = read_file(folder.seal());
  if (!text) return std::unexpected(text.error());
  auto seal = read(Json::parse(*text, nullptr, false), *text);
  if (!seal) return std::unexpected(fmt::format("seal.json is no seal of this version ({})", kRunSealSchema));
  return std::move(*seal);
}

// Whether the part that it goes on from, where it lies beside, is the one that was there then. Empty: it is, or is
// gone.
std::string altered_part_before(const RunFolder& folder) {
  const auto manifest = folder.read_manifest();
  if (!manifest || manifest->goes_on_from_seal.empty()) return {};
  const std::string& name = manifest->goes_on_from;
  if (name.empty() || name == ".." || name.find_first_of(std::string_view("/\0", 2)) != std::string::npos) return {};
  std::error_code error;
  const auto here = std::filesystem::canonical(folder.path(), error);  // `RUN/` is RUN
  const auto seal = config::file_sha256((here.parent_path() / name / "seal.json").string());
  return seal && *seal != manifest->goes_on_from_seal
             ? fmt::format("{}, the part before it, has another seal than it had", name)
             : std::string();
}

}  // namespace

std::expected<std::string, std::string> run_seal_text(const RunFolder& folder, const std::string& run_id, bool closed,
                                                      const std::vector<GrownFile>& grown) {
  Json json{{"schema", kRunSealSchema}, {"run_id", run_id}, {"closed", closed}};
  json["files"] = Json::object();
  if (closed) {
    for (const std::string& name : closed_files(folder)) {
      auto hash = config::file_sha256(folder.path() + "/" + name);
      if (!hash) return std::unexpected(fmt::format("cannot read {}/{}: {}", folder.path(), name, hash.error()));
      json["files"][name] = std::move(*hash);
    }
  }
  std::int64_t until_unix_ns = 0;
  for (const GrownFile& file : grown) {
    Json segments = Json::array();
    for (const SealedSegment& one : file.segments)
      segments.push_back({{"bytes", one.bytes}, {"until_unix_ns", one.until_unix_ns}, {"sha256", one.sha256}});
    json["segments"][std::string(file.name)] = std::move(segments);
    if (!file.segments.empty()) until_unix_ns = std::max(until_unix_ns, file.segments.back().until_unix_ns);
  }
  json["segments"][std::string(kEventsFile)] = closed ? sealed_events(folder, until_unix_ns) : Json::array();
  return json.dump(2) + "\n";
}

std::expected<CheckedSeal, std::string> check_run_seal(const RunFolder& folder) {
  const auto seal = read_seal(folder);
  if (!seal) return std::unexpected(seal.error());
  CheckedSeal checked{
      .closed = seal->closed, .files = seal->files.size(), .segments = 0, .events_behind = 0, .altered = {}};
  for (const auto& [name, hash] : seal->files) {
    const auto now = config::file_sha256(folder.path() + "/" + name);
    if (!now) checked.altered.push_back(fmt::format("{}: {}", name, now.error()));
    if (now && *now != hash) checked.altered.push_back(name + " is not the file that was recorded");
  }
  for (const auto& [name, segments] : seal->grown) {
    checked.segments += segments.size();
    if (std::string why = altered_segment(folder, name, segments, seal->closed); !why.empty())
      checked.altered.push_back(std::move(why));
    if (name != kEventsFile || !seal->closed) continue;
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(folder.path() + "/" + name, error);
    if (!error) checked.events_behind = size - std::min<std::uint64_t>(size, bytes_of(segments));
  }
  if (std::string why = altered_part_before(folder); !why.empty()) checked.altered.push_back(std::move(why));
  return checked;
}

std::optional<std::uint64_t> sealed_event_bytes(const RunFolder& folder) {
  const auto seal = read_seal(folder);
  if (!seal || !seal->closed) return std::nullopt;
  for (const auto& [name, segments] : seal->grown)
    if (name == kEventsFile) return bytes_of(segments);
  return std::nullopt;
}

}  // namespace takt::monitor
