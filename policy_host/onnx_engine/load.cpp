// SPDX-License-Identifier: Apache-2.0
// From bytes to a Program: screen what messages would take, parse, bring in what lies beside the file, screen, settle
// the batch, let libonnx check where it knows the opset, lift what is older than the engine, infer (for newer opsets:
// what the screen and the operators check themselves), compile, compare.
#include <fmt/format.h>
#include <onnx/checker.h>
#include <onnx/onnx_pb.h>
#include <onnx/shape_inference/implementation.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <exception>
#include <fstream>
#include <optional>
#include <set>
#include <system_error>
#include <type_traits>
#include <utility>

#include "policy_host/onnx_engine/builder.hpp"
#include "policy_host/onnx_engine/external_data.hpp"
#include "policy_host/onnx_engine/foreign_format.hpp"
#include "policy_host/onnx_engine/lift.hpp"
#include "policy_host/onnx_engine/memory.hpp"
#include "policy_host/onnx_engine/model.hpp"
#include "policy_host/onnx_engine/node.hpp"
#include "policy_host/onnx_engine/operators.hpp"
#include "policy_host/onnx_engine/program.hpp"
#include "policy_host/onnx_engine/screen.hpp"
#include "policy_host/onnx_engine/wire_screen.hpp"

namespace takt::onnx_engine {

namespace {

using Names = std::set<std::string, std::less<>>;

bool speaks_of_batch(std::string name) {
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return name.find("batch") != std::string::npos;
}

// Of an input; nothing: of a type that this engine does not take.
std::optional<ElementType> element_type_of(const onnx::ValueInfoProto& input) {
  if (!input.type().has_tensor_type()) return std::nullopt;
  switch (input.type().tensor_type().elem_type()) {
    case onnx::TensorProto_DataType_FLOAT:
    case onnx::TensorProto_DataType_DOUBLE:
      return ElementType::float32;
    case onnx::TensorProto_DataType_INT32:
    case onnx::TensorProto_DataType_INT64:
      return ElementType::live_int64;
    case onnx::TensorProto_DataType_BOOL:
      return ElementType::boolean;
    default:
      return std::nullopt;
  }
}

// A dimension counts as the batch if it leads an input or is called so; it becomes 1. No other one may be symbolic.
void settle_batch(onnx::GraphProto& graph, const Names& constants) {
  for (onnx::ValueInfoProto& input : *graph.mutable_input()) {
    if (constants.contains(input.name())) continue;
    if (!element_type_of(input))
      throw Beyond(fmt::format("input '{}' is no tensor of float32, float64, int32, int64 or bool", input.name()));
    if (!input.type().tensor_type().has_shape()) throw Refusal(fmt::format("input '{}' has no shape", input.name()));
    auto& dims = *input.mutable_type()->mutable_tensor_type()->mutable_shape()->mutable_dim();
    for (int d = 0; d < dims.size(); ++d) {
      if (dims[d].has_dim_value() && dims[d].dim_value() > 0) continue;
      if (d != 0 && !speaks_of_batch(dims[d].dim_param())) {
        throw Refusal(fmt::format("input '{}' has a dynamic dimension {} ('{}'); export it with a fixed size",
                                  input.name(), d, dims[d].dim_param()));
      }
      dims[d].set_dim_value(1);
    }
  }
}

// What the exporter says of other shapes may speak of symbols settled since, or (an output of no dimensions) may only
// be there because the checker wants some shape. What remains is compared with what libonnx infers.
void forget_open_claims(onnx::GraphProto& graph) {
  graph.clear_value_info();
  for (onnx::NodeProto& node : *graph.mutable_node()) {
    for (onnx::AttributeProto& attribute : *node.mutable_attribute()) {
      if (attribute.has_g()) forget_open_claims(*attribute.mutable_g());
    }
  }
  for (onnx::ValueInfoProto& output : *graph.mutable_output()) {
    if (!output.type().has_tensor_type()) continue;
    auto& tensor = *output.mutable_type()->mutable_tensor_type();
    if (tensor.shape().dim_size() == 0) tensor.clear_shape();
    for (int d = 0; d < tensor.shape().dim_size(); ++d) {
      auto& dim = *tensor.mutable_shape()->mutable_dim(d);
      if (!dim.has_dim_value()) dim.clear_value();
    }
  }
}

// Whole numbers, or truths, that the caller writes as floats: where to. A whole one is cut; what is not 0 is true; not
// a number stays so.
float* define_written(const std::string& name, const Shape& shape, ElementType type, Builder& builder) {
  const Value& value = builder.define_floats(name, shape, type);
  const std::size_t count = elements(shape);
  float* const written = builder.allocate(count);
  builder.each_run([written, to = value.floats, count, truth = type == ElementType::boolean]() noexcept {
    for (std::size_t i = 0; i < count; ++i) {
      const float x = written[i];
      const bool as_truth = truth && !std::isnan(x);
      to[i] = as_truth ? (x == 0.0F ? 0.0F : 1.0F) : std::trunc(x);
    }
  });
  return written;
}

void define_inputs(const onnx::GraphProto& graph, const Names& constants, Builder& builder, Program& program) {
  for (const onnx::ValueInfoProto& input : graph.input()) {
    if (constants.contains(input.name())) continue;
    Shape shape;
    for (const auto& dim : input.type().tensor_type().shape().dim()) shape.push_back(dim.dim_value());
    program.input_info.push_back({input.name(), shape});
    if (const auto type = element_type_of(input); type != ElementType::float32) {
      program.inputs.emplace_back(define_written(input.name(), shape, *type, builder), elements(shape));
      continue;
    }
    const Value& value = builder.define_floats(input.name(), shape);
    program.inputs.emplace_back(value.floats, elements(shape));
  }
}

void define_outputs(const onnx::GraphProto& graph, Builder& builder, Program& program) {
  for (const onnx::ValueInfoProto& output : graph.output()) {
    const Value* value = builder.find(output.name());
    if (value == nullptr) throw Refusal(fmt::format("no node makes output '{}'", output.name()));
    const std::size_t count = elements(value->shape);
    program.output_info.push_back({output.name(), value->shape});
    // A copy, so that an output that is only another name for an input does not change when the input is written.
    float* copy = builder.allocate(count);
    if (value->type == ElementType::int64)
      std::ranges::transform(value->integers, copy, [](std::int64_t i) { return static_cast<float>(i); });
    else
      builder.each_run([from = value->floats, copy, count]() noexcept { std::copy_n(from, count, copy); });
    program.outputs.emplace_back(copy, count);
  }
}

// Two readings of the same specification: a difference is a bug here or there, and no basis for moving a robot.
void compare_shapes(const onnx::ValueInfoProto& inferred, const Builder& builder) {
  const Value* value = builder.find(inferred.name());
  if (value == nullptr || !inferred.type().has_tensor_type() || !inferred.type().tensor_type().has_shape()) return;
  const auto& dims = inferred.type().tensor_type().shape().dim();
  bool same = static_cast<std::size_t>(dims.size()) == value->shape.size();
  for (int d = 0; same && d < dims.size(); ++d) {
    same = !dims[d].has_dim_value() || dims[d].dim_value() == value->shape[static_cast<std::size_t>(d)];
  }
  if (!same) {
    throw Refusal(fmt::format("value '{}' has shape {} by its operators, but the file or libonnx says otherwise",
                              inferred.name(), to_text(value->shape)));
  }
}

std::unique_ptr<Program> compile(onnx::ModelProto& model) {
  screen_model(model);
  Names constants;
  for (const onnx::TensorProto& tensor : model.graph().initializer()) constants.insert(tensor.name());
  settle_batch(*model.mutable_graph(), constants);
  const bool second_opinion = libonnx_knows(opset_of(model));
  if (second_opinion) {
    // The version of the file's own form says nothing of what the operators mean.
    model.set_ir_version(std::min<std::int64_t>(model.ir_version(), onnx::Version::IR_VERSION));
    onnx::checker::check_model(model);
  }
  forget_open_claims(*model.mutable_graph());
  if (opset_of(model) < kOldestOpset) {
    lift(model, kOldestOpset);
    screen_model(model);
    forget_open_claims(*model.mutable_graph());
  }
  if (second_opinion) onnx::shape_inference::InferShapes(model, onnx::OpSchemaRegistry::Instance(), {true, 1, true});

  auto program = std::make_unique<Program>();
  Builder builder(*program, opset_of(model));
  const onnx::GraphProto& graph = model.graph();
  define_inputs(graph, constants, builder, *program);
  build_graph(builder, graph);
  define_outputs(graph, builder, *program);
  for (const onnx::ValueInfoProto& inferred : graph.value_info()) compare_shapes(inferred, builder);
  for (const onnx::ValueInfoProto& inferred : graph.output()) compare_shapes(inferred, builder);
  return program;
}

// Names inside the file are not ours: the message stays one printable line of a sane length.
std::string one_line(std::string_view name, std::string_view why) {
  constexpr std::size_t longest = 1000;
  std::string line = fmt::format("{}: {}", name, why);
  std::ranges::replace_if(
      line, [](unsigned char c) { return std::iscntrl(c) != 0; }, ' ');
  if (line.size() > longest) line = line.substr(0, longest) + "...";
  return line;
}

Metadata metadata_of(const onnx::ModelProto& model) {
  Metadata metadata;
  for (const auto& entry : model.metadata_props()) metadata.emplace_back(entry.key(), entry.value());
  return metadata;
}

// In the file's own types of numbers; elements that lie beside the file have been brought in, or are not looked at.
template <class Number>
bool has_nan(std::string_view raw) {
  for (std::size_t at = 0; at + sizeof(Number) <= raw.size(); at += sizeof(Number)) {
    Number number;
    std::memcpy(&number, raw.data() + at, sizeof number);
    if (std::isnan(number)) return true;
  }
  return false;
}

// Weights of which one is NaN make every answer NaN.
void screen_weights(const onnx::GraphProto& graph) {
  const auto is_nan = [](auto number) { return std::isnan(number); };
  for (const onnx::TensorProto& weights : graph.initializer()) {
    const bool is_double = weights.data_type() == onnx::TensorProto_DataType_DOUBLE;
    if (!is_double && weights.data_type() != onnx::TensorProto_DataType_FLOAT) continue;
    if (std::ranges::any_of(weights.float_data(), is_nan) || std::ranges::any_of(weights.double_data(), is_nan) ||
        (is_double ? has_nan<double>(weights.raw_data()) : has_nan<float>(weights.raw_data())))
      throw Refusal(fmt::format(
          "weights '{}' hold NaN, as after a training that diverged; export an earlier checkpoint", weights.name()));
  }
}

std::expected<void, std::string> parse(std::span<const std::byte> bytes, std::string_view name,
                                       onnx::ModelProto& model) {
  if (bytes.empty()) return std::unexpected(one_line(name, "is empty; export the model again"));
  if (screen_wire(bytes, *onnx::ModelProto::descriptor()) &&
      model.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    return {};
  if (const std::string foreign = foreign_format(bytes); !foreign.empty())
    return std::unexpected(one_line(name, foreign + ", or run it by --policy-host"));
  return std::unexpected(one_line(name,
                                  "not an ONNX model, or cut short; what another engine or a Python policy reads "
                                  "runs by --policy-host"));
}

std::unexpected<Unloaded> unloaded(std::string sentence, bool beyond = false) {
  return std::unexpected(Unloaded{std::move(sentence), beyond});
}

// What `work` makes of the file `name`, and its exceptions as one line.
template <typename Work>
std::invoke_result_t<Work> judged(std::string_view name, const Work& work) {
  using Made = std::invoke_result_t<Work>;
  const auto refused = [&](const std::string& why) {
    if constexpr (std::is_same_v<typename Made::error_type, Unloaded>)
      return Made(unloaded(one_line(name, why)));
    else
      return Made(std::unexpected(one_line(name, why)));
  };
  try {
    return work();
  } catch (const Refusal& refusal) {
    return refused(refusal.what());
  } catch (const std::bad_alloc&) {
    return refused("not enough memory to load it");
  } catch (const std::exception& error) {
    return refused(fmt::format("libonnx finds it invalid: {}", error.what()));
  }
}

std::expected<Model, Unloaded> load_from(std::span<const std::byte> bytes, std::string_view name,
                                         const std::filesystem::path* file) {
  if (bytes.size() > max_model_bytes)
    return unloaded(one_line(name, fmt::format("larger than {} MiB", max_model_bytes >> 20)));
  try {
    onnx::ModelProto model;
    if (const auto parsed = parse(bytes, name, model); !parsed) return unloaded(parsed.error());
    std::vector<ExternalFile> external;
    if (file != nullptr) external = bring_in_external_data(model, *file);
    screen_weights(model.graph());
    const std::int64_t opset = opset_of(model);  // the file's own, whatever it is lifted to
    Metadata metadata = metadata_of(model);
    std::unique_ptr<Program> program = compile(model);
    program->external_files = std::move(external);
    program->opset = opset;
    program->metadata = std::move(metadata);
    return Model(std::move(program));
  } catch (const Beyond& beyond) {
    return unloaded(one_line(name, beyond.what()), true);
  }
}

std::expected<Model, std::string> in_one_line(std::expected<Model, Unloaded> loaded) {
  if (loaded) return *std::move(loaded);
  return std::unexpected(std::move(loaded.error().sentence));
}

std::expected<std::vector<char>, std::string> bytes_of(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    const bool exists = std::filesystem::exists(file, error);
    return std::unexpected(one_line(file.string(), exists ? "not a regular file" : "no such file"));
  }
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  if (error || size > max_model_bytes) {
    return std::unexpected(one_line(file.string(), fmt::format("larger than {} MiB", max_model_bytes >> 20)));
  }
  std::vector<char> bytes(static_cast<std::size_t>(size));
  std::ifstream stream(file, std::ios::binary);
  if (!stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) {
    return std::unexpected(one_line(file.string(), "cannot be read; check its permissions"));
  }
  return bytes;
}

}  // namespace

std::expected<Model, std::string> load(std::span<const std::byte> bytes, std::string_view name) {
  return in_one_line(judged(name, [&] { return load_from(bytes, name, nullptr); }));
}

std::expected<Model, Unloaded> try_load(const std::filesystem::path& file) {
  return judged(file.string(), [&]() -> std::expected<Model, Unloaded> {
    const auto bytes = bytes_of(file);
    if (!bytes) return unloaded(bytes.error());
    return load_from(std::as_bytes(std::span(*bytes)), file.string(), &file);
  });
}

std::expected<Model, std::string> load(const std::filesystem::path& file) {
  return in_one_line(try_load(file));
}

namespace {

std::expected<void, std::string> parse_file(const std::filesystem::path& file, onnx::ModelProto& model) {
  const auto bytes = bytes_of(file);
  if (!bytes) return std::unexpected(bytes.error());
  return parse(std::as_bytes(std::span(*bytes)), file.string(), model);
}

}  // namespace

std::expected<void, std::string> check_external_data(const std::filesystem::path& file) {
  return judged(file.string(), [&]() -> std::expected<void, std::string> {
    onnx::ModelProto model;
    if (auto parsed = parse_file(file, model); !parsed) return parsed;
    vet_external_data(model, file);
    screen_weights(model.graph());
    return {};
  });
}

std::expected<Memory, std::string> read_memory(const std::filesystem::path& file) {
  return judged(file.string(), [&]() -> std::expected<Memory, std::string> {
    onnx::ModelProto model;
    if (const auto parsed = parse_file(file, model); !parsed) return std::unexpected(parsed.error());
    return memory_of(std::move(model));
  });
}

std::expected<DeclaredTensors, std::string> read_tensors(const std::filesystem::path& file) {
  return judged(file.string(), [&]() -> std::expected<DeclaredTensors, std::string> {
    onnx::ModelProto model;
    if (const auto parsed = parse_file(file, model); !parsed) return std::unexpected(parsed.error());
    Names constants;
    for (const onnx::TensorProto& tensor : model.graph().initializer()) constants.insert(tensor.name());
    const auto info_of = [](const onnx::ValueInfoProto& value) {
      TensorInfo info{value.name(), {}};
      for (const auto& dim : value.type().tensor_type().shape().dim())
        info.shape.push_back(std::max<std::int64_t>(dim.dim_value(), 1));
      return info;
    };
    DeclaredTensors tensors;
    for (const onnx::ValueInfoProto& input : model.graph().input())
      if (!constants.contains(input.name())) tensors.inputs.push_back(info_of(input));
    for (const onnx::ValueInfoProto& output : model.graph().output()) tensors.outputs.push_back(info_of(output));
    return tensors;
  });
}

std::expected<Metadata, std::string> read_metadata(const std::filesystem::path& file) {
  return judged(file.string(), [&]() -> std::expected<Metadata, std::string> {
    onnx::ModelProto model;
    if (const auto parsed = parse_file(file, model); !parsed) return std::unexpected(parsed.error());
    return metadata_of(model);
  });
}

}  // namespace takt::onnx_engine
