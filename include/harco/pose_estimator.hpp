// Poses frame after frame: what follows from the markers alone is prepared once.
#pragma once

#include <memory>
#include <vector>

#include "harco/camera.hpp"
#include "harco/detect.hpp"
#include "harco/image.hpp"
#include "harco/marker.hpp"
#include "harco/pose.hpp"

namespace harco {

/// estimate_poses for one set of markers. Keeps their outlines and its scratch memory, no state:
/// the same frame gives the same poses, whatever came before it. One a thread.
class PoseEstimator {
 public:
  explicit PoseEstimator(MarkerSet markers);
  ~PoseEstimator();
  PoseEstimator(PoseEstimator&&) noexcept;
  PoseEstimator& operator=(PoseEstimator&&) noexcept;

  const MarkerSet& markers() const;

  /// As estimate_poses of pose.hpp.
  std::vector<Pose> estimate(const ImageView& image, const std::vector<Detection>& detections,
                             const Camera& camera, const PoseOptions& options = {});

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace harco
