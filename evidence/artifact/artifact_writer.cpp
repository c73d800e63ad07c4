#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>

#include "config/load.hpp"
#include "evidence/artifact/artifact.hpp"
#include "evidence/artifact/rollout_json.hpp"
#include "evidence/artifact/rollout_parquet.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/run_manifest.hpp"

namespace takt::panel {
namespace {

std::int64_t unix_now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::string errno_text() {
  return std::strerror(errno);
}

// Open for appending, or the sentence.
std::expected<int, std::string> open_rows(const std::string& path) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (fd < 0) return std::unexpected(fmt::format("cannot open {}: {}", path, errno_text()));
  return fd;
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

std::string method_difference(const ArtifactManifest& found, const ArtifactManifest& wanted) {
  if (found.methods != wanted.methods) return "it was begun with other methods";
  if (found.planned_rollouts != wanted.planned_rollouts) return "it was begun with another plan";
  return {};
}

}  // namespace

void ArtifactWriter::Closer::operator()(const int* fd) const {
  ::close(*fd);
  delete fd;
}

ArtifactWriter::ArtifactWriter(Artifact artifact, int fd) : artifact_(std::move(artifact)), fd_(new int(fd)) {
  for (const RolloutRow& row : artifact_.rows) ids_.insert(rollout_id(row));
}

std::expected<ArtifactWriter, std::string> ArtifactWriter::create(const std::string& path, ArtifactManifest manifest,
                                                                  std::string_view panel_text) {
  const ArtifactFolder folder(path);
  std::error_code error;
  if (std::filesystem::exists(folder.manifest(), error)) {
    return std::unexpected(
        fmt::format("{} holds an artifact already; go on with it by --resume, or name another", path));
  }
  std::filesystem::create_directories(path, error);
  if (error) return std::unexpected(fmt::format("cannot make {}: {}", path, error.message()));
  if (config::sha256_hex(panel_text) != manifest.panel_sha256) {
    return std::unexpected("the panel's text is not the one the manifest names");
  }
  if (manifest.schema_sha256.empty()) manifest.schema_sha256 = rollout_schema_sha256();
  if (manifest.started_unix_ns == 0) manifest.started_unix_ns = unix_now_ns();
  if (manifest.host.is_null()) manifest.host = monitor::host_facts();
  // The manifest last: a folder without one is none.
  if (auto done = monitor::replace_file(folder.panel(), panel_text); !done) return std::unexpected(done.error());
  if (auto done = monitor::replace_file(folder.schema(), rollout_schema()); !done) return std::unexpected(done.error());
  if (auto done = monitor::replace_file(folder.rows(), ""); !done) return std::unexpected(done.error());
  if (auto done = folder.write_manifest(manifest); !done) return std::unexpected(done.error());
  const auto fd = open_rows(folder.rows());
  if (!fd) return std::unexpected(fd.error());
  return ArtifactWriter({folder, std::move(manifest), {}}, *fd);
}

std::expected<ArtifactWriter, std::string> ArtifactWriter::resume(const std::string& path,
                                                                  const ArtifactManifest& manifest) {
  const ArtifactFolder folder(path);
  const auto found = folder.read_manifest();
  if (!found) return std::unexpected(found.error());
  ArtifactManifest wanted = manifest;
  if (wanted.schema_sha256.empty()) wanted.schema_sha256 = rollout_schema_sha256();
  std::string reason = difference_between(*found, wanted, path, "this panel");
  if (reason.empty()) reason = method_difference(*found, wanted);
  if (reason.empty() && found->complete) reason = "it is complete";
  if (!reason.empty()) return std::unexpected(fmt::format("cannot go on with {}: {}", path, reason));
  if (auto cut = cut_torn_row(folder.rows()); !cut) return std::unexpected(cut.error());
  auto artifact = open_artifact(path);
  if (!artifact) return std::unexpected(artifact.error());
  const auto fd = open_rows(folder.rows());
  if (!fd) return std::unexpected(fd.error());
  return ArtifactWriter(std::move(*artifact), *fd);
}

std::expected<void, std::string> ArtifactWriter::append(const RolloutRow& row) {
  const std::size_t number = artifact_.rows.size() + 1;
  auto text = row_text(row);
  std::string reason = text ? misfit(row, artifact_.manifest) : text.error();
  if (!reason.empty()) return std::unexpected(fmt::format("row {}{} {}", number, text ? "" : ":", reason));
  if (has(row))
    return std::unexpected(fmt::format("row {} is rollout {}, which is there already", number, rollout_id(row)));
  *text += '\n';
  // One write, so that a crash tears at most this line; a short write (disk full) is cut off again.
  const ssize_t written = ::write(*fd_, text->data(), text->size());
  if (written != static_cast<ssize_t>(text->size()) || ::fdatasync(*fd_) != 0) {
    const std::string why = written >= 0 && written < static_cast<ssize_t>(text->size()) ? "disk full" : errno_text();
    (void)cut_torn_row(folder().rows());
    return std::unexpected(fmt::format("row {}: cannot write {}: {}", number, folder().rows(), why));
  }
  ids_.insert(rollout_id(row));
  artifact_.rows.push_back(row);
  return {};
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
  return manifest;
}

}  // namespace takt::panel
