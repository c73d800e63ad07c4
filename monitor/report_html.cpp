// report.html: page, script and charting library from the build (report_assets), data from the run. The file carries a
// content security policy that forbids every request, so that opening it tells nobody and needs nobody.
#include <fmt/format.h>

#include "monitor/report.hpp"
#include "monitor/report_assets.hpp"

namespace takt::monitor {
namespace {

// Replaces the one occurrence of `slot`.
void fill(std::string& page, std::string_view slot, std::string_view content) {
  const std::size_t at = page.find(slot);
  if (at != std::string::npos) page.replace(at, slot.size(), content);
}

// JSON inside a script element must not contain the element's end.
std::string for_script(std::string json) {
  for (std::size_t at = json.find("</"); at != std::string::npos; at = json.find("</", at + 3))
    json.insert(at + 1, "\\");
  return json;
}

template <class Samples, class Format>
std::string rows(const Samples& samples, const Format& format) {
  std::string text = "[";
  for (const auto& sample : samples) text += (text.size() == 1 ? "[" : ",[") + format(sample) + "]";
  return text + "]";
}

// Written by hand because it is large and its digits are chosen: 0.1 ms of time, 1 us of age, 0.1 mrad.
std::string series_json(const RunSeries& series) {
  std::string text = fmt::format("{{\"bucket_ticks\":{},\"age\":", series.bucket_ticks);
  text += rows(series.age, [](const auto& s) { return fmt::format("{:.4f},{:.3f}", s.at_s, s.total_ms); });
  text += ",\"stages\":" + rows(series.stages, [](const auto& s) {
            return fmt::format("{:.4f},{:.3f}", s.at_s, fmt::join(s.part_ms, ","));
          });
  text += ",\"joints\":[";
  for (std::size_t joint = 0; joint < series.joints.size(); ++joint) {
    text += (joint == 0 ? "" : ",") + rows(series.joints[joint], [](const auto& s) {
              return fmt::format("{:.4f},{:.4f},{:.4f}", s.at_s, s.q, s.reference);
            });
  }
  return text + "]}";
}

nlohmann::ordered_json modes_json(const RunMetrics& metrics) {
  nlohmann::ordered_json bands = nlohmann::ordered_json::array();
  double from = 0;
  const MonoTime start = metrics.start;
  for (const Transition& each : metrics.transitions) {
    const double at = (each.at - start).seconds();
    bands.push_back({from, at, takt::name(each.from), takt::name(each.cause)});
    from = at;
  }
  bands.push_back({from, metrics.span.seconds(), takt::name(metrics.last_mode), ""});
  return bands;
}

}  // namespace

std::string report_html(const RunMetrics& metrics, const RunSeries& series, const RecordedRun& run) {
  const nlohmann::ordered_json facts{
      {"metrics", to_json(metrics, run)},
      {"joints", run.manifest.joints},
      {"host", run.manifest.host},
      {"complete", run.manifest.complete},
      {"started", utc_text(run.manifest.started_at.ns + run.manifest.clock.monotonic_to_unix_ns)},
      {"modes", modes_json(metrics)},
      {"text", report_text(metrics, run, 200)}};
  std::string page(assets::page_html);
  fill(page, "/*DYGRAPHS_CSS*/", assets::dygraphs_css);
  fill(page, "/*DYGRAPHS_JS*/", assets::dygraphs_js);
  fill(page, "/*SYNCHRONIZER_JS*/", assets::synchronizer_js);
  fill(page, "/*PAGE_CSS*/", assets::page_css);
  fill(page, "/*PAGE_JS*/", assets::page_js);
  fill(page, "/*FACTS*/", for_script(facts.dump()));
  fill(page, "/*SERIES*/", series_json(series));
  return page;
}

}  // namespace takt::monitor
