// SPDX-License-Identifier: Apache-2.0
// Goal: what cannot be evaluated is refused at load with one sentence that names the trouble, and a damaged or hostile
// file never does worse than that. Method: one good model, spoilt in one way per test; then thousands of random
// mutations, to be run under AddressSanitizer as well.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>

#include "tests/policy_host/onnx/onnx_graph_maker.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::onnx_engine {
namespace {

GraphMaker small_policy() {
  GraphMaker maker;
  maker.input("obs", {1, 2}).output("action").floats("w", {2, 2}, {1, 2, 3, 4}).floats("bias", {2}, {1, 1});
  maker.node("Gemm", {"obs", "w", "bias"}, {"hidden"});
  maker.node("Tanh", {"hidden"}, {"action"});
  return maker;
}

onnx::TensorProto& weights(GraphMaker& maker) {
  return *maker.graph().mutable_initializer(0);
}

void expect_sentence(const std::string& refusal, const std::vector<std::string>& parts) {
  EXPECT_FALSE(refusal.empty()) << "was accepted";
  EXPECT_EQ(refusal.find('\n'), std::string::npos) << refusal;
  for (const std::string& part : parts)
    EXPECT_NE(refusal.find(part), std::string::npos) << part << " not in: " << refusal;
}

TEST(Refusal, TheUnspoiltModelLoads) {
  EXPECT_EQ(small_policy().refusal(), "");
}

TEST(Refusal, UnsupportedOperatorNamesNodeAndOperator) {
  GraphMaker maker = small_policy();
  maker.graph().mutable_node(1)->set_op_type("BitShift");
  expect_sentence(maker.refusal(), {"BitShift node 'the_Tanh' is not supported"});
}

TEST(Refusal, ForeignDomain) {
  GraphMaker maker = small_policy();
  maker.graph().mutable_node(1)->set_domain("com.example");
  expect_sentence(maker.refusal(), {"com.example"});
}

TEST(Refusal, UnsupportedDataType) {
  GraphMaker maker = small_policy();
  weights(maker).set_data_type(onnx::TensorProto_DataType_FLOAT16);
  expect_sentence(maker.refusal(), {"initializer 'w'", "FLOAT16", "float32"});
  weights(maker).set_data_type(4242);
  expect_sentence(maker.refusal(), {"4242"});
}

TEST(Refusal, InputOfATypeThatIsNotTaken) {
  GraphMaker maker = small_policy();
  maker.graph().mutable_input(0)->mutable_type()->mutable_tensor_type()->set_elem_type(
      onnx::TensorProto_DataType_UINT8);
  expect_sentence(maker.refusal(), {"input 'obs'", "float32"});
}

TEST(Refusal, ANumberThatDoesNotFitIntoFloat32) {
  GraphMaker maker = small_policy();
  onnx::TensorProto& large = *maker.graph().add_initializer();
  large.set_name("large");
  large.set_data_type(onnx::TensorProto_DataType_DOUBLE);
  large.add_dims(1);
  large.add_double_data(1e300);
  expect_sentence(maker.refusal(), {"'large'", "1e+300", "float32"});
}

TEST(Refusal, DynamicShapeExceptTheBatch) {
  GraphMaker maker = small_policy();
  auto& shape = *maker.graph().mutable_input(0)->mutable_type()->mutable_tensor_type()->mutable_shape();
  shape.mutable_dim(0)->set_dim_param("batch");
  const auto model = maker.load();
  ASSERT_TRUE(model) << model.error();
  EXPECT_EQ(model->inputs()[0].shape, (Dims{1, 2}));
  EXPECT_EQ(model->outputs()[0].shape, (Dims{1, 2}));

  shape.mutable_dim(1)->set_dim_param("length");
  expect_sentence(maker.refusal(), {"input 'obs'", "dynamic dimension 1 ('length')"});
}

TEST(Refusal, ExternalDataOfAModelThatIsNoFile) {
  GraphMaker maker = small_policy();
  weights(maker).set_data_location(onnx::TensorProto_DataLocation_EXTERNAL);
  expect_sentence(maker.refusal(), {"initializer 'w'", "another file"});
}

std::string varint(std::size_t value) {
  std::string bytes;
  for (; value >= 0x80U; value >>= 7U) bytes += static_cast<char>(value | 0x80U);
  return bytes + static_cast<char>(value);
}
// A field of a message: `number` below 16.
std::string delimited(char number, const std::string& inside) {
  return static_cast<char>(number << 3 | 2) + varint(inside.size()) + inside;
}
std::string repeated(const std::string& what, std::size_t bytes) {
  std::string all;
  while (all.size() < bytes) all += what;
  return all;
}
std::string refusal_of_bytes(const std::string& bytes) {
  const auto model = load(std::as_bytes(std::span(bytes)), "model");
  return model ? "" : model.error();
}

// Goal: a small file cannot ask for gigabytes: an empty message takes two bytes in it, and hundreds in memory. Method:
// four megabytes of what is emptiest in each kind of message; ModelProto.graph is 7; of a graph node 1, initializer 5,
// value_info 13; of a node input 1, attribute 5; of an attribute ints 8.
// Threat: policy-file
TEST(Refusal, MessagesThatWouldFillMemoryAreNotBuilt) {
  constexpr std::size_t size = std::size_t{4} << 20U;
  const auto in_graph = [](const std::string& inside) { return delimited(7, inside); };
  const auto in_node = [&](const std::string& inside) { return in_graph(delimited(1, inside)); };
  const std::pair<const char*, std::string> bombs[] = {
      {"nodes", in_graph(repeated(delimited(1, ""), size))},
      {"initializers", in_graph(repeated(delimited(5, ""), size))},
      {"value infos", in_graph(repeated(delimited(13, ""), size))},
      {"graphs", repeated(in_graph(delimited(1, "")), size)},
      {"attributes", in_node(repeated(delimited(5, ""), size))},
      {"input names", in_node(repeated(delimited(1, ""), 4 * size))},
      {"packed numbers", in_node(delimited(5, delimited(8, std::string(16 * size, 0))))},
      {"unknown fields", repeated("\x78"
                                  "\x01",
                                  8 * size)},
  };
  for (const auto& [what, bytes] : bombs) {
    SCOPED_TRACE(what);
    expect_sentence(refusal_of_bytes(bytes), {"its messages would take more than 256 MiB besides its weights"});
  }
}

// What networks have is far below: ninety thousand nodes pass, as do weights, which take what they take in the file.
TEST(Refusal, WhatNetworksHaveIsNoFlood) {
  GraphMaker maker = small_policy();
  maker.graph().mutable_node()->Reserve(90'000);
  for (int i = 0; i < 90'000; ++i) {
    auto& node = *maker.graph().add_node();
    node.set_op_type("BitShift");
    node.add_input("hidden");
    node.add_output("h" + std::to_string(i));
  }
  expect_sentence(maker.refusal(), {"BitShift node", "not supported"});
  GraphMaker heavy = small_policy();
  heavy.floats("much", {8 << 20}, std::vector<float>(8 << 20, 1.0F));
  EXPECT_EQ(heavy.refusal(), "");
}

TEST(Refusal, OtherFormatsAreNamed) {
  using namespace std::string_literals;
  const std::vector<std::pair<std::string, std::string>> files{
      {"PK\x03\x04..policy/data.pkl..policy/constants.pkl", "is TorchScript, not ONNX"},
      {"PK\x03\x04..archive/data.pkl", "is weights that PyTorch saved"},
      {"PK\x03\x04..model.weights.h5", "is a Keras archive"},
      {"PK\x03\x04..readme.txt", "is a ZIP archive"},
      {"\x20\0\0\0\0\0\0\0{\"a.weight\":{}}"s, "is safetensors"},
      {"\x1c\0\0\0TFL3..........."s, "is TensorFlow Lite"},
      {"\x89HDF\r\n\x1a\n......."s, "is HDF5"},
      {"\x80\x04\x95......"s, "is a Python pickle"},
      {"<?xml version=\"1.0\"?><net name=\"a\" version=\"11\"/>", "is an OpenVINO network"},
      {"<mujoco/>", "is XML, not ONNX"},
      {"version https://git-lfs.github.com/spec/v1\noid sha256:0", "is a Git LFS pointer to the model"},
      {"ptrt........", "is a TensorRT engine"}};
  for (const auto& [bytes, part] : files) expect_sentence(refusal_of_bytes(bytes), {part, "--policy-host"});
}

TEST(Refusal, WhatProtobufDoesNotWriteIsNoModel) {
  const std::string no_number(1, '\0'), endless(11, '\xff');
  for (const std::string& bytes : {std::string("\x3a\x05"), std::string("\x3b\x3c"), no_number, endless})
    expect_sentence(refusal_of_bytes(bytes), {"not an ONNX model, or cut short"});
  std::string deep;
  for (int i = 0; i < 300; ++i) deep = delimited(1, delimited(5, delimited(6, deep)));  // graphs in attributes of nodes
  expect_sentence(refusal_of_bytes(delimited(7, deep)), {"not an ONNX model, or cut short"});
}

// A model whose weights lie in a file beside it, named and placed as each test wants.
class ExternalData : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(folder_);
    const std::vector<float> numbers{0, 1, 2, 3, 4};
    write(folder_ / "policy.onnx.data",
          {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(float)});
    write(outside_.path("outside.data"), std::string(64, '\0'));
  }

  static void write(const std::filesystem::path& file, const std::string& bytes) {
    std::ofstream(file, std::ios::binary) << bytes;
  }

  std::expected<Model, std::string> load(const std::string& location, const std::string& offset = "4",
                                         const std::string& length = "16") {
    GraphMaker maker = small_policy();
    onnx::TensorProto& tensor = weights(maker);
    tensor.clear_float_data();
    tensor.set_data_location(onnx::TensorProto_DataLocation_EXTERNAL);
    const std::pair<const char*, std::string> entries[] = {
        {"location", location}, {"offset", offset}, {"length", length}};
    for (const auto& [key, value] : entries) {
      auto& entry = *tensor.add_external_data();
      entry.set_key(key);
      entry.set_value(value);
    }
    write(folder_ / "policy.onnx", maker.model.SerializeAsString());
    return onnx_engine::load(folder_ / "policy.onnx");
  }
  std::string refusal(const std::string& location, const std::string& offset = "4", const std::string& length = "16") {
    const auto model = load(location, offset, length);
    return model ? "" : model.error();
  }

  const test::TemporaryDirectory outside_;
  const std::filesystem::path folder_ = outside_.path("model");
};

TEST_F(ExternalData, IsReadWhereTheModelSaysAndItsHashIsTold) {
  auto model = load("policy.onnx.data");
  ASSERT_TRUE(model) << model.error();
  std::ranges::copy(std::vector<float>{0, 0.5F}, model->input(0).begin());
  model->run();
  EXPECT_FLOAT_EQ(model->output(0)[0], std::tanh(0.5F * 3 + 1));
  ASSERT_EQ(model->external_files().size(), 1U);
  const ExternalFile& file = model->external_files()[0];
  EXPECT_EQ(file.location, "policy.onnx.data");
  EXPECT_EQ(file.bytes, 20U);
  // Of the five numbers 0, 1, 2, 3, 4 in little-endian float32, by sha256sum.
  EXPECT_EQ(file.sha256, "8deb90668ea3a6845d5c04454798ccb63829a88ff827892f2dc11c808baac7af");
}

// Threat: policy-file-data
TEST_F(ExternalData, IsReadFromNoFileThatThePolicysHashDoesNotCover) {
  for (const std::string location :
       {"../outside.data", "weights.data", "./policy.onnx.data", "sub/../policy.onnx.data", ""}) {
    expect_sentence(refusal(location), {"initializer 'w'", "only policy.onnx.data or policy.onnx_data", "hash covers"});
  }
  expect_sentence(refusal((folder_ / "policy.onnx.data").string()), {"hash covers"});
  expect_sentence(refusal("policy.onnx_data"), {"policy.onnx_data", "not there; put it beside the model"});
  std::filesystem::create_symlink("../outside.data", folder_ / "policy.onnx_data");
  expect_sentence(refusal("policy.onnx_data"), {"a link that leaves the model's folder"});
  std::filesystem::remove(folder_ / "policy.onnx_data");
  std::filesystem::create_directory(folder_ / "policy.onnx_data");
  expect_sentence(refusal("policy.onnx_data"), {"no file"});
}

// Of a file that another engine runs, which brings in weights from wherever a tensor stands.
TEST_F(ExternalData, IsVettedWhereverATensorStands) {
  const auto outside = [](onnx::TensorProto& tensor, const std::string& location = "weights.bin") {
    tensor.set_name("hidden away");
    tensor.set_data_location(onnx::TensorProto_DataLocation_EXTERNAL);
    auto& entry = *tensor.add_external_data();
    entry.set_key("location");
    entry.set_value(location);
  };
  const auto said = [this](const GraphMaker& maker) {
    write(folder_ / "policy.onnx", maker.model.SerializeAsString());
    const auto fine = check_external_data(folder_ / "policy.onnx");
    return fine ? std::string() : fine.error();
  };
  const std::vector<std::string> parts{"tensor 'hidden away' keeps its data in 'weights.bin'", "hash covers"};
  EXPECT_EQ(said(small_policy()), "");

  GraphMaker initializer = small_policy();
  outside(weights(initializer));
  expect_sentence(said(initializer), parts);
  GraphMaker sparse = small_policy();
  outside(*sparse.graph().add_sparse_initializer()->mutable_values());
  expect_sentence(said(sparse), parts);
  GraphMaker constant = small_policy();
  outside(*constant.graph().mutable_node(1)->add_attribute()->mutable_t());
  expect_sentence(said(constant), parts);
  GraphMaker list = small_policy();
  outside(*list.graph().mutable_node(1)->add_attribute()->add_tensors());
  expect_sentence(said(list), parts);
  GraphMaker branch = small_policy();
  auto& inner = *branch.graph().mutable_node(1)->add_attribute()->mutable_g();
  outside(*inner.add_node()->add_attribute()->mutable_g()->add_initializer());
  expect_sentence(said(branch), parts);
  GraphMaker function = small_policy();
  outside(*function.model.add_functions()->add_node()->add_attribute()->mutable_t());
  expect_sentence(said(function), parts);
  GraphMaker defaults = small_policy();  // of a function's attribute, which libonnx reads since 1.13
  onnx::AttributeProto attribute;
  outside(*attribute.mutable_t());
  auto& called = *defaults.model.add_functions();
  *called.GetReflection()->MutableUnknownFields(&called)->AddLengthDelimited(11) = attribute.SerializeAsString();
  expect_sentence(said(defaults), parts);

  GraphMaker twice = small_policy();  // readers differ in which of two counts
  outside(weights(twice), "policy.onnx.data");
  EXPECT_EQ(said(twice), "");
  outside(weights(twice));
  expect_sentence(said(twice), parts);
  GraphMaker nowhere = small_policy();
  weights(nowhere).set_data_location(onnx::TensorProto_DataLocation_EXTERNAL);
  expect_sentence(said(nowhere), {"tensor 'w' keeps its data in a file that it does not name"});
  GraphMaker compiled = small_policy();
  compiled.node("EPContext", {"obs"}, {"action"}).with("embed_mode", std::int64_t{0});
  expect_sentence(said(compiled), {"EPContext node 'the_EPContext'", "embed_mode 1"});
  write(folder_ / "policy.onnx", "no network");
  EXPECT_FALSE(check_external_data(folder_ / "policy.onnx"));
}

TEST_F(ExternalData, LiesWithinItsFile) {
  expect_sentence(refusal("policy.onnx.data", "8"), {"at byte 8 of 'policy.onnx.data', which has 20 bytes"});
  expect_sentence(refusal("policy.onnx.data", "24"), {"which has 20 bytes"});
  expect_sentence(refusal("policy.onnx.data", "18446744073709551612"), {"which has 20 bytes"});
  expect_sentence(refusal("policy.onnx.data", "-4"), {"offset '-4'"});
  expect_sentence(refusal("policy.onnx.data", "4", "1x"), {"length '1x'"});
  expect_sentence(refusal("policy.onnx.data", "4", "12"), {"holds 12 bytes", "damaged"});
}

TEST(Refusal, WhatOnlyALaterOperatorHas) {
  // libonnx does not know these opsets: the engine's own look must find it.
  for (const std::int64_t opset : {13, 21}) {
    GraphMaker attribute = small_policy();
    attribute.model.mutable_opset_import(0)->set_version(opset);
    EXPECT_EQ(attribute.refusal(), "");
    auto& node = *attribute.graph().mutable_node(1);
    node.add_attribute()->set_name("later");
    node.mutable_attribute(0)->set_type(onnx::AttributeProto_AttributeType_INT);
    expect_sentence(attribute.refusal(), {"Tanh node 'the_Tanh'", "'later'", "not known"});

    GraphMaker input = small_policy();
    input.model.mutable_opset_import(0)->set_version(opset);
    input.graph().mutable_node(1)->add_input("w");
    expect_sentence(input.refusal(), {"Tanh node 'the_Tanh'", "2 inputs"});

    GraphMaker kind = small_policy();
    kind.model.mutable_opset_import(0)->set_version(opset);
    NodeMaker(*kind.graph().mutable_node(0)).with("transB", 1.0F);
    EXPECT_NE(kind.refusal(), "");
  }
}

TEST(Refusal, AWindowThatSeesNothing) {
  for (const char* pool : {"MaxPool", "AveragePool"}) {
    GraphMaker maker;
    maker.input("x", {1, 1, 6}).output("y");
    maker.node(pool, {"x"}, {"y"}).with("kernel_shape", Dims{2}).with("strides", Dims{3}).with("pads", Dims{0, 1});
    EXPECT_EQ(maker.refusal(), "");
    NodeMaker(*maker.graph().mutable_node(0)).with("ceil_mode", std::int64_t{1});
    expect_sentence(maker.refusal(), {pool, "a window lies in the padding altogether"});
  }
}

TEST(Refusal, AnEmptyPartIsNoInput) {
  GraphMaker maker;
  maker.input("x", {2}).output("a").output("y").integers("parts", {2}, {2, 0});
  maker.node("Split", {"x", "parts"}, {"a", "b"});
  maker.node("Relu", {"b"}, {"y"});
  expect_sentence(maker.refusal(), {"the_Relu", "'b'"});
}

TEST(Refusal, Cycle) {
  GraphMaker maker = small_policy();
  maker.graph().mutable_node(0)->set_input(2, "action");
  expect_sentence(maker.refusal(), {"sorted"});
}

TEST(Refusal, AbsurdSizes) {
  GraphMaker weight = small_policy();
  weights(weight).set_dims(0, std::int64_t{1} << 40);
  expect_sentence(weight.refusal(), {"initializer 'w'", "larger"});

  GraphMaker overflow = small_policy();
  for (const int d : {0, 1}) weights(overflow).set_dims(d, std::int64_t{1} << 33);  // 2^66 elements
  expect_sentence(overflow.refusal(), {"larger"});

  // Small file, large tensor: each fits, together they do not.
  GraphMaker expand;
  expand.input("x", {1}).output("y").integers("shape", {1}, {200'000'000});
  expand.node("Expand", {"x", "shape"}, {"a"});
  expand.node("Expand", {"x", "shape"}, {"y"});
  expect_sentence(expand.refusal(), {"1024 MiB"});
}

TEST(Refusal, DataThatDoesNotFillItsShape) {
  GraphMaker maker = small_policy();
  weights(maker).mutable_float_data()->RemoveLast();
  expect_sentence(maker.refusal(), {"initializer 'w'", "damaged"});
}

// A network of such weights answers NaN for ever.
TEST(Refusal, WeightsThatAreNan) {
  GraphMaker maker = small_policy();
  weights(maker).set_float_data(0, std::numeric_limits<float>::quiet_NaN());
  expect_sentence(maker.refusal(), {"weights 'w' hold NaN", "export an earlier checkpoint"});
  GraphMaker raw = small_policy();
  onnx::TensorProto& tensor = weights(raw);
  std::vector<float> numbers(tensor.float_data().begin(), tensor.float_data().end());
  numbers.back() = std::numeric_limits<float>::quiet_NaN();
  tensor.clear_float_data();
  tensor.set_raw_data(numbers.data(), numbers.size() * sizeof(float));
  expect_sentence(raw.refusal(), {"weights 'w' hold NaN"});
}

TEST(Refusal, OpsetTooOldOrTooNew) {
  for (const std::int64_t opset : {std::int64_t{-1}, std::int64_t{0}, std::int64_t{22}, std::int64_t{99}}) {
    GraphMaker maker = small_policy();
    maker.model.mutable_opset_import(0)->set_version(opset);
    expect_sentence(maker.refusal(), {"opset"});
  }
}

TEST(Refusal, ADeclaredOutputShapeThatTheOperatorsContradict) {
  GraphMaker maker = small_policy();
  auto& shape = *maker.graph().mutable_output(0)->mutable_type()->mutable_tensor_type()->mutable_shape();
  for (const std::int64_t dim : {1, 7}) shape.add_dim()->set_dim_value(dim);
  EXPECT_NE(maker.refusal(), "");
}

TEST(Refusal, NamesFromTheFileCannotForgeALogLine) {
  GraphMaker maker = small_policy();
  maker.graph().mutable_node(1)->set_op_type("Bad");
  maker.graph().mutable_node(1)->set_name("x\n2026-01-01 all is well\x1b[2J");
  const std::string refusal = maker.refusal();
  EXPECT_EQ(refusal.find_first_of("\n\x1b"), std::string::npos);
}

TEST(Refusal, FilesThatAreMissingEmptyOrSomethingElse) {
  expect_sentence(load(std::filesystem::path("no/such/policy.onnx")).error(), {"no/such/policy.onnx", "no such file"});
  expect_sentence(load(std::filesystem::path(".")).error(), {"not a regular file"});
  const auto file = std::filesystem::path(testing::TempDir()) / "takt_not_a_model.onnx";
  std::ofstream(file) << "robot: arm6\n";
  expect_sentence(load(file).error(), {"not an ONNX model"});
  std::ofstream(file, std::ios::trunc).flush();
  EXPECT_FALSE(load(file));
  std::filesystem::remove(file);
}

// ---- mutations

// Operators that take by indices, fold, repeat, reduce and multiply by letters.
GraphMaker moving(std::int64_t opset) {
  GraphMaker maker(opset);
  maker.input("x", {1, 4, 2, 2}).output("y").output("place");
  maker.integers("picks", {1, 4, 2, 2}, Dims(16, 1)).integers("row", {1, 1}, {0}).integers("one", {}, {1});
  maker.integers("twice", {4}, {1, 1, 2, 1}).integers("pads", {8}, {0, 0, 1, 0, 0, 0, 0, 1});
  maker.floats("kernel", {4, 1, 2, 2}, std::vector<float>(16, 0.5F)).floats("off_on", {2}, {0, 1});
  maker.floats("update", {1, 4, 2, 2}, std::vector<float>(16, 2)).floats("scale", {4}, {1, 2, 3, 4});
  maker.node("GatherElements", {"x", "picks"}, {"g"}).with("axis", std::int64_t{1});
  maker.node("ScatterND", {"g", "row", "update"}, {"s"});
  maker.node("ScatterElements", {"s", "picks", "update"}, {"e"}).with("axis", std::int64_t{1});
  maker.node("GatherND", {"e", "row"}, {"n"});
  maker.node("Trilu", {"n", "one"}, {"t"});
  maker.node("Tile", {"t", "twice"}, {"tiled"});
  maker.node("Pad", {"tiled", "pads"}, {"padded"}).with("mode", std::string("reflect"));
  maker.node("InstanceNormalization", {"x", "scale", "scale"}, {"i"});
  maker.node("ConvTranspose", {"i", "kernel"}, {"c"}).with("strides", Dims{2, 2}).with("pads", Dims{1, 0, 0, 1});
  maker.node("DepthToSpace", {"i"}, {"d"}).with("blocksize", std::int64_t{2});
  maker.node("SpaceToDepth", {"d"}, {"b"}).with("blocksize", std::int64_t{2});
  maker.node("Einsum", {"b", "x"}, {"m"}).with("equation", std::string("nchw,nkhw->nck"));
  maker.node("CumSum", {"m", "one"}, {"r"});
  maker.node("LogSoftmax", {"r"}, {"l"}).with("axis", std::int64_t{1});
  maker.node("ArgMax", {"l"}, {"place"}).with("axis", std::int64_t{1});
  maker.node("OneHot", {"place", "one", "off_on"}, {"hot"});
  maker.node("GlobalMaxPool", {"padded"}, {"most"});
  maker.node("ReduceLogSumExp", {"c"}, {"sum"});
  maker.node("Sum", {"most", "sum"}, {"y"});
  maker.graph().mutable_output(1)->mutable_type()->mutable_tensor_type()->set_elem_type(
      onnx::TensorProto_DataType_INT64);
  return maker;
}

// One of each family, so that a mutation can reach every operator.
std::vector<std::string> seeds() {
  std::vector<std::string> bytes{small_policy().model.SerializeAsString()};
  GraphMaker shapes;
  shapes.input("x", {2, 3})
      .output("y")
      .integers("start", {1}, {0})
      .integers("end", {1}, {2})
      .integers("axis", {1}, {1});
  shapes.integers("shape", {2}, {-1, 2}).integers("index", {1}, {1});
  shapes.node("Slice", {"x", "start", "end", "axis"}, {"s"});
  shapes.node("Transpose", {"s"}, {"t"}).with("perm", Dims{1, 0});
  shapes.node("Reshape", {"t", "shape"}, {"r"});
  shapes.node("Gather", {"r", "index"}, {"g"}).with("axis", std::int64_t{0});
  shapes.node("Concat", {"g", "r"}, {"c"}).with("axis", std::int64_t{0});
  shapes.node("ReduceMean", {"c"}, {"m"}).with("axes", Dims{1});
  shapes.node("Sub", {"c", "m"}, {"d"});
  shapes.node("Softmax", {"d"}, {"y"});
  bytes.push_back(shapes.model.SerializeAsString());
  GraphMaker recurrent(14);
  recurrent.input("x", {2, 1, 2}).output("y").floats("w", {1, 4, 2}, std::vector<float>(8, 0.1F));
  recurrent.floats("r", {1, 4, 1}, std::vector<float>(4, 0.1F)).floats("b", {1, 8}, std::vector<float>(8, 0.1F));
  recurrent.node("LSTM", {"x", "w", "r", "b"}, {"h"}).with("hidden_size", std::int64_t{1});
  recurrent.node("Squeeze", {"h"}, {"y"});
  bytes.push_back(recurrent.model.SerializeAsString());
  // The same of an opset that libonnx does not know, and what came with it.
  shapes.model.mutable_opset_import(0)->set_version(21);
  bytes.push_back(shapes.model.SerializeAsString());
  GraphMaker windows(20);
  windows.input("x", {1, 2, 5, 5}).output("y").floats("w", {2, 2, 2, 2}, std::vector<float>(16, 0.1F));
  windows.integers("parts", {2}, {1, 1}).integers("axes", {1}, {-1});
  windows.node("Conv", {"x", "w"}, {"c"}).with("pads", Dims{1, 1, 0, 0});
  windows.node("MaxPool", {"c"}, {"m"}).with("kernel_shape", Dims{2, 2}).with("strides", Dims{2, 2});
  windows.node("Split", {"m", "parts"}, {"a", "b"}).with("axis", std::int64_t{1});
  windows.node("Less", {"a", "b"}, {"less"});
  windows.node("Where", {"less", "a", "b"}, {"v"});
  windows.node("AveragePool", {"v"}, {"p"}).with("kernel_shape", Dims{2, 2});
  windows.node("ReduceL2", {"p", "axes"}, {"y"});
  bytes.push_back(windows.model.SerializeAsString());
  GraphMaker branch;
  branch.output("out").floats("w", {2}, {1, 2});
  branch.node("Mul", {"x", "w"}, {"out"});
  GraphMaker choice;
  choice.input("x", {2}).input("count", {}).output("y").integers("three", {}, {3}).integers("two", {}, {2});
  choice.graph().mutable_input(1)->mutable_type()->mutable_tensor_type()->set_elem_type(
      onnx::TensorProto_DataType_INT64);
  choice.node("Mod", {"count", "three"}, {"rest"});
  choice.node("Equal", {"rest", "two"}, {"chosen"});
  choice.node("If", {"chosen"}, {"y"}).with("then_branch", branch.graph()).with("else_branch", branch.graph());
  for (const std::int64_t opset : {13, 21}) {
    choice.model.mutable_opset_import(0)->set_version(opset);
    bytes.push_back(choice.model.SerializeAsString());
  }
  for (const std::int64_t opset : {16, 21}) bytes.push_back(moving(opset).model.SerializeAsString());
  GraphMaker old(6);
  old.model.set_ir_version(4);
  old.input("x", {1, 2, 2}).output("y").floats("b", {2}, {1, 2}).floats("m", {2, 2}, {1, 2, 3, 4});
  old.node("Add", {"x", "b"}, {"s"}).with("broadcast", std::int64_t{1}).with("axis", std::int64_t{1});
  old.node("PRelu", {"s", "b"}, {"p"});
  old.node("Dropout", {"p"}, {"d"}).with("is_test", std::int64_t{1});
  old.node("Flatten", {"d"}, {"f"}).with("axis", std::int64_t{2});
  old.node("Gemm", {"f", "m", "b"}, {"y"}).with("broadcast", std::int64_t{1});
  bytes.push_back(old.model.SerializeAsString());
  return bytes;
}

void load_and_run(const std::string& bytes) {
  auto model = load(std::as_bytes(std::span(bytes)), "mutant");
  if (model) model->run();
}

TEST(Mutation, TheSeedsAreSound) {
  for (const std::string& seed : seeds()) {
    const auto model = load(std::as_bytes(std::span(seed)), "seed");
    EXPECT_TRUE(model) << model.error();
  }
}

TEST(Mutation, EveryTruncationIsSurvived) {
  for (const std::string& seed : seeds()) {
    for (std::size_t length = 0; length < seed.size(); ++length) load_and_run(seed.substr(0, length));
  }
}

TEST(Mutation, RandomBytesAreSurvived) {
  constexpr unsigned rounds = 3000;
  int accepted = 0;
  for (const std::string& seed : seeds()) {
    for (unsigned round = 0; round < rounds; ++round) {
      std::mt19937 random(round);
      std::string bytes = seed;
      const unsigned changes = 1 + random() % 4;
      for (unsigned i = 0; i < changes; ++i) {
        char& byte = bytes[random() % bytes.size()];
        byte = random() % 2 == 0 ? static_cast<char>(random()) : static_cast<char>(byte ^ (1 << (random() % 8)));
      }
      auto model = load(std::as_bytes(std::span(bytes)), "mutant");
      if (!model) {
        EXPECT_FALSE(model.error().empty()) << "round " << round;
        continue;
      }
      ++accepted;
      model->run();
    }
  }
  EXPECT_GT(accepted, 0) << "no mutant got past the checks: the test reaches too little";
}

}  // namespace
}  // namespace takt::onnx_engine
