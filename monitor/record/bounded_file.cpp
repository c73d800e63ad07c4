// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/bounded_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <utility>

#include "config/read_all.hpp"
#include "monitor/record/holes.hpp"

namespace takt::monitor {
namespace {

// Writes everything or returns errno; a write of nothing counts as a full disk.
int write_all(int fd, std::span<const std::byte> data) {
  while (!data.empty()) {
    const ssize_t written = ::write(fd, data.data(), data.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return written < 0 ? errno : ENOSPC;
    data = data.subspan(static_cast<std::size_t>(written));
  }
  return 0;
}

}  // namespace

std::expected<BoundedFile, std::string> BoundedFile::create(const std::string& path, std::uint64_t max_bytes) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (fd < 0) return std::unexpected(fmt::format("cannot create {}: {}", path, std::strerror(errno)));
  (void)::flock(fd, LOCK_EX | LOCK_NB);  // a file system without locks has none
  return BoundedFile(path, fd, max_bytes);
}

BoundedFile::BoundedFile(BoundedFile&& other) noexcept
    : path_(std::move(other.path_)),
      fd_(std::exchange(other.fd_, -1)),
      max_bytes_(other.max_bytes_),
      size_(other.size_),
      synced_(other.synced_),
      seal_(std::move(other.seal_)),
      failure_(std::move(other.failure_)) {}

BoundedFile::~BoundedFile() {
  if (fd_ >= 0) ::close(fd_);
}

bool BoundedFile::append(std::span<const std::byte> piece) {
  // Before it grows: what was cut would be a hole as long as before.
  if (!failure_.empty() || !is_where_it_was()) return false;
  if (max_bytes_ < size_ || piece.size() > max_bytes_ - size_) {
    failure_ = fmt::format("{} reached its limit of {} bytes", path_, max_bytes_);
    return false;
  }
  if (const int error = write_all(fd_, piece); error != 0) {
    failure_ = fmt::format("{} takes no more data: {}", path_, std::strerror(error));
    cut_back_to(size_);
    return false;
  }
  size_ += piece.size();
  seal_.add(piece);
  return true;
}

void BoundedFile::reopen(std::uint64_t max_bytes) {
  failure_.clear();
  max_bytes_ = max_bytes;
}

bool BoundedFile::is_where_it_was() {
  struct stat written {
  }, named{};
  if (::fstat(fd_, &written) != 0) return true;
  const bool is_named =
      ::lstat(path_.c_str(), &named) == 0 && named.st_dev == written.st_dev && named.st_ino == written.st_ino;
  const auto there = static_cast<std::uint64_t>(written.st_size);
  if (is_named && there >= size_) return true;
  if (failure_.empty())
    failure_ = is_named ? fmt::format("{} was cut by another program", path_)
                        : fmt::format("{} is gone: another program deleted, renamed or replaced it", path_);
  cut_back_to(std::min(there, synced_));
  return false;
}

bool BoundedFile::sync() {
  if (!is_where_it_was()) return false;
  int error = 0;
  do error = ::fdatasync(fd_) == 0 ? 0 : errno;
  while (error == EINTR);
  if (error == 0) {
    synced_ = size_;
    return true;
  }
  if (failure_.empty()) failure_ = fmt::format("{} does not reach its medium: {}", path_, std::strerror(error));
  cut_back_to(synced_);
  return false;
}

void BoundedFile::cut_back_to(std::uint64_t size) {
  size_ = size;
  if (::ftruncate(fd_, static_cast<off_t>(size)) == 0) ::lseek(fd_, static_cast<off_t>(size), SEEK_SET);
  seal_.cut_back(path_, size);
}

namespace {

// A device, a pipe or a socket, or a link of the system's to one (/dev/stdout): written to, never replaced. A link
// elsewhere may be a stranger's, and is replaced like a file.
bool is_stream(const std::string& path) {
  struct stat entry {};
  if (::lstat(path.c_str(), &entry) != 0) return false;
  if (S_ISLNK(entry.st_mode) && (!path.starts_with("/dev/") || ::stat(path.c_str(), &entry) != 0)) return false;
  return !S_ISREG(entry.st_mode) && !S_ISDIR(entry.st_mode) && !S_ISLNK(entry.st_mode);
}

std::expected<void, std::string> write_to_stream(const std::string& path, std::string_view text) {
  // Without a reader a pipe would block for ever.
  const int fd = ::open(path.c_str(), O_WRONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return std::unexpected(fmt::format("cannot write {}: {}", path, std::strerror(errno)));
  ::fcntl(fd, F_SETFL, ::fcntl(fd, F_GETFL) & ~O_NONBLOCK);
  const int error = write_all(fd, std::as_bytes(std::span(text)));
  ::close(fd);
  if (error != 0) return std::unexpected(fmt::format("cannot write {}: {}", path, std::strerror(error)));
  return {};
}

}  // namespace

bool is_being_written(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return false;
  const bool is_locked = ::flock(fd, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  ::close(fd);
  return is_locked;
}

std::expected<void, std::string> replace_file(const std::string& path, std::string_view text) {
  if (is_stream(path)) return write_to_stream(path, text);
  // A name at which no other process can have laid a link.
  std::string next = path + ".XXXXXX";
  const int fd = ::mkostemp(next.data(), O_CLOEXEC);
  if (fd < 0) return std::unexpected(fmt::format("cannot create {}: {}", path, std::strerror(errno)));
  int error = write_all(fd, std::as_bytes(std::span(text)));
  if (error == 0 && (::fchmod(fd, 0644) != 0 || ::fsync(fd) != 0)) error = errno;
  ::close(fd);
  if (error == 0 && ::rename(next.c_str(), path.c_str()) != 0) error = errno;
  if (error != 0) {
    ::unlink(next.c_str());
    return std::unexpected(fmt::format("cannot write {}: {}", path, std::strerror(error)));
  }
  return {};
}

std::expected<std::string, std::string> read_file(const std::string& path) {
  constexpr std::int64_t kLargest = std::int64_t{1} << 30U;
  struct stat entry {};
  const bool is_known = !path.starts_with("/dev/") && ::stat(path.c_str(), &entry) == 0;
  if (is_known && !S_ISREG(entry.st_mode))
    return std::unexpected(fmt::format("cannot read {}: it is not a regular file", path));
  if (is_known && entry.st_size > kLargest)
    return std::unexpected(fmt::format("cannot read {}: it is larger than {} bytes", path, kLargest));
  if (is_known && is_mostly_holes(path, entry))
    return std::unexpected(fmt::format("cannot read {}: most of it are holes", path));
  std::ifstream in(path, std::ios::binary);
  if (!in) return std::unexpected(fmt::format("cannot read {}: {}", path, std::strerror(errno)));
  auto content = config::read_all(in);
  if (!content) return std::unexpected(fmt::format("cannot read {}: {}", path, std::strerror(errno)));
  return *std::move(content);
}

}  // namespace takt::monitor
