// A detector that looks where tracked markers are expected, and everywhere every now and then.
#pragma once

#include <optional>
#include <vector>

#include "harco/camera.hpp"
#include "harco/detect.hpp"
#include "harco/filter.hpp"
#include "harco/image.hpp"
#include "harco/marker.hpp"

namespace harco {

struct GuideOptions {
  /// At the latest every so many frames all of the image is searched: a marker that comes into view
  /// elsewhere is found after as many frames. 1 searches all of every frame.
  int full_every = 10;
  double sigmas = 4.0;  ///< standard deviations of the prediction that the region leaves room for
  double margin_px = 8.0;  ///< and so many pixels more
  /// Regions that cover more of the image are not worth it.
  double most_share = 0.7;
};

/// The part of the image in which the markers of all tracked parents should be seen, and the
/// smallest of their sides. Empty where that isn't known: without a track, or where one may be
/// behind the camera or is merely coasting. `tracks` are those of the frame's time.
std::optional<Region> expected_region(const std::vector<Track>& tracks, const MarkerSet& markers,
                                      const Camera& camera, const GuideOptions& options = {});

/// A detector and a guide. Nothing is lost by it: where the region doesn't show every parent that
/// is expected, all of the same frame is searched.
class GuidedDetector {
 public:
  /// Throws as Detector does, and for options without a camera or guide options out of range.
  GuidedDetector(MarkerSet markers, const DetectorOptions& options, const GuideOptions& guide = {});

  /// As Detector::detect, for a frame at whose time `tracks` are believed (Tracker::at).
  std::vector<Detection> detect(const ImageView& image, const std::vector<Track>& tracks,
                                DetectionTrace* trace = nullptr);

  bool searched_all() const { return since_full_ == 0; }  ///< of the last frame
  const Detector& detector() const { return detector_; }

 private:
  Detector detector_;
  GuideOptions guide_;
  int since_full_ = 0;  ///< frames of which only a region was searched
};

}  // namespace harco
