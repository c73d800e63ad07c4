// SPDX-License-Identifier: Apache-2.0
// Models and policies as their makers published them, in the folder `shared` beside the checkout. A clone has none:
// tests that need one skip, and say so. CI has them: with TAKT_REQUIRE_SHARED=1 what would skip fails.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>

namespace takt::test {

// The first of `files` that is not there; empty: all are.
inline std::string missing_of(std::initializer_list<std::filesystem::path> files) {
  for (const std::filesystem::path& file : files)
    if (!std::filesystem::exists(file)) return file.string();
  return {};
}

inline bool shared_files_are_required() {
  const char* const required = std::getenv("TAKT_REQUIRE_SHARED");
  return required != nullptr && std::string_view(required) == "1";
}

}  // namespace takt::test

// At the beginning of a test, or of its SetUp().
#define TAKT_NEEDS_SHARED(...)                                                                           \
  if (const std::string missing_file = ::takt::test::missing_of({__VA_ARGS__}); !missing_file.empty()) { \
    if (::takt::test::shared_files_are_required())                                                       \
      FAIL() << missing_file << " is missing: TAKT_REQUIRE_SHARED is set";                               \
    GTEST_SKIP() << "NOT TESTED: " << missing_file << " is not there";                                   \
  }
