// SPDX-License-Identifier: Apache-2.0
#include "drivers/bus/error_frame.hpp"

#include <linux/can/error.h>

#include <cerrno>

namespace takt::drivers {

std::uint32_t error_classes() noexcept {
  return CAN_ERR_TX_TIMEOUT | CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED;
}

BusEvent read_error_frame(const CanFrame& error) noexcept {
  BusEvent event;
  const bool controller = (error.id & CAN_ERR_CRTL) != 0;
  event.frame_lost =
      (error.id & CAN_ERR_TX_TIMEOUT) != 0 || (controller && (error.data[1] & CAN_ERR_CRTL_TX_OVERFLOW) != 0);
  event.overflowed = controller && (error.data[1] & CAN_ERR_CRTL_RX_OVERFLOW) != 0;
  // In order of severity: one frame may carry several classes, and the worst describes the bus.
  if ((error.id & CAN_ERR_BUSOFF) != 0) {
    event.state = BusState::bus_off;
  } else if (controller && (error.data[1] & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
    event.state = BusState::error_passive;
  } else if ((error.id & CAN_ERR_RESTARTED) != 0 ||
             (controller &&
              (error.data[1] & (CAN_ERR_CRTL_ACTIVE | CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0)) {
    event.state = BusState::up;
  }
  return event;
}

CanFrame make_error_frame(const BusEvent& event) noexcept {
  CanFrame error;
  error.error = true;
  error.length = CAN_ERR_DLC;
  std::uint8_t controller = 0;
  if (event.overflowed) controller |= CAN_ERR_CRTL_RX_OVERFLOW;
  if (event.state == BusState::error_passive) controller |= CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE;
  if (event.state == BusState::up) controller |= CAN_ERR_CRTL_ACTIVE;
  error.data[1] = controller;
  if (controller != 0) error.id |= CAN_ERR_CRTL;
  if (event.state == BusState::bus_off) error.id |= CAN_ERR_BUSOFF;
  if (event.frame_lost) error.id |= CAN_ERR_TX_TIMEOUT;
  return error;
}

void note_error_frame(const CanFrame& error, BusHealth& health) noexcept {
  const BusEvent event = read_error_frame(error);
  if (event.state) health.state = *event.state;
  if (event.frame_lost) ++health.tx_dropped;
  if (event.overflowed) ++health.rx_dropped;
}

bool drops_while_off(BusHealth& health) noexcept {
  if (health.state != BusState::bus_off) return false;
  ++health.tx_dropped;
  return true;
}

SendFailure read_send_error(int error_number) noexcept {
  if (error_number == ENOBUFS || error_number == EAGAIN || error_number == EINTR) return {};
  return {SendResult::bus_down, BusState::down};
}

}  // namespace takt::drivers
