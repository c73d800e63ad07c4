// SPDX-License-Identifier: Apache-2.0
#include "sensors/imu/serial_port.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/serial.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

namespace takt::sensors {
namespace {

struct Rate {
  std::uint32_t baud;
  speed_t speed;
};
constexpr std::array<Rate, 9> kRates{{{9600, B9600},
                                      {19'200, B19200},
                                      {38'400, B38400},
                                      {57'600, B57600},
                                      {115'200, B115200},
                                      {230'400, B230400},
                                      {460'800, B460800},
                                      {921'600, B921600},
                                      {2'000'000, B2000000}}};

// USB adapters by FTDI keep bytes for up to 16 ms otherwise. Who cannot do it has nothing to gain by it.
void ask_for_low_latency(int fd) {
  serial_struct serial{};
  if (::ioctl(fd, TIOCGSERIAL, &serial) != 0) return;
  serial.flags = static_cast<int>(static_cast<unsigned>(serial.flags) | ASYNC_LOW_LATENCY);
  (void)::ioctl(fd, TIOCSSERIAL, &serial);
}

bool set_up(int fd, speed_t speed) {
  termios settings{};
  if (::tcgetattr(fd, &settings) != 0) return false;
  ::cfmakeraw(&settings);
  settings.c_cflag |= CLOCAL | CREAD;
  settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS);
  ::cfsetispeed(&settings, speed);
  ::cfsetospeed(&settings, speed);
  if (::tcsetattr(fd, TCSANOW, &settings) != 0) return false;
  ask_for_low_latency(fd);
  return ::tcflush(fd, TCIFLUSH) == 0;
}

}  // namespace

bool is_known_baud(std::uint32_t baud) {
  return std::ranges::find(kRates, baud, &Rate::baud) != kRates.end();
}

std::string known_bauds() {
  std::string list;
  for (const Rate& rate : kRates) list += fmt::format("{}{}", list.empty() ? "" : ", ", rate.baud);
  return list;
}

std::expected<SerialPort, std::string> SerialPort::open(const std::string& path, std::uint32_t baud) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0)
    return std::unexpected(fmt::format("{}: {}{}", path, std::strerror(errno),
                                       errno == EACCES  ? "; its user must be in the group `dialout`"
                                       : errno == EBUSY ? "; another program has it"
                                                        : ""));
  SerialPort port(fd, path);
  if (::isatty(fd) == 0) return std::unexpected(path + " is no serial port");
  if (::ioctl(fd, TIOCEXCL) != 0 || !set_up(fd, std::ranges::find(kRates, baud, &Rate::baud)->speed))
    return std::unexpected(fmt::format("{} cannot be set to {} baud: {}", path, baud, std::strerror(errno)));
  return port;
}

SerialPort::~SerialPort() {
  if (fd_ >= 0) ::close(fd_);
}

std::expected<std::size_t, std::string> SerialPort::read(std::span<std::uint8_t> into, Duration limit,
                                                         const sigset_t& waiting_mask) {
  pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
  const timespec until{.tv_sec = limit.ns / seconds(1).ns, .tv_nsec = limit.ns % seconds(1).ns};
  if (::ppoll(&waiting, 1, &until, &waiting_mask) <= 0) return 0;
  const ssize_t bytes = ::read(fd_, into.data(), into.size());
  if (bytes > 0) return static_cast<std::size_t>(bytes);
  if (bytes < 0 && (errno == EAGAIN || errno == EINTR)) return 0;
  return std::unexpected(fmt::format("{} vanished ({})", path_, bytes == 0 ? "hung up" : std::strerror(errno)));
}

}  // namespace takt::sensors
