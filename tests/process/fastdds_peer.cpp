// SPDX-License-Identifier: Apache-2.0
#include "tests/process/fastdds_peer.hpp"

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <mutex>
#include <stdexcept>

namespace takt::test {
namespace {

namespace fast = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

constexpr std::uint32_t kMostBytes = 16384;
constexpr int kParticipantsTried = 33;
constexpr int kDepth = 400;

// Bytes in, bytes out, under a name.
class RawType final : public fast::TopicDataType {
 public:
  explicit RawType(const std::string& name) {
    setName(name.c_str());
    m_typeSize = kMostBytes;
    m_isGetKeyDefined = false;
    auto_fill_type_information(false);
    auto_fill_type_object(false);
  }
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const auto& bytes = *static_cast<const Payload*>(data);
    if (bytes.size() > payload->max_size) return false;
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<std::uint32_t>(bytes.size());
    payload->encapsulation = CDR_LE;
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    const auto* const begin = reinterpret_cast<const char*>(payload->data);
    static_cast<Payload*>(data)->assign(begin, begin + payload->length);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<const Payload*>(data)->size()); };
  }
  void* createData() override { return new Payload; }
  void deleteData(void* data) override { delete static_cast<Payload*>(data); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

// Domains up to 100 keep clear of the ports
// that the kernel hands out.
std::uint32_t reserve_domain() {
  for (std::uint32_t domain = 1; domain <= 100; ++domain) {
    const std::string path = testing::TempDir() + "takt-dds-domain-" + std::to_string(domain);
    const int held = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (held >= 0 && flock(held, LOCK_EX | LOCK_NB) == 0) return domain;
    close(held);
  }
  throw std::runtime_error("every DDS domain from 1 to 100 is another test's");
}

// Ports of the first participants of a domain: RTPS 9.6.1.1.
fast::DomainParticipantQos loopback_qos(std::uint32_t domain) {
  fast::DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.emplace_back("127.0.0.1");
  qos.transport().user_transports.push_back(udp);
  for (int index = 0; index < kParticipantsTried; ++index) {
    rtps::Locator_t locator;
    locator.kind = LOCATOR_KIND_UDPv4;
    rtps::IPLocator::setIPv4(locator, 127, 0, 0, 1);
    rtps::IPLocator::setPhysicalPort(
        locator, static_cast<std::uint16_t>(7400 + 250 * static_cast<int>(domain) + 10 + 2 * index));
    qos.wire_protocol().builtin.initialPeersList.push_back(locator);
  }
  return qos;
}

template <class Proxy>
Endpoint endpoint_of(const Proxy& proxy) {
  const auto& user_data = proxy.m_qos.m_userData;
  return {proxy.typeName().to_string(), std::string(user_data.begin(), user_data.end())};
}

}  // namespace

std::uint32_t domain_of_this_test() {
  static const std::uint32_t domain = reserve_domain();
  return domain;
}

class FastDdsPeer::State final : public fast::DomainParticipantListener {
 public:
  explicit State(std::uint32_t domain) {
    auto* const factory = fast::DomainParticipantFactory::get_instance();
    participant = factory->create_participant(domain, loopback_qos(domain), this, fast::StatusMask::none());
    if (participant == nullptr) throw std::runtime_error("Fast DDS gives no participant");
    subscriber = participant->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
    publisher = participant->create_publisher(fast::PUBLISHER_QOS_DEFAULT);
  }
  ~State() override {
    participant->set_listener(nullptr);
    participant->delete_contained_entities();
    fast::DomainParticipantFactory::get_instance()->delete_participant(participant);
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  void on_publisher_discovery(fast::DomainParticipant*, rtps::WriterDiscoveryInfo&& found) override {
    const std::lock_guard lock(mutex);
    writers[found.info.topicName().to_string()] = endpoint_of(found.info);
  }
  void on_subscriber_discovery(fast::DomainParticipant*, rtps::ReaderDiscoveryInfo&& found) override {
    const std::lock_guard lock(mutex);
    readers[found.info.topicName().to_string()] = endpoint_of(found.info);
  }
  fast::Topic* topic(const std::string& name, const std::string& type) {
    fast::TypeSupport support(new RawType(type));
    support.register_type(participant);
    return participant->create_topic(name, type, fast::TOPIC_QOS_DEFAULT);
  }

  fast::DomainParticipant* participant = nullptr;
  fast::Subscriber* subscriber = nullptr;
  fast::Publisher* publisher = nullptr;
  std::map<std::string, fast::DataReader*> listening;
  std::map<std::string, fast::DataWriter*> offering;
  std::map<std::string, std::vector<Payload>> received;
  std::mutex mutex;
  std::map<std::string, Endpoint> writers, readers;  // guarded
};

FastDdsPeer::FastDdsPeer(std::uint32_t domain) : state_(std::make_unique<State>(domain)) {}
FastDdsPeer::~FastDdsPeer() = default;

void FastDdsPeer::listen(const std::string& topic, const std::string& type) {
  fast::DataReaderQos qos = fast::DATAREADER_QOS_DEFAULT;
  qos.reliability().kind = fast::RELIABLE_RELIABILITY_QOS;
  qos.history().depth = kDepth;
  qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  state_->listening[topic] = state_->subscriber->create_datareader(state_->topic(topic, type), qos);
}

const std::vector<Payload>& FastDdsPeer::received(const std::string& topic) {
  auto& all = state_->received[topic];
  Payload payload;
  fast::SampleInfo info;
  while (state_->listening.at(topic)->take_next_sample(&payload, &info) == ReturnCode_t::RETCODE_OK) {
    if (info.valid_data) all.push_back(payload);
  }
  return all;
}

void FastDdsPeer::offer(const std::string& topic, const std::string& type) {
  fast::DataWriterQos qos = fast::DATAWRITER_QOS_DEFAULT;
  qos.reliability().kind = fast::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = fast::VOLATILE_DURABILITY_QOS;
  qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  state_->offering[topic] = state_->publisher->create_datawriter(state_->topic(topic, type), qos);
}

bool FastDdsPeer::is_matched(const std::string& offered_topic) const {
  fast::PublicationMatchedStatus status;
  state_->offering.at(offered_topic)->get_publication_matched_status(status);
  return status.current_count > 0;
}

bool FastDdsPeer::send(const std::string& offered_topic, const Payload& payload) {
  Payload copy = payload;
  return state_->offering.at(offered_topic)->write(&copy);
}

bool FastDdsPeer::send_as_of(std::int64_t unix_ns, const std::string& offered_topic, const Payload& payload) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  Payload copy = payload;
  eprosima::fastrtps::rtps::WriteParams params;
  params.source_timestamp(
      {static_cast<std::int32_t>(unix_ns / kSecond), static_cast<std::uint32_t>(unix_ns % kSecond)});
  return state_->offering.at(offered_topic)->write(&copy, params);
}

std::map<std::string, Endpoint> FastDdsPeer::writers() const {
  const std::lock_guard lock(state_->mutex);
  return state_->writers;
}

std::map<std::string, Endpoint> FastDdsPeer::readers() const {
  const std::lock_guard lock(state_->mutex);
  return state_->readers;
}

}  // namespace takt::test
