// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/png_image.hpp"

#include <png.h>
#include <zlib.h>

#include <csetjmp>

namespace takt::monitor {
namespace {

constexpr int kDepth = 8;

int colour_type(std::uint32_t channels) {
  switch (channels) {
    case 1:
      return PNG_COLOR_TYPE_GRAY;
    case 2:
      return PNG_COLOR_TYPE_GRAY_ALPHA;
    case 3:
      return PNG_COLOR_TYPE_RGB;
    default:
      return PNG_COLOR_TYPE_RGB_ALPHA;
  }
}

void append(png_structp png, png_bytep bytes, std::size_t size) noexcept {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(bytes), size);
}

[[noreturn]] void give_up(png_structp png, png_const_charp) noexcept {
  png_longjmp(png, 1);
}

void say_nothing(png_structp, png_const_charp) noexcept {}

// libpng's errors jump: nothing here has a destructor.
bool write_png(png_structp png, png_infop info, const config::ImageShape& shape, const std::byte* pixels) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_IHDR(png, info, shape.width, shape.height, kDepth, colour_type(shape.channels), PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_BASE, PNG_FILTER_TYPE_BASE);
  // A camera's noise leaves nothing that repeats: differences of neighbours in codes of fitting length is all there is.
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_set_compression_strategy(png, Z_RLE);
  png_write_info(png, info);
  const std::size_t row_bytes = std::size_t{shape.width} * shape.channels;
  for (std::uint32_t row = 0; row < shape.height; ++row)
    png_write_row(png, reinterpret_cast<png_const_bytep>(pixels + row * row_bytes));
  png_write_end(png, info);
  return true;
}

}  // namespace

std::string png_image(const config::ImageShape& shape, std::span<const std::byte> pixels) {
  std::string out;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, give_up, say_nothing);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  if (info != nullptr) {
    png_set_write_fn(png, &out, append, nullptr);
    if (!write_png(png, info, shape, pixels.data())) out.clear();
  }
  png_destroy_write_struct(&png, &info);
  return out;
}

}  // namespace takt::monitor
