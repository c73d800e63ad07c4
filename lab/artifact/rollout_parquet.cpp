// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/rollout_parquet.hpp"

#include <algorithm>

#include "lab/artifact/parquet_file.hpp"
#include "lab/artifact/rollout_fields.hpp"

namespace takt::lab {
namespace {

struct ColumnType {
  ParquetType operator()(const bool*) const { return ParquetType::boolean; }
  ParquetType operator()(const std::uint64_t*) const { return ParquetType::int64; }
  ParquetType operator()(const double*) const { return ParquetType::float64; }
  ParquetType operator()(const std::optional<double>*) const { return ParquetType::float64; }
  ParquetType operator()(const std::string*) const { return ParquetType::text; }
  ParquetType operator()(const Mode*) const { return ParquetType::text; }
  ParquetType operator()(const Cause*) const { return ParquetType::text; }
};

struct AddValue {
  ParquetColumn& column;
  void operator()(const bool* place) { column.add(*place); }
  void operator()(const std::uint64_t* place) { column.add(static_cast<std::int64_t>(*place)); }
  void operator()(const double* place) { column.add(*place); }
  void operator()(const std::optional<double>* place) { place->has_value() ? column.add(**place) : column.add_null(); }
  void operator()(const std::string* place) { column.add(std::string_view(*place)); }
  void operator()(const Mode* place) { column.add(name(*place)); }
  void operator()(const Cause* place) { column.add(name(*place)); }
};

}  // namespace

std::string rollouts_parquet(std::span<const evidence::RolloutRow> rows, const std::string& artifact_id) {
  ParquetRowGroup columns;
  const evidence::RolloutRow sample;
  for (const RolloutField& field : rollout_fields()) {
    if (!rows.empty() &&
        std::ranges::all_of(rows, [&](const evidence::RolloutRow& row) { return is_lacking(field, row); }))
      continue;
    std::string column_name = field.name;
    std::ranges::replace(column_name, '.', '_');
    const FieldPlace place = place_in(field, sample);
    const bool is_optional = std::holds_alternative<std::optional<double>*>(place);
    const ParquetShape shape = is_optional ? ParquetShape::optional : ParquetShape::required;
    ParquetColumn& column = columns.emplace_back(column_name, std::visit(ColumnType{}, place), shape);
    for (const evidence::RolloutRow& row : rows) std::visit(AddValue{column}, place_in(field, row));
  }
  return parquet_file("rollout", {&columns, 1},
                      {{"takt.row_schema", evidence::kRolloutSchema}, {"takt.artifact_id", artifact_id}});
}

}  // namespace takt::lab
