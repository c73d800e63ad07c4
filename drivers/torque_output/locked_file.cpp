// SPDX-License-Identifier: Apache-2.0
#include "drivers/torque_output/locked_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/bus/file_handle.hpp"

namespace takt::drivers {
namespace {

struct flock first_byte(short type) {
  struct flock lock {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  lock.l_len = 1;
  return lock;
}

class LockedFile final : public TorqueOutput {
 public:
  explicit LockedFile(FileHandle file) : file_(std::move(file)) {}
  bool tell(bool permitted) noexcept override {
    struct flock lock = first_byte(permitted ? F_WRLCK : F_UNLCK);
    struct stat found {};
    const bool is_set = fcntl(file_.get(), F_OFD_SETLK, &lock) == 0;
    return fstat(file_.get(), &found) == 0 && found.st_nlink > 0 && is_set;
  }

 private:
  FileHandle file_;  // closing it ends the lock
};

}  // namespace

std::expected<OpenedTorqueOutput, std::string> open_locked_file(const config::SafeTorqueOff& wanted) {
  FileHandle file(open(wanted.file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  if (!file.is_open())
    return std::unexpected(
        fmt::format("safety.safe_torque_off: {}: {}: name a file in a folder where this user may write", wanted.file,
                    std::strerror(errno)));
  auto output = std::make_unique<LockedFile>(std::move(file));
  return OpenedTorqueOutput{std::move(output), fmt::format("a lock on {}, which moves no relay", wanted.file)};
}

bool is_torque_permitted(const std::string& path) {
  const FileHandle file(open(path.c_str(), O_RDWR | O_CLOEXEC));
  struct flock lock = first_byte(F_WRLCK);
  return file.is_open() && fcntl(file.get(), F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

}  // namespace takt::drivers
