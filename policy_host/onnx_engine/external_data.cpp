// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/external_data.hpp"

#include <fmt/format.h>
#include <google/protobuf/message.h>
#include <google/protobuf/unknown_field_set.h>
#include <onnx/onnx_pb.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <system_error>

#include "config/hash.hpp"
#include "config/load.hpp"
#include "policy_host/onnx_engine/builder.hpp"
#include "policy_host/onnx_engine/wire_screen.hpp"

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

// The file itself, or a Refusal: what the policy's hash does not cover is not read.
fs::path vetted_path(const fs::path& model_file, const std::string& location, const std::string& where) {
  const fs::path folder = model_file.parent_path();
  const std::vector<std::string> covered = config::policy_files(model_file.string());
  const bool plain =
      !location.empty() && location.find('\0') == std::string::npos && fs::path(location).filename() == location;
  const std::string name = model_file.filename().string();
  if (!plain || (location != name + ".data" && location != name + "_data")) {
    throw Refusal(
        fmt::format("{} keeps its data in '{}'; only {}.data or {}_data beside the model is read, which the "
                    "policy's hash covers: export it under that name, or as one file",
                    where, location, name, name));
  }
  if (std::ranges::find(covered, (folder / location).string()) == covered.end()) {
    throw Refusal(
        fmt::format("{} keeps its data in '{}', which is not there; put it beside the model", where, location));
  }
  std::error_code error;
  const fs::path root = fs::canonical(folder.empty() ? fs::path(".") : folder, error);
  const fs::path file = fs::canonical(root / location, error);
  if (error || !fs::is_regular_file(file, error)) {
    throw Refusal(fmt::format("{} keeps its data in '{}', which is no file", where, location));
  }
  if (file.parent_path() != root) {
    throw Refusal(fmt::format("{} keeps its data in '{}', a link that leaves the model's folder", where, location));
  }
  return file;
}

class Files {
 public:
  explicit Files(const fs::path& model_file) : model_file_(model_file) {}

  const std::string& contents(const std::string& location, const std::string& where) {
    const auto known = contents_.find(location);
    if (known != contents_.end()) return known->second;
    const fs::path file = vetted_path(model_file_, location, where);
    std::error_code error;
    const std::uintmax_t size = fs::file_size(file, error);
    if (error || size > max_model_bytes - bytes_) {
      throw Beyond(fmt::format("its data in '{}' is larger than {} MiB", location, max_model_bytes >> 20));
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
  fs::path model_file_;
  std::uintmax_t bytes_ = 0;
  std::map<std::string, std::string> contents_;
  std::vector<ExternalFile> read_;
};

constexpr int kFunctionAttributes = 11;  // FunctionProto.attribute_proto, which libonnx has since 1.13

class Vetting {
 public:
  explicit Vetting(const fs::path& model_file) : model_file_(model_file) {}

  // Protobuf's own limit on nesting bounds the recursion.
  void vet(const google::protobuf::Message& message) const {  // NOLINT(misc-no-recursion)
    if (const auto* const tensor = dynamic_cast<const onnx::TensorProto*>(&message)) return vet_tensor(*tensor);
    if (const auto* const node = dynamic_cast<const onnx::NodeProto*>(&message)) vet_node(*node);
    const google::protobuf::Reflection& fields = *message.GetReflection();
    std::vector<const google::protobuf::FieldDescriptor*> set;
    fields.ListFields(message, &set);
    for (const google::protobuf::FieldDescriptor* const field : set) {
      if (field->cpp_type() != google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE) continue;
      if (!field->is_repeated()) {
        vet(fields.GetMessage(message, field));
        continue;
      }
      for (int i = 0; i < fields.FieldSize(message, field); ++i) vet(fields.GetRepeatedMessage(message, field, i));
    }
    if (dynamic_cast<const onnx::FunctionProto*>(&message) != nullptr) vet_defaults(fields.GetUnknownFields(message));
  }

 private:
  void vet_tensor(const onnx::TensorProto& tensor) const {
    if (tensor.data_location() != onnx::TensorProto_DataLocation_EXTERNAL) return;
    const std::string where = fmt::format("tensor '{}'", tensor.name());
    bool located = false;
    for (const auto& entry : tensor.external_data()) {
      if (entry.key() != "location") continue;
      (void)vetted_path(model_file_, entry.value(), where);
      located = true;
    }
    if (!located) throw Refusal(where + " keeps its data in a file that it does not name");
  }

  // ONNX Runtime's node around what a provider compiled, in this file or in another.
  static void vet_node(const onnx::NodeProto& node) {
    if (node.op_type() != "EPContext") return;
    for (const onnx::AttributeProto& attribute : node.attribute())
      if (attribute.name() == "embed_mode" && attribute.i() == 0)
        throw Refusal(fmt::format(
            "EPContext node '{}' keeps what it runs in a file of its own, which the policy's hash does not cover: "
            "export it with embed_mode 1",
            node.name()));
  }

  void vet_defaults(const google::protobuf::UnknownFieldSet& fields) const {  // NOLINT(misc-no-recursion)
    for (int i = 0; i < fields.field_count(); ++i) {
      const google::protobuf::UnknownField& field = fields.field(i);
      if (field.number() != kFunctionAttributes) continue;
      onnx::AttributeProto attribute;
      if (field.type() != google::protobuf::UnknownField::TYPE_LENGTH_DELIMITED ||
          !screen_wire(std::as_bytes(std::span(field.length_delimited())), *onnx::AttributeProto::descriptor()) ||
          !attribute.ParseFromString(field.length_delimited()))
        throw Refusal("a function's attributes cannot be read");
      vet(attribute);
    }
  }

  fs::path model_file_;
};

}  // namespace

void vet_external_data(const onnx::ModelProto& model, const std::filesystem::path& model_file) {
  Vetting(model_file).vet(model);
}

std::vector<ExternalFile> bring_in_external_data(onnx::ModelProto& model, const std::filesystem::path& model_file) {
  Files files(model_file);
  std::uintmax_t copied = 0;
  for (onnx::TensorProto& tensor : *model.mutable_graph()->mutable_initializer()) {
    if (tensor.data_location() != onnx::TensorProto_DataLocation_EXTERNAL) continue;
    const std::string where = fmt::format("initializer '{}'", tensor.name());
    const Reference reference = reference_of(tensor, where);
    const std::string& bytes = files.contents(reference.location, where);
    if (reference.offset > bytes.size() || reference.length.value_or(0) > bytes.size() - reference.offset) {
      throw Refusal(
          fmt::format("{} keeps its data at byte {} of '{}', which has {} bytes: the file is cut short or "
                      "another one's",
                      where, reference.offset, reference.location, bytes.size()));
    }
    const std::uint64_t length = reference.length.value_or(bytes.size() - reference.offset);
    copied += length;  // tensors may share bytes
    if (copied > max_model_bytes) {
      throw Beyond(fmt::format("its tensors need more than {} MiB", max_model_bytes >> 20));
    }
    tensor.set_raw_data(bytes.substr(reference.offset, length));
    tensor.clear_external_data();
    tensor.set_data_location(onnx::TensorProto_DataLocation_DEFAULT);
  }
  return files.read();
}

}  // namespace takt::onnx_engine
