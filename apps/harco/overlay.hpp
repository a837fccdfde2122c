// What is drawn over a frame for people to look at.
#pragma once

#include <optional>
#include <vector>

#include "harco/camera.hpp"
#include "harco/detect.hpp"
#include "harco/marker.hpp"
#include "media.hpp"
#include "results.hpp"

namespace harco::cli {

/// Outline and "layer:id" of every detection in the colour of its layer, a ring at its top-left
/// corner.
Overlay overlay_of_detections(const std::vector<Detection>& detections);

/// The axes of the marker frame (x red, y green, z blue, which points into the plane; each half a
/// side long), the outline of the parent's square where the pose puts it, and a line of text, for
/// every pose.
Overlay overlay_of_poses(const std::vector<Pose>& poses, const MarkerSet& markers,
                         const Camera& camera);

/// All of a result's.
Overlay overlay_of(const FrameResult& result, const MarkerSet& markers,
                   const std::optional<Camera>& camera);

/// The colour of a layer, and of a rejection.
Colour colour_of_layer(int layer);
Colour colour_of(Rejection rejection);

/// The overlay for the same picture `factor` times as large, its lines and letters as they are.
Overlay enlarged(Overlay overlay, int factor);

}  // namespace harco::cli
