// SPDX-License-Identifier: Apache-2.0
// One number for the whole contract: differs whenever a field of any shared structure, or a word of any enum in one, is
// another, elsewhere, or of another type.
#pragma once

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/image_sample.hpp"
#include "executive/contract/layout.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/operator_word.hpp"
#include "executive/contract/policy_input.hpp"
#include "executive/contract/policy_word.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "executive/contract/session.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt {

consteval std::uint64_t contract_layout() {
  return LayoutHash()
      .mix(layout_of<Observation>())
      .mix(layout_of<SensorSample>())
      .mix(layout_of<ImageHeader>())
      .mix(layout_of<CommandChunk>())
      .mix(layout_of<PolicyInputHeader>())
      .mix(layout_of<PolicyInputSample>())
      .mix(layout_of<TickRecord>())
      .mix(layout_of<FrameRecord>())
      .mix(layout_of<TickTag>())
      .mix(layout_of<CommandTag>())
      .mix(layout_of<Hello>())
      .mix(layout_of<Welcome>())
      .mix(layout_of<OperatorMessage>())
      .mix(layout_of<RecorderWord>())
      .mix(layout_of<PolicyWord>())
      .mix(layout_of<OperatorReply>())
      .mix(layout_of<OperatorWord>())
      .value();
}

}  // namespace takt
