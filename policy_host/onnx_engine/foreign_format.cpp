// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/foreign_format.hpp"

#include <array>
#include <string_view>

namespace takt::onnx_engine {

namespace {

struct Format {
  std::string_view magic;
  std::size_t at;
  std::string_view what;
};

constexpr std::string_view kExport = "export the network to ONNX";
constexpr auto kFormats = std::to_array<Format>({
    {"TFL3", 4, "TensorFlow Lite"},
    {std::string_view("\x89HDF\r\n\x1a\n", 8), 0, "HDF5, as Keras saves it"},
    {std::string_view("\x93NUMPY", 6), 0, "a NumPy array"},
    {"GGUF", 0, "GGUF"},
    {"ptrt", 0, "a TensorRT engine"},
    {"ftrt", 0, "a TensorRT engine"},
    {"\x80\x02", 0, "a Python pickle"},
    {"\x80\x03", 0, "a Python pickle"},
    {"\x80\x04", 0, "a Python pickle"},
    {"\x80\x05", 0, "a Python pickle"},
});

std::string named(std::string_view what, std::string_view cure) {
  return std::string("is ").append(what).append(", not ONNX: ").append(cure);
}

// PyTorch's archives and Keras' are ZIP files; the names of their entries tell them apart.
std::string of_archive(std::string_view text) {
  if (text.contains("constants.pkl"))
    return named("TorchScript", "let its name end in .pt, which policy.engine torchscript takes");
  if (text.contains("data.pkl"))
    return named("weights that PyTorch saved, without the network", "load them in training, and export to ONNX");
  if (text.contains("model.weights.h5")) return named("a Keras archive", kExport);
  return named("a ZIP archive", "unpack it, and name the .onnx file");
}

// A length of 64 bits, then a JSON map.
bool is_safetensors(std::string_view text) {
  return text.size() > 9 && text[8] == '{' && text[9] == '"' && text.substr(4, 4) == std::string_view("\0\0\0\0", 4);
}

}  // namespace

std::string foreign_format(std::span<const std::byte> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (text.starts_with("PK\x03\x04")) return of_archive(text);
  if (is_safetensors(text))
    return named("safetensors, weights without the network", "load them in training, and export to ONNX");
  if (text.starts_with("version https://git-lfs"))
    return named("a Git LFS pointer to the model", "fetch it with `git lfs pull`");
  for (const Format& format : kFormats)
    if (text.size() > format.at && text.substr(format.at).starts_with(format.magic)) return named(format.what, kExport);
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first != std::string_view::npos && text[first] == '<')
    return text.contains("<net") ? named("an OpenVINO network", kExport)
                                 : named("XML", "name the .onnx file; a robot's model goes to --model");
  return {};
}

}  // namespace takt::onnx_engine
