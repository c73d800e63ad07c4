// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/parquet_file.hpp"

#include <bit>
#include <cassert>

#include "lab/artifact/thrift_compact.hpp"

namespace takt::lab {
namespace {

constexpr std::string_view kMagic = "PAR1";
constexpr std::int32_t kPlain = 0, kRle = 3;                         // enum Encoding
constexpr std::int32_t kRequired = 0, kOptional = 1, kRepeated = 2;  // enum FieldRepetitionType
constexpr std::int32_t kUtf8 = 0, kList = 3;                         // enum ConvertedType
constexpr std::int32_t kUncompressed = 0;                            // enum CompressionCodec
constexpr std::int32_t kDataPage = 0;                                // enum PageType
constexpr std::int32_t kFormatVersion = 1;

template <class Integer>
void append_little_endian(std::string& out, Integer value) {
  for (std::size_t byte = 0; byte < sizeof(Integer); ++byte)
    out.push_back(static_cast<char>(value >> (8 * byte) & 0xFFU));
}

void append_bits(std::string& out, const std::vector<bool>& bits) {
  std::string bytes((bits.size() + 7) / 8, '\0');
  for (std::size_t index = 0; index < bits.size(); ++index) {
    if (bits[index])
      bytes[index / 8] = static_cast<char>(static_cast<unsigned char>(bytes[index / 8]) | 1U << index % 8);
  }
  out += bytes;
}

// enum Type
std::int32_t physical_type(ParquetType type) {
  switch (type) {
    case ParquetType::boolean:
      return 0;
    case ParquetType::int64:
      return 2;
    case ParquetType::float32:
      return 4;
    case ParquetType::float64:
      return 5;
    case ParquetType::text:
      return 6;
  }
  return 0;
}

// Levels of 0 and 1: one bit-packed run in groups of eight, with its length in front.
void append_levels(std::string& out, const std::vector<bool>& levels) {
  std::string run = thrift_varint((levels.size() + 7) / 8 << 1U | 1U);
  append_bits(run, levels);
  append_little_endian(out, static_cast<std::uint32_t>(run.size()));
  out += run;
}

std::string page_header(std::size_t bytes, std::size_t entries) {
  ThriftWriter header;
  header.i32(1, kDataPage);
  header.i32(2, static_cast<std::int32_t>(bytes));  // uncompressed
  header.i32(3, static_cast<std::int32_t>(bytes));  // compressed
  header.begin_struct(5);                           // DataPageHeader
  header.i32(1, static_cast<std::int32_t>(entries));
  header.i32(2, kPlain);
  header.i32(3, kRle);  // definition levels
  header.i32(4, kRle);  // repetition levels
  header.end_struct();
  return header.finish();
}

struct Chunk {
  std::size_t offset, bytes;  // page header and page
};

void group_element(ThriftWriter& out, std::int32_t repetition, const std::string& name, bool is_list) {
  out.begin_element();
  out.i32(3, repetition);
  out.text(4, name);
  out.i32(5, 1);  // child
  if (is_list) out.i32(6, kList);
  out.end_struct();
}

void value_element(ThriftWriter& out, ParquetType type, std::int32_t repetition, const std::string& name) {
  out.begin_element();
  out.i32(1, physical_type(type));
  out.i32(3, repetition);
  out.text(4, name);
  if (type == ParquetType::text) out.i32(6, kUtf8);
  out.end_struct();
}

// The names from the schema's root to the values.
std::vector<std::string> path_of(const ParquetColumn& column) {
  if (column.shape() == ParquetShape::list) return {column.name(), "list", "element"};
  return {column.name()};
}

void schema_elements(ThriftWriter& out, const ParquetColumn& column) {
  if (column.shape() == ParquetShape::list) {
    group_element(out, kRequired, column.name(), true);
    group_element(out, kRepeated, "list", false);
  }
  value_element(out, column.type(), column.shape() == ParquetShape::optional ? kOptional : kRequired,
                path_of(column).back());
}

void column_chunk(ThriftWriter& out, const ParquetColumn& column, const Chunk& chunk) {
  out.begin_element();
  out.i64(2, static_cast<std::int64_t>(chunk.offset));
  out.begin_struct(3);  // ColumnMetaData
  out.i32(1, physical_type(column.type()));
  out.begin_list(2, ThriftType::i32, 2);
  out.element(kPlain);
  out.element(kRle);
  const auto path = path_of(column);
  out.begin_list(3, ThriftType::binary, path.size());
  for (const std::string& name : path) out.element(name);
  out.i32(4, kUncompressed);
  out.i64(5, static_cast<std::int64_t>(column.entries()));
  out.i64(6, static_cast<std::int64_t>(chunk.bytes));
  out.i64(7, static_cast<std::int64_t>(chunk.bytes));
  out.i64(9, static_cast<std::int64_t>(chunk.offset));
  out.end_struct();
  out.end_struct();
}

void row_group(ThriftWriter& out, std::span<const ParquetColumn> columns, std::span<const Chunk> chunks) {
  std::size_t bytes = 0;
  out.begin_element();
  out.begin_list(1, ThriftType::structure, columns.size());
  for (std::size_t index = 0; index < columns.size(); ++index) {
    column_chunk(out, columns[index], chunks[index]);
    bytes += chunks[index].bytes;
  }
  out.i64(2, static_cast<std::int64_t>(bytes));
  out.i64(3, static_cast<std::int64_t>(columns.front().rows()));
  out.end_struct();
}

struct WrittenGroup {
  const ParquetRowGroup& columns;
  std::vector<Chunk> chunks;  // of each column
};

void schema(ThriftWriter& out, const std::string& table, const ParquetRowGroup& columns) {
  std::size_t elements = 1;
  for (const ParquetColumn& column : columns) elements += path_of(column).size();
  out.begin_list(2, ThriftType::structure, elements);
  out.begin_element();
  out.text(4, table);
  out.i32(5, static_cast<std::int32_t>(columns.size()));
  out.end_struct();
  for (const ParquetColumn& column : columns) schema_elements(out, column);
}

std::string file_metadata(const std::string& table, const ParquetRowGroup& columns,
                          std::span<const WrittenGroup> groups,
                          const std::vector<std::pair<std::string, std::string>>& metadata) {
  std::size_t rows = 0;
  for (const WrittenGroup& group : groups) rows += group.columns.front().rows();
  ThriftWriter out;
  out.i32(1, kFormatVersion);
  schema(out, table, columns);
  out.i64(3, static_cast<std::int64_t>(rows));
  out.begin_list(4, ThriftType::structure, groups.size());
  for (const WrittenGroup& group : groups) row_group(out, group.columns, group.chunks);
  out.begin_list(5, ThriftType::structure, metadata.size());
  for (const auto& [key, value] : metadata) {
    out.begin_element();
    out.text(1, key);
    out.text(2, value);
    out.end_struct();
  }
  out.text(6, "takt");
  return out.finish();
}

}  // namespace

void ParquetColumn::begin_value() {
  if (shape_ != ParquetShape::list) {
    ++rows_;
  } else if (!present_.back()) {  // the entry that begin_list() made
    present_.back() = true;
    return;
  } else {
    continues_.push_back(true);
  }
  present_.push_back(true);
}

void ParquetColumn::add(bool value) {
  assert(type_ == ParquetType::boolean);
  begin_value();
  bits_.push_back(value);
}

void ParquetColumn::add(std::int64_t value) {
  assert(type_ == ParquetType::int64);
  begin_value();
  append_little_endian(values_, static_cast<std::uint64_t>(value));
}

void ParquetColumn::add(float value) {
  assert(type_ == ParquetType::float32);
  begin_value();
  append_little_endian(values_, std::bit_cast<std::uint32_t>(value));
}

void ParquetColumn::add(double value) {
  assert(type_ == ParquetType::float64);
  begin_value();
  append_little_endian(values_, std::bit_cast<std::uint64_t>(value));
}

void ParquetColumn::add(std::string_view value) {
  assert(type_ == ParquetType::text);
  begin_value();
  append_little_endian(values_, static_cast<std::uint32_t>(value.size()));
  values_ += value;
}

void ParquetColumn::add_null() {
  assert(shape_ == ParquetShape::optional);
  ++rows_;
  present_.push_back(false);
}

void ParquetColumn::begin_list() {
  assert(shape_ == ParquetShape::list);
  ++rows_;
  present_.push_back(false);
  continues_.push_back(false);
}

std::string ParquetColumn::page() const {
  std::string page;
  if (shape_ == ParquetShape::list) append_levels(page, continues_);
  if (shape_ != ParquetShape::required) append_levels(page, present_);
  if (type_ == ParquetType::boolean) append_bits(page, bits_);
  return page + values_;
}

std::string parquet_file(const std::string& table, std::span<const ParquetRowGroup> row_groups,
                         const std::vector<std::pair<std::string, std::string>>& metadata) {
  std::string file(kMagic);
  std::vector<WrittenGroup> written;
  for (const ParquetRowGroup& columns : row_groups) {
    if (columns.front().rows() == 0) continue;
    std::vector<Chunk>& chunks = written.emplace_back(columns, std::vector<Chunk>{}).chunks;
    for (const ParquetColumn& column : columns) {
      const std::string page = column.page();
      const std::string header = page_header(page.size(), column.entries());
      chunks.push_back({file.size(), header.size() + page.size()});
      file += header;
      file += page;
    }
  }
  const std::string footer = file_metadata(table, row_groups.front(), written, metadata);
  file += footer;
  append_little_endian(file, static_cast<std::uint32_t>(footer.size()));
  return file.append(kMagic);
}

}  // namespace takt::lab
