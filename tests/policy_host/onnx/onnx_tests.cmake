# Tests of the built-in ONNX engine.
find_package(Protobuf REQUIRED)
find_package(ONNX REQUIRED)
find_package(nlohmann_json REQUIRED)

takt_test(onnx_operators_test
  SOURCES onnx_activations_test.cpp onnx_elementwise_test.cpp onnx_matmul_test.cpp onnx_normalise_test.cpp
          onnx_shape_operators_test.cpp onnx_recurrent_test.cpp
  DEPENDS takt_onnx onnx onnx_proto)
takt_test(onnx_refusal_test SOURCES onnx_refusal_test.cpp DEPENDS takt_onnx onnx onnx_proto)
takt_test(onnx_reference_test SOURCES onnx_reference_test.cpp DEPENDS takt_onnx nlohmann_json::nlohmann_json)
if(NOT TAKT_SANITIZE)  # it replaces malloc, and so do the sanitizers
  takt_test(onnx_allocation_test SOURCES onnx_allocation_test.cpp DEPENDS takt_onnx onnx onnx_proto)
endif()
