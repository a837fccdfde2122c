// How the vehicle sees the deck: by images, or by a model of what images would have told.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "harco/detect.hpp"
#include "harco/marker.hpp"
#include "harco/mount.hpp"
#include "harco/pose.hpp"
#include "harco/pose_estimator.hpp"
#include "lab/camera_simulator.hpp"

namespace harco::lab {

/// What one frame told.
struct Sight {
  std::optional<Pose> pose;  ///< of the set's first parent
  std::vector<int> layers;   ///< of the markers that it was made from, ascending
  Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();  ///< camera_T_marker
  Image image;                                              ///< empty if there was none
  std::vector<Detection> detections;
};

/// What the camera looks at, and how.
struct VisionSetup {
  Camera camera;
  CameraEffects effects;
  MarkerSet markers;                    ///< the first parent's middle is the deck's touchdown point
  Stage stage;                          ///< surroundings; the marker's sheet is added
  std::optional<Surface> deck_surface;  ///< moves with the deck

  /// The marker on the deck, its middle at the touchdown point.
  Eigen::Isometry3d deck_T_marker() const;
  Eigen::Vector3d touchdown_point() const;  ///< in the marker's frame
};

/// Renders what the camera sees, detects, estimates: nothing else tells it about the deck.
class ImageVision {
 public:
  explicit ImageVision(const VisionSetup& setup);

  /// A frame exposed about `time_s`. `gravity` is down in the camera's frame, as the vehicle knows
  /// it.
  Sight look(const Motion& world_T_camera, const Motion& world_T_deck, double time_s,
             const Eigen::Vector3d& gravity, std::uint64_t seed);

 private:
  VisionSetup setup_;
  CameraSimulator simulator_;
  Detector detector_;
  PoseEstimator estimator_;
};

/// A stand-in for images, where flights are too many for them: at a set of heights, pictures are
/// rendered and looked at; what a frame tells is then drawn from the pictures of the nearest
/// height: whether there is a pose, with which covariance, and an error from that covariance,
/// widened by what the errors in those pictures were over theirs.
class ModelledVision {
 public:
  /// Looks at `pictures` frames at each of its heights, tilted and moving as decks and vehicles do.
  ModelledVision(const VisionSetup& setup, int pictures, std::uint64_t seed);

  Sight look(const Eigen::Isometry3d& camera_T_marker, std::uint64_t seed) const;

  /// Root mean square of errors over their standard deviations, over all heights' pictures.
  double error_scale() const;
  /// Share of pictures without a pose.
  double dropouts() const;

 private:
  struct Record {
    std::optional<Matrix6d> covariance;
    std::vector<int> layers;
  };
  struct Height {
    double height_m;
    double scale;  ///< of errors over their standard deviations
    std::vector<Record> records;
  };
  Eigen::Vector3d middle_;
  std::vector<Height> heights_;
};

/// A setup for landings: a camera of 750 x 480 pixels and 350 pixels of focal length, a marker of
/// the given layers, ground or deck around it.
VisionSetup landing_setup(const MarkerSet& markers, bool on_ship);

}  // namespace harco::lab
