// Small pictures for the report.
#pragma once

#include <string>
#include <vector>

#include "harco/detect.hpp"
#include "harco/image.hpp"
#include "lab/experiments/experiment.hpp"

namespace harco::lab {

/// The image made `width_px` wide, as JPEG, with the outlines of what was detected in it, layer by
/// layer in a colour of its own.
Picture picture_of(const ImageView& image, const std::string& label,
                   const std::vector<Detection>& detections = {}, int width_px = 240);

/// As it stands in an item's result, and back.
Json to_json(const Picture& picture);
Picture picture_from(const Json& json);

}  // namespace harco::lab
