// SPDX-License-Identifier: Apache-2.0
// A text with one passage of it changed.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <string_view>

namespace takt::test {

// The first `from` is `to`; a text without any fails the test and comes back as it is.
inline std::string replaced(std::string text, std::string_view from, std::string_view to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << "no " << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

}  // namespace takt::test
