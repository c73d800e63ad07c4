// SPDX-License-Identifier: Apache-2.0
// One observation is one row, and libtorch multiplies it with a layer's weights by a product of matrices, for which a
// BLAS packs all of them first: several times the work of a matrix-vector product.
#pragma once

#include <torch/script.h>

namespace takt::torchscript {

// Linear layers of `module`'s forward become products of a vector where their input is one row when they run.
// Precondition: it is frozen, or otherwise has a graph of its own.
void multiply_rows_as_vectors(torch::jit::Module& module);

}  // namespace takt::torchscript
