// SPDX-License-Identifier: Apache-2.0
// A plugin opened (takt/engine.h): its table judged once, its networks behind an owner that closes them.
//
// Errors: one line that begins with the plugin's path. Once opened a plugin stays for the life of the process: its
// threads and its thread-local state may outlive every network. Thread rule: open at set-up.
#pragma once

#include <expected>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "config/robot_config.hpp"
#include "policy_host/takt/engine.h"

namespace takt::policy_host {

class EngineNetwork {
 public:
  EngineNetwork(const takt_engine_table* engine, takt_engine_network* network) : engine_(engine), network_(network) {}
  EngineNetwork(EngineNetwork&& other) noexcept : engine_(other.engine_), network_(other.network_) {
    other.network_ = nullptr;
  }
  EngineNetwork& operator=(EngineNetwork&&) = delete;
  ~EngineNetwork() {
    if (network_ != nullptr) engine_->close(network_);
  }

  [[nodiscard]] std::span<const takt_engine_tensor> inputs() const { return {network_->inputs, network_->input_count}; }
  [[nodiscard]] std::span<const takt_engine_tensor> outputs() const {
    return {network_->outputs, network_->output_count};
  }
  [[nodiscard]] bool keeps_state() const { return network_->keeps_state != 0; }
  [[nodiscard]] std::string description() const { return network_->description; }
  // The error is the plugin's own sentence.
  std::expected<void, std::string> infer();
  void reset() { engine_->reset(network_); }

 private:
  const takt_engine_table* engine_;
  takt_engine_network* network_;
};

std::size_t value_count(const takt_engine_tensor& tensor);

// Opens `plugin`, a path, and with it the network in `file`, as policy.engine says. A plugin that crashes, ends the
// process or takes longer than policy.engine.load_within ends it with a line and 65 (load_watch.hpp).
std::expected<EngineNetwork, std::string> open_network(const std::string& plugin, const config::RobotConfig& robot,
                                                       const std::filesystem::path& file);

}  // namespace takt::policy_host
