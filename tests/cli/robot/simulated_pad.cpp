// SPDX-License-Identifier: Apache-2.0
#include "tests/cli/robot/simulated_pad.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/input.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cstdarg>
#include <cstring>

#include "executive/contract/monotonic_clock.hpp"

namespace {

// -1: no question that this pad has an answer to.
int answer_as_a_pad(unsigned long request, void* argument) {
  if (request == EVIOCSCLOCKID) return 0;
  if (request == EVIOCGABS(ABS_X) || request == EVIOCGABS(ABS_Y) || request == EVIOCGABS(ABS_RX)) {
    input_absinfo info{};
    info.maximum = 255;
    std::memcpy(argument, &info, sizeof info);
    return 0;
  }
  if (_IOC_TYPE(request) == 'E' && _IOC_NR(request) == _IOC_NR(EVIOCGBIT(EV_KEY, 0))) {
    static_cast<unsigned char*>(argument)[BTN_TL / 8] |= 1U << (BTN_TL % 8);
    return 0;
  }
  return -1;
}

}  // namespace

// Instead of libc's, for the whole program.
extern "C" int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list more;
  va_start(more, request);
  void* argument = va_arg(more, void*);
  va_end(more);
  struct stat file {};
  if (fstat(fd, &file) == 0 && S_ISFIFO(file.st_mode)) return answer_as_a_pad(request, argument);
  return static_cast<int>(syscall(SYS_ioctl, fd, request, argument));
}

namespace takt::test {

SimulatedPad::SimulatedPad(const std::string& path) {
  EXPECT_EQ(mkfifo(path.c_str(), 0600), 0);
  fd_ = open(path.c_str(), O_RDWR | O_CLOEXEC);  // both ends, so that no side waits for the other to open
  EXPECT_GE(fd_, 0);
}

void SimulatedPad::send(std::uint16_t type, std::uint16_t code, std::int32_t value, Duration ahead) const {
  const MonoTime at = monotonic_now() + ahead;
  std::array<input_event, 2> report{};
  for (input_event& event : report) {
    event.input_event_sec = at.ns / seconds(1).ns;
    event.input_event_usec = at.ns % seconds(1).ns / microseconds(1).ns;
  }
  report[0].type = type;
  report[0].code = code;
  report[0].value = value;
  EXPECT_EQ(write(fd_, report.data(), sizeof report), static_cast<ssize_t>(sizeof report));
}

void SimulatedPad::unplug() {
  if (fd_ >= 0) close(fd_);
  fd_ = -1;
}

}  // namespace takt::test
