#include "evidence/artifact/parquet_file.hpp"

#include <bit>
#include <cassert>

#include "evidence/artifact/thrift_compact.hpp"

namespace takt::panel {
namespace {

constexpr std::string_view kMagic = "PAR1";
constexpr std::int32_t kPlain = 0, kRle = 3;          // enum Encoding
constexpr std::int32_t kRequired = 0, kOptional = 1;  // enum FieldRepetitionType
constexpr std::int32_t kUtf8 = 0;                     // enum ConvertedType
constexpr std::int32_t kUncompressed = 0;             // enum CompressionCodec
constexpr std::int32_t kDataPage = 0;                 // enum PageType
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
    case ParquetType::float64:
      return 5;
    case ParquetType::text:
      return 6;
  }
  return 0;
}

std::string page_header(std::size_t bytes, std::size_t rows) {
  ThriftWriter header;
  header.i32(1, kDataPage);
  header.i32(2, static_cast<std::int32_t>(bytes));  // uncompressed
  header.i32(3, static_cast<std::int32_t>(bytes));  // compressed
  header.begin_struct(5);                           // DataPageHeader
  header.i32(1, static_cast<std::int32_t>(rows));
  header.i32(2, kPlain);
  header.i32(3, kRle);  // definition levels
  header.i32(4, kRle);  // repetition levels
  header.end_struct();
  return header.finish();
}

struct Chunk {
  std::size_t offset, bytes;  // page header and page
};

void schema_element(ThriftWriter& out, const ParquetColumn& column) {
  out.begin_element();
  out.i32(1, physical_type(column.type()));
  out.i32(3, column.is_optional() ? kOptional : kRequired);
  out.text(4, column.name());
  if (column.type() == ParquetType::text) out.i32(6, kUtf8);
  out.end_struct();
}

void column_chunk(ThriftWriter& out, const ParquetColumn& column, const Chunk& chunk) {
  out.begin_element();
  out.i64(2, static_cast<std::int64_t>(chunk.offset));
  out.begin_struct(3);  // ColumnMetaData
  out.i32(1, physical_type(column.type()));
  out.begin_list(2, ThriftType::i32, 2);
  out.element(kPlain);
  out.element(kRle);
  out.begin_list(3, ThriftType::binary, 1);
  out.element(column.name());
  out.i32(4, kUncompressed);
  out.i64(5, static_cast<std::int64_t>(column.rows()));
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

std::string file_metadata(const std::string& table, std::span<const ParquetColumn> columns,
                          std::span<const Chunk> chunks,
                          const std::vector<std::pair<std::string, std::string>>& metadata) {
  const std::size_t rows = columns.empty() ? 0 : columns.front().rows();
  ThriftWriter out;
  out.i32(1, kFormatVersion);
  out.begin_list(2, ThriftType::structure, columns.size() + 1);
  out.begin_element();
  out.text(4, table);
  out.i32(5, static_cast<std::int32_t>(columns.size()));
  out.end_struct();
  for (const ParquetColumn& column : columns) schema_element(out, column);
  out.i64(3, static_cast<std::int64_t>(rows));
  out.begin_list(4, ThriftType::structure, rows == 0 ? 0 : 1);
  if (rows != 0) row_group(out, columns, chunks);
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

void ParquetColumn::add(bool value) {
  assert(type_ == ParquetType::boolean);
  present_.push_back(true);
  bits_.push_back(value);
}

void ParquetColumn::add(std::int64_t value) {
  assert(type_ == ParquetType::int64);
  present_.push_back(true);
  append_little_endian(values_, static_cast<std::uint64_t>(value));
}

void ParquetColumn::add(double value) {
  assert(type_ == ParquetType::float64);
  present_.push_back(true);
  append_little_endian(values_, std::bit_cast<std::uint64_t>(value));
}

void ParquetColumn::add(std::string_view value) {
  assert(type_ == ParquetType::text);
  present_.push_back(true);
  append_little_endian(values_, static_cast<std::uint32_t>(value.size()));
  values_ += value;
}

void ParquetColumn::add_null() {
  assert(is_optional_);
  present_.push_back(false);
}

std::string ParquetColumn::page() const {
  std::string page;
  if (is_optional_) {
    // One bit-packed run of levels 0 and 1, in groups of eight, with its length in front.
    std::string levels = thrift_varint((present_.size() + 7) / 8 << 1U | 1U);
    append_bits(levels, present_);
    append_little_endian(page, static_cast<std::uint32_t>(levels.size()));
    page += levels;
  }
  if (type_ == ParquetType::boolean) append_bits(page, bits_);
  return page + values_;
}

std::string parquet_file(const std::string& table, std::span<const ParquetColumn> columns,
                         const std::vector<std::pair<std::string, std::string>>& metadata) {
  std::string file(kMagic);
  std::vector<Chunk> chunks;
  for (const ParquetColumn& column : columns) {
    if (column.rows() == 0) continue;
    const std::string page = column.page();
    const std::string chunk = page_header(page.size(), column.rows()) + page;
    chunks.push_back({file.size(), chunk.size()});
    file += chunk;
  }
  const std::string footer = file_metadata(table, columns, chunks, metadata);
  file += footer;
  append_little_endian(file, static_cast<std::uint32_t>(footer.size()));
  return file.append(kMagic);
}

}  // namespace takt::panel
