// SPDX-License-Identifier: Apache-2.0
// Any text as a robot file: refused with a sentence, or read; and what was read, written with every default, is the
// same robot. Its files are sought beside the shipped ones.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "config/load.hpp"
#include "tests/fuzz/refused_with_a_sentence.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace takt::config;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  takt::fuzz::judge(parse_recorded(text, "config/fuzz.yaml"));
  const auto robot = parse(text, "config/fuzz.yaml");
  takt::fuzz::judge(robot);
  if (!robot) return 0;
  const auto again = parse(with_every_default(*robot), "config/fuzz.yaml");
  if (again && again->hash == robot->hash) return 0;
  std::fprintf(stderr, "%s\n%s\n", with_every_default(*robot).c_str(), again ? "another hash" : again.error().c_str());
  std::abort();
}
