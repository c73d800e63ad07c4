// SPDX-License-Identifier: Apache-2.0
#include "sensors/gamepad/evdev.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <span>
#include <utility>

namespace takt::sensors {
namespace {

struct Named {
  std::string_view name;
  std::uint16_t code;
};
// As linux/input-event-codes.h calls them, without ABS_ and BTN_.
constexpr std::array<Named, 10> kSticks{{{"x", ABS_X},
                                         {"y", ABS_Y},
                                         {"z", ABS_Z},
                                         {"rx", ABS_RX},
                                         {"ry", ABS_RY},
                                         {"rz", ABS_RZ},
                                         {"throttle", ABS_THROTTLE},
                                         {"rudder", ABS_RUDDER},
                                         {"hat0x", ABS_HAT0X},
                                         {"hat0y", ABS_HAT0Y}}};
constexpr std::array<Named, 12> kButtons{{{"tl", BTN_TL},
                                          {"tr", BTN_TR},
                                          {"tl2", BTN_TL2},
                                          {"tr2", BTN_TR2},
                                          {"south", BTN_SOUTH},
                                          {"east", BTN_EAST},
                                          {"north", BTN_NORTH},
                                          {"west", BTN_WEST},
                                          {"thumbl", BTN_THUMBL},
                                          {"thumbr", BTN_THUMBR},
                                          {"trigger", BTN_TRIGGER},
                                          {"thumb", BTN_THUMB}}};

std::string_view name_of(std::span<const Named> all, std::uint16_t code) {
  const auto found = std::ranges::find(all, code, &Named::code);
  return found == all.end() ? std::string_view("?") : found->name;
}

std::string list_of(std::span<const Named> all) {
  std::string list;
  for (const Named& each : all) list += fmt::format("{}{}", list.empty() ? "" : ", ", each.name);
  return list;
}

bool has_button(int fd, std::uint16_t button) {
  std::array<unsigned char, KEY_MAX / 8 + 1> bits{};
  if (::ioctl(fd, EVIOCGBIT(EV_KEY, sizeof(bits)), bits.data()) < 0) return false;
  return ((unsigned{bits[button / 8U]} >> (button % 8U)) & 1U) != 0;
}

// What keeps the device from being this gamepad; empty: nothing.
std::string unfit(int fd, const std::string& path, std::vector<Stick>& sticks, std::uint16_t button) {
  int clock = CLOCK_MONOTONIC;
  if (::ioctl(fd, EVIOCSCLOCKID, &clock) != 0)
    return path + " is no input device: name one of /dev/input/by-id/*-event-joystick";
  if (!has_button(fd, button))
    return fmt::format("{} has no button {}: name another with --dead-man ({})", path, name_of(kButtons, button),
                       known_buttons());
  for (Stick& stick : sticks) {
    input_absinfo info{};
    if (::ioctl(fd, EVIOCGABS(unsigned{stick.code}), &info) < 0 || info.minimum >= info.maximum)
      return fmt::format("{} has no stick {}: name another in --sticks ({})", path, name_of(kSticks, stick.code),
                         known_sticks());
    stick.minimum = info.minimum;
    stick.maximum = info.maximum;
  }
  return {};
}

}  // namespace

std::optional<Stick> stick_named(std::string_view name) {
  const bool reversed = name.starts_with('-');
  const auto found = std::ranges::find(kSticks, reversed ? name.substr(1) : name, &Named::name);
  if (found == kSticks.end()) return std::nullopt;
  return Stick{.code = found->code, .reversed = reversed};
}

std::optional<std::uint16_t> button_named(std::string_view name) {
  const auto found = std::ranges::find(kButtons, name, &Named::name);
  if (found == kButtons.end()) return std::nullopt;
  return found->code;
}

std::string known_sticks() {
  return list_of(kSticks);
}
std::string known_buttons() {
  return list_of(kButtons);
}

std::expected<Evdev, std::string> Evdev::open(const std::string& path, std::vector<Stick>& sticks,
                                              std::uint16_t button) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0)
    return std::unexpected(fmt::format("{}: {}{}", path, std::strerror(errno),
                                       errno == EACCES ? "; your user must be in the group `input`" : ""));
  Evdev device(fd, path);
  if (std::string why = unfit(fd, path, sticks, button); !why.empty()) return std::unexpected(std::move(why));
  return device;
}

Evdev::Evdev(Evdev&& other) noexcept : fd_(std::exchange(other.fd_, -1)), path_(std::move(other.path_)) {}

Evdev::~Evdev() {
  if (fd_ >= 0) ::close(fd_);
}

std::expected<std::vector<input_event>, std::string> Evdev::read(std::chrono::milliseconds limit) {
  pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
  if (::poll(&waiting, 1, static_cast<int>(limit.count())) <= 0) return std::vector<input_event>{};
  std::vector<input_event> events(4096 / sizeof(input_event));
  const ssize_t bytes = ::read(fd_, events.data(), events.size() * sizeof(input_event));
  if (bytes < 0 && (errno == EAGAIN || errno == EINTR)) return std::vector<input_event>{};
  if (bytes <= 0) return std::unexpected(path_ + ": the gamepad is gone: plug it in and begin anew");
  events.resize(static_cast<std::size_t>(bytes) / sizeof(input_event));  // the kernel hands out whole events
  return events;
}

}  // namespace takt::sensors
