// SPDX-License-Identifier: Apache-2.0
// A picture with something in every field, made by hand.
#pragma once

#include "cli/top/picture.hpp"

namespace takt::monitor::top {

// Tracking again after a stall; `joints` joints of which every third intervenes, `buses` buses of which the second
// lost frames.
Picture sample_picture(std::size_t joints, std::size_t buses);

}  // namespace takt::monitor::top
