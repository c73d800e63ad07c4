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
  in >> out.robot >> out.running >> out.tick >> out.mode >> out.cause >> out.detail >> out.freshness >> out.age_ns >>
      out.window_misses >> out.window_ticks >> out.skipped_periods >> out.overruns >> out.refused_commands >>
      out.integration_errors >> out.command_sequence >> out.observation_answered >> out.drives_enabled >>
      out.causes_active >> out.lost_joint_states >> out.lost_diagnostics >> out.lost_status >> out.lost_command_ages >>
      out.request_id >> out.request_verb >> out.request_done >> out.request_answer;
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

Payload encode_request(const std::string& robot, std::uint64_t id, const std::string& verb) {
  Payload bytes(4 + 64 + robot.size() + verb.size());
  FastBuffer buffer(bytes.data(), bytes.size());
  Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  cdr << robot << id << verb;
  bytes.resize(cdr.getSerializedDataLength());
  return bytes;
}

}  // namespace takt::test
