// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/imu_link.hpp"

#include <spdlog/spdlog.h>

#include <cstring>
#include <span>
#include <utility>

#include "executive/contract/imu_of_sample.hpp"
#include "executive/ipc/executive_segments.hpp"

namespace takt::runtime {
namespace {

constexpr Duration kRetry = milliseconds(500);

Hello reader_hello() {
  Hello hello;
  hello.role = Role::sensor_reader;
  std::strncpy(hello.program, "takt-executive", sizeof hello.program - 1);
  return hello;
}

}  // namespace

void ImuMailbox::read(ImuSample& sample) noexcept {
  SensorSample newest;
  const auto result = reader.read_latest(std::as_writable_bytes(std::span(&newest, 1)));
  if (result.status != ipc::ReadStatus::fresh || result.size != sizeof newest || newest.value_count != kImuValues)
    return;
  sample = imu_of(newest);
}

std::string ImuLink::attach() {
  auto lease = ipc::attach(socket_, reader_hello(), kImuAttachTimeout);
  if (!lease) return lease.error();
  if (lease->descriptors.empty()) return socket_ + ": the sensor handed out no mailbox";
  auto segment = ipc::Segment::adopt_read_only(lease->descriptors[0].release(), ipc::ring_bytes(ipc::sensor_mailbox()));
  if (!segment) return segment.error();
  auto reader = ipc::SlotReader::attach(segment->readable(), ipc::sensor_mailbox());
  if (!reader) return reader.error();
  mailboxes_.want(std::make_unique<ImuMailbox>(std::move(*segment), *reader));
  lease_ = std::make_unique<ipc::Lease>(std::move(*lease));
  return {};
}

void ImuLink::serve(MonoTime now) {
  mailboxes_.settle();
  if (lease_ && ipc::is_over(*lease_)) {
    lease_.reset();
    mailboxes_.want(nullptr);
    spdlog::warn("IMU: sensor {}'s process went away", sensor_);
  }
  if (lease_ || now < next_attempt_) return;
  next_attempt_ = now + kRetry;
  const std::string problem = attach();
  if (problem.empty()) spdlog::info("IMU: attached to sensor {}", sensor_);
  if (!problem.empty() && problem != said_) spdlog::warn("IMU: sensor {}: {}", sensor_, problem);
  said_ = problem;
}

}  // namespace takt::runtime
