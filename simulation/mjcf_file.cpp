#include "simulation/mjcf_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <regex>

namespace takt::plant {
namespace {

std::ptrdiff_t line_of(const std::string& text, std::size_t at) {
  return 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
}

std::string only_newlines(const std::string& text) {
  return std::string(static_cast<std::size_t>(std::ranges::count(text, '\n')), '\n');
}

// Takes out every match; `what` names them.
void take_out(MendedMjcf& file, const std::regex& pattern, const std::string& what) {
  std::size_t count = 0;
  std::ptrdiff_t first_line = 0;
  std::smatch match;
  std::size_t from = 0;
  while (std::regex_search(file.text.cbegin() + static_cast<std::ptrdiff_t>(from), file.text.cend(), match, pattern)) {
    const std::size_t at = from + static_cast<std::size_t>(match.position());
    if (++count == 1) first_line = line_of(file.text, at);
    file.text.replace(at, static_cast<std::size_t>(match.length()), only_newlines(match.str()));
    from = at;
  }
  if (count > 0)
    file.mended.push_back(
        fmt::format("{} left out, {} times, first in line {}: MuJoCo 2.2.2 does not know it, and the drives' own "
                    "torque limits hold",
                    what, count, first_line));
}

// Puts an attribute into the first element of that name, or into a new one right inside <mujoco>.
void set_attribute(std::string& text, const std::string& element, const std::string& attribute,
                   const std::string& value) {
  const std::string written = fmt::format(" {}=\"{}\"", attribute, value);
  std::smatch match;
  if (std::regex_search(text, match, std::regex("<" + element + "\\b"))) {
    text.insert(static_cast<std::size_t>(match.position() + match.length()), written);
  } else if (std::regex_search(text, match, std::regex("<mujoco\\b[^>]*>"))) {
    text.insert(static_cast<std::size_t>(match.position() + match.length()), fmt::format("<{}{}/>", element, written));
  }
}

bool has(const std::string& text, const std::string& pattern) {
  return std::regex_search(text, std::regex(pattern));
}

void make_absolute(std::string& text, const std::string& pattern, const std::string& folder) {
  std::smatch match;
  std::size_t from = 0;
  const std::regex names(pattern);
  while (std::regex_search(text.cbegin() + static_cast<std::ptrdiff_t>(from), text.cend(), match, names)) {
    const std::size_t at = from + static_cast<std::size_t>(match.position(1));
    const std::string named = match.str(1);
    const std::string absolute = (std::filesystem::path(folder) / named).lexically_normal();
    text.replace(at, named.size(), absolute);
    from = at + absolute.size();
  }
}

}  // namespace

MendedMjcf mend_mjcf(std::string text, const std::string& folder) {
  MendedMjcf file{std::move(text), {}};
  take_out(file, std::regex(R"(\s+actuatorfrc(range|limited)\s*=\s*("[^"]*"|'[^']*'))"), "a joint's actuatorfrcrange");
  take_out(file, std::regex(R"(<jointactuatorfrc\b[^>]*/>)"), "a sensor jointactuatorfrc");
  if (!has(file.text, "\\bautolimits\\s*=")) {
    set_attribute(file.text, "compiler", "autolimits", "true");
    file.mended.emplace_back("autolimits=\"true\" set, as newer versions of MuJoCo have it by themselves");
  }
  make_absolute(file.text, R"(<include\s+file\s*=\s*["']([^"']*)["'])", folder);
  for (const char* directory : {"meshdir", "texturedir"}) {
    if (has(file.text, fmt::format("\\b{}\\s*=", directory)))
      make_absolute(file.text, fmt::format("\\b{}\\s*=\\s*[\"']([^\"']*)[\"']", directory), folder);
    else
      set_attribute(file.text, "compiler", directory, folder);
  }
  return file;
}

}  // namespace takt::plant
