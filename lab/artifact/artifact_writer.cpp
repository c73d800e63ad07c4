// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <utility>

#include "config/load.hpp"
#include "config/sha256.hpp"
#include "lab/artifact/artifact.hpp"
#include "lab/artifact/rollout_json.hpp"
#include "lab/artifact/rollout_parquet.hpp"
#include "lab/artifact/seal.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/run_manifest.hpp"

namespace takt::lab {
namespace {

std::int64_t unix_now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::string errno_text() {
  return std::strerror(errno);
}

// Open for appending, or the sentence.
std::expected<Descriptor, std::string> open_rows(const std::string& path) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (fd < 0) return std::unexpected(fmt::format("cannot open {}: {}", path, errno_text()));
  return Descriptor(new int(fd));
}

// Cuts off what follows the last line end: a row whose writer was killed.
std::expected<void, std::string> cut_torn_row(const std::string& path) {
  const auto text = monitor::read_file(path);
  if (!text) return std::unexpected(text.error());
  const std::size_t whole = text->rfind('\n') + 1;  // npos + 1 is 0
  if (whole == text->size()) return {};
  if (::truncate(path.c_str(), static_cast<off_t>(whole)) != 0) {
    return std::unexpected(fmt::format("cannot cut the torn row off {}: {}", path, errno_text()));
  }
  return {};
}

// Held until it is closed; who holds it stands in it. The file stays: without it two could hold it.
std::expected<Descriptor, std::string> lock_folder(const ArtifactFolder& folder) {
  const int fd = ::open(folder.lock().c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
  if (fd < 0) return std::unexpected(fmt::format("cannot open {}: {}", folder.lock(), errno_text()));
  Descriptor lock(new int(fd));
  if (::flock(fd, LOCK_EX | LOCK_NB) != 0) {
    std::array<char, 32> holder{};
    const ssize_t read = ::pread(fd, holder.data(), holder.size() - 1, 0);
    return std::unexpected(fmt::format("{} is being written by process {}; wait for it, or end it", folder.path(),
                                       read > 0 ? std::string_view(holder.data()) : "of another machine"));
  }
  const std::string pid = std::to_string(::getpid());
  if (::ftruncate(fd, 0) != 0 || ::pwrite(fd, pid.data(), pid.size(), 0) != static_cast<ssize_t>(pid.size()))
    return std::unexpected(fmt::format("cannot write {}: {}", folder.lock(), errno_text()));
  return lock;
}

// What a writer that was killed left: a row without its seal, or half a seal.
std::expected<void, std::string> cut_unsealed_row(const ArtifactFolder& folder) {
  if (auto cut = cut_torn_row(folder.rows()); !cut) return cut;
  if (auto cut = cut_torn_row(folder.row_seals()); !cut) return cut;
  const auto rows = monitor::read_file(folder.rows()), seals = monitor::read_file(folder.row_seals());
  if (!rows) return std::unexpected(rows.error());
  if (!seals) return std::unexpected(seals.error());
  if (std::ranges::count(*rows, '\n') != std::ranges::count(*seals, '\n') + 1) return {};
  const std::size_t before = rows->size() < 2 ? std::string::npos : rows->rfind('\n', rows->size() - 2);
  if (::truncate(folder.rows().c_str(), static_cast<off_t>(before + 1)) != 0)
    return std::unexpected(fmt::format("cannot cut the unsealed row off {}: {}", folder.rows(), errno_text()));
  return {};
}

std::string last_line(std::string_view text) {
  if (text.empty()) return {};
  text.remove_suffix(1);
  return std::string(text.substr(text.rfind('\n') + 1));
}

// One write; what a short one left is cut off again.
std::expected<void, std::string> append_line(int fd, const std::string& path, const std::string& line) {
  const ssize_t written = ::write(fd, line.data(), line.size());
  if (written == static_cast<ssize_t>(line.size()) && ::fdatasync(fd) == 0) return {};
  const std::string why = written >= 0 && written < static_cast<ssize_t>(line.size()) ? "disk full" : errno_text();
  (void)cut_torn_row(path);
  return std::unexpected(fmt::format("cannot write {}: {}", path, why));
}

std::string method_difference(const ArtifactManifest& found, const ArtifactManifest& wanted) {
  if (found.methods != wanted.methods) return "it was begun with other methods";
  if (contents_of(found.outside.policy_host) != contents_of(wanted.outside.policy_host))
    return "it was begun with another program behind --policy-host";
  if (found.planned_rollouts != wanted.planned_rollouts || found.shard != wanted.shard)
    return "it was begun with another plan";
  return {};
}

}  // namespace

void DescriptorCloser::operator()(const int* fd) const {
  ::close(*fd);
  delete fd;
}

ArtifactWriter::ArtifactWriter(Artifact artifact, Descriptor rows, Descriptor seals, Descriptor lock,
                               std::string last_seal)
    : artifact_(std::move(artifact)),
      rows_fd_(std::move(rows)),
      seals_fd_(std::move(seals)),
      lock_(std::move(lock)),
      last_seal_(std::move(last_seal)) {
  for (const evidence::RolloutRow& row : artifact_.rows) ids_.insert(evidence::rollout_id(row));
}

std::expected<ArtifactWriter, std::string> ArtifactWriter::create(const std::string& path, ArtifactManifest manifest,
                                                                  std::string_view panel_text) {
  const ArtifactFolder folder(path);
  std::error_code error;
  if (std::filesystem::exists(folder.manifest(), error)) {
    return std::unexpected(
        fmt::format("{} holds an artifact already; go on with it by --resume, or name another", path));
  }
  for (const std::string& file : {folder.panel(), folder.schema(), folder.rows(), folder.row_seals()})
    if (std::filesystem::exists(file, error))
      return std::unexpected(fmt::format("{} is there already, and {} is no artifact; name a new folder", file, path));
  std::filesystem::create_directories(path, error);
  if (error) return std::unexpected(fmt::format("cannot make {}: {}", path, error.message()));
  if (config::sha256_hex(panel_text) != manifest.panel_sha256) {
    return std::unexpected("the panel's text is not the one the manifest names");
  }
  if (manifest.schema_sha256.empty()) manifest.schema_sha256 = rollout_schema_sha256();
  if (manifest.started_unix_ns == 0) manifest.started_unix_ns = unix_now_ns();
  if (manifest.host.is_null()) {
    manifest.host = monitor::host_facts();
    static const auto kProgram = config::file_sha256("/proc/self/exe");
    if (kProgram) manifest.host[kProgramHash] = *kProgram;
  }
  auto lock = lock_folder(folder);
  if (!lock) return std::unexpected(lock.error());
  const std::string schema = rollout_schema();
  // The manifest last: a folder without one is none.
  for (const auto& [file, text] : {std::pair{folder.panel(), panel_text},
                                   {folder.schema(), schema},
                                   {folder.rows(), std::string_view()},
                                   {folder.row_seals(), std::string_view()}})
    if (auto done = monitor::replace_file(file, text); !done) return std::unexpected(done.error());
  if (auto done = folder.write_manifest(manifest); !done) return std::unexpected(done.error());
  return open_writer({folder, std::move(manifest), {}}, std::move(*lock), {});
}

std::expected<ArtifactWriter, std::string> ArtifactWriter::resume(const std::string& path,
                                                                  const ArtifactManifest& manifest) {
  const ArtifactFolder folder(path);
  auto lock = lock_folder(folder);
  if (!lock) return std::unexpected(lock.error());
  const auto found = folder.read_manifest();
  if (!found) return std::unexpected(found.error());
  ArtifactManifest wanted = manifest;
  if (wanted.schema_sha256.empty()) wanted.schema_sha256 = rollout_schema_sha256();
  std::string reason = difference_between(*found, wanted, path, "this panel");
  if (reason.empty()) reason = method_difference(*found, wanted);
  if (reason.empty() && found->until_decided != wanted.until_decided) reason = "its --until-decided differs";
  if (reason.empty() && found->complete) reason = "it is complete";
  if (!reason.empty()) return std::unexpected(fmt::format("cannot go on with {}: {}", path, reason));
  if (auto cut = cut_unsealed_row(folder); !cut) return std::unexpected(cut.error());
  auto artifact = open_artifact(path);
  if (!artifact) return std::unexpected(artifact.error());
  const auto seals = monitor::read_file(folder.row_seals());
  if (!seals) return std::unexpected(seals.error());
  return open_writer(std::move(*artifact), std::move(*lock), last_line(*seals));
}

std::expected<ArtifactWriter, std::string> ArtifactWriter::open_writer(Artifact artifact, Descriptor lock,
                                                                       std::string last_seal) {
  auto rows = open_rows(artifact.folder.rows()), seals = open_rows(artifact.folder.row_seals());
  if (!rows) return std::unexpected(rows.error());
  if (!seals) return std::unexpected(seals.error());
  return ArtifactWriter(std::move(artifact), std::move(*rows), std::move(*seals), std::move(lock),
                        std::move(last_seal));
}

std::expected<void, std::string> ArtifactWriter::append(const evidence::RolloutRow& row) {
  const std::size_t number = artifact_.rows.size() + 1;
  auto text = row_text(row);
  std::string reason = text ? misfit(row, artifact_.manifest) : text.error();
  if (!reason.empty()) return std::unexpected(fmt::format("row {}{} {}", number, text ? "" : ":", reason));
  if (has(row))
    return std::unexpected(
        fmt::format("row {} is rollout {}, which is there already", number, evidence::rollout_id(row)));
  *text += '\n';
  last_seal_ = row_seal(last_seal_, *text);
  auto done = append_line(*rows_fd_, folder().rows(), *text);
  if (done) done = append_line(*seals_fd_, folder().row_seals(), last_seal_ + "\n");
  if (!done) return std::unexpected(fmt::format("row {}: {}", number, done.error()));
  ids_.insert(evidence::rollout_id(row));
  artifact_.rows.push_back(row);
  return {};
}

void ArtifactWriter::end_plan_after(std::uint64_t seeds) {
  artifact_.manifest.seed_plan = seed_plan_of(artifact_.manifest.seed_plan.seeds.front(), seeds);
  artifact_.manifest.planned_rollouts = rows().size();
}

std::expected<ArtifactManifest, std::string> ArtifactWriter::finish() {
  ArtifactManifest& manifest = artifact_.manifest;
  if (rows().size() != manifest.planned_rollouts) {
    return std::unexpected(
        fmt::format("{} has {} of {} planned rollouts", folder().path(), rows().size(), manifest.planned_rollouts));
  }
  manifest.artifact_id = artifact_id_of(manifest, rows());
  const std::string parquet = rollouts_parquet(rows(), manifest.artifact_id);
  if (auto done = monitor::replace_file(folder().parquet(), parquet); !done) return std::unexpected(done.error());
  const std::string confusion = confusion_file_text(manifest.artifact_id, rows());
  if (auto done = monitor::replace_file(folder().confusion(), confusion); !done) return std::unexpected(done.error());
  manifest.complete = true;
  manifest.ended_unix_ns = unix_now_ns();
  if (auto done = folder().write_manifest(manifest); !done) return std::unexpected(done.error());
  const auto seal = seal_of(folder(), manifest.artifact_id);
  if (!seal) return std::unexpected(seal.error());
  if (auto done = monitor::replace_file(folder().seal(), *seal); !done) return std::unexpected(done.error());
  lock_.reset();  // nothing is written any more
  return manifest;
}

}  // namespace takt::lab
