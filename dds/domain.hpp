// SPDX-License-Identifier: Apache-2.0
// A participant in the DDS domain that a robot file's `dds` section describes.
// Thread rules are Cyclone DDS's own: its entities may be used from any thread.
#pragma once

#include <dds/dds.h>

#include <expected>
#include <memory>
#include <string>
#include <string_view>

#include "config/robot_config.hpp"

namespace takt::dds {

struct DeleteQos {
  void operator()(dds_qos_t* qos) const { dds_delete_qos(qos); }
};
using Qos = std::unique_ptr<dds_qos_t, DeleteQos>;
inline Qos make_qos() {
  return Qos(dds_create_qos());
}

class Domain {
 public:
  // Precondition: robot.dds. `name`: as which others see the participant. At most one per process and domain. The error
  // is one sentence. It does not hear what comes by another interface (neighbours.hpp).
  static std::expected<Domain, std::string> open(const config::RobotConfig& robot, const std::string& name);
  Domain(Domain&& other) noexcept;
  Domain& operator=(Domain&&) = delete;
  ~Domain();  // and everything in it

  [[nodiscard]] dds_entity_t participant() const { return participant_; }
  // The sentence for an entity that could not be made.
  [[nodiscard]] std::string failure(std::string_view what, dds_entity_t refused) const;

 private:
  explicit Domain(const config::RobotConfig& robot) : where_(where(robot)) {}
  static std::string where(const config::RobotConfig& robot);
  std::string where_;
  dds_entity_t domain_ = 0, participant_ = 0;
};

}  // namespace takt::dds
