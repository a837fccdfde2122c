// Every stage of a detection, drawn over the frame, for whoever wonders why a marker wasn't found.
#pragma once

#include <filesystem>
#include <optional>

#include "frames.hpp"
#include "harco/camera.hpp"
#include "harco/detect.hpp"
#include "harco/marker.hpp"
#include "results.hpp"

namespace harco::cli {

/// Makes the folder FOLDER/NUMBER-NAME and writes into it
///   1-binary-K.png     the frame's black and white, one a threshold
///   2-contours.png     closed outlines
///   3-candidates.png   quads, in the colour of what became of them
///   4-detections.png   the result
///   candidates.txt     what became of every quad and why, for people
///   candidates.json    the same for programs
/// Throws Error.
void explain(const std::filesystem::path& folder, const Frame& frame, const FrameResult& result,
             const DetectionTrace& trace, const std::vector<PlacedMarker>& placed,
             const Overlay& detections);

}  // namespace harco::cli
