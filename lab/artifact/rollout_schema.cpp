// SPDX-License-Identifier: Apache-2.0
// The JSON Schema of a row, from the field table.
#include <utility>

#include "config/load.hpp"
#include "lab/artifact/rollout_fields.hpp"
#include "lab/artifact/rollout_json.hpp"

namespace takt::lab {
namespace {

using Json = nlohmann::ordered_json;

Json with_range(Json type, const Range& range) {
  Json schema{{"type", std::move(type)}};
  if (range.low > -std::numeric_limits<double>::max()) schema["minimum"] = range.low;
  if (range.high < std::numeric_limits<double>::max()) schema["maximum"] = range.high;
  return schema;
}

template <class Enum>
Json names(std::size_t count) {
  Json list = Json::array();
  for (std::size_t index = 0; index < count; ++index) list.push_back(name(static_cast<Enum>(index)));
  return {{"enum", std::move(list)}};
}

struct ToSchema {
  const RolloutField& field;
  Json operator()(const bool* /*place*/) const { return {{"type", "boolean"}}; }
  Json operator()(const std::uint64_t* /*place*/) const {
    return {{"type", "integer"}, {"minimum", 0}, {"maximum", kLargestCount}};
  }
  Json operator()(const double* /*place*/) const { return with_range("number", field.range); }
  Json operator()(const std::optional<double>* /*place*/) const {
    return with_range(Json::array({"number", "null"}), field.range);
  }
  Json operator()(const std::string* /*place*/) const {
    if (field.format == TextFormat::schema) return {{"const", evidence::kRolloutSchema}};
    return {{"type", "string"}, {"pattern", pattern_of(field.format)}};
  }
  Json operator()(const Mode* /*place*/) const { return names<Mode>(kModeCount); }
  Json operator()(const Cause* /*place*/) const { return names<Cause>(kCauseCount); }
};

Json empty_object() {
  return {
      {"type", "object"}, {"additionalProperties", false}, {"required", Json::array()}, {"properties", Json::object()}};
}

// The schema of the object that holds `name`'s last step, made on the way.
Json& holder_of(Json& schema, std::string& name, bool is_added) {
  Json* object = &schema;
  for (std::size_t dot = name.find('.'); dot != std::string::npos; dot = name.find('.')) {
    const std::string step = name.substr(0, dot);
    name.erase(0, dot + 1);
    if (!(*object)["properties"].contains(step)) {
      if (!is_added) (*object)["required"].push_back(step);
      (*object)["properties"][step] = empty_object();
    }
    object = &(*object)["properties"][step];
  }
  return *object;
}

}  // namespace

std::string rollout_schema() {
  Json schema = empty_object();
  const evidence::RolloutRow row;
  for (const RolloutField& field : rollout_fields()) {
    std::string step = field.name;
    Json& holder = holder_of(schema, step, field.is_added);
    Json property = std::visit(ToSchema{field}, place_in(field, row));
    property["description"] = field.unit.empty() ? field.meaning : field.meaning + " [" + field.unit + "]";
    if (!field.is_added) holder["required"].push_back(step);
    holder["properties"][step] = std::move(property);
  }
  Json head{{"$schema", "https://json-schema.org/draft/2020-12/schema"},
            {"title", evidence::kRolloutSchema},
            {"description", "One rollout of a panel: one line of rollouts.jsonl. Made from rollout_fields.cpp."}};
  head.update(schema);
  // The one rule between fields that a schema can say.
  head["if"] = {{"properties", {{"success", {{"const", true}}}}}};
  head["then"] = {{"properties", {{"failure_label", {{"const", ""}}}}}};
  head["else"] = {{"properties", {{"failure_label", {{"minLength", 1}}}}}};
  return head.dump(2) + "\n";
}

std::string rollout_schema_sha256() {
  return config::sha256_hex(rollout_schema());
}

}  // namespace takt::lab
