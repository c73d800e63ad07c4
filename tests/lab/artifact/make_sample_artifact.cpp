// SPDX-License-Identifier: Apache-2.0
// make_sample_artifact DIR: an artifact of sample rows, for readers in other languages. 21 rows: more than two groups
// of eight, the last one not full.
#include <cstdio>
#include <exception>

#include "tests/lab/artifact/sample_artifact.hpp"
#include "tests/lab/artifact/sample_rows.hpp"

int main(int argc, char** argv) {
  using namespace takt::lab;
  using namespace takt::evidence;
  if (argc != 2) return 64;
  try {
    std::vector<RolloutRow> rows;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      rows.push_back(seed % 3 == 0 ? failed_row("method-a", seed) : sample_row("method-a", seed));
      rows.back().energy_J = static_cast<double>(seed) / 3;
    }
    rows.push_back(sample_row("method-b", 1));
    rows.back().age_per_tick = {};
    write_artifact(argv[1], sample_manifest({"method-a", "method-b"}, rows.size()), rows);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_sample_artifact: %s\n", error.what());
    return 1;
  }
  return 0;
}
