// SPDX-License-Identifier: Apache-2.0
// save and load of TickState's used part.
//
// A keyframe is a KeyframeHeader, the fixed pieces, as much of memory and windows as the configuration uses, the link
// watch and joint_count ReplyWatches, joint_count JointStates and JointWatches, what waits, of each seat its state,
// its join and the used bytes of its chunk, and those of the chunk that waits (none while there is no such command).
// The checksum covers everything after the header. Little-endian, this ABI only: the magic and the layout refuse
// another.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>
#include <string>
#include <type_traits>

#include "executive/contract/layout.hpp"
#include "executive/pipeline/tick_state.hpp"

namespace takt::pipeline {
namespace {

struct Nothing {};

struct KeyframeHeader {
  std::uint64_t magic = kMagic;
  std::uint64_t layout = 0;
  std::uint64_t checksum = 0;
  std::uint32_t bytes = 0;  // whole keyframe
  std::uint32_t joint_count = 0;
  std::uint32_t window_ticks = 0;
  std::uint32_t remembered = 0;
  PerSeat<std::uint32_t> chunk_bytes{};  // of the chunks in use
  std::uint32_t waiting_bytes = 0;       // of the one that waits
  [[no_unique_address]] std::conditional_t<kSeatCount % 2 == 1, Nothing, std::uint32_t> reserved{};  // no padding
};
static_assert(sizeof(KeyframeHeader) == 40 + 4 * (kSeatCount + 1 + (kSeatCount + 1) % 2));

constexpr std::uint64_t kStateLayout = layout_hash({{kAbiVersion, sizeof(TickState)},
                                                    {offsetof(TickState, mode), sizeof(ModeState)},
                                                    {offsetof(TickState, counters), sizeof(Counters)},
                                                    {offsetof(TickState, recovery), sizeof(Recovery)},
                                                    {offsetof(TickState, memory), sizeof(ObservationMemory)},
                                                    {offsetof(TickState, misses), sizeof(TickWindow)},
                                                    {offsetof(TickState, clamped), sizeof(TickWindow)},
                                                    {offsetof(TickState, fallback_clamped), sizeof(TickWindow)},
                                                    {offsetof(TickState, late), sizeof(TickWindow)},
                                                    {offsetof(TickState, links), sizeof(LinkWatch)},
                                                    {offsetof(TickState, imu), sizeof(ImuWatch)},
                                                    {offsetof(TickState, joints), sizeof(JointState)},
                                                    {offsetof(TickState, feedback), sizeof(JointWatch)},
                                                    {offsetof(TickState, waiting), sizeof(WaitingCommand)},
                                                    {offsetof(TickState, fallback), sizeof(FallbackState)},
                                                    {offsetof(TickState, candidate), sizeof(CandidateState)},
                                                    {offsetof(TickState, seats), sizeof(SeatState)},
                                                    {offsetof(SeatState, join), sizeof(JoinState)},
                                                    {offsetof(SeatState, chunk), sizeof(CommandChunk)},
                                                    {kSeatCount, sizeof(CommandInUse)}});

// Of the links: everything but the joints, which are as many as the robot has.
constexpr std::size_t kLinkBytes = offsetof(LinkWatch, joints);
// Of a seat: everything but its chunk.
constexpr std::size_t kSeatBytes = offsetof(SeatState, chunk);

// All but the chunks.
std::size_t fixed_bytes(const StateShape& shape) {
  return sizeof(KeyframeHeader) + sizeof(ModeState) + sizeof(Counters) + sizeof(Recovery) +
         ObservationMemory::saved_bytes(shape.remembered) + 8 * TickWindow::saved_bytes(shape.window_ticks) +
         sizeof(WaitingCommand) + sizeof(FallbackState) + sizeof(CandidateState) + kSeatCount * kSeatBytes +
         kLinkBytes + sizeof(ImuWatch) +
         shape.joint_count * (sizeof(ReplyWatch) + sizeof(JointState) + sizeof(JointWatch));
}

StateShape shape_of(const KeyframeHeader& header) {
  return {header.joint_count, header.window_ticks, header.remembered};
}

struct ChunkBytes {
  PerSeat<std::size_t> in_use;
  std::size_t waiting;
  [[nodiscard]] std::size_t all() const { return std::accumulate(in_use.values, in_use.values + kSeatCount, waiting); }
  [[nodiscard]] std::size_t largest() const { return std::max(std::ranges::max(in_use.values), waiting); }
};

ChunkBytes chunks_of(const KeyframeHeader& header) {
  ChunkBytes chunks{{}, header.waiting_bytes};
  for (const Seat seat : kSeats) chunks.in_use[seat] = header.chunk_bytes[seat];
  return chunks;
}

std::size_t bytes_of(const CommandInUse& command, const CommandChunk& chunk) {
  return command.sequence == 0 ? 0 : chunk.used_bytes();
}

ChunkBytes chunk_bytes(const TickState& state) {
  ChunkBytes chunks{{}, bytes_of(state.waiting.command, state.waiting_chunk)};
  for (const Seat seat : kSeats) chunks.in_use[seat] = bytes_of(state.seats[seat].command, state.seats[seat].chunk);
  return chunks;
}

// Word-wise multiply and rotate: catches damage, not malice; cheap enough for the control thread.
std::uint64_t checksum(std::span<const std::byte> bytes) {
  std::uint64_t sum = 0x9E37'79B9'7F4A'7C15ULL ^ bytes.size();
  const auto mix = [&sum](std::uint64_t word) { sum = std::rotl((sum ^ word) * 0x0000'0100'0000'01B3ULL, 29) + word; };
  std::size_t at = 0;
  for (; at + 8 <= bytes.size(); at += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, 8);
    mix(word);
  }
  for (; at < bytes.size(); ++at) mix(std::to_integer<std::uint64_t>(bytes[at]));
  return sum;
}

// Walks the pieces of a keyframe once, for saving and for loading, so that the two cannot disagree.
template <class State, class Piece>
void walk(State& state, const StateShape& shape, const ChunkBytes& chunks, Piece&& piece) {
  piece(&state.mode, sizeof(state.mode));
  piece(&state.counters, sizeof(state.counters));
  piece(&state.recovery, sizeof(state.recovery));
  piece(&state.memory, ObservationMemory::saved_bytes(shape.remembered));
  piece(&state.misses, TickWindow::saved_bytes(shape.window_ticks));
  piece(&state.refusals, TickWindow::saved_bytes(shape.window_ticks));
  piece(&state.clamped, TickWindow::saved_bytes(shape.window_ticks));
  piece(&state.fallback_clamped, TickWindow::saved_bytes(shape.window_ticks));
  piece(&state.late, TickWindow::saved_bytes(shape.window_ticks));
  piece(&state.links, kLinkBytes);
  piece(&state.links.joints[0], shape.joint_count * sizeof(ReplyWatch));
  piece(&state.imu, sizeof(state.imu));
  piece(&state.joints[0], shape.joint_count * sizeof(JointState));
  piece(&state.feedback[0], shape.joint_count * sizeof(JointWatch));
  piece(&state.waiting, sizeof(state.waiting));
  piece(&state.fallback, sizeof(state.fallback));
  piece(&state.candidate, sizeof(state.candidate));
  piece(&state.candidate_misses, TickWindow::saved_bytes(shape.window_ticks));
  piece(&state.candidate_refusals, TickWindow::saved_bytes(shape.window_ticks));
  piece(&state.candidate_clamped, TickWindow::saved_bytes(shape.window_ticks));
  for (const Seat seat : kSeats) {
    piece(&state.seats[seat], kSeatBytes);
    piece(&state.seats[seat].chunk, chunks.in_use[seat]);
  }
  piece(&state.waiting_chunk, chunks.waiting);
}

std::string refuse(const char* what) {
  return std::string("keyframe: ") + what + "; replay from another keyframe, or with the Takt that made this run";
}

const char* damage_in(const KeyframeHeader& header, const TickConfig& config, std::span<const std::byte> bytes) {
  if (header.magic != kMagic) return "not a keyframe";
  if (header.layout != kStateLayout) return "made by a different version of the pipeline";
  if (header.joint_count != config.joint_count) return "joint count differs from the configuration's";
  if (header.window_ticks != config.freshness.window_ticks) return "freshness window differs from the configuration's";
  if (header.remembered != remembered_observations(config)) return "max_age differs from the configuration's";
  const ChunkBytes chunks = chunks_of(header);
  if (chunks.largest() > sizeof(CommandChunk) || header.bytes != fixed_bytes(shape_of(header)) + chunks.all())
    return "sizes do not add up";
  if (bytes.size() < header.bytes) return "cut short";
  if (checksum(bytes.subspan(sizeof(header), header.bytes - sizeof(header))) != header.checksum)
    return "checksum does not match";
  return nullptr;
}

bool is_consistent(const CommandInUse& command, const CommandChunk& chunk, std::size_t bytes,
                   const TickConfig& config) {
  if (command.sequence == 0) return bytes == 0;
  const CommandHeader& header = chunk.header;
  return bytes >= sizeof(CommandHeader) && header.step_count >= 1 && header.step_count <= kMaxChunkSteps &&
         header.joint_count == config.joint_count && header.step_period > Duration{0} && chunk.used_bytes() == bytes;
}

bool is_consistent(const TickState& state, const TickConfig& config, const ChunkBytes& chunks) {
  const bool waiting_fits = is_consistent(state.waiting.command, state.waiting_chunk, chunks.waiting, config);
  const bool seats_fit = std::ranges::all_of(kSeats, [&](Seat seat) {
    const SeatState& one = state.seats[seat];
    return is_consistent(one.command, one.chunk, chunks.in_use[seat], config) && one.join.delays.is_consistent();
  });
  const JointMask given_up = state.mode.deenergised | state.mode.damped | state.mode.held | state.mode.holding;
  return waiting_fits && seats_fit && static_cast<std::size_t>(state.mode.mode) < kModeCount &&
         static_cast<std::size_t>(state.mode.stop_cause) < kCauseCount &&
         static_cast<std::size_t>(state.mode.player) < kMoverCount &&
         static_cast<std::size_t>(state.mode.last_player) < kMoverCount &&
         (given_up & ~every_joint(config.joint_count)) == 0 && state.recovery.relapses <= kMaxDoublings &&
         std::isfinite(state.recovery.excess) && state.recovery.excess >= 0 &&
         state.misses.fits(config.freshness.window_ticks) && state.refusals.fits(config.freshness.window_ticks) &&
         state.clamped.fits(config.freshness.window_ticks) &&
         state.fallback_clamped.fits(config.freshness.window_ticks) && state.late.fits(config.freshness.window_ticks) &&
         state.candidate_misses.fits(config.freshness.window_ticks) &&
         state.candidate_refusals.fits(config.freshness.window_ticks) &&
         state.candidate_clamped.fits(config.freshness.window_ticks) && state.candidate.in_charge <= 1 &&
         state.memory.is_consistent();
}

}  // namespace

std::size_t save(const TickState& state, std::span<std::byte> out) noexcept {
  const ChunkBytes chunks = chunk_bytes(state);
  const std::size_t total = fixed_bytes(state.shape) + chunks.all();
  if (out.size() < total) return 0;
  std::size_t at = sizeof(KeyframeHeader);
  walk(state, state.shape, chunks, [&](const void* piece, std::size_t size) {
    std::memcpy(out.data() + at, piece, size);
    at += size;
  });
  KeyframeHeader header;
  header.layout = kStateLayout;
  header.bytes = static_cast<std::uint32_t>(total);
  header.joint_count = state.shape.joint_count;
  header.window_ticks = state.shape.window_ticks;
  header.remembered = state.shape.remembered;
  for (const Seat seat : kSeats) header.chunk_bytes[seat] = static_cast<std::uint32_t>(chunks.in_use[seat]);
  header.waiting_bytes = static_cast<std::uint32_t>(chunks.waiting);
  header.checksum = checksum(out.subspan(sizeof(header), total - sizeof(header)));
  std::memcpy(out.data(), &header, sizeof(header));
  return total;
}

bool is_of_this_layout(std::span<const std::byte> keyframe) noexcept {
  KeyframeHeader header;
  if (keyframe.size() < sizeof header) return false;
  std::memcpy(&header, keyframe.data(), sizeof header);
  return header.magic == kMagic && header.layout == kStateLayout;
}

std::expected<void, std::string> load(TickState& state, const TickConfig& config, std::span<const std::byte> bytes) {
  KeyframeHeader header;
  if (bytes.size() < sizeof(header)) return std::unexpected(refuse("cut short"));
  std::memcpy(&header, bytes.data(), sizeof(header));
  if (const char* what = damage_in(header, config, bytes); what != nullptr) return std::unexpected(refuse(what));
  const TickStatePtr loaded = make_tick_state(config);
  const ChunkBytes chunks = chunks_of(header);
  std::size_t at = sizeof(header);
  walk(*loaded, shape_of(header), chunks, [&](void* piece, std::size_t size) {
    std::memcpy(piece, bytes.data() + at, size);
    at += size;
  });
  if (!is_consistent(*loaded, config, chunks)) return std::unexpected(refuse("contents contradict themselves"));
  state = *loaded;
  return {};
}

void remember_more(TickState& state, const TickConfig& config) noexcept {
  const std::uint32_t remembered = remembered_observations(config);
  state.memory.deepen(state.shape.remembered, remembered);
  state.shape.remembered = remembered;
}

}  // namespace takt::pipeline
