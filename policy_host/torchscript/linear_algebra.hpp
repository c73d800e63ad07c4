// SPDX-License-Identifier: Apache-2.0
// The linear algebra library (BLAS) that libtorch found: Debian lets the machine choose it, and its reference one is
// many times slower than others (docs/policies.md).
#pragma once

#include <string>

namespace takt::torchscript {

// What it is, for the log: "OpenBLAS 0.3.21", "reference BLAS (slow: install libopenblas0-pthread)".
std::string linear_algebra();

// It uses this many threads from here on. Those that OpenBLAS started when it was loaded stay, and sleep.
void limit_linear_algebra(unsigned threads);

}  // namespace takt::torchscript
