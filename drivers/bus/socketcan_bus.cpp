// SPDX-License-Identifier: Apache-2.0
#include "drivers/bus/socketcan_bus.hpp"

#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "drivers/bus/can_frame.hpp"
#include "drivers/bus/error_frame.hpp"
#include "executive/contract/monotonic_clock.hpp"

namespace takt::drivers {
namespace {

using SetUp = std::expected<void, std::string>;

constexpr int kBatchesPerCall = 4;
constexpr std::uint32_t kIffEcho = 1U << 18U;  // of linux/if.h, which does not go beside net/if.h

std::unexpected<std::string> refusal(const std::string& interface, const std::string& what, const std::string& mend) {
  return std::unexpected(interface + ": " + what + (errno != 0 ? " (" + std::string(std::strerror(errno)) + ")" : "") +
                         ": " + mend);
}

SetUp check_interface(int socket, const BusOptions& options, std::uint32_t bitrate) {
  ifreq request{};
  std::strncpy(request.ifr_name, options.interface.c_str(), IFNAMSIZ - 1);
  errno = 0;
  if (::ioctl(socket, SIOCGIFFLAGS, &request) != 0 || (request.ifr_flags & IFF_UP) == 0)
    return refusal(options.interface, "interface is down",
                   "takt bus up --robot FILE, as root, brings it up with " + std::to_string(bitrate) + " bit/s");
  if (!options.fd) return {};
  if (::ioctl(socket, SIOCGIFMTU, &request) != 0 || request.ifr_mtu != CANFD_MTU)
    return refusal(options.interface, "fd: true, but the interface carries classic frames only",
                   "switch it to CAN FD (ip link set ... fd on) or set fd: false");
  return {};
}

// The driver hands our frames back when they left, instead of the kernel when they were written.
bool says_what_left(const std::string& interface) {
  std::ifstream file("/sys/class/net/" + interface + "/flags");
  std::uint32_t flags = 0;
  return (file >> std::hex >> flags) && (flags & kIffEcho) != 0;
}

SetUp set_options(int socket, const BusOptions& options, bool own_frames) {
  const auto set = [socket](int level, int name, const void* value, std::size_t size) {
    return ::setsockopt(socket, level, name, value, static_cast<socklen_t>(size)) == 0;
  };
  std::vector<can_filter> filters;
  for (const config::IdPattern& one : options.receive.value_or(std::vector<config::IdPattern>{}))
    filters.push_back({one.id | (one.extended ? CAN_EFF_FLAG : 0), one.mask | CAN_EFF_FLAG | CAN_RTR_FLAG});
  const can_err_mask_t errors = error_classes();
  const int on = 1;
  const int off = 0;
  const int own = own_frames ? 1 : 0;
  errno = 0;
  if ((!options.receive || set(SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), filters.size() * sizeof(can_filter))) &&
      set(SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) &&
      set(SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &own, sizeof own) &&
      set(SOL_CAN_RAW, CAN_RAW_FD_FRAMES, options.fd ? &on : &off, sizeof on) &&
      set(SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) && set(SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on))
    return {};
  return refusal(options.interface, "the kernel refuses an option of the raw CAN socket", "needs Linux 3.6 or newer");
}

SetUp bind_to(int socket, const std::string& interface) {
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
  sockaddr_storage any{};
  std::memcpy(&any, &address, sizeof address);
  errno = 0;
  if (address.can_ifindex == 0 || ::bind(socket, reinterpret_cast<const sockaddr*>(&any), sizeof address) != 0)
    return refusal(interface, "not a CAN interface", "name one that `ip -details link show type can` lists");
  return {};
}

}  // namespace

bool SocketCanBus::is_virtual(const std::string& interface) {
  std::error_code error;
  const auto device = std::filesystem::read_symlink("/sys/class/net/" + interface, error);
  return !error && device.string().find("/virtual/") != std::string::npos;
}

bool SocketCanBus::has_hardware(const std::string& interface) {
  return interface_exists(interface) && !is_virtual(interface);
}

bool SocketCanBus::interface_exists(const std::string& interface) {
  return ::if_nametoindex(interface.c_str()) != 0;
}

std::expected<std::unique_ptr<SocketCanBus>, std::string> SocketCanBus::open(const BusOptions& options,
                                                                             std::uint32_t bitrate) {
  errno = 0;
  FileHandle socket(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
  if (!socket.is_open())
    return refusal(options.interface, "no raw CAN socket to be had",
                   "load the kernel modules can, can_raw and the adapter's driver");
  // The interface's own state first: binding says less about what is wrong.
  if (const SetUp done = bind_to(socket.get(), options.interface); !done) return std::unexpected(done.error());
  if (const SetUp done = check_interface(socket.get(), options, bitrate); !done) return std::unexpected(done.error());
  const bool own_frames = says_what_left(options.interface);
  if (const SetUp done = set_options(socket.get(), options, own_frames); !done) return std::unexpected(done.error());
  return std::make_unique<SocketCanBus>(std::move(socket), own_frames);
}

BusHealth SocketCanBus::health() const noexcept {
  BusHealth health = health_;
  health.left_at = sent_.left_at();
  health.waiting_since = sent_.waiting_since();
  return health;
}

SendResult SocketCanBus::send(const CanFrame& frame) noexcept {
  if (drops_while_off(health_)) return SendResult::bus_down;
  const canfd_frame raw = to_kernel(frame);
  if (::send(socket_.get(), &raw, frame.fd ? CANFD_MTU : CAN_MTU, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0) {
    if (health_.state == BusState::down) health_.state = BusState::up;
    if (says_what_left_) sent_.handed_over(frame, monotonic_now());
    return SendResult::sent;
  }
  const SendFailure failure = read_send_error(errno);
  ++health_.tx_dropped;
  if (failure.state) set_state(*failure.state);
  return failure.result;
}

std::size_t SocketCanBus::receive(std::span<ReceivedFrame> out) noexcept {
  std::size_t filled = 0;
  for (int batch = 0; batch < kBatchesPerCall && filled < out.size(); ++batch) {
    const std::size_t wanted = std::min(out.size() - filled, MessageBatch::kBatch);
    const MessageBatch::Result fetched = batch_.fetch(socket_.get(), wanted);
    if (fetched.error != 0) set_state(BusState::down);
    if (fetched.count == 0) break;
    const ClockPair clocks = sample_clocks();
    for (std::size_t i = 0; i < fetched.count; ++i)
      if (take(i, clocks, out[filled])) ++filled;
    if (fetched.count < wanted) break;
  }
  return filled;
}

// The kernel throws away what an interface has to send when it goes down, and when its controller is off the bus.
void SocketCanBus::set_state(BusState state) noexcept {
  health_.state = state;
  if (state == BusState::down || state == BusState::bus_off) sent_.forget();
}

bool SocketCanBus::take(std::size_t index, const ClockPair& clocks, ReceivedFrame& out) noexcept {
  const ControlMessages control = batch_.control(index);
  if (control.kernel_dropped) {  // the kernel's own total; the controller's overflows are counted beside it
    health_.rx_dropped += *control.kernel_dropped - kernel_dropped_;
    kernel_dropped_ = *control.kernel_dropped;
  }
  canfd_frame raw = batch_.frame(index);
  // The size tells the kind; kernels before 6.2 leave the FDF flag out, and a classic frame's byte 5 is no flag.
  if (batch_.size(index) != CAN_MTU && batch_.size(index) != CANFD_MTU) return false;
  raw.flags = batch_.size(index) == CANFD_MTU ? static_cast<std::uint8_t>(raw.flags | CANFD_FDF) : std::uint8_t{0};
  const std::optional<CanFrame> frame = from_kernel(raw);
  if (!frame) return false;
  if (frame->error) {
    note_error_frame(*frame, health_);
    set_state(health_.state);
    return false;
  }
  if (batch_.is_own(index)) {
    sent_.left(*frame, to_monotonic(control.realtime_ns, clocks));
    return false;
  }
  out.frame = *frame;
  out.received_at = to_monotonic(control.realtime_ns, clocks);
  return true;
}

}  // namespace takt::drivers
