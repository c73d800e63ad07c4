// SPDX-License-Identifier: Apache-2.0
// A SampleBlock as text for a page, read by page/columns.js.
//
// Values become 16-bit integers, value = offset + scale * integer; -32768 stands for NaN. A column is then written as
// differences to the row before (modulo 2^16), all low bytes first, then all high bytes, which is what compresses well.
// The first column is time in 10 us, as differences of 32 bits in four byte planes. All columns together are
// one zlib stream, in base64. The layout names the columns:
// {"rows":..,"bucket_ticks":..,"columns":[[name,offset,scale]]}.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "evidence/review/report/sample_block.hpp"

namespace takt::evidence {

struct PackedBlock {
  nlohmann::ordered_json layout;
  std::string base64;
};
PackedBlock pack(const SampleBlock& block);
std::string base64_of(const std::string& bytes);

}  // namespace takt::evidence
