// Image -> detections: which marker of the set is seen, and where (paper, section 3.4 a-c).
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "harco/camera.hpp"
#include "harco/image.hpp"
#include "harco/marker.hpp"

namespace harco {

using Matrix8d = Eigen::Matrix<double, 8, 8>;

/// One marker seen in one image.
struct Detection {
  int parent = 0;  ///< id of the layer-1 marker that it belongs to
  int layer = 1;
  int id = 0;
  int placed = 0;  ///< index into place(markers)

  /// Corners of the marker's full square in pixels of the (distorted) image: top-left, top-right,
  /// bottom-right, bottom-left of the upright marker.
  std::array<Eigen::Vector2d, 4> corners{Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero(),
                                         Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};

  /// Covariance of the corners' coordinates, x and y of each in turn, in square pixels. Corners at
  /// the ends of one side share its errors.
  Matrix8d corner_covariance = Matrix8d::Identity();

  int bit_errors = 0;    ///< corrected bits
  double quality = 0.0;  ///< 0 … 1: how well the cells agree with the marker's own picture

  /// Its corners were not measured: they follow from a larger marker of the same sheet, and its
  /// cells were found to be there. Poses don't count it as evidence of its own.
  bool inferred = false;

  /// Share of its picture's edges that were seen, below 1 for a marker that is partly covered.
  double visible = 1.0;

  bool tentative = false;  ///< more bits corrected than one frame alone can justify (track.hpp)
};

/// Every option has a default that just works.
struct DetectorOptions {
  /// Smallest side of a marker looked for, in pixels.
  double min_side_px = 10.0;

  /// Bits corrected in a code without other evidence; never more than half the dictionary's
  /// distance allows. A marker whose place is confirmed by its parent, sibling or child may have
  /// one more.
  int max_bit_errors = 1;

  /// Detections below this quality are dropped (the paper's kappa). A corrected bit asks for more:
  /// each leaves two fifths of what the quality may lack.
  double min_quality = 0.75;

  /// The paper's a (section 3.4 c): codes with up to so many wrong bits, beyond max_bit_errors, are
  /// returned as tentative for `Memory` to confirm. 0: none are.
  int tentative_bit_errors = 0;

  /// Whether layer-1 markers of which parts are covered or out of view are looked for as well, from
  /// a side of 80 pixels on, in frames without a whole one.
  bool covered = true;

  /// Whether markers too small for their outline to be found are looked for where a larger one
  /// of their sheet says that they are (Detection::inferred).
  bool infer = true;

  /// Threads that work on one frame, the caller's included, 1 … kMostThreads. Results are the same
  /// with any number. The detector keeps them, asleep, from frame to frame.
  int threads = 1;
  static constexpr int kMostThreads = 256;

  /// Lens of the images. With it, edges are fitted where they are straight; without it,
  /// the image is taken to be free of distortion.
  std::optional<Camera> camera;
};

/// Why a quad was not a marker.
enum class Rejection {
  none,         ///< it was one
  ring,         ///< its border cells are neither all black nor all white
  contrast,     ///< no contrast between its black and white
  edges,        ///< no straight edges found along its sides
  shape,        ///< too small or not convex after the edges were fitted
  code,         ///< no code of the set is near enough
  quality,      ///< the cells don't look like the marker that the code names
  duplicate,    ///< another quad gave the same marker better
  inconsistent  ///< it contradicts better evidence for the same marker
};
const char* to_string(Rejection rejection);

/// One quad on its way through the detector.
struct Candidate {
  std::array<Eigen::Vector2d, 4> corners{};
  bool hole = false;  ///< a bright region inside dark (how children show); else dark inside bright
  Rejection rejection = Rejection::none;
  int placed = -1;   ///< the marker that it was taken for, if any
  std::string note;  ///< what was measured, in words
};

/// What every stage of one detection saw. Filling it costs time; it is meant for looking at.
struct DetectionTrace {
  std::vector<Image> binary;                           ///< one per threshold
  std::vector<std::vector<Eigen::Vector2d>> contours;  ///< closed outlines long enough to matter
  std::vector<Candidate> candidates;
};

/// What the last frame was like for the detector.
struct DetectorStatistics {
  double noise = 0.0;     ///< standard deviation in grey levels, from the evenest parts
  std::size_t quads = 0;  ///< quadrilaterals found

  /// There was more to look at than a frame's budget allows, and only the largest or most promising
  /// was: 300 quads and one for every 1000 pixels, or, where covered markers are looked for, 4
  /// squares and one for every 400 000 pixels, at most 12, of which 4 may turn out to look like a
  /// marker. Tiled walls and pages of print do that.
  bool budget_reached = false;
};

/// A part of an image, and what is looked for in it.
struct Region {
  int x = 0, y = 0;           ///< its first pixel
  int width = 0, height = 0;  ///< pixels
  /// Smallest side of a marker looked for; what DetectorOptions asks for, if that is more.
  double min_side_px = 0.0;
};

/// Finds the markers of one set. It owns its scratch memory: use one a thread.
class Detector {
 public:
  /// Throws std::invalid_argument for an impossible set (see validate) or option.
  explicit Detector(MarkerSet markers, const DetectorOptions& options = {});

  /// The same with default options, for images taken with `camera`.
  Detector(MarkerSet markers, const Camera& camera);

  ~Detector();
  Detector(Detector&&) noexcept;
  Detector& operator=(Detector&&) noexcept;

  /// The markers in one image, in the order of the set; empty if there are none. Throws
  /// std::invalid_argument for an empty view, or one whose size is not the camera's.
  std::vector<Detection> detect(const ImageView& image, DetectionTrace* trace = nullptr);

  /// The markers in a part of the image, wholly so; their corners are in pixels of the whole image,
  /// the trace is in those of the part. Throws as well if that isn't within the image.
  std::vector<Detection> detect(const ImageView& image, const Region& region,
                                DetectionTrace* trace = nullptr);

  /// The same into a vector that is used again and again. Once it and the detector's own memory
  /// have grown as large as frames of a kind need, nothing is allocated any more. (Of a layer-1
  /// marker that may be seen in part, a picture is made when that happens first.)
  void detect(const ImageView& image, std::vector<Detection>& detections);

  const DetectorStatistics& statistics() const;  ///< of the last frame
  const MarkerSet& markers() const;
  const std::vector<PlacedMarker>& placed() const;
  const DetectorOptions& options() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace harco
