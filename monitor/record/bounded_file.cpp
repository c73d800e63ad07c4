#include "monitor/record/bounded_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <utility>

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
  return BoundedFile(path, fd, max_bytes);
}

BoundedFile::BoundedFile(BoundedFile&& other) noexcept
    : path_(std::move(other.path_)),
      fd_(std::exchange(other.fd_, -1)),
      max_bytes_(other.max_bytes_),
      size_(other.size_),
      synced_(other.synced_),
      failure_(std::move(other.failure_)) {}

BoundedFile::~BoundedFile() {
  if (fd_ >= 0) ::close(fd_);
}

bool BoundedFile::append(std::span<const std::byte> piece) {
  if (!failure_.empty()) return false;
  if (size_ + piece.size() > max_bytes_) {
    failure_ = fmt::format("{} reached its limit of {} bytes", path_, max_bytes_);
    return false;
  }
  if (const int error = write_all(fd_, piece); error != 0) {
    failure_ = fmt::format("{} takes no more data: {}", path_, std::strerror(error));
    cut_back_to(size_);
    return false;
  }
  size_ += piece.size();
  return true;
}

void BoundedFile::reopen(std::uint64_t max_bytes) {
  failure_.clear();
  max_bytes_ = max_bytes;
}

bool BoundedFile::sync() {
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
}

std::expected<void, std::string> replace_file(const std::string& path, std::string_view text) {
  const std::string next = path + ".next";
  const int fd = ::open(next.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd < 0) return std::unexpected(fmt::format("cannot create {}: {}", next, std::strerror(errno)));
  int error = write_all(fd, std::as_bytes(std::span(text)));
  if (error == 0 && ::fsync(fd) != 0) error = errno;
  ::close(fd);
  if (error == 0 && ::rename(next.c_str(), path.c_str()) != 0) error = errno;
  if (error != 0) {
    ::unlink(next.c_str());
    return std::unexpected(fmt::format("cannot write {}: {}", path, std::strerror(error)));
  }
  return {};
}

std::expected<std::string, std::string> read_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) return std::unexpected(fmt::format("cannot read {}: {}", path, std::strerror(errno)));
  return std::string(std::istreambuf_iterator<char>(in), {});
}

}  // namespace takt::monitor
