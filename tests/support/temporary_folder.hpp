// SPDX-License-Identifier: Apache-2.0
// A fixture with a temporary directory for each test.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "tests/support/temporary_directory.hpp"

namespace takt::test {

class TemporaryFolder : public ::testing::Test {
 protected:
  [[nodiscard]] std::string path(const std::string& name) const { return directory_.path(name); }

 private:
  const TemporaryDirectory directory_;
};

}  // namespace takt::test
