// Families of square markers that others know, taken from the libraries that define them.
#pragma once

#include <string>
#include <vector>

#include "harco/code.hpp"
#include "opencv_module.hpp"

namespace harco::cli {

/// The codes of a family, upright as its makers print it; the index is the marker's id.
struct Family {
  std::string name;
  std::vector<Code> codes;
};

/// `aruco:4x4_50` … `aruco:7x7_1000`, `aruco:original`, `aruco:mip_36h12` as far as the OpenCV in
/// use has them (OpenCV's own spelling, `aruco:DICT_4X4_50`, is understood too), and AprilTag's
/// families with a one-cell black border: `apriltag:16h5`, `25h9`, `36h10`, `36h11`. Throws
/// std::invalid_argument, saying what there is, for any other name.
Family load_family(const std::string& name);

/// The module's part of it, which does all the work: see opencv_module.hpp.
HARCO_OPENCV_EXPORT void harco_load_family(const std::string& name, Family& family);

}  // namespace harco::cli
