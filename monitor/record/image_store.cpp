// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/image_store.hpp"

#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>

#include "monitor/record/image_file.hpp"

namespace takt::monitor {
namespace {

constexpr double kMib = 1U << 20U;
constexpr std::uint64_t kLeftForTicks = std::uint64_t{512} << 20U;

bool write_whole(const std::string& path, const std::string& content) {
  ::unlink(path.c_str());  // what a crash left, or a link to another file
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644);
  if (fd < 0) return false;
  std::size_t done = 0;
  while (done < content.size()) {
    const ssize_t wrote = ::write(fd, content.data() + done, content.size() - done);
    if (wrote <= 0) break;
    done += static_cast<std::size_t>(wrote);
  }
  return ::close(fd) == 0 && done == content.size();
}

}  // namespace

ImageStore::ImageStore(const RunFolder& folder, const config::ImageRecord& limits)
    : directory_(folder.images()), run_(folder.path()), limits_(limits), allowance_(limits.rate_mib_per_s * kMib) {}

bool ImageStore::has_room(std::size_t bytes) const {
  struct statvfs disk {};
  if (::statvfs(run_.c_str(), &disk) != 0) return false;
  return std::uint64_t{disk.f_bavail} * disk.f_frsize >= kLeftForTicks + bytes;
}

ImageFile ImageStore::write(const std::string& name, const std::string& content) {
  std::error_code error;
  std::filesystem::create_directory(directory_, error);
  const std::string path = directory_ + "/" + name;
  const std::string part = directory_ + "/.part";
  if (error || !has_room(content.size()) || !write_whole(part, content) ||
      std::rename(part.c_str(), path.c_str()) != 0) {
    std::filesystem::remove(part, error);
    return ImageFile::unwritten;
  }
  return ImageFile::stored;
}

ImageFile ImageStore::keep(const ShownImage& image, const std::string& content, MonoTime now) {
  const std::string name = image_file_name(image.shape, image.sha256);
  if (kept_.contains(name)) return ImageFile::stored;
  const bool has_allowance = allowance_.has_any(now);
  if (static_cast<double>(written_ + content.size()) > limits_.budget_mib * kMib) return ImageFile::over_budget;
  if (!has_allowance) return ImageFile::over_rate;
  const ImageFile file = write(name, content);
  if (file == ImageFile::stored) {
    allowance_.take(content.size());
    written_ += content.size();
    kept_.insert(name);
  }
  return file;
}

}  // namespace takt::monitor
