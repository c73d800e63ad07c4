// SPDX-License-Identifier: Apache-2.0
#include "drivers/torque_output/gpio_line.hpp"

#include <fmt/format.h>
#include <gpiod.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace takt::drivers {
namespace {

struct ChipCloser {
  void operator()(gpiod_chip* chip) const noexcept { gpiod_chip_close(chip); }  // gives its lines back
};
using Chip = std::unique_ptr<gpiod_chip, ChipCloser>;

class GpioLine final : public TorqueOutput {
 public:
  GpioLine(Chip chip, gpiod_line* line) : chip_(std::move(chip)), line_(line) {}
  ~GpioLine() override { tell(false); }
  GpioLine(const GpioLine&) = delete;
  GpioLine& operator=(const GpioLine&) = delete;

  bool tell(bool permitted) noexcept override {
    const int wanted = permitted ? 1 : 0;
    if (told_ != wanted && gpiod_line_set_value(line_, wanted) != 0) return false;
    told_ = wanted;
    if (gpiod_line_get_value(line_) == wanted) return true;
    told_ = kUnknown;
    return false;
  }

 private:
  static constexpr int kUnknown = -1;
  Chip chip_;
  gpiod_line* line_;  // the chip's
  int told_ = 0;      // as requested
};

std::string why_not(gpiod_line* line, int error) {
  const char* const holder = error == EBUSY ? gpiod_line_consumer(line) : nullptr;
  if (holder != nullptr) return fmt::format("{} uses it: end that program", holder);
  return std::strerror(error);
}

}  // namespace

std::expected<OpenedTorqueOutput, std::string> open_gpio_line(const config::SafeTorqueOff& wanted) {
  const std::string place = fmt::format("safety.safe_torque_off: line {} of {}", wanted.line, wanted.chip);
  Chip chip(gpiod_chip_open(wanted.chip.c_str()));
  if (!chip)
    return std::unexpected(
        fmt::format("{}: {}: name a chip of `gpiodetect` that this user may open", place, std::strerror(errno)));
  gpiod_line* const line = gpiod_chip_get_line(chip.get(), wanted.line);
  if (line == nullptr)
    return std::unexpected(
        fmt::format("{}: the chip has {} lines: name one of `gpioinfo`", place, gpiod_chip_num_lines(chip.get())));
  const int flags = wanted.active == config::ActiveLevel::low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
  if (gpiod_line_request_output_flags(line, "takt", flags, 0) != 0)
    return std::unexpected(fmt::format("{}: {}", place, why_not(line, errno)));
  const std::string description =
      fmt::format("line {} of {} ({}), active {}", wanted.line, wanted.chip, gpiod_chip_label(chip.get()),
                  wanted.active == config::ActiveLevel::low ? "low" : "high");
  return OpenedTorqueOutput{std::make_unique<GpioLine>(std::move(chip), line), description};
}

}  // namespace takt::drivers
