// SPDX-License-Identifier: Apache-2.0
// Goal: a run is recorded whatever the folders around it are called. Method: a manifest whose policy lies in a folder
// with a name that is no UTF-8, as JSON is; written and read again.
#include "monitor/record/run_folder.hpp"

#include <gtest/gtest.h>

#include "monitor/record/run_manifest.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

class RunFolderTest : public test::TemporaryFolder {};

TEST_F(RunFolderTest, AManifestNamesAnyPath) {
  const RunFolder folder(path(""));
  RunManifest manifest;
  manifest.run_id = "r";
  manifest.policy_file = "/home/j\xFCrgen/policy.onnx";
  const auto written = folder.write_manifest(manifest);
  ASSERT_TRUE(written) << written.error();
  const auto read = folder.read_manifest();
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->policy_file, "/home/j\xEF\xBF\xBDrgen/policy.onnx") << "U+FFFD for what JSON cannot hold";
}

}  // namespace
}  // namespace takt::monitor
