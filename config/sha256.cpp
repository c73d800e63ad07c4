// SPDX-License-Identifier: Apache-2.0
#include "config/sha256.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

namespace takt::config {

void Sha256::Free::operator()(evp_md_ctx_st* context) const {
  EVP_MD_CTX_free(context);
}

Sha256::Sha256() : context_(EVP_MD_CTX_new()) {
  EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr);
}

void Sha256::add(std::span<const std::byte> piece) {
  EVP_DigestUpdate(context_.get(), piece.data(), piece.size());
}

std::string Sha256::hex() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  EVP_DigestFinal_ex(context_.get(), digest.data(), &size);
  EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr);
  std::string text;
  for (unsigned int i = 0; i < size; ++i) text += fmt::format("{:02x}", digest[i]);
  return text;
}

namespace {

std::expected<void, std::string> add_file(Sha256& sha, const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) return std::unexpected(std::strerror(errno));
  struct stat status {};
  std::string why = ::fstat(fd, &status) != 0 ? std::strerror(errno) : "";
  if (why.empty() && !S_ISREG(status.st_mode)) why = "is not a regular file";
  std::array<std::byte, 65536> buffer{};
  ssize_t got = 1;
  while (why.empty() && got > 0) {
    got = ::read(fd, buffer.data(), buffer.size());
    if (got < 0) why = std::strerror(errno);
    if (got > 0) sha.add(std::span(buffer).first(static_cast<std::size_t>(got)));
  }
  ::close(fd);
  if (!why.empty()) return std::unexpected(why);
  return {};
}

}  // namespace

std::expected<std::string, std::string> file_sha256(const std::string& path) {
  Sha256 sha;
  if (const auto added = add_file(sha, path); !added) return std::unexpected(added.error());
  return sha.hex();
}

}  // namespace takt::config
