// How far a panel is: on a terminal one line with a bar and the time left, rewritten as rows arrive; elsewhere nothing.
#pragma once

#include <chrono>
#include <cstddef>

namespace takt::cli {

class PanelProgress {
 public:
  explicit PanelProgress(std::size_t planned);
  ~PanelProgress();  // leaves the line empty
  PanelProgress(const PanelProgress&) = delete;
  PanelProgress& operator=(const PanelProgress&) = delete;
  void one_more();

 private:
  using Clock = std::chrono::steady_clock;
  void show(Clock::time_point now);
  bool terminal_;
  std::size_t planned_, done_ = 0;
  Clock::time_point started_ = Clock::now(), shown_;
};

}  // namespace takt::cli
