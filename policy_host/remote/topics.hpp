// SPDX-License-Identifier: Apache-2.0
// The four topics between a robot's bridge and its policy servers (dds/policy_types.idl): endpoints with their QoS.
// Errors: one sentence.
#pragma once

#include <cstdint>
#include <expected>
#include <string>

#include "config/robot_config.hpp"
#include "dds/domain.hpp"
#include "policy_host/remote/peer.hpp"
#include "policy_types.h"

namespace takt::policy_host::remote {

enum class Topic : std::uint8_t { observation, sample, command, status };

// Precondition: robot.policy. Lifespan and deadline are freshness.max_age: what is older moves no robot.
std::expected<dds_entity_t, std::string> make_writer(const dds::Domain& domain, const config::RobotConfig& robot,
                                                     Topic topic);
std::expected<dds_entity_t, std::string> make_reader(const dds::Domain& domain, const config::RobotConfig& robot,
                                                     Topic topic);

// A number that no other process draws, not 0.
std::uint64_t drawn_number();

// Who wrote what `reader` took under this handle. Unknown: it has left since.
PeerId sender_of(dds_entity_t reader, dds_instance_handle_t publication);

// All that came: `each(message, sender)`, oldest first. What an unknown sender wrote is dropped.
template <class Message, class Each>
void take_all(dds_entity_t reader, Each each) {
  void* loan[1] = {nullptr};
  dds_sample_info_t info;
  while (dds_take(reader, loan, &info, 1, 1) > 0) {
    const PeerId sender = info.valid_data ? sender_of(reader, info.publication_handle) : PeerId{};
    if (sender.is_known()) each(*static_cast<const Message*>(loan[0]), sender);
    dds_return_loan(reader, loan, 1);
    loan[0] = nullptr;
  }
}

// Points a sequence of idlc's at values that outlive it.
template <class Sequence, class Value>
void refer(Sequence& sequence, const Value* values, std::size_t count) {
  sequence._length = sequence._maximum = static_cast<std::uint32_t>(count);
  sequence._buffer = const_cast<Value*>(values);  // DDS reads what it is asked to write; its structures cannot say so
  sequence._release = false;
}

}  // namespace takt::policy_host::remote
