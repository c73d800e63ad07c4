// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/run_parts.hpp"

#include <malloc.h>

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
                                                                      std::uint64_t part_bytes, Duration longest_part) {
  auto first = Recorder::start(folder, std::move(manifest), robot);
  if (!first) return std::unexpected(first.error());
  return std::unique_ptr<RunParts>(new RunParts(folder, std::move(*first), part_bytes, longest_part));
}

RunParts::RunParts(RunFolder folder, std::unique_ptr<Recorder> first, std::uint64_t part_bytes, Duration longest_part)
    : base_(folder.path()),
      folder_(std::move(folder)),
      part_bytes_(part_bytes),
      longest_part_(longest_part),
      next_at_bytes_(part_bytes),
      next_at_(first->manifest().started_at + longest_part),
      current_(std::move(first)),
      thinner_(into_parts_) {
  sink_ = {.command = [this](const RecordedCommand& command) { thinner_.command(command); },
           .tick = [this](const TickRecord& record) { thinner_.tick(record); },
           .keyframe = [this](const RecordedKeyframe& each) { thinner_.keyframe(each); },
           .frame = [this](const FrameRecord& frame) { thinner_.frame(frame); },
           .loss = [this](const Loss& loss) { current_->sink().loss(loss); },
           .policy_input = [this](const RecordedPolicyInput& input) { thinner_.policy_input(input); },
           .image = [this](const ShownImage& image) { current_->sink().image(image); },
           .picture = [this](const ShownPicture& picture) { current_->sink().picture(picture); }};
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
  if (is_due(keyframe)) begin_next(keyframe);
}

bool RunParts::is_due(const RecordedKeyframe& keyframe) const {
  const bool is_of_newest = keyframe.tick == current_->newest_tick();  // and that tick was not lost
  const bool is_long = current_->size() >= next_at_bytes_ || current_->now() >= next_at_;
  return is_of_newest && is_long && !ending_ && stop_reason().empty();
}

void RunParts::begin_next(const RecordedKeyframe& keyframe) {
  const auto folder = RunFolder::create(base_, number_ + 1);
  auto next = folder ? current_->begin_next(*folder) : std::unexpected(folder.error());
  if (!next) {
    failure_ = next.error();
    std::error_code ignored;
    if (folder) std::filesystem::remove_all(folder->path(), ignored);
    next_at_bytes_ = current_->size() + part_bytes_ / 16;
    next_at_ = current_->now() + Duration{longest_part_.ns / 16};
    return;
  }
  failure_.clear();
  next_at_bytes_ = part_bytes_;
  next_at_ = (*next)->manifest().started_at + longest_part_;
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

void RunParts::wait_for_closer() {
  if (closer_.joinable()) closer_.join();
}

// Each part says by its seal which one it goes on from, so that the seals of a session are a chain.
void RunParts::close_ending() {
  wait_for_closer();
  ending_->recorder->goes_on_from(seal_of_closed_);
  closer_ = std::jthread([this, ending = std::shared_ptr<Ending>(std::move(ending_)),
                          at = current_->manifest().started_at, in = current_->manifest().run_id] {
    if (ending->last_words) ending->last_words(ending->recorder->sink());
    (void)ending->recorder->finish(at, "the recording goes on in " + in);
    seal_of_closed_ = config::file_sha256(RunFolder(ending->folder).seal()).value_or("");
    ending->recorder.reset();
    ::malloc_trim(0);  // its index lay between what lives on
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
