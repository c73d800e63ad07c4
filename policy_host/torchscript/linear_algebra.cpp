// SPDX-License-Identifier: Apache-2.0
#include "policy_host/torchscript/linear_algebra.hpp"

#include <dlfcn.h>

#include <filesystem>
#include <sstream>

namespace takt::torchscript {
namespace {

// Loaded with libtorch, and named here without being linked: every such library goes by this name.
void* loaded_library() {
  static void* const library = dlopen("libblas.so.3", RTLD_NOW | RTLD_NOLOAD);
  return library;
}

template <class Function>
Function* function(const char* name) {
  void* const library = loaded_library();
  return library == nullptr ? nullptr : reinterpret_cast<Function*>(dlsym(library, name));
}

// The folder that Debian has it in says which it is: .../openblas-pthread, .../blis-pthread, .../atlas, .../blas.
std::string folder_of_library() {
  auto* const product = function<void()>("sgemm_");
  Dl_info info{};
  if (product == nullptr || dladdr(reinterpret_cast<const void*>(product), &info) == 0) return {};
  std::error_code unreadable;
  return std::filesystem::canonical(info.dli_fname, unreadable).parent_path().filename().string();
}

}  // namespace

std::string linear_algebra() {
  if (const auto about = function<const char*()>("openblas_get_config")) {
    std::istringstream words(about());  // "OpenBLAS 0.3.21 NO_LAPACKE DYNAMIC_ARCH ..."
    std::string name, version;
    words >> name >> version;
    return name + " " + version;
  }
  const std::string folder = folder_of_library();
  if (folder == "blas") return "reference BLAS (slow: install libopenblas0-pthread)";
  return folder.empty() ? "an unknown BLAS" : "BLAS of " + folder;
}

void limit_linear_algebra(unsigned threads) {
  if (const auto limit = function<void(int)>("openblas_set_num_threads")) limit(static_cast<int>(threads));
}

}  // namespace takt::torchscript
