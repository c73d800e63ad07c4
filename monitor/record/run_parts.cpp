// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/run_parts.hpp"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <system_error>
#include <utility>

#include "config/sha256.hpp"

namespace takt::monitor {
namespace {

// Of the answers before a seam whose commands are read behind it: hosts publish both within a few milliseconds.
constexpr std::size_t kRepeatedInputs = 64;
// The inputs of one drain of the rings belong to commands of that drain or of the one before.
constexpr int kDrainsToLinger = 2;

}  // namespace

std::expected<std::unique_ptr<RunParts>, std::string> RunParts::start(const RunFolder& folder, RunManifest manifest,
                                                                      const config::RobotConfig& robot,
                                                                      std::uint64_t part_bytes) {
  auto first = Recorder::start(folder, std::move(manifest), robot);
  if (!first) return std::unexpected(first.error());
  return std::unique_ptr<RunParts>(new RunParts(folder, std::move(*first), part_bytes));
}

RunParts::RunParts(RunFolder folder, std::unique_ptr<Recorder> first, std::uint64_t part_bytes)
    : base_(folder.path()),
      folder_(std::move(folder)),
      part_bytes_(part_bytes),
      next_at_bytes_(part_bytes),
      current_(std::move(first)),
      thinner_(into_parts_) {
  sink_ = {.command = [this](const RecordedCommand& command) { thinner_.command(command); },
           .tick = [this](const TickRecord& record) { thinner_.tick(record); },
           .keyframe = [this](const RecordedKeyframe& each) { thinner_.keyframe(each); },
           .frame = [this](const FrameRecord& frame) { thinner_.frame(frame); },
           .loss = [this](const Loss& loss) { current_->sink().loss(loss); },
           .policy_input = [this](const RecordedPolicyInput& input) { thinner_.policy_input(input); },
           .image = [this](const ShownImage& image) { current_->sink().image(image); }};
  into_parts_ = {.command = [this](const RecordedCommand& command) { current_->sink().command(command); },
                 .tick = [this](const TickRecord& record) { current_->sink().tick(record); },
                 .keyframe = [this](const RecordedKeyframe& each) { keyframe(each); },
                 .frame = [this](const FrameRecord& frame) { current_->sink().frame(frame); },
                 .loss = [this](const Loss& loss) { current_->sink().loss(loss); },
                 .policy_input = [this](const RecordedPolicyInput& input) { policy_input(input); },
                 .image = [this](const ShownImage& image) { current_->sink().image(image); }};
}

RunParts::~RunParts() {
  if (ending_) close_ending();
}

void RunParts::policy_input(const RecordedPolicyInput& input) {
  newest_inputs_.push_back(input);
  if (newest_inputs_.size() > kRepeatedInputs) newest_inputs_.pop_front();
  if (ending_) ending_->recorder->sink().policy_input(input);
  current_->sink().policy_input(input);
}

void RunParts::keyframe(const RecordedKeyframe& keyframe) {
  current_->sink().keyframe(keyframe);
  const bool is_of_newest = keyframe.tick == current_->newest_tick();  // and that tick was not lost
  if (is_of_newest && !ending_ && current_->size() >= next_at_bytes_ && stop_reason().empty()) begin_next(keyframe);
}

void RunParts::begin_next(const RecordedKeyframe& keyframe) {
  const auto folder = RunFolder::create(base_, number_ + 1);
  auto next = folder ? current_->begin_next(*folder) : std::unexpected(folder.error());
  if (!next) {
    failure_ = next.error();
    std::error_code ignored;
    if (folder) std::filesystem::remove_all(folder->path(), ignored);
    next_at_bytes_ = current_->size() + part_bytes_ / 16;
    return;
  }
  failure_.clear();
  next_at_bytes_ = part_bytes_;
  const std::string suffix = folder->path().substr(base_.size() + 1);
  std::from_chars(suffix.data(), suffix.data() + suffix.size(), number_);
  through_before_ = current_->written_through();
  ending_ = std::make_unique<Ending>(std::exchange(current_, std::move(*next)), folder_.path(), nullptr);
  drains_since_seam_ = 0;
  folder_ = *folder;
  current_->sink().keyframe(keyframe);
  for (const RecordedPolicyInput& input : newest_inputs_) current_->sink().policy_input(input);
  if (on_seam_) ending_->last_words = on_seam_(folder_, current_->manifest());
}

void RunParts::flush_if_due(MonoTime now) {
  current_->flush_if_due(now);
  if (ending_ && ++drains_since_seam_ >= kDrainsToLinger) close_ending();
}

// Each part says by its seal which one it goes on from, so that the seals of a session are a chain.
void RunParts::wait_for_closer() {
  if (closer_.joinable()) closer_.join();
}

void RunParts::close_ending() {
  wait_for_closer();
  ending_->recorder->goes_on_from(seal_of_closed_);
  closer_ = std::jthread([this, ending = std::shared_ptr<Ending>(std::move(ending_)),
                          at = current_->manifest().started_at, in = current_->manifest().run_id] {
    if (ending->last_words) ending->last_words(ending->recorder->sink());
    (void)ending->recorder->finish(at, "the recording goes on in " + in);
    seal_of_closed_ = config::file_sha256(RunFolder(ending->folder).seal()).value_or("");
    const std::scoped_lock lock(closed_mutex_);
    closed_.push_back(ending->folder);
  });
}

std::expected<void, std::string> RunParts::finish(MonoTime now, const std::string& because) {
  thinner_.finish();
  if (ending_) close_ending();
  wait_for_closer();
  current_->goes_on_from(seal_of_closed_);
  return current_->finish(now, because);
}

std::uint64_t RunParts::written_through() const {
  if (!stop_reason().empty()) return 0;
  return std::max(current_->written_through(), through_before_);
}

std::vector<std::string> RunParts::take_closed() {
  const std::scoped_lock lock(closed_mutex_);
  return std::exchange(closed_, {});
}

}  // namespace takt::monitor
