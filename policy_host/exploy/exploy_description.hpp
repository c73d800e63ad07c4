// SPDX-License-Identifier: Apache-2.0
// What the metadata of an ONNX file that exploy exported says (rai-opensource/exploy): tensors speak by their names,
// joints and ranges by one JSON each. Quaternions are w x y z there. Its only IMU (`sensor.imu.NAME`) is taken for the
// robot's, of several the one that is called as the base; another, like another body, is an outside sensor's.
//
// Errors: one line, about the metadata. Thread rule: set-up only.
#pragma once

#include <expected>
#include <optional>
#include <span>
#include <string>

#include "policy_host/described_policy.hpp"
#include "policy_host/onnx_engine/model.hpp"

namespace takt::policy_host {

// Nothing: it is none of exploy's.
std::expected<std::optional<DescribedPolicy>, std::string> describe_exploy(
    const onnx_engine::Metadata& metadata, std::span<const onnx_engine::TensorInfo> inputs,
    std::span<const onnx_engine::TensorInfo> outputs);

}  // namespace takt::policy_host
