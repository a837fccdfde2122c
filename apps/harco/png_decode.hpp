// Reading PNG images without OpenCV, which takes longer to start than to read one.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "media.hpp"

namespace harco::cli {

/// Any PNG, brought to 8 bits; transparency is ignored. Throws Error, naming `name`, if it is
/// damaged.
Picture decode_png(const std::vector<std::uint8_t>& bytes, const std::string& name, bool colour);

}  // namespace harco::cli
