// SPDX-License-Identifier: Apache-2.0
// Goal: no process can take memory away from under a reader or gain write access after sealing. Method: try every such
// operation on real memfds; show in a forked child that the same truncation kills a reader of an unsealed file.
#include "executive/ipc/segment.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <stdexcept>

namespace takt::ipc {
namespace {

constexpr std::size_t kBytes = 3 * 4096 + 100;

Segment made(bool map_writable) {
  auto segment = Segment::create("takt-test", kBytes, map_writable);
  if (!segment) throw std::runtime_error(segment.error());
  return std::move(*segment);
}

int duplicate(const Segment& segment) {
  return fcntl(segment.fd(), F_DUPFD_CLOEXEC, 0);
}

void* map(int fd, int protection) {
  return mmap(nullptr, kBytes, protection, MAP_SHARED, fd, 0);
}

void expect_size_is_fixed(int fd) {
  EXPECT_NE(ftruncate(fd, 0), 0);
  EXPECT_EQ(errno, EPERM);
  EXPECT_NE(ftruncate(fd, 1 << 20), 0);
  EXPECT_EQ(errno, EPERM);
}

void expect_no_new_writer(int fd) {
  EXPECT_EQ(map(fd, PROT_READ | PROT_WRITE), MAP_FAILED);
  EXPECT_EQ(errno, EPERM);
  EXPECT_NE(fallocate(fd, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0, 4096), 0);
  EXPECT_EQ(errno, EPERM);
  const char byte = 1;
  EXPECT_LT(pwrite(fd, &byte, 1, 0), 0);
  EXPECT_EQ(errno, EPERM);
  void* const readable = map(fd, PROT_READ);
  ASSERT_NE(readable, MAP_FAILED);
  EXPECT_NE(mprotect(readable, 4096, PROT_READ | PROT_WRITE), 0);
  EXPECT_EQ(errno, EACCES);
  munmap(readable, kBytes);
  EXPECT_NE(fcntl(fd, F_ADD_SEALS, F_SEAL_WRITE), 0) << "the seals themselves are final";
}

TEST(Segment, IsZeroedAndItsSizeIsFixedFromBirth) {
  Segment segment = made(true);
  EXPECT_EQ(segment.writable().size(), kBytes);
  for (const std::byte byte : segment.readable()) ASSERT_EQ(byte, std::byte{0});
  expect_size_is_fixed(segment.fd());
}

TEST(Segment, OurDataCannotBeWrittenByThoseItIsHandedTo) {
  Segment ours = made(true);
  ASSERT_TRUE(ours.seal_against_new_writers());
  expect_size_is_fixed(ours.fd());
  expect_no_new_writer(ours.fd());
  EXPECT_FALSE(Segment::adopt_writable(duplicate(ours), kBytes).has_value());
  auto theirs = Segment::adopt_read_only(duplicate(ours), kBytes);
  ASSERT_TRUE(theirs) << theirs.error();
  ours.writable()[4097] = std::byte{42};
  EXPECT_EQ(theirs->readable()[4097], std::byte{42});
  EXPECT_TRUE(theirs->writable().empty());
}

TEST(Segment, PeersMailboxKeepsItsWriterAndAdmitsNoOther) {
  Segment ours = made(false);
  EXPECT_TRUE(ours.readable().empty());
  auto peers = Segment::adopt_writable(duplicate(ours), kBytes);
  ASSERT_TRUE(peers) << peers.error();
  ASSERT_TRUE(ours.seal_against_new_writers());
  ASSERT_TRUE(ours.map_read_only());
  EXPECT_FALSE(ours.map_read_only().has_value()) << "mapped twice";
  peers->writable()[9000] = std::byte{7};
  EXPECT_EQ(ours.readable()[9000], std::byte{7});
  expect_size_is_fixed(peers->fd());
  expect_no_new_writer(peers->fd());
  // The map that the peer keeps is no way round the seals either.
  EXPECT_NE(madvise(peers->writable().data(), 4096, MADV_REMOVE), 0);
  EXPECT_EQ(errno, EPERM);
}

// A peer that seals its mailbox itself, to keep its descriptor writable, is noticed.
TEST(Segment, PeerThatSealedFirstIsRefused) {
  Segment ours = made(false);
  ASSERT_EQ(fcntl(ours.fd(), F_ADD_SEALS, F_SEAL_SEAL), 0);
  const auto sealed = ours.seal_against_new_writers();
  ASSERT_FALSE(sealed);
  EXPECT_NE(sealed.error().find("seal"), std::string::npos);
}

TEST(Segment, UnsealedShortOrForeignDescriptorsAreRefused) {
  const int unsealed = memfd_create("unsealed", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  ASSERT_EQ(ftruncate(unsealed, kBytes), 0);
  auto refused = Segment::adopt_read_only(unsealed, kBytes);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().find("truncated"), std::string::npos);
  EXPECT_EQ(fcntl(unsealed, F_GETFD), -1) << "a refused descriptor is closed";

  refused = Segment::adopt_read_only(duplicate(made(false)), kBytes + 1);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().find("bytes"), std::string::npos);

  refused = Segment::adopt_read_only(open("/dev/null", O_RDONLY | O_CLOEXEC), kBytes);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().find("not a memfd"), std::string::npos);
  EXPECT_FALSE(Segment::adopt_read_only(-1, kBytes).has_value());
}

// What a child of ours dies of when the file under its map is truncated to nothing; 0: nothing.
int fatal_signal_of_reader(int fd) {
  const pid_t child = fork();
  if (child == 0) {
    std::signal(SIGBUS, SIG_DFL);
    const auto* const at = static_cast<const volatile std::byte*>(map(fd, PROT_READ));
    [[maybe_unused]] std::byte byte = at[0];
    [[maybe_unused]] const int ignored = ftruncate(fd, 0);
    byte = at[0];
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFSIGNALED(status) ? WTERMSIG(status) : 0;
}

TEST(Segment, TruncationKillsReadersOfUnsealedFilesOnly) {
  const Descriptor unsealed(memfd_create("unsealed", MFD_CLOEXEC));
  ASSERT_EQ(ftruncate(unsealed.get(), kBytes), 0);
  EXPECT_EQ(fatal_signal_of_reader(unsealed.get()), SIGBUS) << "the danger that sealing removes";
  EXPECT_EQ(fatal_signal_of_reader(made(false).fd()), 0);
}

TEST(Segment, MovesOwnership) {
  Segment first = made(true);
  first.writable()[0] = std::byte{5};
  const int fd = first.fd();
  Segment second = std::move(first);
  EXPECT_EQ(second.fd(), fd);
  EXPECT_EQ(second.readable()[0], std::byte{5});
  second = made(true);
  EXPECT_EQ(second.readable()[0], std::byte{0});
}

}  // namespace
}  // namespace takt::ipc
