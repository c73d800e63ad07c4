// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/screen.hpp"

#include <fmt/format.h>
#include <onnx/defs/schema.h>
#include <onnx/onnx_pb.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "policy_host/onnx_engine/node.hpp"
#include "policy_host/onnx_engine/operators.hpp"

namespace takt::onnx_engine {

namespace {

constexpr std::int64_t newest_opset = 21;
constexpr int most_nodes = 100'000;
constexpr int deepest = 8;  // branches in branches

bool standard_domain(const std::string& domain) {
  return domain.empty() || domain == "ai.onnx";
}

std::string type_name(std::int32_t type) {
  return onnx::TensorProto_DataType_IsValid(type)
             ? onnx::TensorProto_DataType_Name(static_cast<onnx::TensorProto_DataType>(type))
             : fmt::format("number {}", type);
}

// Such as no version of ONNX has; newer ones than libonnx's end at 64.
bool is_no_type(std::int32_t type) {
  constexpr std::int32_t most = 64;
  return type <= onnx::TensorProto_DataType_UNDEFINED || type > most;
}

Shape shape_of(const onnx::TensorProto& tensor) {
  return {tensor.dims().begin(), tensor.dims().end()};
}

// Bytes of one element in a file; 0: a type that this engine does not take.
std::size_t stored_size(std::int32_t type) {
  switch (type) {
    case onnx::TensorProto_DataType_FLOAT:
      return sizeof(float);
    case onnx::TensorProto_DataType_INT32:
      return sizeof(std::int32_t);
    case onnx::TensorProto_DataType_INT64:
      return sizeof(std::int64_t);
    case onnx::TensorProto_DataType_DOUBLE:
      return sizeof(double);
    case onnx::TensorProto_DataType_BOOL:
      return 1;
    default:
      return 0;
  }
}

// Elements outside of raw_data.
std::size_t listed_elements(const onnx::TensorProto& tensor) {
  switch (tensor.data_type()) {
    case onnx::TensorProto_DataType_FLOAT:
      return static_cast<std::size_t>(tensor.float_data_size());
    case onnx::TensorProto_DataType_INT64:
      return static_cast<std::size_t>(tensor.int64_data_size());
    case onnx::TensorProto_DataType_DOUBLE:
      return static_cast<std::size_t>(tensor.double_data_size());
    default:
      return static_cast<std::size_t>(tensor.int32_data_size());
  }
}

void screen_tensor(const onnx::TensorProto& tensor, const std::string& where) {
  const std::size_t size = stored_size(tensor.data_type());
  if (size == 0) {
    const std::string why = fmt::format(
        "{} has data type {}; this engine takes FLOAT, DOUBLE, INT32, INT64 and BOOL, export the model in float32",
        where, type_name(tensor.data_type()));
    if (is_no_type(tensor.data_type())) throw Refusal(why);
    throw Beyond(why);
  }
  if (tensor.data_location() == onnx::TensorProto_DataLocation_EXTERNAL || tensor.external_data_size() > 0) {
    throw Refusal(fmt::format("{} keeps its data in another file, which only an initializer of a file may", where));
  }
  if (tensor.has_segment()) throw Refusal(fmt::format("{} is segmented, which is not supported", where));
  const std::int64_t count = checked_elements(shape_of(tensor));
  if (count < 0) {
    throw Refusal(fmt::format("{} of shape {} is larger than this engine holds ({} MiB, {} dimensions)", where,
                              to_text(shape_of(tensor)), max_model_bytes >> 20, max_rank));
  }
  const std::size_t stored = tensor.has_raw_data() ? tensor.raw_data().size() : size * listed_elements(tensor);
  if (stored != size * static_cast<std::size_t>(count)) {
    throw Refusal(fmt::format("{} of shape {} holds {} bytes of data: the file is damaged", where,
                              to_text(shape_of(tensor)), stored));
  }
}

// How much has been seen of a model, its branches included.
struct Seen {
  bool forms = true;  // whether inputs, outputs and attributes are compared too
  int nodes = 0;
  int depth = 0;
};
void screen_graph(const onnx::GraphProto& graph, Seen& seen);

void screen_attribute(const onnx::NodeProto& node, const onnx::AttributeProto& attribute, Seen& seen) {
  switch (attribute.type()) {
    case onnx::AttributeProto_AttributeType_GRAPH:
      if (++seen.depth > deepest) throw Refusal(fmt::format("{}: branches in branches, too deep", describe(node)));
      screen_graph(attribute.g(), seen);
      --seen.depth;
      return;
    case onnx::AttributeProto_AttributeType_TENSOR:
      screen_tensor(attribute.t(), fmt::format("{}: attribute '{}'", describe(node), attribute.name()));
      return;
    case onnx::AttributeProto_AttributeType_FLOAT:
    case onnx::AttributeProto_AttributeType_INT:
    case onnx::AttributeProto_AttributeType_STRING:
    case onnx::AttributeProto_AttributeType_FLOATS:
    case onnx::AttributeProto_AttributeType_INTS:
    case onnx::AttributeProto_AttributeType_STRINGS:
      return;
    case onnx::AttributeProto_AttributeType_UNDEFINED:
    case onnx::AttributeProto_AttributeType_SPARSE_TENSOR:
    case onnx::AttributeProto_AttributeType_TYPE_PROTO:
    case onnx::AttributeProto_AttributeType_TENSORS:
    case onnx::AttributeProto_AttributeType_GRAPHS:
    case onnx::AttributeProto_AttributeType_SPARSE_TENSORS:
    case onnx::AttributeProto_AttributeType_TYPE_PROTOS:
      break;
  }
  throw Beyond(fmt::format("{}: attribute '{}' is of a kind that is not supported", describe(node), attribute.name()));
}

bool has_word(std::string_view words, std::string_view word) {
  while (!words.empty()) {
    const std::size_t end = std::min(words.find(' '), words.size());
    if (words.substr(0, end) == word) return true;
    words.remove_prefix(std::min(end + 1, words.size()));
  }
  return false;
}

void screen_node(const onnx::NodeProto& node, Seen& seen) {
  if (!standard_domain(node.domain()) || find_operator(node.op_type()) == nullptr) {
    throw Beyond(fmt::format("{} is not supported{} (docs/policies.md)", describe(node),
                             standard_domain(node.domain()) ? "" : ", of domain " + node.domain()));
  }
  const OperatorForm& form = form_of(node.op_type());
  if (!seen.forms) {
    for (const onnx::AttributeProto& attribute : node.attribute()) screen_attribute(node, attribute, seen);
    return;
  }
  if (static_cast<std::size_t>(node.input_size()) > form.most_inputs ||
      static_cast<std::size_t>(node.output_size()) > form.most_outputs) {
    throw Beyond(fmt::format("{} has {} inputs and {} outputs, more than this engine knows of", describe(node),
                             node.input_size(), node.output_size()));
  }
  for (const onnx::AttributeProto& attribute : node.attribute()) {
    if (!has_word(form.attributes, attribute.name())) {
      throw Beyond(fmt::format("{}: attribute '{}' is not known to this engine", describe(node), attribute.name()));
    }
    screen_attribute(node, attribute, seen);
  }
}

void screen_graph(const onnx::GraphProto& graph, Seen& seen) {
  if (graph.sparse_initializer_size() > 0) throw Beyond("it has sparse initializers, which is not supported");
  if (graph.node_size() > most_nodes - seen.nodes) throw Refusal(fmt::format("it has more than {} nodes", most_nodes));
  seen.nodes += graph.node_size();
  for (const onnx::TensorProto& tensor : graph.initializer()) {
    screen_tensor(tensor, fmt::format("initializer '{}'", tensor.name()));
  }
  for (const onnx::NodeProto& node : graph.node()) screen_node(node, seen);
}

}  // namespace

std::int64_t opset_of(const onnx::ModelProto& model) {
  std::int64_t version = 0;
  for (const onnx::OperatorSetIdProto& opset : model.opset_import()) {
    if (standard_domain(opset.domain())) version = opset.version();
  }
  return version;
}

bool libonnx_knows(std::int64_t opset) {
  const auto& known = onnx::OpSchemaRegistry::DomainToVersionRange::Instance().Map();
  const auto standard = known.find(onnx::ONNX_DOMAIN);
  return standard != known.end() && opset <= standard->second.second;
}

void screen_model(const onnx::ModelProto& model) {
  if (!model.has_graph() || model.graph().node_size() == 0) throw Refusal("it has no graph: is it an ONNX model?");
  const std::int64_t opset = opset_of(model);
  if (opset < 1 || opset > newest_opset) {
    const std::string why =
        fmt::format("its opset is {}; this engine takes 1 to {}, export it for one of those", opset, newest_opset);
    if (opset < 1) throw Refusal(why);
    throw Beyond(why);
  }
  if (model.functions_size() > 0) throw Beyond("it defines functions of its own, which is not supported");
  // What operators of older opsets had goes when they are lifted; until then libonnx's checker compares it.
  Seen seen{.forms = opset >= kOldestOpset};
  screen_graph(model.graph(), seen);
}

namespace {

// Numbers of double precision are computed with in float32.
Value& define_rounded(Builder& builder, const std::string& name, const onnx::TensorProto& tensor) {
  const Shape shape = shape_of(tensor);
  Value& value = builder.define_floats(name, shape);
  for (std::size_t i = 0; i < elements(shape); ++i) {
    double number = 0;
    if (tensor.has_raw_data())
      std::memcpy(&number, tensor.raw_data().data() + i * sizeof number, sizeof number);
    else
      number = tensor.double_data(static_cast<int>(i));
    value.floats[i] = static_cast<float>(number);
    if (std::isfinite(number) && !std::isfinite(value.floats[i]))
      throw Beyond(fmt::format("tensor '{}' holds {}, which does not fit into float32", name, number));
  }
  value.constant = true;
  return value;
}

}  // namespace

Value& define_constant(Builder& builder, const std::string& name, const onnx::TensorProto& tensor) {
  const Shape shape = shape_of(tensor);
  const auto count = static_cast<std::size_t>(checked_elements(shape));
  if (tensor.data_type() == onnx::TensorProto_DataType_INT64) {
    std::vector<std::int64_t> integers(tensor.int64_data().begin(), tensor.int64_data().end());
    if (tensor.has_raw_data()) {
      integers.resize(count);
      if (count > 0) std::memcpy(integers.data(), tensor.raw_data().data(), count * sizeof(std::int64_t));
    }
    return builder.define_integers(name, shape, std::move(integers));
  }
  if (tensor.data_type() == onnx::TensorProto_DataType_INT32) {
    std::vector<std::int32_t> integers(tensor.int32_data().begin(), tensor.int32_data().end());
    if (tensor.has_raw_data()) {
      integers.resize(count);
      if (count > 0) std::memcpy(integers.data(), tensor.raw_data().data(), count * sizeof(std::int32_t));
    }
    return builder.define_integers(name, shape, {integers.begin(), integers.end()});
  }
  if (tensor.data_type() == onnx::TensorProto_DataType_DOUBLE) return define_rounded(builder, name, tensor);
  const bool truths = tensor.data_type() == onnx::TensorProto_DataType_BOOL;
  Value& value = builder.define_floats(name, shape, truths ? ElementType::boolean : ElementType::float32);
  if (truths) {
    for (std::size_t i = 0; i < count; ++i) {
      const bool truth =
          tensor.has_raw_data() ? tensor.raw_data()[i] != 0 : tensor.int32_data(static_cast<int>(i)) != 0;
      value.floats[i] = truth ? 1.0F : 0.0F;
    }
  } else if (tensor.has_raw_data()) {
    std::memcpy(value.floats, tensor.raw_data().data(), count * sizeof(float));
  } else {
    std::ranges::copy(tensor.float_data(), value.floats);
  }
  value.constant = true;
  return value;
}

}  // namespace takt::onnx_engine
