// SPDX-License-Identifier: Apache-2.0
// The <frame>s of newer MJCF files, taken out: what stands in one gets its place, orientation and class. Newlines stay.
// Pure.
#pragma once

#include <cstddef>
#include <string>

namespace takt::simulation {

struct UnfoldedFrames {
  std::string text;
  std::size_t count = 0;       // that were taken out
  std::size_t first_line = 0;  // of the first of them
};

// Left as they are, for MuJoCo to refuse: frames in a text whose defaults give places or orientations, frames that move
// what has neither (a composite), and numbers that cannot be read.
UnfoldedFrames unfold_frames(const std::string& text);

}  // namespace takt::simulation
