// SPDX-License-Identifier: Apache-2.0
#include "config/schema.hpp"

#include <array>

#include "config/based_on.hpp"

namespace takt::config {

void describe(Fields& fields, RobotConfig& robot) {
  constexpr std::array kSchemas{kSchemaName};
  std::string schema(kSchemaName);
  fields.one_of({"schema", "format of this file"}, schema, kSchemas, "schema");
  // For the key table and the schema; a reader finds the base's keys added already.
  std::string base;
  if (fields.shows_all())
    fields.text({kBasedOn, "robot file in this folder whose keys hold where this file has none", "none"}, base);
  std::int64_t revision = kDefaultsRevision;
  fields.whole({.name = "defaults_revision",
                .doc = "of the defaults of omitted keys",
                .otherwise = "the newest",
                .prefilled = true},
               revision, kDefaultsRevision, kDefaultsRevision);
  fields.identifier({"robot", "name of robot and runtime directory"}, robot.robot);
  describe_timing(fields, robot);
  describe_machine(fields, robot);
  describe_policy(fields, robot);
  describe_evidence(fields, robot);
}

std::vector<std::string_view> joint_names(const RobotConfig& robot) {
  std::vector<std::string_view> names;
  for (const Joint& joint : robot.joints) names.push_back(joint.name);
  return names;
}

}  // namespace takt::config
