// SPDX-License-Identifier: Apache-2.0
// Any text as what a run folder, an artifact or an attestation says in JSON: refused with a sentence, or read.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "evidence/attestation/attestation.hpp"
#include "lab/artifact/artifact_manifest.hpp"
#include "lab/artifact/rollout_json.hpp"
#include "monitor/record/run_manifest.hpp"
#include "monitor/record/strict_json.hpp"
#include "tests/fuzz/refused_with_a_sentence.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using takt::fuzz::judge;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  judge(takt::lab::row_of(text));
  judge(takt::evidence::attestation_of(text));
  const auto json = takt::monitor::parse_strict(text);
  judge(json);
  if (!json) return 0;
  judge(takt::monitor::manifest_of(*json));
  judge(takt::lab::artifact_manifest_of(*json));
  return 0;
}
