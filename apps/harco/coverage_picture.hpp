// Where a calibration's points were seen, and how far off they are.
#pragma once

#include <vector>

#include "calibration.hpp"
#include "calibration_verdict.hpp"
#include "media.hpp"

namespace harco::cli {

/// A picture as large as the image: cells with points are light, those without red, those that the
/// lens can't see grey; every point that took part is a dot with its residual, enlarged as the
/// legend says; those left out are crosses.
ColourImage coverage_picture(const std::vector<TargetView>& views, const Calibration& calibration,
                             const ImageCoverage& coverage);

}  // namespace harco::cli
