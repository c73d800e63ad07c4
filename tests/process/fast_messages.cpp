// SPDX-License-Identifier: Apache-2.0
#include "tests/process/fast_messages.hpp"

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <stdexcept>

namespace takt::test {
namespace {

using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;

// Reads one payload from front to end.
class Reading {
 public:
  explicit Reading(const Payload& payload)
      : bytes_(payload), buffer_(bytes_.data(), bytes_.size()), cdr_(buffer_, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR) {
    cdr_.read_encapsulation();
  }
  template <class T>
  Reading& operator>>(T& value) {
    cdr_ >> value;
    return *this;
  }
  std::int64_t time() {
    std::int32_t sec = 0;
    std::uint32_t nanosec = 0;
    cdr_ >> sec >> nanosec;
    return std::int64_t{sec} * 1'000'000'000 + nanosec;
  }
  // Writers may pad the payload to a whole word.
  void end() {
    constexpr std::size_t kMostPadding = 3;
    if (cdr_.getSerializedDataLength() + kMostPadding < bytes_.size())
      throw std::runtime_error("the payload is longer than the message");
  }

 private:
  Payload bytes_;
  FastBuffer buffer_;
  Cdr cdr_;
};

}  // namespace

FastJointState decode_joint_state(const Payload& payload) {
  Reading in(payload);
  FastJointState out;
  out.unix_ns = in.time();
  in >> out.frame_id >> out.name >> out.position >> out.velocity >> out.effort;
  in.end();
  return out;
}

std::vector<FastDiagnostic> decode_diagnostics(const Payload& payload) {
  Reading in(payload);
  (void)in.time();
  std::string frame_id;
  std::uint32_t parts = 0;
  in >> frame_id >> parts;
  std::vector<FastDiagnostic> out;
  for (std::uint32_t part = 0; part < parts; ++part) {
    FastDiagnostic& one = out.emplace_back();
    std::uint32_t values = 0;
    in >> one.level >> one.name >> one.message >> one.hardware_id >> values;
    for (std::uint32_t value = 0; value < values; ++value) {
      auto& [key, text] = one.values.emplace_back();
      in >> key >> text;
    }
  }
  in.end();
  return out;
}

FastStatus decode_status(const Payload& payload) {
  Reading in(payload);
  FastStatus out;
  out.unix_ns = in.time();
  in >> out.robot >> out.machine >> out.running >> out.tick >> out.mode >> out.cause >> out.detail >> out.freshness >>
      out.age_ns >> out.window_misses >> out.window_ticks >> out.skipped_periods >> out.overruns >>
      out.refused_commands >> out.integration_errors >> out.command_sequence >> out.observation_answered >>
      out.drives_enabled >> out.causes_active >> out.lost_joint_states >> out.lost_diagnostics >> out.lost_status >>
      out.lost_command_ages >> out.request_id >> out.request_verb >> out.request_done >> out.request_answer;
  in.end();
  return out;
}

FastCommandAge decode_command_age(const Payload& payload) {
  Reading in(payload);
  FastCommandAge out;
  out.unix_ns = in.time();
  in >> out.robot >> out.tick >> out.command_sequence >> out.observation_id >> out.sense_ns >> out.queue_ns >>
      out.infer_ns >> out.publish_ns >> out.hold_ns >> out.total_ns;
  in.end();
  return out;
}

namespace {

// One payload, written from front to end.
class Writing {
 public:
  Writing() : buffer_(), cdr_(buffer_, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR) { cdr_.serialize_encapsulation(); }
  template <class T>
  Writing& operator<<(const T& value) {
    cdr_ << value;
    return *this;
  }
  Writing& header(std::int64_t unix_ns) {
    cdr_ << static_cast<std::int32_t>(unix_ns / 1'000'000'000) << static_cast<std::uint32_t>(unix_ns % 1'000'000'000)
         << std::string("frame");
    return *this;
  }
  Payload bytes() { return {buffer_.getBuffer(), buffer_.getBuffer() + cdr_.getSerializedDataLength()}; }

 private:
  FastBuffer buffer_;
  Cdr cdr_;
};

}  // namespace

Payload encode_request(const std::string& robot, std::uint64_t id, const std::string& verb,
                       const std::string& machine) {
  Writing out;
  out << robot << machine << id << verb;
  return out.bytes();
}

Payload encode_status(const FastStatus& status) {
  Writing out;
  out << static_cast<std::int32_t>(status.unix_ns / 1'000'000'000)
      << static_cast<std::uint32_t>(status.unix_ns % 1'000'000'000) << status.robot << status.machine << status.running
      << status.tick << status.mode << status.cause << status.detail << status.freshness << status.age_ns
      << status.window_misses << status.window_ticks << status.skipped_periods << status.overruns
      << status.refused_commands << status.integration_errors << status.command_sequence << status.observation_answered
      << status.drives_enabled << status.causes_active << status.lost_joint_states << status.lost_diagnostics
      << status.lost_status << status.lost_command_ages << status.request_id << status.request_verb
      << status.request_done << status.request_answer;
  return out.bytes();
}

Payload encode_image(const FastImage& image) {
  Writing out;
  out.header(image.unix_ns) << image.height << image.width << image.encoding << std::uint8_t{0} << image.step
                            << image.data;
  return out.bytes();
}

Payload encode_imu(std::int64_t unix_ns, const std::vector<double>& ten) {
  Writing out;
  out.header(unix_ns);
  const auto covariance = [&out] {
    for (int i = 0; i < 9; ++i) out << 0.01;
  };
  for (std::size_t i = 0; i < 10; ++i) {
    out << ten.at(i);
    if (i == 3 || i == 6 || i == 9) covariance();
  }
  return out.bytes();
}

Payload encode_joint_state(const FastJointState& state) {
  Writing out;
  out.header(state.unix_ns) << state.name << state.position << state.velocity << state.effort;
  return out.bytes();
}

Payload encode_twist(const std::vector<double>& six) {
  Writing out;
  for (const double value : six) out << value;
  return out.bytes();
}

}  // namespace takt::test
