// SPDX-License-Identifier: Apache-2.0
#include "sensors/ros/ros_topic_reader.hpp"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <cstring>

#include "dds/type_hash.hpp"
#include "executive/contract/image_sample.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "sensors/ros/ros_sample.hpp"

namespace takt::sensors {
namespace {

constexpr std::int32_t kImages = 5;     // rmw_qos_profile_sensor_data
constexpr std::int32_t kSamples = 128;  // small ones: a moment in which this process does not run loses none

struct TypeFacts {
  const char* name;
  const dds_topic_descriptor_t* descriptor;
};

TypeFacts facts_of(config::RosType type) {
  switch (type) {
    case config::RosType::image:
      return {"sensor_msgs/msg/Image", &sensor_msgs_msg_dds__Image__desc};
    case config::RosType::imu:
      return {"sensor_msgs/msg/Imu", &sensor_msgs_msg_dds__Imu__desc};
    case config::RosType::joint_state:
      return {"sensor_msgs/msg/JointState", &sensor_msgs_msg_dds__JointState__desc};
    case config::RosType::twist:
      break;
  }
  return {"geometry_msgs/msg/Twist", &geometry_msgs_msg_dds__Twist__desc};
}

Arrival now_by_both_clocks(const WaitStart& waits) {
  const MonoTime at = monotonic_now();
  timespec time{};
  clock_gettime(CLOCK_REALTIME, &time);
  return {waits.taken(at), std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec};
}

// Unix ns; 0: there is none.
std::int64_t stamp_in(config::RosType type, const void* message) {
  switch (type) {
    case config::RosType::image:
      return stamp_of(static_cast<const sensor_msgs_msg_dds__Image_*>(message)->header);
    case config::RosType::imu:
      return stamp_of(static_cast<const sensor_msgs_msg_dds__Imu_*>(message)->header);
    case config::RosType::joint_state:
      return stamp_of(static_cast<const sensor_msgs_msg_dds__JointState_*>(message)->header);
    case config::RosType::twist:
      break;
  }
  return 0;
}

RosResult values_of(config::RosType type, const void* message, const config::Sensor& sensor, RosValues& values) {
  if (type == config::RosType::imu)
    return take(*static_cast<const sensor_msgs_msg_dds__Imu_*>(message), sensor, values);
  if (type == config::RosType::joint_state)
    return take(*static_cast<const sensor_msgs_msg_dds__JointState_*>(message), sensor, values);
  return take(*static_cast<const geometry_msgs_msg_dds__Twist_*>(message), sensor, values);
}

}  // namespace

std::expected<std::unique_ptr<RosTopicReader>, std::string> RosTopicReader::open(const dds::Domain& domain,
                                                                                 const config::Sensor& sensor,
                                                                                 ipc::SensorServer& server) {
  const TypeFacts facts = facts_of(sensor.ros->type);
  const dds::Qos qos = dds::make_qos();
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_BEST_EFFORT, 0);
  dds_qset_durability(qos.get(), DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, sensor.image ? kImages : kSamples);
  const std::string hash = dds::user_data(facts.name);
  dds_qset_userdata(qos.get(), hash.data(), hash.size());
  const std::string topic_name = "rt" + sensor.ros->topic;
  const dds_entity_t topic =
      dds_create_topic(domain.participant(), facts.descriptor, topic_name.c_str(), nullptr, nullptr);
  if (topic <= 0) return std::unexpected(domain.failure(topic_name, topic));
  auto made = std::unique_ptr<RosTopicReader>(new RosTopicReader(sensor, server));
  made->reader_ = dds_create_reader(domain.participant(), topic, qos.get(), nullptr);
  if (made->reader_ <= 0) return std::unexpected(domain.failure(topic_name, made->reader_));
  return made;
}

void RosTopicReader::take_all(const WaitStart& waits) {
  void* loan[1] = {nullptr};
  dds_sample_info_t info;
  while (dds_take(reader_, loan, &info, 1, 1) > 0) {
    if (info.valid_data) take_one(loan[0], info.source_timestamp, waits);
    dds_return_loan(reader_, loan, 1);
    loan[0] = nullptr;
  }
}

void RosTopicReader::take_one(const void* message, std::int64_t source_unix_ns, const WaitStart& waits) {
  const Arrival arrival = now_by_both_clocks(waits);
  const MonoTime now = arrival.heard.at;
  const SensedAt sensed = clock_.take({stamp_in(sensor_.ros->type, message), source_unix_ns}, arrival);
  if (sensed.ahead > Duration{}) ++counts_.ahead;
  if (heard_.is_set() && now - heard_ > sensor_.timeout) ++counts_.pauses;
  heard_ = now;
  if (arrival.heard.since - sensed.at > sensor_.timeout)
    old_.say(now,
             fmt::format("{}: stamped more than the sensor's timeout before they arrive; is it this machine's clock, "
                         "and not that of a simulation (use_sim_time)?",
                         sensor_.ros->topic));
  const auto published = publish(message, sensed.at);
  if (published) {
    if (++counts_.samples == 1) spdlog::info("{} is heard, for sensor {}", sensor_.ros->topic, sensor_.name);
    complaint_.forget();
    return;
  }
  ++counts_.refused;
  complaint_.say(
      now, fmt::format("{}: {}: not passed on to sensor {}", sensor_.ros->topic, published.error(), sensor_.name));
}

std::expected<void, std::string> RosTopicReader::publish(const void* message, MonoTime sensed) {
  if (sensor_.image) {
    const std::span<std::byte> slot = server_.begin();
    const auto pixels = slot.subspan(sizeof(ImageHeader), sensor_.image->bytes());
    if (auto taken = take_image(*static_cast<const sensor_msgs_msg_dds__Image_*>(message), sensor_, pixels); !taken)
      return taken;
    const ImageHeader header{++sequence_, sensed, monotonic_now(), sensor_.image->bytes(), 0};
    std::memcpy(slot.data(), &header, sizeof header);
    server_.commit(sizeof header + pixels.size());
    return {};
  }
  RosValues values;
  if (auto taken = values_of(sensor_.ros->type, message, sensor_, values); !taken) return taken;
  SensorSample sample;
  sample.sequence = ++sequence_;
  sample.sensed_at = sensed;
  sample.published_at = monotonic_now();
  sample.value_count = static_cast<std::uint32_t>(values.count);
  std::copy_n(values.at.begin(), values.count, sample.values);
  server_.publish(sample);
  return {};
}

void RosTopicReader::report() {
  const bool same =
      counts_.refused == reported_.refused && counts_.pauses == reported_.pauses && counts_.ahead == reported_.ahead;
  if (same) return;
  spdlog::warn(
      "{}: of {} samples so far: {} stamped after they arrived; {} messages refused, {} pauses beyond {:.0f} ms",
      sensor_.ros->topic, counts_.samples, counts_.ahead, counts_.refused, counts_.pauses,
      sensor_.timeout.milliseconds());
  reported_ = counts_;
}

}  // namespace takt::sensors
