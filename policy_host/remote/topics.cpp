// SPDX-License-Identifier: Apache-2.0
#include "policy_host/remote/topics.hpp"

#include <algorithm>
#include <iterator>
#include <random>

namespace takt::policy_host::remote {
namespace {

constexpr dds_duration_t kMaxBlocking = DDS_MSECS(1);
// Messages of an instance that a reader keeps until they are taken: with one, a stranger's would replace a peer's.
constexpr std::int32_t kKept = 4;

struct TopicFacts {
  const char* name;
  const dds_topic_descriptor_t* descriptor;
  bool is_kept;  // reliable, and for who comes later: samples are large, and some are rare
};

TopicFacts facts_of(Topic topic) {
  switch (topic) {
    case Topic::observation:
      return {"takt/remote_policy/observation", &takt_remote_Observation_desc, false};
    case Topic::sample:
      return {"takt/remote_policy/sample", &takt_remote_Sample_desc, true};
    case Topic::status:
      return {"takt/remote_policy/status", &takt_remote_ServerStatus_desc, false};
    case Topic::command:
      break;
  }
  return {"takt/remote_policy/command", &takt_remote_Command_desc, false};
}

// Both sides make theirs of the same robot file, so that they match.
dds::Qos qos_of(const config::RobotConfig& robot, Topic topic) {
  dds::Qos qos = dds::make_qos();
  const dds_duration_t max_age = robot.freshness.max_age.ns;
  const bool is_kept = facts_of(topic).is_kept;
  dds_qset_reliability(qos.get(), is_kept ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, kMaxBlocking);
  dds_qset_durability(qos.get(), is_kept ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, 1);
  if (topic == Topic::observation || topic == Topic::command) dds_qset_deadline(qos.get(), max_age);
  const char* const partition = robot.robot.c_str();
  dds_qset_partition1(qos.get(), partition);
  return qos;
}

std::expected<dds_entity_t, std::string> made(const dds::Domain& domain, Topic topic, dds_entity_t entity) {
  if (entity > 0) return entity;
  return std::unexpected(domain.failure(facts_of(topic).name, entity));
}

dds_entity_t make_topic(const dds::Domain& domain, Topic topic) {
  const TopicFacts facts = facts_of(topic);
  return dds_create_topic(domain.participant(), facts.descriptor, facts.name, nullptr, nullptr);
}

}  // namespace

std::expected<dds_entity_t, std::string> make_writer(const dds::Domain& domain, const config::RobotConfig& robot,
                                                     Topic topic) {
  const dds::Qos qos = qos_of(robot, topic);
  // Samples of rare sensors have to wait for who comes later; how old each is, the observations say.
  if (topic == Topic::observation || topic == Topic::command) dds_qset_lifespan(qos.get(), robot.freshness.max_age.ns);
  return made(domain, topic, dds_create_writer(domain.participant(), make_topic(domain, topic), qos.get(), nullptr));
}

std::expected<dds_entity_t, std::string> make_reader(const dds::Domain& domain, const config::RobotConfig& robot,
                                                     Topic topic) {
  const dds::Qos qos = qos_of(robot, topic);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, kKept);
  return made(domain, topic, dds_create_reader(domain.participant(), make_topic(domain, topic), qos.get(), nullptr));
}

PeerId sender_of(dds_entity_t reader, dds_instance_handle_t publication) {
  PeerId sender;
  dds_builtintopic_endpoint_t* const writer = dds_get_matched_publication_data(reader, publication);
  if (writer == nullptr) return sender;
  static_assert(sizeof writer->participant_key.v == sizeof sender.guid);
  std::ranges::copy(writer->participant_key.v, sender.guid.begin());
  dds_builtintopic_free_endpoint(writer);
  return sender;
}

std::uint64_t drawn_number() {
  std::random_device device;
  std::uint64_t number = 0;
  while (number == 0) number = (std::uint64_t{device()} << 32U) | device();
  return number;
}

}  // namespace takt::policy_host::remote
