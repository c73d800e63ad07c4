// SPDX-License-Identifier: Apache-2.0
#include "executive/ipc/segment.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#ifndef MFD_NOEXEC_SEAL
#define MFD_NOEXEC_SEAL 0x0008U  // Linux 6.3
#endif

namespace takt::ipc {
namespace {

constexpr int kSizeSeals = F_SEAL_SHRINK | F_SEAL_GROW;
constexpr int kWriterSeals = F_SEAL_FUTURE_WRITE | F_SEAL_SEAL;

std::unexpected<std::string> segment_failed(const std::string& what) {
  return std::unexpected("shared memory: " + what + ": " + std::generic_category().message(errno));
}

int open_memfd(const char* name) {
  constexpr unsigned kFlags = MFD_CLOEXEC | MFD_ALLOW_SEALING;
  const int fd = memfd_create(name, kFlags | MFD_NOEXEC_SEAL);
  return fd < 0 && errno == EINVAL ? memfd_create(name, kFlags) : fd;  // kernels before 6.3
}

}  // namespace

std::expected<Segment, std::string> Segment::create(const char* name, std::size_t bytes, bool map_writable) {
  Descriptor file(open_memfd(name));
  if (!file.is_open()) return segment_failed("cannot create " + std::string(name));
  if (ftruncate(file.get(), static_cast<off_t>(bytes)) != 0) return segment_failed("cannot size " + std::string(name));
  if (fcntl(file.get(), F_ADD_SEALS, kSizeSeals) != 0)
    return segment_failed("cannot seal the size of " + std::string(name));
  Segment segment(std::move(file), bytes);
  if (map_writable) {
    if (auto mapped = segment.map(true); !mapped) return std::unexpected(mapped.error());
  }
  return segment;
}

std::expected<Segment, std::string> Segment::adopt(int fd, std::size_t bytes, bool writable) {
  Descriptor file(fd);
  const int seals = fcntl(fd, F_GET_SEALS);
  if (seals < 0) return segment_failed("the descriptor received is not a memfd");
  if ((seals & kSizeSeals) != kSizeSeals) {
    return std::unexpected("shared memory: the segment received can be truncated under us: its owner must seal it");
  }
  struct stat status {};
  if (fstat(fd, &status) != 0) return segment_failed("cannot stat the segment received");
  if (static_cast<std::size_t>(status.st_size) < bytes) {
    return std::unexpected("shared memory: the segment received has " + std::to_string(status.st_size) +
                           " bytes, expected " + std::to_string(bytes) +
                           ": both sides must run the same version of Takt and the same robot file");
  }
  Segment segment(std::move(file), bytes);
  if (auto mapped = segment.map(writable); !mapped) return std::unexpected(mapped.error());
  return segment;
}

std::expected<Segment, std::string> Segment::adopt_read_only(int fd, std::size_t bytes) {
  return adopt(fd, bytes, false);
}

std::expected<Segment, std::string> Segment::adopt_writable(int fd, std::size_t bytes) {
  return adopt(fd, bytes, true);
}

std::expected<void, std::string> Segment::map(bool writable) {
  const int protection = writable ? PROT_READ | PROT_WRITE : PROT_READ;
  void* const at = mmap(nullptr, size_, protection, MAP_SHARED | MAP_POPULATE, file_.get(), 0);
  if (at == MAP_FAILED) return segment_failed(writable ? "cannot map a segment writable" : "cannot map a segment");
  data_ = static_cast<std::byte*>(at);
  writable_ = writable;
  // MAP_POPULATE hides failures; this reports them, and also takes the write faults. EINVAL: Linux before 5.14.
  if (madvise(at, size_, writable ? MADV_POPULATE_WRITE : MADV_POPULATE_READ) != 0 && errno != EINVAL) {
    return segment_failed("cannot pre-fault " + std::to_string(size_) + " bytes");
  }
  return {};
}

std::expected<void, std::string> Segment::map_read_only() {
  if (data_ != nullptr) return std::unexpected("shared memory: the segment is mapped already: fix the caller");
  return map(false);
}

std::expected<void, std::string> Segment::seal_against_new_writers() {
  if (fcntl(file_.get(), F_ADD_SEALS, kWriterSeals) != 0)
    return segment_failed("cannot seal a segment against new writers");
  return {};
}

void Segment::unmap() {
  if (data_ != nullptr) munmap(std::exchange(data_, nullptr), size_);
}

Segment::Segment(Segment&& other) noexcept
    : file_(std::move(other.file_)),
      size_(std::exchange(other.size_, 0)),
      data_(std::exchange(other.data_, nullptr)),
      writable_(std::exchange(other.writable_, false)) {}

Segment& Segment::operator=(Segment&& other) noexcept {
  if (this != &other) {
    unmap();
    file_ = std::move(other.file_);
    size_ = std::exchange(other.size_, 0);
    data_ = std::exchange(other.data_, nullptr);
    writable_ = std::exchange(other.writable_, false);
  }
  return *this;
}

Segment::~Segment() {
  unmap();
}

std::span<std::byte> Segment::writable() {
  return writable_ ? std::span(data_, size_) : std::span<std::byte>();
}

std::span<const std::byte> Segment::readable() const {
  return data_ != nullptr ? std::span<const std::byte>(data_, size_) : std::span<const std::byte>();
}

}  // namespace takt::ipc
