// SPDX-License-Identifier: Apache-2.0
// report.html: page, script and charting library from the build (report_assets), data from the run. The file carries a
// content security policy that forbids every request, so that opening it sends nothing and needs nothing.
#include "evidence/review/report/report_html.hpp"

#include "evidence/review/report/packed_block.hpp"
#include "evidence/review/report/report_assets.hpp"
#include "evidence/review/report/report_text.hpp"
#include "evidence/review/report/robot_figure.hpp"

namespace takt::evidence {
namespace {

using Json = nlohmann::ordered_json;

// Replaces the one occurrence of `slot`.
void fill(std::string& page, std::string_view slot, std::string_view content) {
  const std::size_t at = page.find(slot);
  if (at != std::string::npos) page.replace(at, slot.size(), content);
}

// JSON inside a script element must not contain the element's end, nor what begins a comment there.
std::string for_script(const Json& json) {
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at)) {
    text.replace(at, 1, "\\u003c");
  }
  return text;
}

Json modes_json(const RunSeries& series) {
  Json bands = Json::array();
  for (const ModeBand& band : series.modes) {
    const std::string_view left_by = band.left_by == Cause::none ? "" : takt::name(band.left_by);
    bands.push_back({band.from_s, band.to_s, takt::name(band.mode), left_by});
  }
  return bands;
}

Json violations_json(const monitor::FaultSummary& faults, MonoTime start) {
  Json violations = Json::array();
  for (const monitor::FaultVerdict& verdict : faults.verdicts) {
    violations.push_back({{"at_s", (verdict.at - start).seconds()},
                          {"first_tick", verdict.first_tick},
                          {"last_tick", verdict.last_tick},
                          {"fault", name(verdict.fault)},
                          {"gravity", name(verdict.gravity)},
                          {"lateness_ms", verdict.lateness.milliseconds()},
                          {"sentence", verdict.sentence}});
  }
  return violations;
}

Json marks_json(const monitor::RunMetrics& metrics) {
  Json marks = Json::array();
  for (const monitor::Mark& mark : metrics.marks) {
    marks.push_back({{"at_s", (mark.at - metrics.start).seconds()}, {"tick", mark.tick}, {"text", mark.text}});
  }
  return marks;
}

Json seen_json(const std::vector<SeenBySensor>& seen) {
  Json sensors = Json::array();
  for (const SeenBySensor& each : seen) {
    Json pictures = Json::array();
    for (const Picture& picture : each.pictures)
      pictures.push_back({{"sensed_s", picture.sensed_s},
                          {"published_s", picture.published_s},
                          {"until_s", picture.until_s ? Json(*picture.until_s) : Json(nullptr)},
                          {"width", picture.shape.width},
                          {"height", picture.shape.height},
                          {"png", base64_of(picture.png)}});
    sensors.push_back({{"sensor", each.sensor},
                       {"shown", each.shown},
                       {"without_file", each.without_file},
                       {"unreadable", each.unreadable},
                       {"pictures", pictures}});
  }
  return sensors;
}

Json joints_json(const config::RobotConfig& robot) {
  Json joints = Json::array();
  for (const config::Joint& joint : robot.joints) {
    const config::Limits& limits = joint.limits;
    joints.push_back({{"name", joint.name},
                      {"q_min", limits.q_min},
                      {"q_max", limits.q_max},
                      {"velocity", limits.velocity},
                      {"torque", limits.torque},
                      {"kp", joint.kp},
                      {"kd", joint.kd},
                      {"damping", joint.damping}});
    if (joint.kind == config::JointKind::slide) joints.back()["slides"] = true;
  }
  return joints;
}

Json facts_of(const ReportContent& content, const Json& whole, const Json& moments) {
  const monitor::RunManifest& manifest = content.run.manifest;
  Json buses = Json::array();
  for (const config::Bus& bus : content.run.robot.buses) buses.push_back(bus.name);
  return {
      {"metrics", to_json(content.metrics, content.run)},
      {"joints", joints_json(content.run.robot)},
      {"buses", buses},
      {"intervention_kinds", kInterventionNames},
      {"host", manifest.host},
      {"complete", manifest.complete},
      {"started", monitor::utc_text(manifest.started_at.ns + manifest.clock.monotonic_to_unix_ns)},
      {"period_s", content.run.robot.control.period.seconds()},
      {"modes", modes_json(content.series)},
      {"violations", violations_json(content.faults, content.metrics.start)},
      {"violation_count", content.faults.total()},
      {"marks", marks_json(content.metrics)},
      {"seen", seen_json(content.series.seen)},
      {"figure", robot_figure(content.run.robot)},
      {"comparison", content.comparison ? to_json(*content.comparison) : Json(nullptr)},
      {"together", contract_text(content.metrics)},
      {"text", report_text(content.metrics, content.run, 200) + faults_of_record(content.metrics, content.faults, 200)},
      {"whole", whole},
      {"moments", moments}};
}

}  // namespace

std::string report_html(const ReportContent& content) {
  const PackedBlock whole = pack(content.series.whole);
  const PackedBlock moments = pack(content.series.moments);
  std::string page(assets::page_html);
  fill(page, "/*DYGRAPHS_CSS*/", assets::dygraphs_css);
  fill(page, "/*DYGRAPHS_JS*/", assets::dygraphs_js);
  fill(page, "/*PAGE_CSS*/", assets::page_css);
  fill(page, "/*PAGE_JS*/", assets::page_js);
  fill(page, "/*MOMENTS*/", moments.base64);
  fill(page, "/*WHOLE*/", whole.base64);
  fill(page, "/*FACTS*/", for_script(facts_of(content, whole.layout, moments.layout)));  // last: its text is untrusted
  return page;
}

}  // namespace takt::evidence
