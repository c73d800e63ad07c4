// SPDX-License-Identifier: Apache-2.0
// Summaries of closed runs, each written by a process of its own: to read a long run again takes tens of seconds and 64
// bytes per tick, and the executive's next session must not wait for that, nor be lost with its memory.
// Thread rule: one thread at a time.
#pragma once

#include <sys/types.h>

#include <expected>
#include <string>
#include <vector>

namespace takt::monitor {

class ClosingReviews {
 public:
  ClosingReviews() = default;
  ClosingReviews(const ClosingReviews&) = delete;
  ClosingReviews& operator=(const ClosingReviews&) = delete;
  ~ClosingReviews();  // waits for those under way

  // Starts this very program with `--review RUN_FOLDER`; the signals that ask a monitor to end do not end it, a monitor
  // that crashes does. The error is one sentence.
  std::expected<void, std::string> begin(const std::string& run_folder);
  // Takes leave of those that ended, and logs what was not written. Does not wait.
  void look();

 private:
  struct Review {
    pid_t pid = 0;
    std::string run_folder;
  };
  static bool is_over(const Review& review, int options);

  std::vector<Review> under_way_;
};

}  // namespace takt::monitor
