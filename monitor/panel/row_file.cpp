#include "monitor/panel/row_file.hpp"

#include <filesystem>
#include <fstream>

#include "monitor/panel/rollout_json.hpp"

namespace takt::panel {

std::expected<RowFile, std::string> RowFile::open(const std::string& folder, bool resume) {
  const std::string path = folder + "/rollouts.jsonl";
  const bool exists = std::filesystem::exists(path);
  if (exists && !resume)
    return std::unexpected(path + " exists already: choose another --out, or go on with it by --resume");
  RowFile made;
  std::error_code ignored;
  std::filesystem::create_directories(folder, ignored);
  std::uintmax_t good = 0;
  if (exists) {
    std::ifstream stream(path, std::ios::binary);
    for (std::string line; std::getline(stream, line) && !stream.eof();) {
      const auto row = row_of(line);
      if (!row) return std::unexpected(path + ": " + row.error());
      made.rows_.push_back(*row);
      made.ids_.insert(rollout_id(*row));
      good += line.size() + 1;
    }
    std::filesystem::resize_file(path, good, ignored);
  }
  made.file_.reset(std::fopen(path.c_str(), "ae"));
  if (!made.file_) return std::unexpected(path + ": cannot be written");
  return made;
}

std::expected<void, std::string> RowFile::append(const RolloutRow& row) {
  const auto text = row_text(row);
  if (!text) return std::unexpected(text.error());
  if (std::fprintf(file_.get(), "%s\n", text->c_str()) < 0 || std::fflush(file_.get()) != 0)
    return std::unexpected("a row cannot be written: is the disk full?");
  rows_.push_back(row);
  ids_.insert(rollout_id(row));
  return {};
}

}  // namespace takt::panel
