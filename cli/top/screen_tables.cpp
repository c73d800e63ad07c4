// SPDX-License-Identifier: Apache-2.0
#include "cli/top/screen_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

namespace takt::monitor::top {
namespace {

constexpr std::size_t kBusColumns = 35;

std::string_view name_of(BusState state) {
  constexpr std::array<std::string_view, 4> names{"up", "passive", "bus-off", "down"};
  const auto index = static_cast<std::size_t>(state);
  return index < names.size() ? names[index] : "invalid";
}

void add_bus(Line& line, const BusPicture& bus) {
  const BusHealth& health = bus.health;
  line.add(first_cells(bus.name, 9)).add(" ");
  line.add(name_of(health.state), health.state == BusState::up ? Style::good : Style::alarm);
  line.add(fmt::format(" {:.0f} %", 100 * bus.load), bus.load > 0.9 ? Style::alarm : Style::plain);
  if (bus.planned) line.add(fmt::format(" [{:.0f}]", 100 * *bus.planned), Style::faint);
  std::string errors;
  if (health.tx_dropped != 0) errors += fmt::format(" tx lost {}", health.tx_dropped);
  if (health.rx_dropped != 0) errors += fmt::format(" rx lost {}", health.rx_dropped);
  if (health.foreign_frames != 0) errors += fmt::format(" alien {}", health.foreign_frames);
  if (health.flooded != 0) errors += " flooded";
  const std::string well =
      bus.tick_to_wire ? fmt::format(" wire {:.1f} ms", bus.tick_to_wire->milliseconds()) : " no errors";
  line.add(errors.empty() ? well : errors, errors.empty() ? Style::faint : Style::warning);
}

std::string interventions_text(const JointPicture& joint) {
  std::string text;
  for (std::size_t kind = 0; kind < kInterventionCount; ++kind)
    if ((joint.recent >> kind & 1U) != 0) text += fmt::format("{} {}  ", kInterventionNames[kind], joint.ticks[kind]);
  return text;
}

Line joint_line(const JointPicture& joint) {
  const JointRecord& record = joint.newest;
  Line line;
  line.add(first_cells(joint.name, 19)).to(20);
  line.add(fmt::format("{:>8.3f} {:>8.3f} {:>8.2f} {:>5.0f}  ", record.q_estimate, record.q_reference, record.tau_total,
                       record.feedback.temperature_C));
  if (!joint.error.empty()) line.add(joint.error + "  ", Style::alarm);
  if (record.reply_faults != 0) line.add("replies bad  ", Style::warning);
  if (record.behind != 0) line.add("behind its reference  ", Style::warning);
  return line.add(interventions_text(joint), Style::warning);
}

}  // namespace

std::vector<Line> bus_lines(const Picture& picture, std::size_t columns) {
  const std::size_t per_line = std::max<std::size_t>((columns - kLabel) / kBusColumns, 1);
  std::vector<Line> lines;
  for (std::size_t bus = 0; bus < picture.buses.size(); ++bus) {
    if (bus % per_line == 0) lines.push_back(labelled(bus == 0 ? "bus" : ""));
    lines.back().to(kLabel + bus % per_line * kBusColumns);
    add_bus(lines.back(), picture.buses[bus]);
  }
  return lines;
}

std::vector<Line> joint_lines(const Picture& picture, std::size_t scroll, std::size_t rows) {
  Line header;
  const bool slides =
      std::ranges::find(picture.joints, config::JointKind::slide, &JointPicture::kind) != picture.joints.end();
  header.add(fmt::format("{:<19} {:>8} {:>8} {:>8} {:>5}  ", "joint", slides ? "q rad,m" : "q rad", "target",
                         slides ? "tau Nm,N" : "tau Nm", "C"),
             Style::faint);
  std::vector<Line> lines;
  const std::size_t count = picture.joints.size();
  const std::size_t shown = std::min(count, rows - 1);
  const std::size_t first = std::min(scroll, count - shown);
  if (shown < count)
    header.add(fmt::format("{}-{} of {} (j k)", first + 1, first + shown, count), Style::strong);
  else
    header.add("interventions (in ticks)", Style::faint);
  lines.push_back(std::move(header));
  for (std::size_t joint = first; joint < first + shown; ++joint) lines.push_back(joint_line(picture.joints[joint]));
  return lines;
}

}  // namespace takt::monitor::top
