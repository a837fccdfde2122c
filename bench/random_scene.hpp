// Scenes of all kinds that a camera meets, for measurements that no one setting may decide.
#pragma once

#include <random>
#include <vector>

#include "harco/harco.hpp"
#include "lab/render.hpp"

namespace harco::bench {

/// From … to.
struct Interval {
  double low = 0.0, high = 0.0;
};

/// Between what everything is drawn. Sides, blur and noise evenly in their logarithm.
struct SceneLaw {
  Interval side_px;  ///< of the square, seen straight on
  Interval tilt_deg{0.0, 60.0};
  Interval psf_px{0.4, 1.5};  ///< sigma, beside the pixel's own square
  Interval noise{0.5, 8.0};   ///< sigma in grey levels
  double distorted = 0.5;     ///< share of the scenes with a lens that distorts
};

struct RandomScene {
  lab::Scene scene;
  Eigen::Isometry3d camera_T_marker = Eigen::Isometry3d::Identity();
  double side_px = 0.0, tilt_deg = 0.0;
};

/// Parent 0 of a set on its sheet of paper, anywhere in the picture of a camera with 1600 x 1200
/// pixels, in light that changes across it, on patches of random grey; of the picture only the
/// part around the sheet. The same state of `random` gives the same scene.
RandomScene random_scene(const SceneLaw& law, double side_m, std::mt19937_64& random);

}  // namespace harco::bench
