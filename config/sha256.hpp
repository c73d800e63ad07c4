// SPDX-License-Identifier: Apache-2.0
// SHA-256 of what comes in pieces, and of whole files. Thread rule: one thread per object.
#pragma once

#include <cstddef>
#include <expected>
#include <memory>
#include <span>
#include <string>

struct evp_md_ctx_st;

namespace takt::config {

class Sha256 {
 public:
  Sha256();
  void add(std::span<const std::byte> piece);
  // 64 hexadecimal digits of all pieces; afterwards it begins anew.
  std::string hex();

 private:
  struct Free {
    void operator()(evp_md_ctx_st* context) const;
  };
  std::unique_ptr<evp_md_ctx_st, Free> context_;
};

// Never blocks on a pipe. The error: why the file cannot be read, such as "is not a regular file".
std::expected<std::string, std::string> file_sha256(const std::string& path);

}  // namespace takt::config
