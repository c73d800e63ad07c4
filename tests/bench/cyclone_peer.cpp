// SPDX-License-Identifier: Apache-2.0
// Cyclone DDS over the loopback interface, best effort, keep-last 1, blocking in a wait set: what a ROS 2 node would
// do.
#include <dds/dds.h>

#include <cstdlib>
#include <cstring>
#include <thread>

#include "round_trip.h"
#include "tests/bench/round_trip.hpp"

namespace takt::bench {
namespace {

constexpr dds_domainid_t kDomain = 77;
constexpr const char* kLoopbackOnly =
    "<CycloneDDS><Domain Id='any'><General><Interfaces><NetworkInterface name='lo' multicast='true'/></Interfaces>"
    "</General></Domain></CycloneDDS>";

class CycloneTransport final : public Transport {
 public:
  explicit CycloneTransport(int side) : participant_(dds_create_participant(kDomain, nullptr, nullptr)) {
    dds_qos_t* const qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_BEST_EFFORT, 0);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
    writer_ = dds_create_writer(participant_, topic(side), qos, nullptr);
    reader_ = dds_create_reader(participant_, topic(1 - side), qos, nullptr);
    dds_delete_qos(qos);
    const dds_entity_t condition = dds_create_readcondition(reader_, DDS_ANY_STATE);
    wait_set_ = dds_create_waitset(participant_);
    dds_waitset_attach(wait_set_, condition, 0);
    while (!is_matched()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  ~CycloneTransport() override { dds_delete(participant_); }
  CycloneTransport(const CycloneTransport&) = delete;
  CycloneTransport& operator=(const CycloneTransport&) = delete;

  void send(const Message& message) override { dds_write(writer_, &message); }
  bool receive(Message& message) override {
    for (int attempt = 0; attempt < 2; ++attempt) {
      takt_bench_Message sample{};
      void* samples[1] = {&sample};
      dds_sample_info_t info;
      if (dds_take(reader_, samples, &info, 1, 1) > 0 && info.valid_data) {
        std::memcpy(message.words, sample.words, sizeof message.words);
        return true;
      }
      dds_waitset_wait(wait_set_, nullptr, 0, DDS_MSECS(100));
    }
    return false;
  }

 private:
  dds_entity_t topic(int side) {
    const char* const name = side == 0 ? "takt_bench_measuring" : "takt_bench_echoing";
    return dds_create_topic(participant_, &takt_bench_Message_desc, name, nullptr, nullptr);
  }
  bool is_matched() const {
    dds_publication_matched_status_t published;
    dds_subscription_matched_status_t subscribed;
    dds_get_publication_matched_status(writer_, &published);
    dds_get_subscription_matched_status(reader_, &subscribed);
    return published.current_count > 0 && subscribed.current_count > 0;
  }
  dds_entity_t participant_;
  dds_entity_t writer_ = 0;
  dds_entity_t reader_ = 0;
  dds_entity_t wait_set_ = 0;
};
static_assert(sizeof(takt_bench_Message) == sizeof(Message));

}  // namespace

std::unique_ptr<RoundTrip> cyclone_round_trip(const int (&cpus)[2]) {
  return std::make_unique<RoundTrip>("Cyclone DDS " TAKT_BENCH_CYCLONE, cpus, 1'000, [](int side) {
    setenv("CYCLONEDDS_URI", kLoopbackOnly, 1);
    return std::make_unique<CycloneTransport>(side);
  });
}

}  // namespace takt::bench
