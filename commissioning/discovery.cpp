// SPDX-License-Identifier: Apache-2.0
#include "commissioning/discovery.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdio>
#include <cstring>
#include <numeric>

#include "drivers/protocol/cia402/cia402_codec.hpp"
#include "drivers/protocol/little_endian.hpp"
#include "drivers/protocol/mit/mit_codec.hpp"
#include "drivers/protocol/odrive/odrive_codec.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "drivers/protocol/robstride/robstride_codec.hpp"

namespace takt::commissioning {
namespace {

std::string hex(std::uint32_t value) {
  std::array<char, 16> digits{};
  std::snprintf(digits.data(), digits.size(), "0x%X", value);
  return digits.data();
}

std::string decimal(double value) {
  std::array<char, 32> digits{};
  std::snprintf(digits.data(), digits.size(), "%g", value);
  return digits.data();
}

// --- MIT: Damiao drives answer questions for their registers, on their reply id, wherever that is ---

constexpr std::uint32_t kDamiaoRegisters = 0x7FF, kDisabled = 0x100;
constexpr std::uint8_t kRead = 0x33, kControlMode = 10, kPositionRange = 21, kVelocityRange = 22, kTorqueRange = 23;

std::vector<drivers::CanFrame> ask_mit(std::uint32_t id) {
  std::vector<drivers::CanFrame> frames;
  for (const std::uint8_t which : {kControlMode, kPositionRange, kVelocityRange, kTorqueRange}) {
    drivers::CanFrame frame;
    frame.id = kDamiaoRegisters;
    frame.length = 8;
    frame.data[0] = static_cast<std::uint8_t>(id & 0xFFU);
    frame.data[1] = static_cast<std::uint8_t>(id >> 8U);
    frame.data[2] = kRead;
    frame.data[3] = which;
    frames.push_back(frame);
  }
  return frames;
}

// What RobStride says to everybody ends in FE too.
bool is_other_ak_protocol(const drivers::CanFrame& frame) {
  const std::uint32_t id = frame.id & 0xFFU;
  return id != 0xFE && drivers::is_ak_v3_feedback(id, frame);
}

std::optional<Found> read_mit(const drivers::CanFrame& frame) {
  if (is_other_ak_protocol(frame))
    return Found{.id = frame.id & 0xFFU,
                 .what = "speaks the protocol of AK V3 firmware or servo mode, which Takt does not",
                 .other_protocol = "that of AK V3 firmware or servo mode"};
  if (!frame.extended && !frame.fd && frame.length == 6)
    return Found{frame.data[0], "T-Motor reply on " + hex(frame.id), kDisabled};
  if (drivers::is_robstride_reply(frame.data[0], frame))
    return Found{frame.data[0], "RobStride in MIT protocol, replies on " + hex(frame.id), kDisabled};
  if (frame.extended || frame.length != 8 || frame.id == kDamiaoRegisters || frame.data[2] != kRead)
    return std::nullopt;
  const std::uint32_t id = frame.data[0] | static_cast<std::uint32_t>(frame.data[1]) << 8U;
  const std::uint32_t bits = drivers::get_u32(frame.data + 4);
  const auto number = static_cast<double>(std::bit_cast<float>(bits));
  switch (frame.data[3]) {
    case kControlMode:
      return Found{id, "replies on " + hex(frame.id) + ", control mode " + std::to_string(bits), kControlMode};
    case kPositionRange:
      return Found{id, "PMAX " + decimal(number) + " rad", kPositionRange};
    case kVelocityRange:
      return Found{id, "VMAX " + decimal(number) + " rad/s", kVelocityRange};
    case kTorqueRange:
      return Found{id, "TMAX " + decimal(number) + " Nm", kTorqueRange};
    default:
      return std::nullopt;
  }
}

// --- RobStride: "get id" is answered with the drive's number and its unique id ---

constexpr std::uint32_t kIdentity = 0, kAnswerTarget = 0xFE, kOurNumber = 0xFD;

std::vector<drivers::CanFrame> ask_robstride(std::uint32_t id) {
  drivers::CanFrame frame;
  frame.id = kIdentity << 24U | kOurNumber << 8U | id;
  frame.extended = true;
  frame.length = 8;
  return {frame};
}

std::optional<Found> read_robstride(const drivers::CanFrame& frame) {
  if (!frame.extended || frame.fd || frame.length != 8) return std::nullopt;
  if (frame.id >> 24U != kIdentity || (frame.id & 0xFFU) != kAnswerTarget) return std::nullopt;
  std::string unique = "unique id ";
  for (std::size_t i = 0; i < 8; ++i) {
    std::array<char, 4> byte{};
    std::snprintf(byte.data(), byte.size(), "%02X", frame.data[i]);
    unique += byte.data();
  }
  return Found{frame.id >> 8U & 0xFFFFU, unique, kIdentity};
}

// --- ODrive: heartbeats come by themselves ---

constexpr std::uint32_t kOdriveVersion = 0;

std::optional<Found> read_odrive(const drivers::CanFrame& frame) {
  const std::uint32_t node = frame.id >> 5U;
  const auto heartbeat = drivers::decode_odrive_heartbeat(node, frame);
  if (const auto version = drivers::decode_odrive_version(node, frame); version && (frame.id & 0x1FU) == 0)
    return Found{node, "firmware " + drivers::text_of({{version->firmware}, 1}, drivers::WordStyle::version),
                 kOdriveVersion};
  if (!heartbeat) return std::nullopt;
  return Found{node, "axis state " + std::to_string(heartbeat->axis_state) +
                         (heartbeat->axis_error == 0 ? "" : ", errors " + hex(heartbeat->axis_error))};
}

// --- moteus: registers 000 mode and 00F fault, read as int8 ---

std::vector<drivers::CanFrame> ask_moteus(std::uint32_t id) {
  drivers::CanFrame frame;
  frame.id = 0x8000U | id;
  frame.extended = frame.fd = frame.bit_rate_switch = true;
  frame.length = 4;
  constexpr std::array<std::uint8_t, 4> kReadBoth{0x11, 0x00, 0x11, 0x0F};
  std::ranges::copy(kReadBoth, frame.data);
  return {frame};
}

std::optional<Found> read_moteus(const drivers::CanFrame& frame) {
  const std::uint32_t id = frame.id >> 8U;
  const bool to_us = (frame.id & 0xFFU) == 0 && id >= 1 && id <= 127;
  if (!frame.fd || !to_us || frame.length < 6 || frame.data[0] != 0x21 || frame.data[1] != 0) return std::nullopt;
  const bool has_fault = frame.data[3] == 0x21 && frame.data[4] == 0x0F && frame.data[5] != 0;
  return Found{id,
               "mode " + std::to_string(frame.data[2]) +
                   (has_fault ? ", fault " + std::to_string(frame.data[5]) : std::string()),
               0};
}

// --- CiA 402: identity objects of CiA 301 over SDO ---

constexpr drivers::cia402::ObjectId kDeviceType{0x1000, 0}, kVendor{0x1018, 1}, kRevision{0x1018, 3};

std::vector<drivers::CanFrame> ask_cia402(std::uint32_t id) {
  return {drivers::cia402::encode_sdo_read(id, kDeviceType), drivers::cia402::encode_sdo_read(id, kVendor),
          drivers::cia402::encode_sdo_read(id, kRevision)};
}

std::optional<Found> read_cia402(const drivers::CanFrame& frame) {
  if (frame.extended || frame.fd || frame.id <= drivers::cia402::kSdoAnswerId ||
      frame.id > drivers::cia402::kSdoAnswerId + 127)
    return std::nullopt;
  const auto answer = drivers::cia402::decode_sdo_answer(frame);
  if (!answer) return std::nullopt;
  Found found{.id = frame.id - drivers::cia402::kSdoAnswerId,
              .what = {},
              .question = answer->object.index << 8U | answer->object.sub};
  if (answer->kind != drivers::cia402::SdoAnswer::Kind::value) return found;
  if (answer->object == kDeviceType)
    found.what = (answer->value & 0xFFFFU) == 402 ? "CiA 402 drive" : "device type " + hex(answer->value);
  if (answer->object == kVendor) found.what = "vendor " + hex(answer->value);
  if (answer->object == kRevision) found.what = "revision " + hex(answer->value);
  return found;
}

}  // namespace

std::vector<drivers::CanFrame> questions_to(config::DriveProtocol protocol, std::uint32_t id) {
  switch (protocol) {
    case config::DriveProtocol::mit:
      return ask_mit(id);
    case config::DriveProtocol::robstride:
      return ask_robstride(id);
    case config::DriveProtocol::odrive:
      return {};
    case config::DriveProtocol::moteus:
      return ask_moteus(id);
    case config::DriveProtocol::cia402:
      return ask_cia402(id);
  }
  return {};
}

std::vector<drivers::CanFrame> own_questions(const config::Drive& drive, const config::Bus& bus) {
  if (drive.protocol == config::DriveProtocol::odrive) return {drivers::odrive_get_version(drive.id)};
  if (drive.protocol != config::DriveProtocol::mit) return {};
  if (drive.variant != "damiao") {
    drivers::CanFrame frame;
    frame.id = drive.id;
    frame.length = 8;
    std::ranges::copy(drivers::encode_mit_special(drivers::MitSpecial::exit_motor_mode), frame.data);
    return {frame};
  }
  if (!bus.fd) return {};
  std::vector<drivers::CanFrame> frames = ask_mit(drive.id);
  for (drivers::CanFrame& frame : frames) frame.fd = frame.bit_rate_switch = true;
  return frames;
}

std::optional<Found> read_answer(config::DriveProtocol protocol, const drivers::CanFrame& frame) {
  if (frame.remote || frame.error) return std::nullopt;
  switch (protocol) {
    case config::DriveProtocol::mit:
      return read_mit(frame);
    case config::DriveProtocol::robstride:
      return read_robstride(frame);
    case config::DriveProtocol::odrive:
      return read_odrive(frame);
    case config::DriveProtocol::moteus:
      return read_moteus(frame);
    case config::DriveProtocol::cia402:
      return read_cia402(frame);
  }
  return std::nullopt;
}

namespace {

drivers::CanFrame robstride_frame(const config::Drive& drive, std::uint32_t type) {
  drivers::CanFrame frame;
  frame.id = type << 24U | drive.host_id << 8U | drive.id;
  frame.extended = true;
  frame.length = 8;
  return frame;
}

std::vector<drivers::CanFrame> robstride_zero_frames(const config::Drive& drive) {
  constexpr std::uint32_t kSetZero = 6, kSave = 22;
  drivers::CanFrame zero = robstride_frame(drive, kSetZero);
  zero.data[0] = 1;
  drivers::CanFrame save = robstride_frame(drive, kSave);
  std::iota(save.data, save.data + save.length, std::uint8_t{1});
  return {zero, save};
}

}  // namespace

std::vector<drivers::CanFrame> zero_frames(const config::Drive& drive) {
  drivers::CanFrame frame;
  frame.length = 8;
  switch (drive.protocol) {
    case config::DriveProtocol::mit:
      if (drive.variant == "robstride") return {};  // cannot be told to keep it, and loses it with its supply
      frame.id = drive.id;
      std::ranges::copy(drivers::encode_mit_special(drivers::MitSpecial::set_zero), frame.data);
      return {frame};
    case config::DriveProtocol::robstride:
      return robstride_zero_frames(drive);
    case config::DriveProtocol::odrive:
    case config::DriveProtocol::moteus:
    case config::DriveProtocol::cia402:
      return {};
  }
  return {};
}

BusScan::BusScan(const std::set<config::DriveProtocol>& protocols, std::uint32_t first, std::uint32_t last)
    : protocols_(protocols), first_(first), last_(last) {
  for (const config::DriveProtocol protocol : protocols_) {
    for (std::uint32_t id = first_; id <= last_; ++id) {
      const auto asked = questions_to(protocol, id);
      questions_.insert(questions_.end(), asked.begin(), asked.end());
    }
  }
}

void BusScan::also_ask(const drivers::CanFrame& question) {
  questions_.push_back(question);
}

std::optional<drivers::CanFrame> BusScan::next_question() {
  if (asked_ == questions_.size()) return std::nullopt;
  return questions_[asked_++];
}

// An ODrive's heartbeat is known by its id alone, which may be another's answer: it comes last.
constexpr std::array kMostTellingFirst{config::DriveProtocol::mit, config::DriveProtocol::robstride,
                                       config::DriveProtocol::moteus, config::DriveProtocol::cia402,
                                       config::DriveProtocol::odrive};

void BusScan::take(const drivers::CanFrame& frame) {
  for (const config::DriveProtocol protocol : kMostTellingFirst) {
    if (!protocols_.contains(protocol)) continue;
    const auto found = read_answer(protocol, frame);
    if (!found) continue;
    if (found->id < first_ || found->id > last_) return;
    Drive& drive = found_[{protocol, found->id}];
    drive.protocol = protocol;
    drive.id = found->id;
    if (!found->what.empty()) drive.said.insert(found->what);
    if (!found->other_protocol.empty()) drive.other_protocols.insert(found->other_protocol);
    if (!found->question) return;
    (frame.fd ? drive.fd : drive.classic) = true;
    drive.reply_ids.insert(frame.id);
    constexpr std::uint32_t kInFd = 0x8000'0000;  // asked twice, in either form
    ++drive.answers[*found->question | (frame.fd ? kInFd : 0)];
    return;
  }
}

std::vector<BusScan::Drive> BusScan::found() const {
  std::vector<Drive> drives;
  for (const auto& [key, drive] : found_) drives.push_back(drive);
  return drives;
}

bool BusScan::Drive::answers_twice() const {
  return std::ranges::any_of(answers, [](const auto& answer) { return answer.second > 1; });
}

namespace {

void add_what_a_scan_heard(const config::Drive& file, const BusScan::Drive& found, std::vector<std::string>& wrong) {
  for (const std::string& protocol : found.other_protocols)
    wrong.push_back("speaks " + protocol + ", which Takt does not");
  if (found.answers_twice())
    wrong.push_back("one question has two answers: two drives have the number " + std::to_string(found.id));
  if (file.protocol != config::DriveProtocol::mit) return;
  for (const std::uint32_t id : found.reply_ids)
    if (id != file.reply_id)
      wrong.push_back("replies on " + hex(id) + ", the robot file says reply_id " + hex(file.reply_id));
  const bool answered = found.fd || found.classic;
  if (answered && file.fd_bitrate != 0 && !found.fd)
    wrong.push_back("answers in classic frames, the robot file says CAN FD (fd_bitrate)");
  if (answered && file.fd_bitrate == 0 && !found.classic)
    wrong.push_back("answers in CAN FD, the robot file says classic frames: write fd_bitrate");
}

}  // namespace

std::vector<std::string> differences(const config::Joint& joint, const BusScan::Drive* found,
                                     const JointFeedback& feedback) {
  std::vector<std::string> wrong;
  if (found != nullptr) add_what_a_scan_heard(joint.drive, *found, wrong);
  // That it forgot with its supply where it is, is no difference.
  const drivers::SetupFault kind = drivers::kind_of(feedback.error_code);
  const bool wants_home = kind == drivers::SetupFault::home_unknown;
  const bool is_silent =
      found == nullptr && !feedback.received_at.is_set() && kind == drivers::SetupFault::settings_unread;
  if (feedback.error_code != 0 && !wants_home && !is_silent)
    wrong.push_back(drivers::error_name(joint.drive, feedback.error_code));
  else if (!feedback.received_at.is_set() && wrong.empty())
    wrong.emplace_back(found == nullptr ? "no answer: is it powered, and are id and bus right?"
                                        : "answers questions and reports nothing");
  else if (feedback.received_at.is_set() && feedback.drive_state != DriveState::disabled && !wants_home)
    wrong.emplace_back("does not say that it is disabled");
  return wrong;
}

}  // namespace takt::commissioning
