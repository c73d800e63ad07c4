// SPDX-License-Identifier: Apache-2.0
// Text files built into the program (embed_text.cmake): the report's page, its scripts one behind the other, and the
// charting library of the build machine's libjs-dygraphs package.
#pragma once

#include <string_view>

namespace takt::evidence::assets {

extern const std::string_view page_html, page_css, page_js, dygraphs_js, dygraphs_css;

}  // namespace takt::evidence::assets
