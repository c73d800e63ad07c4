// SPDX-License-Identifier: Apache-2.0
// A tick's words (modes, causes, verdicts, bits) of a run that another version recorded: by the names that stand in the
// run's own description, for their numbers may have moved.
#pragma once

#include <expected>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "executive/contract/tick_record.hpp"
#include "monitor/record/message_schema.hpp"

namespace takt::monitor {

struct TickField;

class TickWords {
 public:
  explicit TickWords(const MessageSchema& recorded);
  [[nodiscard]] bool differ() const { return !changes_.empty(); }
  // Puts this version's numbers for the recorded ones. The error names the word that this version does not know.
  std::expected<void, std::string> translate(TickRecord& record) const;

 private:
  struct Word {
    std::string name;
    std::optional<std::uint64_t> ours{};
  };
  struct Change {
    const TickField* field;
    enum class Group : std::uint8_t { header, bus, joint } group;
    bool is_mask;             // a bit per word
    std::vector<Word> words;  // by the recorded number
  };
  static std::expected<void, std::string> translate(const Change& change, std::byte* value);
  void look_at(std::span<const TickField> fields, Change::Group group, const MessageSchema& recorded);
  std::vector<Change> changes_;
};

}  // namespace takt::monitor
