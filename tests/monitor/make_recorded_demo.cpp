// make_recorded_demo DIR: a recorded run of the virtual robot, for tests in other languages.
#include <cstdio>
#include <exception>

#include "monitor/bounded_file.hpp"
#include "monitor/report.hpp"
#include "tests/monitor/recorded_demo.hpp"

int main(int argc, char** argv) {
  using namespace takt::monitor;
  if (argc != 2) return 64;
  try {
    const RecordedRun run = record_demo(argv[1]);
    const auto metrics = write_metrics(run);
    const auto series = metrics ? series_of(run, *metrics) : std::unexpected(metrics.error());
    if (!series) throw std::runtime_error(series.error());
    const auto written = replace_file(run.folder.report(), report_html(*metrics, *series, run));
    if (!written) throw std::runtime_error(written.error());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_recorded_demo: %s\n", error.what());
    return 1;
  }
  return 0;
}
