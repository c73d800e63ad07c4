// SPDX-License-Identifier: Apache-2.0
// ONNX Runtime's library, where the machine has tests/node's npm packages.
#pragma once

#include <filesystem>
#include <optional>

// ONNX Runtime keeps some bytes of its own for ever; of ours nothing is excused.
#if defined(__SANITIZE_ADDRESS__)
extern "C" const char* __lsan_default_suppressions();  // NOLINT(bugprone-reserved-identifier): the sanitizer's name
extern "C" [[gnu::used]] inline const char* __lsan_default_suppressions() {  // NOLINT(bugprone-reserved-identifier)
  return "leak:libonnxruntime.so";
}
#endif

namespace takt::policy_host {

// tests/node's package has the library of every machine that it knows.
inline std::optional<std::filesystem::path> installed_onnx_runtime() {
#if defined(__aarch64__)
  constexpr const char* machine = "arm64";
#else
  constexpr const char* machine = "x64";
#endif
  const std::filesystem::path package = "tests/node/node_modules/onnxruntime-node/bin";
  if (!std::filesystem::exists(package)) return std::nullopt;
  for (const auto& version : std::filesystem::directory_iterator(package)) {
    const std::filesystem::path library = version.path() / "linux" / machine / "libonnxruntime.so.1";
    if (std::filesystem::exists(library)) return library;
  }
  return std::nullopt;
}

}  // namespace takt::policy_host
