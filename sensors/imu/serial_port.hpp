// SPDX-License-Identifier: Apache-2.0
// A serial port, or the terminal of a program that plays one: raw bytes, 8 data bits, no parity, one stop bit, no flow
// control, opened exclusively. Errors: one sentence. Thread rule: one thread.
#pragma once

#include <csignal>
#include <cstdint>
#include <expected>
#include <span>
#include <string>
#include <utility>

#include "executive/contract/mono_time.hpp"

namespace takt::sensors {

bool is_known_baud(std::uint32_t baud);
std::string known_bauds();

class SerialPort {
 public:
  // `baud`: a known one. What had arrived before is thrown away.
  static std::expected<SerialPort, std::string> open(const std::string& path, std::uint32_t baud);
  SerialPort(SerialPort&& other) noexcept : fd_(std::exchange(other.fd_, -1)), path_(std::move(other.path_)) {}
  SerialPort& operator=(SerialPort&& other) = delete;
  ~SerialPort();

  // Waits for bytes until `limit` passed or a signal outside `waiting_mask` came. How many are in `into`; an error: the
  // port vanished.
  std::expected<std::size_t, std::string> read(std::span<std::uint8_t> into, Duration limit,
                                               const sigset_t& waiting_mask);

 private:
  SerialPort(int fd, std::string path) : fd_(fd), path_(std::move(path)) {}
  int fd_;
  std::string path_;
};

}  // namespace takt::sensors
