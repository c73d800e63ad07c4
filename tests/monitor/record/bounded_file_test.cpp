// SPDX-License-Identifier: Apache-2.0
// Goal: a file that is replaced is never another one: a device stays a device, and a link that lies in its place, or in
// the place of the unfinished copy, leads nowhere. Method: such entries in a folder of the test's own.
#include "monitor/record/bounded_file.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

using ReplacedFile = test::TemporaryFolder;

TEST_F(ReplacedFile, HasTheNewTextAndNothingIsLeftBeside) {
  ASSERT_TRUE(replace_file(path("metrics.json"), "old"));
  ASSERT_TRUE(replace_file(path("metrics.json"), "new"));
  EXPECT_EQ(read_file(path("metrics.json")).value(), "new");
  const std::filesystem::path folder = std::filesystem::path(path("metrics.json")).parent_path();
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1);
  struct stat entry {};
  ASSERT_EQ(::stat(path("metrics.json").c_str(), &entry), 0);
  EXPECT_EQ(entry.st_mode & 0777U, 0644U);
}

// Threat: run-links
TEST_F(ReplacedFile, NoLinkInItsPlaceLeadsToAnotherFile) {
  ASSERT_TRUE(replace_file(path("mine"), "mine"));
  std::filesystem::create_symlink(path("mine"), path("metrics.json"));
  std::filesystem::create_symlink(path("mine"), path("metrics.json.next"));
  ASSERT_TRUE(replace_file(path("metrics.json"), "a stranger's"));
  EXPECT_EQ(read_file(path("mine")).value(), "mine");
  EXPECT_EQ(read_file(path("metrics.json")).value(), "a stranger's");
}

TEST_F(ReplacedFile, ADeviceStaysADevice) {
  const std::string null = path("null");
  if (::mknod(null.c_str(), S_IFCHR | 0666, ::makedev(1, 3)) != 0) GTEST_SKIP() << "NOT TESTED: mknod needs root";
  ASSERT_TRUE(replace_file(null, "a page"));
  struct stat entry {};
  ASSERT_EQ(::lstat(null.c_str(), &entry), 0);
  EXPECT_TRUE(S_ISCHR(entry.st_mode));
}

TEST_F(ReplacedFile, APipeIsWrittenToAndOneWithoutAReaderIsRefused) {
  const std::string pipe = path("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_FALSE(replace_file(pipe, "no reader")) << "and it does not block";
  const int reader = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  ASSERT_GE(reader, 0);
  ASSERT_TRUE(replace_file(pipe, "text"));
  std::array<char, 8> buffer{};
  EXPECT_EQ(::read(reader, buffer.data(), buffer.size()), 4);
  ::close(reader);
}

// What a stranger's folder has in the place of a file may never end, or never begin.
// Threat: run-pipe
TEST_F(ReplacedFile, NoPipeFolderOrLinkToADeviceIsRead) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  std::filesystem::create_symlink("/dev/zero", path("zero"));
  std::filesystem::create_directory(path("folder"));
  for (const char* const name : {"pipe", "zero", "folder"}) {
    const auto text = read_file(path(name));
    ASSERT_FALSE(text) << name;
    EXPECT_TRUE(text.error().ends_with("it is not a regular file")) << text.error();
  }
  EXPECT_EQ(read_file("/dev/null").value(), "") << "named by the user";
}

// Of 20 GiB, and beyond the smaller limit: no memory for what its medium does not hold.
// Threat: run-hole
TEST_F(ReplacedFile, AFileOfHolesIsRefusedUnread) {
  const std::pair<std::uint64_t, std::string> sizes[] = {
      {std::uint64_t{20} << 30U, "it is larger than 1073741824 bytes"},
      {std::uint64_t{65} << 20U, "most of it are holes"}};
  for (const auto& [size, why] : sizes) {
    std::ofstream(path("hole")) << "{}";
    std::filesystem::resize_file(path("hole"), size);
    EXPECT_EQ(read_file(path("hole")).error(), "cannot read " + path("hole") + ": " + why);
    std::filesystem::resize_file(path("hole"), 0);
    std::filesystem::resize_file(path("hole"), size);
    EXPECT_EQ(read_file(path("hole")).error(), "cannot read " + path("hole") + ": " + why) << "without a byte";
  }
}

}  // namespace
}  // namespace takt::monitor
