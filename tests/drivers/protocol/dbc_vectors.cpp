// Prints frames as our codecs encode them, beside the values they stand for, for dbc_check.py to read through the DBC
// files: one a line, "FILE ID HEX SIGNAL=VALUE ...". A protocol adds a function and a call.
#include <cstdio>
#include <string>

#include "drivers/protocol/cia402/cia402_codec.hpp"
#include "drivers/protocol/odrive/odrive_codec.hpp"

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

}  // namespace

int main() {
  print_cia402();
  print_odrive();
}
