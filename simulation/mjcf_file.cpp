#include "simulation/mjcf_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <regex>
#include <string_view>

namespace takt::plant {
namespace {

std::ptrdiff_t line_of(const std::string& text, std::size_t at) {
  return 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
}

std::string only_newlines(const std::string& text) {
  return std::string(static_cast<std::size_t>(std::ranges::count(text, '\n')), '\n');
}

bool is_space(char letter) {
  return std::string_view(" \t\n\v\f\r").find(letter) != std::string_view::npos;
}

// A whole word, or a tag's beginning, and a regular expression for what follows: such an expression alone is tried at
// every letter, which takes longer than MuJoCo takes to read the file.
class Pattern {
 public:
  Pattern(std::string word, const std::string& rest)
      : word_(std::move(word)), whole_((word_.front() == '<' ? "" : "\\b") + word_ + rest) {}

  // Where the first match from there on begins; npos: there is none.
  std::size_t find(const std::string& text, std::size_t from, std::smatch& match) const {
    for (std::size_t at = text.find(word_, from); at != std::string::npos; at = text.find(word_, at + 1)) {
      auto flags = std::regex_constants::match_continuous;
      if (at != 0) flags |= std::regex_constants::match_prev_avail;
      if (std::regex_search(text.cbegin() + static_cast<std::ptrdiff_t>(at), text.cend(), match, whole_, flags))
        return at;
    }
    return std::string::npos;
  }
  [[nodiscard]] bool is_in(const std::string& text) const {
    std::smatch match;
    return find(text, 0, match) != std::string::npos;
  }

 private:
  std::string word_;
  std::regex whole_;
};

// Takes out every match, an attribute with the space before it; `what` names them.
void take_out(MendedMjcf& file, const Pattern& pattern, const std::string& what) {
  std::size_t count = 0;
  std::ptrdiff_t first_line = 0;
  std::smatch match;
  std::size_t from = 0;
  for (std::size_t at = 0; (at = pattern.find(file.text, from, match)) != std::string::npos; from = at) {
    const std::size_t end = at + static_cast<std::size_t>(match.length());
    if (file.text[at] != '<')
      while (at > from && is_space(file.text[at - 1])) --at;
    if (++count == 1) first_line = line_of(file.text, at);
    file.text.replace(at, end - at, only_newlines(file.text.substr(at, end - at)));
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
  const std::size_t npos = std::string::npos;
  if (const std::size_t at = Pattern("<" + element, "\\b").find(text, 0, match); at != npos) {
    text.insert(at + static_cast<std::size_t>(match.length()), written);
  } else if (const std::size_t root = Pattern("<mujoco", "\\b[^>]*>").find(text, 0, match); root != npos) {
    text.insert(root + static_cast<std::size_t>(match.length()), fmt::format("<{}{}/>", element, written));
  }
}

void make_absolute(std::string& text, const Pattern& pattern, const std::string& folder) {
  std::smatch match;
  std::size_t from = 0;
  while ((from = pattern.find(text, from, match)) != std::string::npos) {
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
  take_out(file, Pattern("actuatorfrc", R"((range|limited)\s*=\s*("[^"]*"|'[^']*'))"), "a joint's actuatorfrcrange");
  take_out(file, Pattern("<jointactuatorfrc", R"(\b[^>]*/>)"), "a sensor jointactuatorfrc");
  if (!Pattern("autolimits", "\\s*=").is_in(file.text)) {
    set_attribute(file.text, "compiler", "autolimits", "true");
    file.mended.emplace_back("autolimits=\"true\" set, as newer versions of MuJoCo have it by themselves");
  }
  for (const char* directory : {"meshdir", "texturedir"}) {
    if (Pattern(directory, "\\s*=").is_in(file.text))
      make_absolute(file.text, Pattern(directory, R"(\s*=\s*["']([^"']*)["'])"), folder);
    else
      set_attribute(file.text, "compiler", directory, folder);
  }
  return file;
}

}  // namespace takt::plant
