// Rows of a panel in DIR/rollouts.jsonl, appended as they come.
#pragma once

#include <cstdio>
#include <expected>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "monitor/panel/rollout_row.hpp"

namespace takt::panel {

class RowFile {
 public:
  static std::expected<RowFile, std::string> open(const std::string& folder, bool resume);
  [[nodiscard]] const std::vector<RolloutRow>& rows() const { return rows_; }
  [[nodiscard]] bool has(const RolloutRow& row) const { return ids_.contains(rollout_id(row)); }
  std::expected<void, std::string> append(const RolloutRow& row);

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::unique_ptr<std::FILE, Close> file_;
  std::vector<RolloutRow> rows_;
  std::set<std::string> ids_;
};

}  // namespace takt::panel
