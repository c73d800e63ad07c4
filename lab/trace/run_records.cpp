// SPDX-License-Identifier: Apache-2.0
#include "lab/trace/run_records.hpp"

#include <algorithm>

#include "monitor/record/recorded_run.hpp"

namespace takt::lab {

std::expected<std::vector<TickFacts>, std::string> records_of(const std::string& run_directory) {
  const auto run = monitor::open_run(run_directory);
  if (!run) return std::unexpected(run.error());
  std::vector<TickFacts> records;
  const auto scan =
      monitor::scan_run(*run, {.tick =
                                   [&records](const monitor::RecordedTick& tick) {
                                     const TickRecordHeader& h = tick.record.header;
                                     const SeatRecord& policy = h.seats[Seat::policy];
                                     records.push_back({h.tick, h.now, h.age, policy.command_sequence, h.mode,
                                                        policy.freshness, h.overrun_cause, h.cause});
                                   },
                               .command = {},
                               .keyframe = {},
                               .loss = {}});
  if (!scan) return std::unexpected(scan.error());
  std::ranges::sort(records, {}, &TickFacts::tick);
  return records;
}

}  // namespace takt::lab
