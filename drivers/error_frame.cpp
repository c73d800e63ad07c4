#include "drivers/error_frame.hpp"

#include <linux/can/error.h>

#include <cerrno>

namespace takt::drivers {

std::uint32_t error_classes() noexcept {
  return CAN_ERR_TX_TIMEOUT | CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED;
}

BusEvent read_error_frame(const CanFrame& error) noexcept {
  BusEvent event;
  event.frame_lost = (error.id & CAN_ERR_TX_TIMEOUT) != 0;
  // In order of severity: one frame may carry several classes, and the worst describes the bus.
  if ((error.id & CAN_ERR_BUSOFF) != 0) {
    event.state = BusState::bus_off;
  } else if ((error.id & CAN_ERR_CRTL) != 0 &&
             (error.data[1] & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
    event.state = BusState::error_passive;
  } else if ((error.id & CAN_ERR_RESTARTED) != 0 ||
             ((error.id & CAN_ERR_CRTL) != 0 &&
              (error.data[1] & (CAN_ERR_CRTL_ACTIVE | CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0)) {
    event.state = BusState::up;
  }
  return event;
}

SendFailure read_send_error(int error_number) noexcept {
  if (error_number == ENOBUFS || error_number == EAGAIN || error_number == EINTR) return {};
  return {SendResult::bus_down, BusState::down};
}

}  // namespace takt::drivers
