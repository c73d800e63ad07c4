// SPDX-License-Identifier: Apache-2.0
// The few SVG elements that Takt's pictures are made of: no script, no style sheet, no request. Text is escaped here.
// Units: px, origin at the top left. Pure. Source: SVG 1.1.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace takt::evidence {

struct SvgBox {
  double x = 0, y = 0, width = 0, height = 0;
};
struct SvgPoint {
  double x = 0, y = 0;
};

// `body`: elements; `title` is what a screen reader says.
std::string svg_document(double width, double height, std::string_view title, std::string_view body);
std::string svg_text(double x, double y, std::string_view text, std::string_view anchor);  // start | middle | end
std::string svg_line(double x1, double y1, double x2, double y2, std::string_view colour);
// `hint` is shown under the pointer.
std::string svg_rectangle(const SvgBox& box, std::string_view colour, double opacity, std::string_view hint);
std::string svg_polyline(std::span<const SvgPoint> points, std::string_view colour);

}  // namespace takt::evidence
