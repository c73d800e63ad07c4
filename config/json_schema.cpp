// SPDX-License-Identifier: Apache-2.0
#include "config/json_schema.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "config/based_on.hpp"
#include "config/fields.hpp"
#include "config/joint_defaults.hpp"
#include "config/schema.hpp"

namespace takt::config {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kNumber = "-?[0-9.]+([eE][-+]?[0-9]+)?";

Json plain_number(Range range) {
  Json number{{"type", "number"}};
  if (std::isfinite(range.low)) number[range.low_open ? "exclusiveMinimum" : "minimum"] = range.low;
  if (std::isfinite(range.high)) number[range.high_open ? "exclusiveMaximum" : "maximum"] = range.high;
  // YAML 1.1 takes 1e-3 for a word.
  return {{"anyOf", {number, {{"type", "string"}, {"pattern", fmt::format("^{}$", kNumber)}}}}};
}

Json quantity_in(const std::vector<Dimension>& dimensions) {
  std::string unit;
  for (const Dimension dimension : dimensions)
    for (const Unit& one : units())
      if (one.dimension == dimension) unit += (unit.empty() ? "" : "|") + std::string(one.symbol);
  return {{"type", "string"}, {"pattern", fmt::format("^{} ?({})$", kNumber, unit)}};
}

// Which of two units it is, the joint's kind decides, and `takt config check`.
Json value_of(const Key& key, Dimension dimension, Range range) {
  if (dimension == Dimension::none)
    return key.other ? Json{{"anyOf", {plain_number(range), quantity_in({key.other->dimension})}}}
                     : plain_number(range);
  std::vector<Dimension> dimensions{dimension};
  if (key.other) dimensions.push_back(key.other->dimension);
  dimensions.insert(dimensions.end(), key.mixed.begin(), key.mixed.end());
  return quantity_in(dimensions);
}

Json list_of(Json items, std::size_t least, std::size_t most) {
  Json list{{"type", "array"}, {"items", std::move(items)}};
  if (least > 0) list["minItems"] = least;
  if (most > 0) list["maxItems"] = most;
  return list;
}

Json any_of(Json one, Json other) {
  return {{"anyOf", {std::move(one), std::move(other)}}};
}

Json name_value() {
  return {{"type", "string"}, {"pattern", "^[A-Za-z][A-Za-z0-9_-]*$"}};
}

// Names of the file's own entries are not known here.
Json word_of(Words words, std::string_view none_word) {
  const bool is_reference = words.empty() || words.front() == "base";
  if (is_reference) return {{"type", "string"}};
  Json all = Json::array();
  for (const std::string_view word : words) all.push_back(word);
  if (!none_word.empty()) all.push_back(none_word);
  return {{"enum", all}};
}

class SchemaMaker final : public Fields {
 public:
  Json result() { return std::move(object_); }
  const Json& required() const { return required_; }

  void quantity(const Key& key, double&, Dimension dimension, Range range) override {
    add(key, value_of(key, dimension, range));
  }
  void duration(const Key& key, Duration&, Duration, Duration) override {
    add(key, value_of(key, Dimension::time, {}));
  }
  void whole(const Key& key, std::int64_t&, std::int64_t low, std::int64_t high) override {
    add(key, integer(low, high));
  }
  void whole_or_none(const Key& key, std::optional<int>&, int low, int high) override {
    add(key, any_of(integer(low, high), {{"const", "none"}}));
  }
  void flag(const Key& key, bool&) override { add(key, {{"type", "boolean"}}); }
  void identifier(const Key& key, std::string&) override { add(key, name_value()); }
  void text(const Key& key, std::string&) override { add(key, {{"type", "string"}, {"minLength", 1}}); }
  void one_of(const Key& key, std::string&, Words words, std::string_view, std::string_view none_word) override {
    add(key, word_of(words, none_word));
  }
  void quantities(const Key& key, std::vector<double>&, Dimension dimension, Range range, Count count) override {
    const bool is_counted = count.of != "joint";
    Json list = list_of(value_of(key, dimension, range), is_counted ? count.low : 0, is_counted ? count.high : 0);
    add(key, count.single_allowed ? any_of(value_of(key, dimension, range), std::move(list)) : std::move(list));
  }
  void interval(const Key& key, double&, double&, Dimension dimension, Range range) override {
    add(key, list_of(value_of(key, dimension, range), 2, 2));
  }
  void names(const Key& key, std::vector<std::string>&, Words, std::string_view) override {
    add(key, list_of({{"type", "string"}}, 0, 0));
  }
  void word_or_quantities(const Key& key, std::size_t&, Words words, std::vector<double>&, Dimension dimension,
                          Range range, Count) override {
    add(key, any_of(word_of(words, {}), list_of(value_of(key, dimension, range), 0, 0)));
  }
  void section(const Key& key, const Body& body) override { add(key, below(body)); }
  void optional_section(const Key& key, bool&, const Body& body) override {
    add({key.name, key.doc, "absent"}, below(body));
  }
  void sequence(const Key& key, std::size_t, std::size_t most, const std::function<void(std::size_t)>& resize,
                const ItemBody& item) override {
    resize(1);
    add(key, list_of(below([&](Fields& f) { item(f, 0); }), 0, most));
    resize(0);
  }
  void named_sections(const Key& key, std::vector<std::string>,
                      const std::function<void(const std::vector<std::string>&)>& set_names,
                      const ItemBody& item) override {
    set_names({"NAME"});
    Json sections{{"type", "object"}, {"additionalProperties", below([&](Fields& f) { item(f, 0); })}};
    set_names({});
    add(key, std::move(sections));
  }
  [[nodiscard]] bool shows_all() const override { return true; }

 private:
  static Json integer(std::int64_t low, std::int64_t high) {
    Json whole{{"type", "integer"}, {"minimum", low}};
    if (high != std::numeric_limits<std::int64_t>::max()) whole["maximum"] = high;
    return whole;
  }
  static Json below(const Body& body) {
    SchemaMaker maker;
    body(maker);
    return maker.result();
  }
  void add(const Key& key, Json value) {
    std::string sentence(key.doc);
    if (key.otherwise) sentence += fmt::format(" (default: {})", *key.otherwise);
    value["description"] = sentence;
    object_["properties"][std::string(key.name)] = std::move(value);
    if (!key.otherwise) required_.push_back(key.name);
  }

  Json object_{{"type", "object"}, {"additionalProperties", false}, {"properties", Json::object()}};
  Json required_ = Json::array();
};

}  // namespace

std::string json_schema() {
  SchemaMaker maker;
  RobotConfig robot;
  describe(maker, robot);
  Json schema{{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", "Takt robot file"}};
  // Its base has the other keys.
  schema["if"] = {{"required", {kBasedOn}}};
  schema["else"] = {{"required", maker.required()}};
  schema.update(maker.result());
  Json& shared = schema["properties"][std::string(kJointDefaults)]["items"]["properties"];
  for (const auto& [key, value] : schema["properties"]["joints"]["items"]["properties"].items())
    if (key != "name") shared[key] = value;
  return schema.dump(2) + '\n';
}

}  // namespace takt::config
