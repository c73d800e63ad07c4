// SPDX-License-Identifier: Apache-2.0
#include "monitor/image_watch.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <utility>

#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "config/paths.hpp"
#include "executive/contract/contract_layout.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "monitor/executive_session.hpp"
#include "monitor/record/image_file.hpp"
#include "monitor/record/png_image.hpp"

namespace takt::monitor {
namespace {

constexpr std::chrono::milliseconds kSensorAttachTimeout{100};
constexpr Duration kSensorRetry = milliseconds(50);
constexpr Duration kRound = milliseconds(5);
// A policy may be quicker than we are at finding a sensor that has just begun.
constexpr Duration kPatience = seconds(1);
constexpr std::size_t kMostBytes = std::size_t{64} << 20U;
constexpr std::size_t kFewestImages = 4;
constexpr double kPictureBytesPerSecond = 256 * 1024;
constexpr std::size_t kMostRequests = 8192;
constexpr std::size_t kRememberedRequests = 256;

bool is_same(const ShownImage& image, const ImageHeader& header) {
  return header.sequence == image.sequence && header.published_at == image.published_at &&
         header.sensed_at == image.sensed_at;
}

}  // namespace

// One sensor's mailbox, and the newest of what came through it.
class ImageWatch::Camera {
 public:
  Camera(const std::string& runtime_directory, const config::RobotConfig& robot, const config::Sensor& sensor)
      : socket_(config::sensor_socket(runtime_directory, sensor.name)),
        hello_(hello_of(Role::sensor_reader, "takt-monitor", robot)),
        shape_(*sensor.image),
        ring_(ipc::image_mailbox(shape_.height, shape_.width, shape_.channels)),
        buffer_(ring_.payload_capacity) {}

  void read(MonoTime now) {
    if (attached_) {
      const bool is_over = ipc::is_over(attached_->lease);  // asked first: what it published before that is there
      drain();
      if (is_over) attached_.reset();
    }
    if (attached_ || now < next_attempt_) return;
    next_attempt_ = now + kSensorRetry;
    attach();
    if (attached_) drain();
  }

  // Null: not here.
  std::shared_ptr<Seen> find(const ShownImage& image) const {
    const auto found =
        std::ranges::find_if(seen_, [&](const std::shared_ptr<Seen>& seen) { return is_same(image, seen->header); });
    return found == seen_.end() ? nullptr : *found;
  }

 private:
  void attach() {
    auto lease = ipc::attach(socket_, hello_, kSensorAttachTimeout);
    if (!lease || lease->descriptors.empty()) return;
    auto segment = ipc::Segment::adopt_read_only(lease->descriptors[0].release(), ipc::ring_bytes(ring_));
    if (!segment) return;
    auto reader = ipc::SlotReader::attach(segment->readable(), ring_);
    if (!reader) return;
    attached_.emplace(std::move(*lease), std::move(*segment), *reader);
  }

  void drain() {
    for (std::uint32_t count = 0; count < 2 * ring_.slot_count; ++count) {
      const ipc::ReadResult result = attached_->reader.read_next(buffer_);
      if (result.status == ipc::ReadStatus::nothing_new || result.status == ipc::ReadStatus::contended) return;
      if (result.sequence == 0) return;  // the head itself makes no sense: nothing was consumed
      if (result.status == ipc::ReadStatus::fresh && result.size == buffer_.size()) remember();
    }
  }

  void remember() {
    auto seen = std::make_shared<Seen>();
    std::memcpy(&seen->header, buffer_.data(), sizeof seen->header);
    const auto pixels = std::span<const std::byte>(buffer_).subspan(sizeof(ImageHeader));
    if (seen->header.bytes != pixels.size()) return;
    seen->content = image_file(shape_, pixels);
    bytes_ += seen->content.size();
    seen_.push_back(std::move(seen));
    while (bytes_ > kMostBytes && seen_.size() > kFewestImages) {
      bytes_ -= seen_.front()->content.size();
      seen_.pop_front();
    }
  }

  std::string socket_;
  Hello hello_;
  config::ImageShape shape_;
  ipc::RingShape ring_;
  std::optional<Attached> attached_;
  MonoTime next_attempt_;
  Bytes buffer_;
  std::deque<std::shared_ptr<Seen>> seen_;
  std::size_t bytes_ = 0;
};

ImageWatch::ImageWatch(const std::string& runtime_directory, const config::RobotConfig& robot, const RunFolder& folder)
    : cameras_(robot.sensors.size()),
      sensors_(robot.sensors),
      asked_(robot.sensors.size()),
      store_(folder, robot.record.images),
      picture_bytes_(robot.sensors.size(), ByteAllowance(kPictureBytesPerSecond)) {
  if (config::largest_policy_input(robot) == 0) return;
  bool any = false;
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    const auto shows = [&](const config::ObservationTerm& term) { return term.sensor == sensors_[i].name; };
    if (!sensors_[i].image || std::ranges::none_of(robot.policy->observation, shows)) continue;
    cameras_[i] = std::make_unique<Camera>(runtime_directory, robot, sensors_[i]);
    any = true;
  }
  if (!any) return;
  watcher_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
  writer_ = std::jthread([this](const std::stop_token& stop) { write(stop); });
}

ImageWatch::~ImageWatch() = default;

void ImageWatch::shown(const PolicyInput& input) {
  for (const PolicyInputSample& sample : input.samples) {
    if (sample.sensor >= cameras_.size() || !cameras_[sample.sensor]) continue;
    const ShownImage image{.sequence = sample.sequence,
                           .sensed_at = sample.sensed_at,
                           .published_at = sample.published_at,
                           .sensor = sample.sensor,
                           .shape = *sensors_[sample.sensor].image,
                           .file = ImageFile::unseen,
                           .sha256 = {}};
    std::deque<ShownImage>& asked = asked_[sample.sensor];
    const auto is_this = [&](const ShownImage& other) {
      return other.sequence == image.sequence && other.published_at == image.published_at;
    };
    if (std::ranges::any_of(asked, is_this)) continue;
    asked.push_back(image);
    if (asked.size() > kRememberedRequests) asked.pop_front();
    const std::scoped_lock lock(requests_mutex_);
    if (requests_.size() < kMostRequests)
      requests_.push_back({image, monotonic_now()});
    else
      tell(image);
  }
}

void ImageWatch::watch(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    look(false);
    sleep_until(monotonic_now() + kRound);
  }
  look(true);
}

// Requests first: what they name was published before.
void ImageWatch::look(bool is_last) {
  {
    const std::scoped_lock lock(requests_mutex_);
    unresolved_.insert(unresolved_.end(), requests_.begin(), requests_.end());
    requests_.clear();
  }
  for (const auto& camera : cameras_)
    if (camera) camera->read(monotonic_now());
  for (Request& request : unresolved_) resolve(request, is_last);
  std::erase_if(unresolved_, [](const Request& request) { return !request.asked_at.is_set(); });
}

// Done: no longer asked for.
void ImageWatch::resolve(Request& request, bool is_last) {
  const std::shared_ptr<Seen> seen = cameras_[request.image.sensor]->find(request.image);
  if (!seen) {
    if (!is_last && monotonic_now() - request.asked_at < kPatience) return;
    tell(request.image);
    request.asked_at = {};
    return;
  }
  request.asked_at = {};
  if (seen->sha256.empty()) seen->sha256 = config::sha256_hex(seen->content);
  request.image.sha256 = seen->sha256;
  request.image.file = ImageFile::behind;
  {
    const std::scoped_lock lock(jobs_mutex_);
    if (job_bytes_ + seen->content.size() <= kMostBytes || jobs_.empty()) {
      job_bytes_ += seen->content.size();
      jobs_.push_back({std::move(request.image), seen});
      has_jobs_.notify_one();
      return;
    }
  }
  tell(request.image);
}

void ImageWatch::write(const std::stop_token& stop) {
  std::unique_lock lock(jobs_mutex_);
  for (;;) {
    has_jobs_.wait(lock, stop, [this] { return !jobs_.empty(); });
    if (jobs_.empty()) return;
    Job job = std::move(jobs_.front());
    jobs_.pop_front();
    job_bytes_ -= job.seen->content.size();
    lock.unlock();
    job.image.file = store_.keep(job.image, job.seen->content, monotonic_now());
    tell(job.image);
    if (job.image.file == ImageFile::stored) draw(job.image, *job.seen);
    lock.lock();
  }
}

void ImageWatch::draw(const ShownImage& image, const Seen& seen) {
  ByteAllowance& allowance = picture_bytes_[image.sensor];
  if (!allowance.has_any(monotonic_now())) return;
  const std::span<const char> file = seen.content;
  ShownPicture picture{.sensed_at = image.sensed_at,
                       .sensor = image.sensor,
                       .png = png_image(image.shape, std::as_bytes(file.last(image.shape.bytes())))};
  if (picture.png.empty()) return;
  allowance.take(picture.png.size());
  const std::scoped_lock lock(results_mutex_);
  pictures_.push_back(std::move(picture));
}

void ImageWatch::tell(const ShownImage& image) {
  const std::scoped_lock lock(results_mutex_);
  results_.push_back(image);
}

void ImageWatch::hand_on(const RecordSink& sink) {
  std::vector<ShownImage> results;
  std::vector<ShownPicture> pictures;
  {
    const std::scoped_lock lock(results_mutex_);
    results.swap(results_);
    pictures.swap(pictures_);
  }
  std::array<std::uint64_t, kImageFileNames.size()> without{};
  for (const ShownImage& image : results) {
    sink.image(image);
    if (image.file != ImageFile::stored) ++without[static_cast<std::size_t>(image.file)];
  }
  for (std::size_t file = 0; file < without.size(); ++file) {
    if (without[file] != 0)
      sink.loss({std::string(kImageLoss), std::string(kImageFileNames[file]), without[file], 0, 0});
  }
  for (const ShownPicture& picture : pictures) sink.picture(picture);
}

void ImageWatch::finish(const RecordSink& sink) {
  for (std::jthread* const thread : {&watcher_, &writer_}) {
    if (!thread->joinable()) continue;
    thread->request_stop();
    thread->join();
  }
  hand_on(sink);
}

}  // namespace takt::monitor
