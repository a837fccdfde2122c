// A marker of which only parts are seen: its picture laid over the image and held against every
// edge that is there.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "detect/edge_template.hpp"
#include "detect/lens.hpp"
#include "detect/quad.hpp"
#include "harco/detect.hpp"
#include "harco/image.hpp"

namespace harco::detect {

/// Grey levels of black and white, each a plane over the marker's unit square.
struct LightLevels {
  Eigen::Vector3d black = Eigen::Vector3d::Zero();
  Eigen::Vector3d white = Eigen::Vector3d::Zero();
  double black_at(const Eigen::Vector2d& unit) const {
    return black.dot(Eigen::Vector3d(1.0, unit.x(), unit.y()));
  }
  double white_at(const Eigen::Vector2d& unit) const {
    return white.dot(Eigen::Vector3d(1.0, unit.x(), unit.y()));
  }
};

/// Where a marker's square lies in the image.
struct Registration {
  Eigen::Matrix3d image_H_unit = Eigen::Matrix3d::Identity();  ///< [0, 1]^2 to ideal pixels
  LightLevels levels;
  /// Of x and y of where (0,0), (1,0), (1,1), (0,1) lie, square ideal pixels.
  Matrix8d corner_covariance = Matrix8d::Identity();
};

/// How much of what a marker's picture predicts is there.
struct Evidence {
  int predicted = 0;  ///< edges inside the border that this image is large and sharp enough for
  int seen = 0;  ///< of them, those that are in their place with dark and bright as they should be
  double share() const { return predicted == 0 ? 0.0 : static_cast<double>(seen) / predicted; }
};

/// A place on an edge, as the image sees it.
struct Probe {
  Eigen::Vector2d unit;
  Eigen::Vector2d place;            ///< ideal pixels
  Eigen::Vector2d to_white;         ///< unit normal, ideal pixels
  double black = 0.0, white = 0.0;  ///< how far even black and white reach, pixels
};

/// A step found near a probe.
struct Step {
  double offset = 0.0;  ///< pixels from the probe towards white
  double dark = 0.0, bright = 0.0;
};

/// The memory of fits, kept from one to the next.
struct FitMemory {
  struct Match {
    Probe probe;
    Step step;
  };
  std::vector<Probe> probes;
  std::vector<Match> matches;
  std::vector<double> values;
  std::vector<TemplateEdge> sides;
};

/// Where the unit square's corners lie.
Quad corners_of(const Eigen::Matrix3d& image_H_unit);

/// Fits the outline of a black square of `cells` x `cells` cells (border ring included) on white to
/// what the image shows of it, starting at `quad` (ideal pixels, right to a few pixels). Empty if
/// too little is seen, or nothing of some side.
std::optional<Registration> fit_border(const ImageView& image, const Lens& lens, const Quad& quad,
                                       int cells, FitMemory& memory);

/// Fits a registration to those of the template's edges that are seen near their places, its levels
/// as well. False if they are too few.
bool refine(const ImageView& image, const Lens& lens, const std::vector<TemplateEdge>& edges,
            Registration& registration, FitMemory& memory);

/// Counts the template's edges that are seen.
Evidence gather(const ImageView& image, const Lens& lens, const std::vector<TemplateEdge>& edges,
                const Registration& registration, FitMemory& memory);

/// The registration of the same square whose upright corner (0, 0) is corner `turns` of this one.
Registration turned(const Registration& registration, int turns);

}  // namespace harco::detect
