// Drawing a marker: raster, SVG and PDF from the one geometry of geometry.hpp.
#pragma once

namespace harco {}  // namespace harco
