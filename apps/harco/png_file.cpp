#include "png_file.hpp"

#include <png.h>

#include <cmath>
#include <csetjmp>
#include <cstdio>
#include <memory>

#include "harco/error.hpp"

namespace harco::cli {
namespace {

/// libpng reports by longjmp, so this function owns nothing.
bool write_rows(png_structp png, png_infop info, std::FILE* out, const ImageView& image,
                png_uint_32 pixels_per_metre) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_init_io(png, out);
  png_set_IHDR(png, info, static_cast<png_uint_32>(image.width()),
               static_cast<png_uint_32>(image.height()), 8, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  if (pixels_per_metre > 0)
    png_set_pHYs(png, info, pixels_per_metre, pixels_per_metre, PNG_RESOLUTION_METER);
  // Rows of a marker repeat the row above.
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_UP);
  png_write_info(png, info);
  for (int y = 0; y < image.height(); ++y) png_write_row(png, image.row(y));
  png_write_end(png, info);
  return true;
}

void keep_silent(png_structp /*png*/, png_const_charp /*message*/) {}

struct Writer {
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, keep_silent);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  Writer() = default;
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;
  ~Writer() { png_destroy_write_struct(&png, &info); }
};

}  // namespace

void write_png(const ImageView& image, const std::filesystem::path& file, double pixels_per_metre) {
  const std::string failed = file.string() + ": can't be written";
  std::FILE* out = std::fopen(file.c_str(), "wb");
  if (out == nullptr) throw Error(failed);
  Writer writer;
  const double limit = PNG_UINT_31_MAX;
  const double density = std::round(pixels_per_metre);
  const bool written =
      writer.info != nullptr &&
      write_rows(writer.png, writer.info, out, image,
                 density <= limit ? static_cast<png_uint_32>(density) : png_uint_32{0});
  const bool closed = std::fclose(out) == 0;
  if (!written || !closed) throw Error(failed);
}

}  // namespace harco::cli
