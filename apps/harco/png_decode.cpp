#include "png_decode.hpp"

#include <png.h>

#include <csetjmp>
#include <cstdint>
#include <cstring>

#include "harco/error.hpp"

namespace harco::cli {
namespace {

// What a header may ask for: more than any camera has, and too little to exhaust the memory.
constexpr std::uint64_t kMaxPixels = std::uint64_t{1} << 28;

constexpr png_uint_32 kMaxSide = 65535;

/// One decoding. libpng reports errors by longjmp, so all that has a destructor lives here, outside
/// of the functions that it jumps over.
struct Decoder {
  explicit Decoder(const std::vector<std::uint8_t>& data)
      : bytes(data),
        png(png_create_read_struct(PNG_LIBPNG_VER_STRING, this, on_error, on_warning)),
        info(png == nullptr ? nullptr : png_create_info_struct(png)) {}
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;
  ~Decoder() { png_destroy_read_struct(&png, &info, nullptr); }

  static Decoder& self(png_structp png) { return *static_cast<Decoder*>(png_get_io_ptr(png)); }

  [[noreturn]] static void on_error(png_structp png, png_const_charp message) {
    auto& decoder = *static_cast<Decoder*>(png_get_error_ptr(png));
    std::strncpy(decoder.message, message, sizeof(decoder.message) - 1);
    png_longjmp(png, 1);
  }

  static void on_warning(png_structp /*png*/, png_const_charp /*message*/) {}

  static void on_read(png_structp png, png_bytep to, std::size_t count) {
    Decoder& decoder = self(png);
    if (count > decoder.bytes.size() - decoder.position) png_error(png, "is cut short");
    std::memcpy(to, decoder.bytes.data() + decoder.position, count);
    decoder.position += count;
  }

  /// Size and kind; everything comes out as 8-bit grey or 8-bit RGB.
  bool read_header() {
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    png_set_read_fn(png, this, on_read);
    png_set_user_limits(png, kMaxSide, kMaxSide);
    png_read_info(png, info);
    png_set_expand(png);
    png_set_scale_16(png);
    png_set_strip_alpha(png);
    passes = png_set_interlace_handling(png);
    png_read_update_info(png, info);
    width = png_get_image_width(png, info);
    height = png_get_image_height(png, info);
    channels = png_get_channels(png, info);
    return true;
  }

  bool read_pixels(std::uint8_t* pixels) {
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    const std::size_t stride = std::size_t{width} * channels;
    for (int pass = 0; pass < passes; ++pass)
      for (png_uint_32 y = 0; y < height; ++y) png_read_row(png, pixels + y * stride, nullptr);
    png_read_end(png, nullptr);
    return true;
  }

  const std::vector<std::uint8_t>& bytes;
  std::size_t position = 0;
  char message[128] = {};
  png_structp png;
  png_infop info;
  png_uint_32 width = 0, height = 0;
  std::size_t channels = 0;
  int passes = 1;
};

/// Luma of ITU-R BT.601, as OpenCV takes it.
std::uint8_t luma(const std::uint8_t* rgb) {
  return static_cast<std::uint8_t>((4899 * rgb[0] + 9617 * rgb[1] + 1868 * rgb[2] + 8192) >> 14);
}

}  // namespace

Picture decode_png(const std::vector<std::uint8_t>& bytes, const std::string& name, bool colour) {
  Decoder decoder(bytes);
  const auto fail = [&] {
    throw Error(name + ": is a damaged PNG (" + std::string(decoder.message) + ")");
  };
  if (decoder.info == nullptr || !decoder.read_header()) fail();
  if (std::uint64_t{decoder.width} * decoder.height > kMaxPixels)
    throw Error(name + ": is too large (" + std::to_string(decoder.width) + " x " +
                std::to_string(decoder.height) + ")");
  Image raw(static_cast<int>(decoder.width * decoder.channels), static_cast<int>(decoder.height));
  if (!decoder.read_pixels(raw.pixels.data())) fail();

  Picture picture;
  if (decoder.channels == 1) {
    picture.grey = std::move(raw);
    if (colour) picture.colour = to_colour(picture.grey);
    return picture;
  }
  picture.grey = Image(static_cast<int>(decoder.width), static_cast<int>(decoder.height));
  for (std::size_t i = 0; i < picture.grey.pixels.size(); ++i)
    picture.grey.pixels[i] = luma(raw.pixels.data() + 3 * i);
  if (colour) {
    picture.colour = {picture.grey.width, picture.grey.height, std::move(raw.pixels)};
    for (std::size_t i = 0; i < picture.colour.bgr.size(); i += 3)
      std::swap(picture.colour.bgr[i], picture.colour.bgr[i + 2]);
  }
  return picture;
}

}  // namespace harco::cli
