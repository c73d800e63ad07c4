// SPDX-License-Identifier: Apache-2.0
#include "monitor/dds/participant.hpp"

#include <dds/dds.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>

#include "dds/domain.hpp"
#include "dds/type_hash.hpp"
#include "monitor/dds/requests.hpp"
#include "monitor/dds/wire.hpp"

namespace takt::monitor::dds {
namespace {

struct TopicFacts {
  const char* name;
  std::string_view type;
  const dds_topic_descriptor_t* descriptor;
  std::int32_t depth;
  dds_durability_kind_t durability = DDS_DURABILITY_VOLATILE;
};

constexpr std::array<TopicFacts, kChannelCount> kWritten{{
    {"rt/joint_states", "sensor_msgs/msg/JointState", &sensor_msgs_msg_dds__JointState__desc, 10},
    {"rt/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", &diagnostic_msgs_msg_dds__DiagnosticArray__desc, 10},
    {"rt/takt/status", "takt_msgs/msg/Status", &takt_msgs_msg_dds__Status__desc, 1, DDS_DURABILITY_TRANSIENT_LOCAL},
    {"rt/takt/command_age", "takt_msgs/msg/CommandAge", &takt_msgs_msg_dds__CommandAge__desc, 256},
}};
constexpr TopicFacts kOthers{"rt/takt/status", "takt_msgs/msg/Status", &takt_msgs_msg_dds__Status__desc, 256};
constexpr TopicFacts kRequests{"rt/takt/request", "takt_msgs/msg/Request", &takt_msgs_msg_dds__Request__desc, 16};

using takt::dds::Qos;

Qos qos_of(const TopicFacts& topic) {
  Qos qos = takt::dds::make_qos();
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, DDS_MSECS(kMaxBlocking.count()));
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, topic.depth);
  dds_qset_durability(qos.get(), topic.durability);
  const std::string hash = takt::dds::user_data(topic.type);
  dds_qset_userdata(qos.get(), hash.data(), hash.size());
  return qos;
}

}  // namespace

class Participant::Entities {
 public:
  Entities(const config::RobotConfig& robot, const std::string& machine)
      : robot_(robot), address_{.robot = robot.robot, .machine = machine} {}
  ~Entities() = default;
  Entities(const Entities&) = delete;
  Entities& operator=(const Entities&) = delete;

  // Empty, or what went wrong.
  std::string open() {
    auto domain = takt::dds::Domain::open(robot_, "takt-monitor " + robot_.robot);
    if (!domain) return domain.error();
    domain_.emplace(std::move(*domain));
    for (std::size_t channel = 0; channel < kChannelCount; ++channel) {
      const TopicFacts& topic = kWritten[channel];
      const dds_entity_t created = create_topic(topic);
      if (!keep(writers_[channel], dds_create_writer(domain_->participant(), created, qos_of(topic).get(), nullptr),
                topic.name))
        return failure_;
    }
    if (robot_.dds->allow_requests) open_readers();
    return failure_;
  }

  bool write(Channel channel, const void* message) {
    return dds_write(writers_[static_cast<std::size_t>(channel)], message) == DDS_RETCODE_OK;
  }

  std::vector<Request> take_requests(std::chrono::milliseconds patience) {
    std::vector<Request> requests;
    if (reader_ <= 0) return requests;
    dds_waitset_wait(wait_set_, nullptr, 0, DDS_MSECS(patience.count()));
    take<takt_msgs_msg_dds__Request_>(reader_, [&](const auto& wire, const dds_sample_info_t& info) {
      Request request{wire.robot, wire.machine, wire.id, printable(wire.verb), info.source_timestamp};
      if (is_for(request, address_)) requests.push_back(std::move(request));
    });
    note_namesakes();
    return requests;
  }

  const Address& address() {
    note_namesakes();
    const auto alive = matched_writers();
    address_.namesakes.clear();
    for (const auto& [writer, machine] : told_)
      if (std::ranges::find(alive, writer) != alive.end()) address_.namesakes.push_back(machine);
    return address_;
  }

 private:
  // Hands over everything that waits in the reader.
  template <class Message, class Each>
  static void take(dds_entity_t reader, const Each& each) {
    void* loan[1] = {nullptr};
    dds_sample_info_t info;
    while (dds_take(reader, loan, &info, 1, 1) > 0) {
      if (info.valid_data) each(*static_cast<const Message*>(loan[0]), info);
      dds_return_loan(reader, loan, 1);
      loan[0] = nullptr;
    }
  }
  // Bounded: a writer that says another name is forgotten, and one that left goes with the next look.
  void note_namesakes() {
    const auto alive = matched_writers();
    std::erase_if(told_, [&](const auto& one) { return std::ranges::find(alive, one.first) == alive.end(); });
    take<takt_msgs_msg_dds__Status_>(others_, [&](const auto& status, const dds_sample_info_t& info) {
      if (status.robot == address_.robot)
        told_.insert_or_assign(info.publication_handle, printable(status.machine));
      else
        told_.erase(info.publication_handle);
    });
  }
  [[nodiscard]] std::vector<dds_instance_handle_t> matched_writers() const {
    constexpr std::size_t kMost = 1024;
    std::vector<dds_instance_handle_t> writers(kMost);
    const auto count = dds_get_matched_publications(others_, writers.data(), kMost);
    writers.resize(std::min(kMost, static_cast<std::size_t>(std::max(0, count))));
    return writers;
  }
  bool keep(dds_entity_t& entity, dds_entity_t created, std::string_view what) {
    entity = created;
    if (created > 0) return true;
    failure_ = domain_->failure(what, created);
    return false;
  }
  [[nodiscard]] dds_entity_t create_topic(const TopicFacts& topic) const {
    return dds_create_topic(domain_->participant(), topic.descriptor, topic.name, nullptr, nullptr);
  }
  void open_readers() {
    const dds_entity_t topic = create_topic(kRequests);
    if (!keep(reader_, dds_create_reader(domain_->participant(), topic, qos_of(kRequests).get(), nullptr),
              kRequests.name))
      return;
    wait_set_ = dds_create_waitset(domain_->participant());
    dds_waitset_attach(wait_set_, dds_create_readcondition(reader_, DDS_ANY_STATE), 0);
    Qos qos = qos_of(kOthers);
    dds_qset_ignorelocal(qos.get(), DDS_IGNORELOCAL_PARTICIPANT);
    keep(others_, dds_create_reader(domain_->participant(), create_topic(kOthers), qos.get(), nullptr), kOthers.name);
  }

  const config::RobotConfig& robot_;
  Address address_;
  std::map<dds_instance_handle_t, std::string> told_;  // machines of writers that said this robot's name
  std::string failure_;
  std::optional<takt::dds::Domain> domain_;
  dds_entity_t reader_ = 0, wait_set_ = 0, others_ = 0;
  std::array<dds_entity_t, kChannelCount> writers_{};
};

std::expected<std::unique_ptr<Participant>, std::string> Participant::open(const config::RobotConfig& robot,
                                                                           const std::string& machine) {
  auto participant = std::unique_ptr<Participant>(new Participant(robot, machine));
  if (std::string failure = participant->entities_->open(); !failure.empty()) return std::unexpected(failure);
  return participant;
}

Participant::Participant(const config::RobotConfig& robot, const std::string& machine)
    : robot_(robot), machine_(machine), entities_(std::make_unique<Entities>(robot, machine)) {}
Participant::~Participant() = default;

bool Participant::write(const JointStates& message) {
  LentJointStates lent;
  lend(message, robot_, lent);
  return entities_->write(Channel::joint_states, &lent.wire);
}

bool Participant::write(const Diagnostics& message) {
  LentDiagnostics lent;
  lend(message, robot_, lent);
  return entities_->write(Channel::diagnostics, &lent.wire);
}

bool Participant::write(const Status& message, const Losses& losses, const RequestAnswer& answer) {
  LentStatus lent;
  lend(message, losses, answer, robot_, machine_, lent);
  return entities_->write(Channel::status, &lent.wire);
}

bool Participant::write(const CommandAge& message) {
  const auto wire = lend(message, robot_);
  return entities_->write(Channel::command_age, &wire);
}

std::vector<Request> Participant::take_requests(std::chrono::milliseconds patience) {
  return entities_->take_requests(patience);
}

const Address& Participant::address() {
  return entities_->address();
}

}  // namespace takt::monitor::dds
