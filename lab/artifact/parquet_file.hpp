// SPDX-License-Identifier: Apache-2.0
// A Parquet file in its simplest form: columns of single values or of lists of them, each a PLAIN uncompressed data
// page per row group.
//
// Every reader knows it. Optional columns carry definition levels, lists definition and repetition levels (one bit
// each). No statistics, dictionaries, compression or page index.
// Source: github.com/apache/parquet-format (README.md, Encodings.md, LogicalTypes.md, parquet.thrift) and the Thrift
// compact protocol.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace takt::lab {

enum class ParquetType : std::uint8_t { boolean, int64, float32, float64, text };
enum class ParquetShape : std::uint8_t { required, optional, list };  // a value per row, at most one, any number

// Values in row order; add() must be called with the column's own type, add_null() only on an optional column. Of a
// list column a row is the add()s that follow a begin_list().
class ParquetColumn {
 public:
  ParquetColumn(std::string name, ParquetType type, ParquetShape shape)
      : name_(std::move(name)), type_(type), shape_(shape) {}
  void add(bool value);
  void add(std::int64_t value);
  void add(float value);
  void add(double value);
  void add(std::string_view value);
  void add_null();
  void begin_list();

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] ParquetType type() const { return type_; }
  [[nodiscard]] ParquetShape shape() const { return shape_; }
  [[nodiscard]] std::size_t rows() const { return rows_; }
  [[nodiscard]] std::size_t entries() const { return present_.size(); }  // values, nulls and empty lists
  [[nodiscard]] std::string page() const;                                // levels and values

 private:
  void begin_value();
  std::string name_;
  ParquetType type_;
  ParquetShape shape_;
  std::size_t rows_ = 0;
  std::vector<bool> present_;    // per entry
  std::vector<bool> continues_;  // per entry of a list column: it is of the same row as the one before
  std::vector<bool> bits_;       // values of a boolean column
  std::string values_;           // PLAIN, of every other
};

using ParquetRowGroup = std::vector<ParquetColumn>;

// Precondition: there is a row group; its columns have the same number of rows, and those of every further one the
// first's names, types and shapes. A group without rows is left out.
std::string parquet_file(const std::string& table, std::span<const ParquetRowGroup> row_groups,
                         const std::vector<std::pair<std::string, std::string>>& metadata);

}  // namespace takt::lab
