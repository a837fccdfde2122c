// Picture files, whatever their format.
#pragma once

#include <filesystem>
#include <optional>

#include "media.hpp"

namespace harco::cli {

struct PictureFile {
  Picture picture;
  std::optional<double> timestamp_s;  ///< where the file says when it was taken (PGM)
};

/// Reads PNG and binary PGM by itself and leaves the rest to OpenCV. Throws Error, naming the file.
PictureFile read_picture(const std::filesystem::path& file, bool colour);

}  // namespace harco::cli
