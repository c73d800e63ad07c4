// SPDX-License-Identifier: Apache-2.0
// Prints frames as our codecs encode them, beside the values they stand for, for dbc_check.py to read through the DBC
// files: one a line, "FILE ID HEX SIGNAL=VALUE ...". A protocol adds a function and a call.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <string>
#include <string_view>

#include "config/drive_presets.hpp"
#include "drivers/protocol/cia402/cia402_codec.hpp"
#include "drivers/protocol/mit/mit_codec.hpp"
#include "drivers/protocol/odrive/odrive_codec.hpp"
#include "drivers/protocol/robstride/robstride_codec.hpp"

namespace {

using takt::drivers::CanFrame;

void print(const char* file, const CanFrame& frame, const char* signals) {
  std::string hex;
  char two[3];
  for (std::size_t i = 0; i < frame.length; ++i) {
    std::snprintf(two, sizeof two, "%02x", frame.data[i]);
    hex += two;
  }
  std::printf("%s %x %s %s\n", file, frame.id, hex.empty() ? "-" : hex.c_str(), signals);
}

void print_odrive() {
  using namespace takt::drivers;
  constexpr std::uint32_t kNode = 3;  // the file's example
  const auto say = [](const CanFrame& frame, const char* signals) { print("odrive.dbc", frame, signals); };
  say(odrive_estop(kNode), "");
  say(odrive_set_axis_state(kNode, kOdriveClosedLoop), "Requested_State=8");
  say(odrive_set_axis_state(kNode, kOdriveIdle), "Requested_State=1");
  say(odrive_controller_mode(kNode, 3, 1), "Control_Mode=3 Input_Mode=1");
  say(odrive_input_pos(kNode, 1.5F, -0.25F, 1.2F), "Input_Position=1.5 Velocity_FF=-0.25 Torque_FF=1.2");
  say(odrive_input_vel(kNode, -2.5F, 0.125F), "Input_Velocity=-2.5 Input_Torque_FF=0.125");
  say(odrive_input_torque(kNode, -0.75F), "Torque_Setpoint=-0.75");
  say(odrive_limits(kNode, 20, 7.5F), "Velocity_Limit=20 Current_Limit=7.5");
  say(odrive_clear_errors(kNode), "Identify=0");
}

void print_cia402() {
  using namespace takt::drivers::cia402;
  constexpr std::uint32_t kNode = 5;  // the file's example
  const auto say = [](const CanFrame& frame, const char* signals) { print("cia402_cst.dbc", frame, signals); };
  say(encode_nmt(NmtCommand::start, kNode), "NMT_command=1 NMT_node=5");
  say(encode_sync(), "");
  say(encode_rpdo(takt::config::Cia402Mode::cst, kNode, kShutdown, 250),
      "Controlword=6 Mode_of_operation=10 Target_torque=250");
}

void fill(CanFrame& frame, const std::array<std::uint8_t, 8>& bytes) {
  std::ranges::copy(bytes, frame.data);
  frame.length = 8;
}

std::string file_of(std::string_view model) {
  return std::string(model) + ".dbc";
}

// A drive's packed fields at the ends of their ranges, next to each other: what lies a bit aside, or spans something
// else, shows.
void print_mit(const takt::config::DrivePreset& preset, takt::drivers::MitVariant variant) {
  using namespace takt::drivers;
  const auto f = [](double value) { return static_cast<float>(value); };
  const MitRange range{f(preset.position), f(preset.velocity), f(preset.kp), f(preset.kd), f(preset.torque)};
  const std::string file = file_of(preset.model);
  for (const float sign : {1.0F, -1.0F}) {
    const float kp = sign > 0 ? range.kp : 0, kd = sign > 0 ? 0 : range.kd;
    CanFrame frame;
    frame.id = 1;
    frame.length = 8;
    const MitPayload payload = encode_mit_command(range, {sign * range.p, -sign * range.v, kp, kd, sign * range.t});
    std::ranges::copy(payload, frame.data);
    print(file.c_str(), frame,
          fmt::format("Position={} Velocity={} Kp={} Kd={} Torque={}", sign * range.p, -sign * range.v, kp, kd,
                      sign * range.t)
              .c_str());
    frame.id = variant == MitVariant::damiao ? 0x11 : 0;
    const std::uint8_t high = sign > 0 ? 0xFF : 0, low = static_cast<std::uint8_t>(~high);
    fill(frame, {0x11, high, high, low, static_cast<std::uint8_t>((low & 0xF0U) | (high & 0x0FU)), high, 60, 35});
    const auto reply = decode_mit_reply(range, variant, frame);
    const bool damiao = variant == MitVariant::damiao;
    print(file.c_str(), frame,
          fmt::format("Position={} Velocity={} Torque={} {}={}", reply->p, reply->v, reply->t,
                      damiao ? "Temperature_MOS" : "Temperature", reply->temperature_C)
              .c_str());
  }
}

void print_robstride(const takt::config::DrivePreset& preset) {
  using namespace takt::drivers;
  const auto f = [](double value) { return static_cast<float>(value); };
  const RobstrideRange range{f(preset.position), f(preset.velocity), f(preset.kp), f(preset.kd), f(preset.torque)};
  CanFrame frame;
  frame.id = 0x028001FD;
  frame.extended = true;
  frame.length = 8;
  for (const std::uint8_t high : {std::uint8_t{0xFF}, std::uint8_t{0}}) {
    const auto low = static_cast<std::uint8_t>(~high);
    fill(frame, {high, high, low, low, high, high, 0x01, 0x5E});
    const auto reply = decode_robstride_feedback(range, frame);
    print(file_of(preset.model).c_str(), frame,
          fmt::format("Position={} Velocity={} Torque={} Temperature={}", reply->p, reply->v, reply->t,
                      reply->temperature_C)
              .c_str());
  }
}

void print_presets() {
  const auto settled = [](const takt::config::DrivePreset& preset) { return preset.unsettled.empty(); };
  for (const takt::config::DrivePreset& preset : takt::config::kMitPresets)
    if (settled(preset))
      print_mit(preset,
                preset.model.starts_with("DM") ? takt::drivers::MitVariant::damiao : takt::drivers::MitVariant::tmotor);
  for (const takt::config::DrivePreset& preset : takt::config::kRobstridePresets)
    if (settled(preset)) print_robstride(preset);
}

}  // namespace

int main() {
  print_presets();
  print_cia402();
  print_odrive();
}
