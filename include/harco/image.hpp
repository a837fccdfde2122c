// Grey images: a view that owns nothing, and a plain owner for what the library itself makes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <vector>

namespace harco {

/// A view of an 8-bit grey image that somebody else owns. Pixel (x, y) has its centre at exactly
/// (x, y): x to the right, y down, (0, 0) the top-left pixel's centre.
class ImageView {
 public:
  ImageView() = default;

  /// `stride` is the distance between rows in bytes; 0 means that rows follow one another
  /// directly. Throws std::invalid_argument if the description makes no sense.
  ImageView(const std::uint8_t* pixels, int width, int height, std::ptrdiff_t stride = 0)
      : pixels_(pixels), width_(width), height_(height), stride_(stride == 0 ? width : stride) {
    if (pixels == nullptr || width <= 0 || height <= 0 || stride_ < width)
      throw std::invalid_argument("ImageView: needs pixels, a positive size and stride >= width");
  }

  int width() const { return width_; }
  int height() const { return height_; }
  std::ptrdiff_t stride() const { return stride_; }
  bool empty() const { return pixels_ == nullptr; }
  const std::uint8_t* row(int y) const { return pixels_ + y * stride_; }
  std::uint8_t operator()(int x, int y) const { return row(y)[x]; }

 private:
  const std::uint8_t* pixels_ = nullptr;
  int width_ = 0;
  int height_ = 0;
  std::ptrdiff_t stride_ = 0;
};

/// An 8-bit grey image that owns its pixels, rows one after another without gaps.
struct Image {
  Image() = default;
  Image(int w, int h, std::uint8_t value = 0)
      : width(w),
        height(h),
        pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), value) {}

  std::uint8_t* row(int y) { return pixels.data() + static_cast<std::ptrdiff_t>(y) * width; }
  const std::uint8_t* row(int y) const {
    return pixels.data() + static_cast<std::ptrdiff_t>(y) * width;
  }
  ImageView view() const { return {pixels.data(), width, height}; }

  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;
};

}  // namespace harco
