#include "config/model_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <regex>
#include <utility>

#include "config/document.hpp"

namespace takt::config {
namespace {

constexpr std::size_t kMostFiles = 256;

std::string without_comments(std::string text) {
  for (std::size_t at = 0; (at = text.find("<!--", at)) != std::string::npos;) {
    const std::size_t end = std::min(text.find("-->", at), text.size() - 3) + 3;
    for (; at < end; ++at)
      if (text[at] != '\n') text[at] = ' ';
  }
  return text;
}

class ModelReader {
 public:
  explicit ModelReader(const std::string& path) : folder_(std::filesystem::path(path).parent_path()) {}

  std::expected<ModelText, std::string> read(const std::string& path) {
    const auto text = open(path);
    if (!text) return std::unexpected(path + ": cannot be read; name an MJCF file as simulation.mujoco.model");
    model_.lines.push_back({0, 1});
    if (auto done = append(*text, 0, 1); !done) return std::unexpected(done.error());
    return std::move(model_);
  }

 private:
  std::expected<std::string, std::string> open(const std::string& path) {
    auto text = read_file(path);
    if (!text) return text;
    model_.files.push_back(path);
    return without_comments(std::move(*text));
  }

  std::expected<void, std::string> append(const std::string& text, std::size_t file, std::size_t line) {
    static const std::regex kInclude(R"re(<include\s+file\s*=\s*(?:"([^"]*)"|'([^']*)')\s*(?:/>|>\s*</include\s*>))re");
    open_.push_back(model_.files[file]);
    std::size_t from = 0;
    for (std::size_t at = 0; (at = text.find("<include", from)) != std::string::npos;) {
      std::smatch match;
      if (!std::regex_search(text.cbegin() + static_cast<std::ptrdiff_t>(at), text.cend(), match, kInclude,
                             std::regex_constants::match_continuous)) {
        line = copy(text.substr(from, at + 1 - from), file, line);
        from = at + 1;
        continue;
      }
      line = copy(text.substr(from, at - from), file, line);
      const std::string named = match[1].matched ? match.str(1) : match.str(2);
      if (auto done = include(named, fmt::format("{}:{}: includes {}", model_.files[file], line, named)); !done)
        return done;
      const std::string element = match.str();
      line += static_cast<std::size_t>(std::ranges::count(element, '\n'));
      from = at + element.size();
    }
    copy(text.substr(from), file, line);
    open_.pop_back();
    return {};
  }

  std::expected<void, std::string> include(const std::string& named, const std::string& where) {
    const std::string path = (folder_ / named).lexically_normal();
    if (std::ranges::find(open_, path) != open_.end() || model_.files.size() == kMostFiles)
      return std::unexpected(where + ", which comes back to itself; take one of the two out");
    const auto text = open(path);
    if (!text) return std::unexpected(where + ", which cannot be read; files are named from the model's folder");
    const std::size_t file = model_.files.size() - 1;
    static const std::regex kRoot(R"(<(mujoco|mujocoinclude)\b[^>]*>)");
    std::smatch root;
    if (!std::regex_search(*text, root, kRoot) || root.str().ends_with("/>")) return {};
    const auto begins = static_cast<std::size_t>(root.position() + root.length());
    const std::size_t ends = text->rfind("</" + root.str(1));
    if (ends == std::string::npos || ends < begins)
      return std::unexpected(where + ", which does not end its <" + root.str(1) + ">");
    const auto line = 1 + std::ranges::count(text->substr(0, begins), '\n');
    return append(text->substr(begins, ends - begins), file, static_cast<std::size_t>(line));
  }

  // Returns the line that its end stands in.
  std::size_t copy(const std::string& text, std::size_t file, std::size_t line) {
    model_.text += text;
    for (const char letter : text)
      if (letter == '\n') model_.lines.push_back({file, ++line});
    return line;
  }

  std::filesystem::path folder_;
  ModelText model_;
  std::vector<std::string> open_;  // files that include the one being read, and it
};

}  // namespace

std::expected<ModelText, std::string> read_model_text(const std::string& path) {
  return ModelReader(path).read(path);
}

std::expected<std::string, std::string> model_bytes(const std::string& path) {
  const auto model = read_model_text(path);
  if (!model) return std::unexpected(model.error());
  std::string bytes;
  for (const std::string& file : model->files) {
    const auto text = read_file(file);
    if (!text) return std::unexpected(text.error());
    bytes += *text;
  }
  return bytes;
}

std::string in_lines_of_files(const ModelText& model, const std::string& sentence) {
  static const std::regex kLine(R"(([Ll]ine (?:number=)?)(\d+))");
  std::string told;
  auto from = sentence.cbegin();
  for (std::sregex_iterator one(sentence.begin(), sentence.end(), kLine), end; one != end; ++one) {
    const std::size_t line = std::min<std::size_t>(std::stoul(one->str(2).substr(0, 9)), model.lines.size());
    const ModelText::Line& stands = model.lines[line == 0 ? 0 : line - 1];
    told.append(from, (*one)[0].first);
    told += fmt::format("{}{}", one->str(1), stands.line);
    if (stands.file != 0) told += " of " + model.files[stands.file];
    from = (*one)[0].second;
  }
  return told.append(from, sentence.cend());
}

}  // namespace takt::config
