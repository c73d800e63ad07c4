// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/cyclic_loop.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "executive/ipc/crc32c.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/runtime/overrun.hpp"
#include "executive/trace/trace.hpp"

namespace takt::runtime {
namespace {

// Rounded up: the shortest sleep counts.
constexpr std::uint32_t whole_milliseconds(Duration span) noexcept {
  const std::int64_t up = (span.ns + milliseconds(1).ns - 1) / milliseconds(1).ns;
  return static_cast<std::uint32_t>(std::min<std::int64_t>(up, UINT32_MAX));
}

constexpr Arrival arrival_of(ipc::ReadStatus status) noexcept {
  switch (status) {
    case ipc::ReadStatus::fresh:
    case ipc::ReadStatus::cut:  // longer than any legal one: the tick refuses it by its size
      return Arrival::accepted;
    case ipc::ReadStatus::nothing_new:
      return Arrival::none;
    case ipc::ReadStatus::contended:
      return Arrival::contended;
    case ipc::ReadStatus::corrupt:
      return Arrival::corrupt;
  }
  return Arrival::none;
}

}  // namespace

CyclicLoop::CyclicLoop(const LoopParts& parts, const LoopTiming& timing)
    : parts_(parts),
      timing_(timing),
      wakeup_(parts.clock, timing.wake, timing.spin),
      suspend_(parts.clock.read_boot_time()),
      state_(pipeline::make_tick_state(parts.config)),
      commands_(std::make_unique<PerSeat<CommandChunk>>()),
      keyframe_(ipc::kMaxKeyframeBytes - sizeof(TickTag)) {}

void CyclicLoop::run(const EvidenceSource& evidence, std::uint64_t ticks) noexcept {
  Pace pace(parts_.clock.now() + parts_.config.period, parts_.config.period);
  Evidence before = evidence.read();
  MonoTime ended = parts_.clock.now();
  while (input_.tick < ticks && !finishing_.load(std::memory_order_acquire)) {
    const MonoTime due = pace.due();
    const bool sleeps = ended < due - wakeup_.spin();
    const MonoTime woken = wakeup_.wait_until(due);

    const std::size_t frames = tick(woken, woken - due);

    // After the bus write: what follows delays no command.
    const Duration work = parts_.clock.now() - woken;
    const Evidence after = evidence.read();
    ended = parts_.clock.now();
    const bool follows_long_tick = input_.last_duration * 2 > parts_.config.period;
    input_.last_duration = work;
    input_.overrun_cause = OverrunCause::none;
    if (pace.advance(ended) != 0) {
      input_.overrun_cause =
          attribute({woken - due, ended - woken, wakeup_.spin(), sleeps, frames, follows_long_tick, after - before});
      ++status_.overruns[static_cast<std::size_t>(input_.overrun_cause)];
      input_.skipped_periods = pace.skipped();
    }
    before = after;
  }
  say_farewell(pace);
}

std::size_t CyclicLoop::tick(MonoTime woken, Duration lateness) noexcept {
  ++input_.tick;
  input_.now = woken;
  input_.lateness = lateness;
  input_.slept_ms = whole_milliseconds(suspend_.slept(parts_.clock.read_boot_time()));
  trace::tick_begin(input_.tick, woken, lateness);
  const std::size_t frames = parts_.edge.receive(input_, parts_.published);
  read_commands();
  read_imu();
  const OperatorInbox::Asked asked = parts_.requests.take();
  input_.operator_request = asked.request;
  input_.asked_at = asked.at;
  input_.asked_policy = asked.policy;
  input_.recorded_through = parts_.recorded.get();
  pipeline::control_tick(*state_, input_, parts_.config, output_);
  const Departure departure = parts_.edge.send(output_, parts_.clock, suspend_, parts_.published);
  input_.last_sent_at = departure.at;
  input_.last_damped = departure.damped;
  input_.torque_output = departure.torque_output;
  if (output_.observation_due) {
    parts_.published.observation(output_.observation);
    trace::observation_published(output_.observation);
  }
  if (input_.messages[Seat::policy].command != nullptr) trace::command_consumed(output_.record.header);
  record();
  publish_status();
  trace::tick_end(output_.record.header);
  return frames;
}

void CyclicLoop::read_commands() noexcept {
  const bool candidate_in_charge = output_.record.header.candidate.in_charge != 0;
  PerSeat<pipeline::PolicyMessage>& messages = input_.messages;
  if (std::exchange(candidate_in_charge_, candidate_in_charge) != candidate_in_charge)
    std::swap(messages[Seat::policy].session, messages[Seat::candidate].session);
  PerSeat<CommandMailbox*> mailboxes{};
  for (const Seat seat : kSeats) mailboxes[seat] = parts_.mailboxes[seat].current();
  if (mailboxes[Seat::candidate] != nullptr) input_.candidate_policy = mailboxes[Seat::candidate]->policy_hash;
  if (candidate_in_charge) std::swap(mailboxes[Seat::policy], mailboxes[Seat::candidate]);
  for (const Seat seat : kSeats)
    messages[seat] = read_command(mailboxes[seat], messages[seat].session, (*commands_)[seat]);
}

pipeline::PolicyMessage CyclicLoop::read_command(CommandMailbox* mailbox, std::uint8_t session_before,
                                                 CommandChunk& copy) noexcept {
  if (mailbox == nullptr) return {.session = session_before};
  const auto largest = std::as_writable_bytes(std::span(&copy, 1)).first(parts_.config.largest_command);
  const ipc::ReadResult result = mailbox->reader.read_latest(largest);
  const Arrival arrival = arrival_of(result.status);
  if (arrival != Arrival::accepted) return {.mailbox = arrival, .session = mailbox->session};
  return {.mailbox = arrival, .session = mailbox->session, .command = &copy, .bytes = result.size};
}

// What was read last stays: its age tells.
void CyclicLoop::read_imu() noexcept {
  ImuMailbox* const mailbox = parts_.imu == nullptr ? nullptr : parts_.imu->current();
  if (mailbox != nullptr) mailbox->read(input_.imu);
}

void CyclicLoop::record() noexcept {
  parts_.published.tick(output_.record);
  refused_bytes_.next_tick();
  for (const Seat seat : kSeats) record_command(seat);
  if (input_.tick % timing_.keyframe_every_ticks == 0) {
    const std::size_t size = pipeline::save(*state_, keyframe_);
    parts_.published.keyframe(input_.tick, std::span(keyframe_).first(size));
  }
}

void CyclicLoop::record_command(Seat seat) noexcept {
  const CommandChunk* const command = input_.messages[seat].command;
  const std::size_t bytes = input_.messages[seat].bytes;
  if (command == nullptr) return;
  const bool was_read = bytes <= parts_.config.largest_command;
  const auto message = std::as_bytes(std::span(command, 1)).first(was_read ? bytes : sizeof(CommandHeader));
  CommandTag tag{input_.tick, static_cast<std::uint32_t>(bytes), 0, player_of(seat)};
  const bool is_refused = output_.record.header.seats[seat].arrival != Arrival::accepted;
  if (bytes <= sizeof(CommandHeader) || (was_read && (!is_refused || refused_bytes_.take(bytes))))
    return parts_.published.command(tag, message);
  if (was_read) tag.crc = ipc::crc32c(message);
  parts_.published.command(tag, message.first(sizeof(CommandHeader)));
}

void CyclicLoop::publish_status() noexcept {
  status_.tick = output_.record.header;
  status_.ticks = input_.tick;
  ++status_.arrivals[static_cast<std::size_t>(output_.record.header.seats[Seat::policy].arrival)];
  parts_.board.publish(status_);
}

void CyclicLoop::say_farewell(Pace& pace) noexcept {
  output_ = {};
  output_.record.header.tick = input_.tick;
  // No turn is waited for: as in a change of mode, every drive is written to.
  output_.record.header.previous_mode = Mode::damped_stop;
  for (int i = 0; i < kFarewellTicks; ++i) {
    wakeup_.wait_until(pace.due());
    parts_.edge.receive(input_, parts_.published);
    parts_.edge.send(output_, parts_.clock, suspend_, parts_.published);
    pace.advance(parts_.clock.now());
  }
}

}  // namespace takt::runtime
