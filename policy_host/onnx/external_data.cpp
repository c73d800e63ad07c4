#include "policy_host/onnx/external_data.hpp"

#include <fmt/format.h>
#include <onnx/onnx_pb.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <string>
#include <system_error>

#include "config/load.hpp"
#include "policy_host/onnx/builder.hpp"

namespace takt::onnx_engine {

namespace {

namespace fs = std::filesystem;

struct Reference {
  std::string location;
  std::uint64_t offset = 0;
  std::optional<std::uint64_t> length;  // none: to the end
};

std::uint64_t number(const std::string& where, const std::string& key, const std::string& text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    throw Refusal(fmt::format("{}: {} '{}' of its data is not a number of bytes", where, key, text));
  }
  return value;
}

Reference reference_of(const onnx::TensorProto& tensor, const std::string& where) {
  Reference reference;
  for (const auto& entry : tensor.external_data()) {
    if (entry.key() == "location") reference.location = entry.value();
    if (entry.key() == "offset") reference.offset = number(where, "offset", entry.value());
    if (entry.key() == "length") reference.length = number(where, "length", entry.value());
  }
  return reference;
}

// The file itself, or a Refusal: a model may name only what lies below its own folder.
fs::path vetted_path(const fs::path& folder, const std::string& location, const std::string& where) {
  const fs::path relative(location);
  if (location.empty() || location.find('\0') != std::string::npos || relative.is_absolute() ||
      std::ranges::find(relative, fs::path("..")) != relative.end()) {
    throw Refusal(fmt::format("{} keeps its data in '{}'; only a relative path below the model's folder is read", where,
                              location));
  }
  std::error_code error;
  const fs::path root = fs::canonical(folder.empty() ? fs::path(".") : folder, error);
  const fs::path file = fs::canonical(root / relative, error);
  if (error || !fs::is_regular_file(file, error)) {
    throw Refusal(fmt::format("{} keeps its data in '{}', which is not there; put it beside the model", where, location));
  }
  const auto [root_end, file_at] = std::ranges::mismatch(root, file);
  if (root_end != root.end()) {
    throw Refusal(fmt::format("{} keeps its data in '{}', a link that leaves the model's folder", where, location));
  }
  return file;
}

class Files {
 public:
  explicit Files(const fs::path& folder) : folder_(folder) {}

  const std::string& contents(const std::string& location, const std::string& where) {
    const auto known = contents_.find(location);
    if (known != contents_.end()) return known->second;
    const fs::path file = vetted_path(folder_, location, where);
    std::error_code error;
    const std::uintmax_t size = fs::file_size(file, error);
    if (error || size > max_model_bytes - bytes_) {
      throw Refusal(fmt::format("its data in '{}' is larger than {} MiB", location, max_model_bytes >> 20));
    }
    bytes_ += size;
    std::string bytes(static_cast<std::size_t>(size), '\0');
    std::ifstream stream(file, std::ios::binary);
    if (!stream.read(bytes.data(), static_cast<std::streamsize>(size))) {
      throw Refusal(fmt::format("its data in '{}' cannot be read; check its permissions", location));
    }
    read_.push_back({location, size, config::sha256_hex(bytes)});
    return contents_.emplace(location, std::move(bytes)).first->second;
  }

  std::vector<ExternalFile> read() { return std::move(read_); }

 private:
  fs::path folder_;
  std::uintmax_t bytes_ = 0;
  std::map<std::string, std::string> contents_;
  std::vector<ExternalFile> read_;
};

}  // namespace

std::vector<ExternalFile> bring_in_external_data(onnx::ModelProto& model, const std::filesystem::path& folder) {
  Files files(folder);
  std::uintmax_t copied = 0;
  for (onnx::TensorProto& tensor : *model.mutable_graph()->mutable_initializer()) {
    if (tensor.data_location() != onnx::TensorProto_DataLocation_EXTERNAL) continue;
    const std::string where = fmt::format("initializer '{}'", tensor.name());
    const Reference reference = reference_of(tensor, where);
    const std::string& bytes = files.contents(reference.location, where);
    if (reference.offset > bytes.size() || reference.length.value_or(0) > bytes.size() - reference.offset) {
      throw Refusal(fmt::format("{} keeps its data at byte {} of '{}', which has {} bytes: the file is cut short or "
                                "another one's",
                                where, reference.offset, reference.location, bytes.size()));
    }
    const std::uint64_t length = reference.length.value_or(bytes.size() - reference.offset);
    copied += length;  // tensors may share bytes
    if (copied > max_model_bytes) {
      throw Refusal(fmt::format("its tensors need more than {} MiB", max_model_bytes >> 20));
    }
    tensor.set_raw_data(bytes.substr(reference.offset, length));
    tensor.clear_external_data();
    tensor.set_data_location(onnx::TensorProto_DataLocation_DEFAULT);
  }
  return files.read();
}

}  // namespace takt::onnx_engine
