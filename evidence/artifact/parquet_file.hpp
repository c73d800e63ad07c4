// A Parquet file in its simplest form: flat columns, one row group, one PLAIN uncompressed data page per column.
//
// Enough for tables of some thousand rows, and every reader knows it. Optional columns carry definition levels (one bit
// per row). No statistics, dictionaries, compression or page index.
// Source: github.com/apache/parquet-format (README.md, Encodings.md, parquet.thrift) and the Thrift compact protocol.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace takt::panel {

enum class ParquetType : std::uint8_t { boolean, int64, float64, text };

// Values in row order; add() must be called with the column's own type, add_null() only on an optional column.
class ParquetColumn {
 public:
  ParquetColumn(std::string name, ParquetType type, bool is_optional)
      : name_(std::move(name)), type_(type), is_optional_(is_optional) {}
  void add(bool value);
  void add(std::int64_t value);
  void add(double value);
  void add(std::string_view value);
  void add_null();

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] ParquetType type() const { return type_; }
  [[nodiscard]] bool is_optional() const { return is_optional_; }
  [[nodiscard]] std::size_t rows() const { return present_.size(); }
  [[nodiscard]] std::string page() const;  // definition levels and values

 private:
  std::string name_;
  ParquetType type_;
  bool is_optional_;
  std::vector<bool> present_;  // per row
  std::vector<bool> bits_;     // values of a boolean column
  std::string values_;         // PLAIN, of every other
};

// Precondition: every column has the same number of rows.
std::string parquet_file(const std::string& table, std::span<const ParquetColumn> columns,
                         const std::vector<std::pair<std::string, std::string>>& metadata);

}  // namespace takt::panel
