// One number for the whole contract: differs whenever any shared structure's layout differs.
#pragma once

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/layout.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/policy_input.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "executive/contract/session.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt {

constexpr std::uint64_t contract_layout() {
  return layout_hash({{kObservationLayout, sizeof(Observation)},
                      {kSensorSampleLayout, sizeof(SensorSample)},
                      {kCommandLayout, sizeof(CommandChunk)},
                      {kTickRecordLayout, sizeof(TickRecord)},
                      {kPolicyInputLayout, sizeof(PolicyInputHeader)},
                      {sizeof(Hello), sizeof(OperatorReply)}});
}

}  // namespace takt
