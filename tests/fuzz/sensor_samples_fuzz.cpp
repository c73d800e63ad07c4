// SPDX-License-Identifier: Apache-2.0
// Any answer of a sensor's process, and any bytes in its mailbox: what may drive the robot afterwards is whole, finite,
// within limits and no younger than it can be. Method: a stranger serves a mailbox that an honest writer made and the
// input spoiled, of values, of a person's command, of images and of an IMU.
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/load.hpp"
#include "executive/contract/image_sample.hpp"
#include "executive/contract/imu.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "executive/runtime/imu_link.hpp"
#include "policy_host/sensor_link.hpp"
#include "tests/fuzz/peer.hpp"
#include "tests/fuzz/refused_with_a_sentence.hpp"
#include "tests/fuzz/scratch.hpp"
#include "tests/fuzz/source.hpp"

namespace {

using namespace takt;
using fuzz::require;
using fuzz::Source;

constexpr MonoTime kNow{10'000'000'000};

const config::RobotConfig& robot() {
  static const config::RobotConfig one = config::load("config/balancer.yaml").value();
  return one;
}

// A mailbox as a sensor's process leaves it: an honest ring, spoilt samples in it, and spoilt itself.
std::optional<ipc::Segment> spoilt_mailbox(Source& source, const ipc::RingShape& shape, std::uint32_t values) {
  auto segment = ipc::Segment::create("takt-fuzz", ipc::ring_bytes(shape), true);
  if (!segment) return std::nullopt;
  ipc::SlotWriter writer(segment->writable(), shape);
  for (int left = source.byte() % 4; left > 0; --left) {
    if (values == 0) {
      std::vector<std::byte> image(shape.payload_capacity);
      ImageHeader header{static_cast<std::uint64_t>(left), kNow, kNow,
                         static_cast<std::uint32_t>(image.size() - sizeof(ImageHeader)), 0};
      source.spoil(header);
      std::memcpy(image.data(), &header, sizeof header);
      writer.publish(std::span(image).first(image.size() - source.byte() % 4));
      continue;
    }
    SensorSample sample{.sequence = 1, .sensed_at = kNow, .published_at = kNow, .value_count = values};
    source.spoil(sample);
    writer.publish(std::as_bytes(std::span(&sample, 1)).first(sizeof sample - source.byte() % 2));
  }
  for (int left = source.byte() % 8; left > 0; --left)
    segment->writable()[source.value<std::uint16_t>() % segment->size()] = std::byte{source.byte()};
  if (source.byte() % 4 != 0) require(segment->seal_against_new_writers().has_value());
  return std::move(*segment);
}

// Serves `mailbox` while `read` reads.
template <class Read>
void with_a_sensor(Source& source, const ipc::Segment& mailbox, const std::string& path, const Read& read) {
  Welcome welcome;
  welcome.status = WelcomeStatus::accepted;
  welcome.descriptor_count = 1;
  source.spoil(welcome);
  const fuzz::Peer peer(fuzz::listening(path, SOCK_SEQPACKET), [&](int socket) {
    if (!fuzz::hears(socket)) return;
    const std::array files{mailbox.fd()};
    (void)ipc::send_message(socket, std::as_bytes(std::span(&welcome, 1)), files);
    (void)fuzz::hears(socket);
  });
  read();
}

void read_values(Source& source) {
  const std::size_t which = source.byte() % robot().sensors.size();
  const config::Sensor& sensor = robot().sensors[which];
  const auto mailbox = spoilt_mailbox(source, policy_host::mailbox_of(sensor), sensor.values);
  if (!mailbox) return;
  const std::string path = fuzz::scratch_folder() + "/sensor.sock";
  std::vector<SensorSample> seen(robot().sensors.size()), used(robot().sensors.size());
  with_a_sensor(source, *mailbox, path, [&] {
    policy_host::SensorLink link(path, Hello{}, policy_host::mailbox_of(sensor));
    link.update(kNow, seen[which]);
    link.update(kNow, seen[which]);
    if (!link.problem().empty()) fuzz::require_sentence(link.problem());
    SensorSample next;
    for (int i = 0; i < 4; ++i) (void)link.next(std::as_writable_bytes(std::span(&next, 1)));
  });
  const SampleVerdict verdict = policy_host::judge(sensor, seen[which], kNow);
  require((verdict == SampleVerdict::usable) == policy_host::sentence_of(verdict, robot(), sensor).empty());
  const std::array in_use{which};
  if (!policy_host::take_usable(robot(), in_use, seen, kNow, used).empty()) return;
  const SensorSample& taken = used[which];
  require(taken.value_count == sensor.values && taken.sensed_at <= kNow && taken.sensed_at >= kNow - sensor.timeout);
  for (std::size_t i = 0; i < sensor.values; ++i) {
    require(std::isfinite(taken.values[i]));
    require(!sensor.command || (taken.values[i] >= static_cast<float>(sensor.command->minimum[i]) &&
                                taken.values[i] <= static_cast<float>(sensor.command->maximum[i])));
  }
}

void read_image(Source& source) {
  static const config::Sensor camera{.name = "eye", .timeout = seconds(1), .image = config::ImageShape{2, 3, 1}};
  const auto mailbox = spoilt_mailbox(source, policy_host::mailbox_of(camera), 0);
  if (!mailbox) return;
  const std::string path = fuzz::scratch_folder() + "/sensor.sock";
  with_a_sensor(source, *mailbox, path, [&] {
    policy_host::SensorLink link(path, Hello{}, policy_host::mailbox_of(camera));
    std::vector<std::byte> image(policy_host::image_bytes(camera));
    SensorSample sample;
    link.update(kNow, sample, image);
    ImageHeader header;
    std::memcpy(&header, image.data(), sizeof header);
    require(sample.sequence == 0 || header.bytes == camera.image->bytes());
    (void)policy_host::judge(camera, sample, kNow);
  });
}

void read_imu(Source& source) {
  const auto segment = spoilt_mailbox(source, ipc::sensor_mailbox(), kImuValues);
  if (!segment) return;
  auto reader = ipc::SlotReader::attach(segment->readable(), ipc::sensor_mailbox());
  fuzz::check_refusal(reader);
  if (!reader) return;
  auto adopted = ipc::Segment::create("takt-fuzz", 1, false);  // the reader's memory is the writer's here
  require(adopted.has_value());
  runtime::ImuMailbox mailbox{std::move(*adopted), *reader};
  ImuSample sample;
  for (int i = 0; i < 4; ++i) mailbox.read(sample);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Source source({data, size});
  switch (source.byte() % 4) {
    case 0:
      read_image(source);
      break;
    case 1:
      read_imu(source);
      break;
    default:
      read_values(source);
  }
  return 0;
}
