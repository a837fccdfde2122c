// Writing PNG images.
#pragma once

#include <filesystem>

#include "harco/image.hpp"

namespace harco::cli {

/// Writes an 8-bit grey PNG row by row; `pixels_per_metre`, if positive, tells programs its printed
/// size. Throws Error.
void write_png(const ImageView& image, const std::filesystem::path& file,
               double pixels_per_metre = 0.0);

}  // namespace harco::cli
