// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/rollout_json.hpp"

#include <fmt/format.h>

#include <functional>
#include <set>
#include <vector>

#include "config/printable.hpp"
#include "lab/artifact/rollout_fields.hpp"
#include "monitor/record/strict_json.hpp"

namespace takt::lab {
namespace {

using Json = nlohmann::ordered_json;

std::vector<std::string> path_of(const RolloutField& field) {
  std::vector<std::string> path;
  std::size_t begin = 0;
  for (std::size_t dot = field.name.find('.'); dot != std::string::npos; dot = field.name.find('.', begin)) {
    path.push_back(field.name.substr(begin, dot - begin));
    begin = dot + 1;
  }
  path.push_back(field.name.substr(begin));
  return path;
}

struct ToJson {
  Json operator()(const bool* place) const { return *place; }
  Json operator()(const std::uint64_t* place) const { return *place; }
  Json operator()(const double* place) const { return *place; }
  Json operator()(const std::optional<double>* place) const { return place->has_value() ? Json(**place) : Json(); }
  Json operator()(const std::string* place) const { return *place; }
  Json operator()(const Mode* place) const { return name(*place); }
  Json operator()(const Cause* place) const { return name(*place); }
};

template <class Enum>
bool named(const Json& json, std::size_t count, Enum& out) {
  if (!json.is_string()) return false;
  for (std::size_t index = 0; index < count; ++index) {
    out = static_cast<Enum>(index);
    if (json.get_ref<const std::string&>() == name(out)) return true;
  }
  return false;
}

// True when `json` has the field's type; the value is in place then.
struct FromJson {
  const Json& json;
  bool operator()(bool* place) const {
    if (json.is_boolean()) *place = json.get<bool>();
    return json.is_boolean();
  }
  bool operator()(std::uint64_t* place) const {
    if (json.is_number_unsigned()) *place = json.get<std::uint64_t>();
    return json.is_number_unsigned();
  }
  bool operator()(double* place) const {
    if (json.is_number()) *place = json.get<double>();
    return json.is_number();
  }
  bool operator()(std::optional<double>* place) const {
    if (json.is_null()) place->reset();
    if (json.is_number()) *place = json.get<double>();
    return json.is_null() || json.is_number();
  }
  bool operator()(std::string* place) const {
    if (json.is_string()) *place = json.get<std::string>();
    return json.is_string();
  }
  bool operator()(Mode* place) const { return named(json, kModeCount, *place); }
  bool operator()(Cause* place) const { return named(json, kCauseCount, *place); }
};

// The table's names, and the names of the objects that hold them.
struct KnownNames {
  std::set<std::string, std::less<>> fields, groups;
  KnownNames() {
    for (const RolloutField& field : rollout_fields()) {
      fields.insert(field.name);
      for (std::size_t dot = field.name.find('.'); dot != std::string::npos; dot = field.name.find('.', dot + 1)) {
        groups.insert(field.name.substr(0, dot));
      }
    }
  }
};

// First value in `json` that the table does not know; empty when there is none.
std::string first_unknown(const Json& json, const std::string& prefix) {
  static const KnownNames kKnown;
  for (const auto& [key, value] : json.items()) {
    std::string name = prefix + key;
    if (kKnown.groups.contains(name) && value.is_object()) {
      if (std::string unknown = first_unknown(value, name + "."); !unknown.empty()) return unknown;
    } else if (!kKnown.groups.contains(name) && !kKnown.fields.contains(name)) {
      return name;
    }
  }
  return {};
}

std::expected<void, std::string> refuse_unknown(const Json& json) {
  const std::string unknown = first_unknown(json, "");
  if (unknown.empty()) return {};
  return std::unexpected(fmt::format("{} is not a field of {}", config::printable(unknown), evidence::kRolloutSchema));
}

const Json* find(const Json& json, const std::vector<std::string>& path) {
  const Json* value = &json;
  for (const std::string& step : path) {
    if (!value->is_object()) return nullptr;
    const auto found = value->find(step);
    if (found == value->end()) return nullptr;
    value = &*found;
  }
  return value;
}

}  // namespace

std::expected<std::string, std::string> row_text(const evidence::RolloutRow& row, HostFields host) {
  if (auto checked = check(row); !checked) return std::unexpected(config::printable(checked.error()));
  Json json;
  for (const RolloutField& field : rollout_fields()) {
    if ((field.is_host() && host == HostFields::left_out) || is_lacking(field, row)) continue;
    Json* value = &json;
    for (const std::string& step : path_of(field)) value = &(*value)[step];
    *value = std::visit(ToJson{}, place_in(field, row));
  }
  return json.dump();
}

std::expected<evidence::RolloutRow, std::string> row_of(std::string_view line) {
  const auto json = monitor::parse_strict(line);
  if (!json) return std::unexpected(json.error());
  if (!json->is_object()) return std::unexpected("not a JSON object");
  // First of all: an older or newer row differs in many fields, and this says why.
  if (const Json* schema = find(*json, {"schema"}); schema != nullptr && *schema != evidence::kRolloutSchema) {
    return std::unexpected(fmt::format("schema is {}, this version reads \"{}\"", config::printable(schema->dump()),
                                       evidence::kRolloutSchema));
  }
  if (auto known = refuse_unknown(*json); !known) return std::unexpected(known.error());
  evidence::RolloutRow row;
  for (const RolloutField& field : rollout_fields()) {
    const Json* value = find(*json, path_of(field));
    if (value == nullptr && field.is_added) continue;
    if (value == nullptr) return std::unexpected(fmt::format("{} is missing", field.name));
    const FieldPlace place = field.place(row);
    if (!std::visit(FromJson{*value}, place)) {
      return std::unexpected(
          fmt::format("{} is {}, not {}", field.name, config::printable(value->dump()), type_name(place)));
    }
  }
  if (auto checked = check(row); !checked) return std::unexpected(config::printable(checked.error()));
  return row;
}

}  // namespace takt::lab
