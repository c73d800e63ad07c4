// SPDX-License-Identifier: Apache-2.0
// How old the samples of each outside sensor were when the policy was asked: their share of the ages' `sense`.
//
// Of every recorded answer of the policy in charge (policy_input): the newest sample of each sensor that it was shown,
// at the instant of the observation answered. The stamps of samples are claims of the sensors' processes. A command
// that is absent, and its when_absent instead, is no sample. Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"
#include "monitor/judge/freshness_statistics.hpp"
#include "monitor/record/policy_input_message.hpp"

namespace takt::monitor {

struct SensorAge {
  std::string sensor;
  Quantiles age;             // ns, per answer
  std::uint64_t oldest = 0;  // answers for which no other outside sensor's sample was older
};

class SensorAges {
 public:
  explicit SensorAges(const config::RobotConfig& robot);
  void tick(const TickRecordHeader& header);
  void input(const RecordedPolicyInput& recorded);
  // Of the sensors that were shown, in the robot file's order.
  [[nodiscard]] std::vector<SensorAge> ages() const;

 private:
  struct Published {
    std::uint64_t observation = 0;
    MonoTime at;
  };
  [[nodiscard]] const Published* observation(std::uint64_t id) const;
  std::vector<std::string> names_;
  std::vector<std::vector<std::int64_t>> ages_;  // one per sensor of the robot file
  std::vector<std::uint64_t> oldest_;
  std::deque<Published> published_;  // the newest, by id
};

}  // namespace takt::monitor
