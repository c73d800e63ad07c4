// SPDX-License-Identifier: Apache-2.0
// The recorder's own eyes: reads every image sensor that the robot's policies are shown, as any reader does, and keeps
// the newest images in memory. When a policy's process says that one of them was shown (policy_input.hpp), it is
// hashed, written into the run folder (record/image_store.hpp) and handed on as a ShownImage. So a file's bytes are the
// sensor's, not the policy's word; that the policy was shown them remains its claim.
// For viewers it is handed on as a PNG too (ShownPicture), of each camera as many of those
// written as fit into 256 KiB/s in the mean.
//
// Two threads of its own: one reads and hashes and waits for no disk, one writes. Memory is bounded: 64 MiB of images
// of each sensor not asked for yet, and as much waiting for the disk. An image that is asked for and not there,
// because it was overwritten before it was read, or was never published, is told as `unseen`.
// Thread rule: shown(), hand_on() and finish() from one thread; none of them waits but finish(), which ends the
// threads.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/image_sample.hpp"
#include "executive/contract/session.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"
#include "monitor/record/byte_allowance.hpp"
#include "monitor/record/image_store.hpp"
#include "monitor/record/policy_input_message.hpp"
#include "monitor/record/record_stream.hpp"

namespace takt::monitor {

class ImageWatch {
 public:
  // Where the robot's policies are shown no images, or nothing of them is recorded, this does nothing.
  ImageWatch(const std::string& runtime_directory, const config::RobotConfig& robot, const RunFolder& folder);
  ImageWatch(const ImageWatch&) = delete;
  ImageWatch& operator=(const ImageWatch&) = delete;
  ~ImageWatch();

  // What a policy's process said.
  void shown(const PolicyInput& input);
  // What became of the images since the last call: to the sink's `image`, its `loss` where there is no file, and its
  // `picture`.
  void hand_on(const RecordSink& sink);
  // The rest of it. Afterwards nothing may be shown any more.
  void finish(const RecordSink& sink);

 private:
  struct Seen {
    ImageHeader header;
    std::string content, sha256;  // image_file(); hashed when it is asked for
  };
  struct Request {
    ShownImage image;
    MonoTime asked_at;
  };
  struct Job {
    ShownImage image;
    std::shared_ptr<const Seen> seen;
  };
  class Camera;
  struct Attached {
    ipc::Lease lease;
    ipc::Segment segment;
    ipc::SlotReader reader;
  };

  void watch(const std::stop_token& stop);
  void look(bool is_last);
  void resolve(Request& request, bool is_last);
  void write(const std::stop_token& stop);
  void tell(const ShownImage& image);
  void draw(const ShownImage& image, const Seen& seen);

  std::vector<std::unique_ptr<Camera>> cameras_;  // of images, null for each other sensor of the robot file
  std::vector<config::Sensor> sensors_;
  std::vector<std::deque<ShownImage>> asked_;  // newest of each sensor, so that each image is asked for once
  ImageStore store_;                           // the writer's
  std::vector<ByteAllowance> picture_bytes_;   // the writer's; of each sensor
  std::vector<Request> unresolved_;            // the watcher's

  std::mutex requests_mutex_, jobs_mutex_, results_mutex_;
  std::vector<Request> requests_;
  std::deque<Job> jobs_;
  std::size_t job_bytes_ = 0;
  std::condition_variable_any has_jobs_;
  std::vector<ShownImage> results_;
  std::vector<ShownPicture> pictures_;  // under results_mutex_
  std::jthread watcher_, writer_;       // last: end first
};

}  // namespace takt::monitor
