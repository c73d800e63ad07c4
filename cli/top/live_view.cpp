// SPDX-License-Identifier: Apache-2.0
#include "cli/top/live_view.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "config/printable.hpp"
#include "drivers/protocol/bus_load.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "executive/contract/tick_facts.hpp"

namespace takt::monitor::top {
namespace {

constexpr std::uint32_t kExtendedId = 0x8000'0000;  // CAN_EFF_FLAG
constexpr std::uint8_t kFdFrame = 0x80, kBitRateSwitch = 0x01;
constexpr Duration kRecently = seconds(1);

double seconds_on_wire(const FrameRecord& frame, const config::Bus& bus) {
  const drivers::FrameTraffic traffic{
      .bytes = frame.length, .extended = (frame.can_id & kExtendedId) != 0, .fd = (frame.fd_flags & kFdFrame) != 0};
  config::Bus rates = bus;
  if ((frame.fd_flags & kBitRateSwitch) == 0 || rates.data_bitrate == 0) rates.data_bitrate = rates.bitrate;
  return drivers::bit_times(traffic, rates) / bus.bitrate;
}

template <class Entry>
void forget_older(std::deque<Entry>& entries, MonoTime than) {
  while (!entries.empty() && entries.front().at < than) entries.pop_front();
}

}  // namespace

LiveView::Session::Session(const config::RobotConfig& robot)
    : metrics(robot), intervened_at(robot.joints.size()), wire_seconds(robot.buses.size()), incidents(robot) {}

LiveView::LiveView(const config::RobotConfig& robot) : robot_(robot), session_(robot) {
  if (const auto loads = drivers::check_bus_load(robot))
    for (const drivers::BusLoad& load : *loads) planned_loads_.push_back(load.load);
}

void LiveView::begin() {
  session_ = Session(robot_);
  attached_ = true;
  why_.clear();
}

void LiveView::wait(std::string why) {
  attached_ = false;
  why_ = std::move(why);
}

void LiveView::status(const OperatorReply& reply) {
  session_.reply = reply;
  session_.has_status = true;
}

void LiveView::tick(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  if (header.joint_count != robot_.joints.size()) return;
  const bool is_first = session_.metrics.ticks == 0;
  session_.metrics.tick(record);
  session_.incidents.tick(record);
  if (is_first || header.mode != header.previous_mode) session_.mode_since = header.now;
  if (header.mode != header.previous_mode) session_.entered_by = header.cause;
  if (header.seats[Seat::policy].arrival == Arrival::accepted) session_.accepted.add(header.now, 1);
  for (std::size_t joint = 0; joint < robot_.joints.size(); ++joint)
    for (std::size_t kind = 0; kind < kInterventionCount; ++kind)
      if ((record.joints[joint].interventions >> kind & 1U) != 0) session_.intervened_at[joint][kind] = header.now;
  remember_ages(header);
  remember_slice(header);
}

void LiveView::remember_ages(const TickRecordHeader& header) {
  if (header.seats[Seat::policy].freshness == Freshness::missing) return;
  const AgeParts& age = header.age;
  if (relies_on_policy(header)) session_.ages.push_back({header.now, age.total().ns});
  if (header.seats[Seat::policy].arrival == Arrival::accepted)
    session_.stages.push_back({header.now, {age.sense.ns, age.queue.ns, age.infer.ns, age.publish.ns}});
  forget_older(session_.ages, header.now - kWindow);
  forget_older(session_.stages, header.now - kWindow);
}

void LiveView::remember_slice(const TickRecordHeader& header) {
  const std::int64_t number = header.now.ns / kSlice.ns;
  if (slices_.empty() || number - newest_slice_ > static_cast<std::int64_t>(kSlices)) {
    slices_.clear();
    newest_slice_ = number - 1;
  }
  for (; newest_slice_ < number; ++newest_slice_) slices_.emplace_back();
  while (slices_.size() > kSlices) slices_.pop_front();
  Slice& slice = slices_.back();
  slice.mode = slice.ticks == 0 ? header.mode : std::max(slice.mode, header.mode);
  ++slice.ticks;
  if (header.seats[Seat::policy].freshness != Freshness::missing) slice.age = std::max(slice.age, header.age.total());
  slice.missed |= relies_on_policy(header) && !is_usable(header.seats[Seat::policy].freshness);
  slice.marked |= header.operator_request == OperatorRequest::mark;
}

void LiveView::frame(const FrameRecord& frame) {
  if (frame.bus >= robot_.buses.size()) return;
  session_.wire_seconds[frame.bus].add(frame.stamp, seconds_on_wire(frame, robot_.buses[frame.bus]));
}

void LiveView::loss(const Loss& loss) {
  if (loss.ring == "tick" && loss.reason != "before_attach") session_.lost_ticks += loss.count;
}

std::vector<Slice> LiveView::history(MonoTime now) const {
  std::vector<Slice> shown(slices_.begin(), slices_.end());
  const bool is_quiet = now - session_.metrics.newest.now > kSilentAfter;
  if (shown.empty() || !is_quiet) return shown;
  const std::int64_t since = std::clamp<std::int64_t>(now.ns / kSlice.ns - newest_slice_, 0, kSlices);
  shown.resize(shown.size() + static_cast<std::size_t>(since));
  if (shown.size() > kSlices) shown.erase(shown.begin(), shown.end() - static_cast<std::ptrdiff_t>(kSlices));
  return shown;
}

void LiveView::describe_policy(Picture& picture, MonoTime now) const {
  picture.policy_rate = session_.accepted.per_second(now);
  if (robot_.policy) picture.planned_rate = 1 / robot_.policy->period.seconds();
  picture.arrivals = session_.metrics.arrivals;
  if (!session_.has_status) return;
  picture.policy_pid = session_.reply.status.policy_pids[Seat::policy];
  picture.monitor_pid = session_.reply.status.monitor_pid;
  picture.realtime = session_.reply.status.realtime != 0;
}

std::vector<BusPicture> LiveView::buses(MonoTime now) const {
  std::vector<BusPicture> pictures;
  for (std::size_t bus = 0; bus < robot_.buses.size(); ++bus) {
    BusPicture picture{.name = robot_.buses[bus].name,
                       .health = session_.metrics.newest.buses[bus],
                       .tick_to_wire = session_.metrics.newest_to_wire[bus]};
    picture.load = session_.wire_seconds[bus].per_second(now);
    if (bus < planned_loads_.size()) picture.planned = planned_loads_[bus];
    pictures.push_back(std::move(picture));
  }
  return pictures;
}

std::vector<JointPicture> LiveView::joints() const {
  std::vector<JointPicture> pictures;
  for (std::size_t joint = 0; joint < robot_.joints.size(); ++joint) {
    JointPicture picture{
        .name = robot_.joints[joint].name, .kind = robot_.joints[joint].kind, .newest = session_.metrics.joints[joint]};
    picture.ticks = session_.metrics.interventions[joint];
    if (const std::uint32_t code = picture.newest.feedback.error_code; code != 0)
      picture.error = drivers::error_name(robot_.joints[joint].drive, code);
    for (std::size_t kind = 0; kind < kInterventionCount; ++kind) {
      const MonoTime at = session_.intervened_at[joint][kind];
      if (at.is_set() && session_.metrics.newest.now - at <= kRecently)
        picture.recent = static_cast<InterventionMask>(picture.recent | 1U << kind);
    }
    pictures.push_back(std::move(picture));
  }
  return pictures;
}

// The executive's own word where the stop is older than what the rings still held when this view attached.
std::string LiveView::incident() const {
  if (!attached_ || !session_.incidents.stands()) return {};
  if (session_.incidents.latest()) return session_.incidents.latest()->sentence;
  const char* const said = session_.reply.incident.sentence;
  return config::printable({said, strnlen(said, sizeof session_.reply.incident.sentence)});
}

Picture LiveView::picture(MonoTime now) const {
  const LiveMetrics& metrics = session_.metrics;
  Picture picture{.robot = robot_.robot,
                  .max_age = robot_.freshness.max_age,
                  .epsilon = robot_.freshness.epsilon,
                  .confidence = robot_.freshness.confidence};
  picture.why = why_;
  picture.tick = metrics.newest;
  picture.since_tick = now - metrics.newest.now;
  const bool is_silent = picture.tick.tick == 0 || picture.since_tick > kSilentAfter;
  if (attached_) picture.link = is_silent ? Link::silent : Link::live;
  picture.in_mode = metrics.newest.now - session_.mode_since;
  picture.entered_by = session_.entered_by;
  picture.incident = incident();
  picture.history = history(now);
  std::vector<std::int64_t> samples;
  for (const Aged& aged : session_.ages) samples.push_back(aged.age_ns);
  picture.age = quantiles_of(samples);
  for (std::size_t stage = 0; stage < kAgeStageCount; ++stage) {
    samples.clear();
    for (const Staged& staged : session_.stages) samples.push_back(staged.parts_ns[stage]);
    picture.stages[stage] = quantiles_of(samples);
  }
  picture.misses = miss_rate(metrics.deadline_misses, metrics.relied_ticks, picture.epsilon, picture.confidence);
  picture.ticks = metrics.ticks;
  picture.overruns = metrics.overruns;
  picture.skipped_periods = metrics.skipped_periods;
  picture.lost_ticks = session_.lost_ticks;
  describe_policy(picture, now);
  picture.buses = buses(now);
  picture.joints = joints();
  return picture;
}

}  // namespace takt::monitor::top
