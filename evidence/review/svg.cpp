// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/svg.hpp"

#include <fmt/format.h>

#include "config/xml_text.hpp"

namespace takt::evidence {

std::string svg_document(double width, double height, std::string_view title, std::string_view body) {
  return fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" width="{0:.0f}" height="{1:.0f}" viewBox="0 0 {0:.0f} {1:.0f}" )"
      R"(font-family="system-ui, sans-serif" font-size="13" role="img"><title>{2}</title>)"
      "\n"
      R"(<rect width="100%" height="100%" fill="#ffffff"/>)"
      "\n{3}</svg>\n",
      width, height, config::xml_text(title), body);
}

std::string svg_text(double x, double y, std::string_view text, std::string_view anchor) {
  return fmt::format(R"(<text x="{:.1f}" y="{:.1f}" text-anchor="{}">{}</text>)", x, y, anchor,
                     config::xml_text(text)) +
         "\n";
}

std::string svg_line(double x1, double y1, double x2, double y2, std::string_view colour) {
  return fmt::format(R"(<line x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}" stroke="{}"/>)", x1, y1, x2, y2, colour) +
         "\n";
}

std::string svg_rectangle(const SvgBox& box, std::string_view colour, double opacity, std::string_view hint) {
  return fmt::format(
             R"(<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}" fill="{}" fill-opacity="{:.2f}"><title>{}</title></rect>)",
             box.x, box.y, box.width, box.height, colour, opacity, config::xml_text(hint)) +
         "\n";
}

std::string svg_polyline(std::span<const SvgPoint> points, std::string_view colour) {
  std::string places;
  for (const SvgPoint& point : points) places += fmt::format("{:.1f},{:.1f} ", point.x, point.y);
  return fmt::format(R"(<polyline points="{}" fill="none" stroke="{}" stroke-width="1.5"/>)", places, colour) + "\n";
}

}  // namespace takt::evidence
