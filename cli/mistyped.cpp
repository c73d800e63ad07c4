// SPDX-License-Identifier: Apache-2.0
#include "cli/mistyped.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "config/nearest.hpp"
#include "config/printable.hpp"

namespace takt::cli {
namespace {

std::vector<const CLI::App*> children_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

// Option groups are children without a name.
std::vector<std::string> options_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options({}))
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  for (const CLI::App* child : children_of(app))
    if (child->get_name().empty()) std::ranges::copy(options_of(*child), std::back_inserter(names));
  return names;
}

std::vector<std::string> commands_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* child : children_of(app))
    if (!child->get_name().empty()) {
      names.push_back(child->get_name());
      std::ranges::copy(child->get_aliases(), std::back_inserter(names));
    }
  return names;
}

std::string meant(const std::string& word, const std::vector<std::string>& known, const std::string& before) {
  const std::vector<std::string_view> words(known.begin(), known.end());
  const std::string_view best = config::nearest(word, words);
  return best.empty() ? "; " : fmt::format("; did you mean `{}{}`? ", before, best);
}

// A command of this name one group further down, or a file's name where the group has `run`: the words in full.
std::string meant_further_down(const CLI::App& app, const std::string& word, const std::string& before) {
  for (const CLI::App* child : children_of(app)) {
    const std::vector<std::string> names = commands_of(*child);
    if (std::ranges::find(names, word) != names.end())
      return fmt::format("; did you mean `{}{} {}`? ", before, child->get_name(), word);
  }
  const std::vector<std::string> known = commands_of(app);
  const bool has_run = std::ranges::find(known, "run") != known.end();
  return has_run && word.ends_with(".yaml") ? fmt::format("; did you mean `{}run {}`? ", before, word) : "";
}

std::string help_for(const std::string& path) {
  return "`takt help" + path.substr(std::min(path.find(' '), path.size())) + "`";
}

}  // namespace

std::optional<std::string> mistyped(const CLI::App& app, const std::vector<std::string>& words) {
  const CLI::App* at = &app;
  std::string path = app.get_name();
  for (const std::string& word : words) {
    if (word == "--") return std::nullopt;
    const std::string name = word.substr(0, word.find('='));
    if (name.starts_with("--")) {
      const std::vector<std::string> known = options_of(*at);
      if (std::ranges::find(known, name) != known.end()) continue;
      return config::printable(
          fmt::format("`{}` has no option {}{}{} lists them", path, name, meant(name, known, ""), help_for(path)));
    }
    const std::vector<std::string> known = commands_of(*at);
    if (word.starts_with('-') || known.empty()) continue;
    if (std::ranges::find(known, word) == known.end()) {
      const std::string elsewhere = meant_further_down(*at, word, path + ' ');
      return config::printable(fmt::format("there is no command `{} {}`{}{} lists them", path, word,
                                           elsewhere.empty() ? meant(word, known, path + ' ') : elsewhere,
                                           help_for(path)));
    }
    at = at->get_subcommand(word);
    path += ' ' + word;
  }
  return std::nullopt;
}

}  // namespace takt::cli
