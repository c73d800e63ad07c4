// SPDX-License-Identifier: Apache-2.0
#include "executive/ipc/socket_claim.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <ctime>

#include "executive/ipc/unix_socket.hpp"

namespace takt::ipc {
namespace {

constexpr mode_t kDirectoryMode = 0750;
constexpr mode_t kSocketMode = 0660;

std::unexpected<std::string> failed(const std::string& what) {
  return std::unexpected("rendezvous: " + what + ": " + errno_text());
}

std::string directory_of(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

std::expected<void, std::string> give_to(const std::string& path, uid_t owner) {
  if (owner == geteuid() || chown(path.c_str(), owner, static_cast<gid_t>(-1)) == 0) return {};
  return failed("cannot give " + path + " to user " + std::to_string(owner));
}

// Makes the missing directories of `directory`, outermost first.
std::expected<void, std::string> make_directory(const std::string& directory, uid_t owner) {
  if (access(directory.c_str(), F_OK) == 0) return {};
  if (auto parent = make_directory(directory_of(directory), geteuid()); !parent) return parent;
  if (mkdir(directory.c_str(), kDirectoryMode) != 0) {
    return errno == EEXIST ? std::expected<void, std::string>() : failed("cannot make directory " + directory);
  }
  return give_to(directory, owner);
}

// Held while a server looks and binds: microseconds. A file that the directory's owner alone may open: who may
// open a directory may lock it for ever.
std::expected<Descriptor, std::string> lock_beside(const std::string& directory) {
  constexpr int kTries = 200;
  constexpr timespec kPause{0, 10'000'000};
  const std::string file = directory + "/.lock";
  Descriptor lock(open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, S_IRUSR | S_IWUSR));
  if (!lock.is_open()) return failed("cannot open " + file);
  struct stat place {};
  if (stat(directory.c_str(), &place) != 0) return failed("cannot look at " + directory);
  if (auto given = give_to(file, geteuid() == 0 ? place.st_uid : geteuid()); !given)
    return std::unexpected(given.error());
  for (int i = 0; i < kTries; ++i) {
    if (flock(lock.get(), LOCK_EX | LOCK_NB) == 0) return lock;
    if (errno != EWOULDBLOCK) return failed("cannot lock " + file);
    nanosleep(&kPause, nullptr);
  }
  return std::unexpected("rendezvous: another program has held " + file +
                         " for 2 s: end it, or choose another --runtime-dir");
}

// Removes what a dead server left at `path`. Precondition: the directory is locked.
std::expected<void, std::string> clear_path(const std::string& path) {
  struct stat status {};
  if (lstat(path.c_str(), &status) != 0) {
    return errno == ENOENT ? std::expected<void, std::string>() : failed("cannot look at " + path);
  }
  if (!S_ISSOCK(status.st_mode)) {
    return std::unexpected("rendezvous: " + path +
                           " exists and is no socket: remove it or choose another --runtime-dir");
  }
  const Descriptor probe = open_seqpacket(SOCK_NONBLOCK);
  if (!probe.is_open()) return failed("cannot open a socket");
  // EAGAIN: a server listens, but is too busy to accept.
  if (connect_to(probe, path) || errno == EAGAIN) {
    return std::unexpected("rendezvous: another server is live at " + path +
                           ": stop it first or choose another --runtime-dir");
  }
  if (errno != ECONNREFUSED) return failed("cannot probe the socket at " + path);
  if (unlink(path.c_str()) != 0) return failed("cannot remove the dead socket at " + path);
  return {};
}

}  // namespace

std::expected<SocketClaim, std::string> SocketClaim::make(const std::string& path, uid_t owner) {
  if (auto checked = check_path(path); !checked) return std::unexpected(checked.error());
  const std::string directory = directory_of(path);
  if (auto made = make_directory(directory, owner); !made) return std::unexpected(made.error());
  const auto lock = lock_beside(directory);
  if (!lock) return std::unexpected(lock.error());
  if (auto cleared = clear_path(path); !cleared) return std::unexpected(cleared.error());
  auto listener = listen_at(path);
  if (!listener) return std::unexpected(listener.error());

  struct stat status {};
  if (lstat(path.c_str(), &status) != 0) return failed("cannot look at " + path);
  SocketClaim claim(std::move(*listener), path, status.st_dev, status.st_ino);
  if (chmod(path.c_str(), kSocketMode) != 0) return failed("cannot set the mode of " + path);
  if (auto given = give_to(path, owner); !given) return std::unexpected(given.error());
  return claim;
}

bool SocketClaim::has_name() const {
  struct stat status {};
  return lstat(path_.c_str(), &status) == 0 && status.st_dev == device_ && status.st_ino == inode_;
}

SocketClaim::~SocketClaim() {
  if (listener_.is_open() && has_name()) unlink(path_.c_str());
}

}  // namespace takt::ipc
