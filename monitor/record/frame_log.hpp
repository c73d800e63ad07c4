// SPDX-License-Identifier: Apache-2.0
// can.log.zst of a run folder: candump's lines, in zstd frames of up to half a second. Each frame is whole by itself,
// so that a file cut off anywhere gives back all but its last half second; `zstd -dc` reads it.
#pragma once

#include <expected>
#include <string>
#include <string_view>

#include "monitor/record/bytes.hpp"
#include "monitor/record/run_folder.hpp"

namespace takt::monitor {

Bytes compressed_frames(std::string_view lines);
// Every line up to the file's end, or to what is damaged; of an older run those of its plain can.log.
std::expected<std::string, std::string> read_frame_log(const RunFolder& folder);

}  // namespace takt::monitor
