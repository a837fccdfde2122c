#include "coverage_picture.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace harco::cli {
namespace {

using Eigen::Vector2d;

constexpr Colour kSeen{236, 242, 236}, kMissing{240, 170, 160}, kGrid{205, 210, 205},
    kUnseen{190, 190, 190};
constexpr Colour kDot{30, 90, 170}, kResidual{20, 130, 60}, kLeftOut{200, 40, 40},
    kText{255, 255, 255};

void fill(ColourImage& picture, const ImageCoverage& coverage) {
  picture.bgr.resize(3 * static_cast<std::size_t>(picture.width) *
                     static_cast<std::size_t>(picture.height));
  std::size_t at = 0;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) {
      const int column = x * coverage.columns / picture.width;
      const int row = y * coverage.rows / picture.height;
      const int count = coverage.points[static_cast<std::size_t>(row * coverage.columns + column)];
      const Colour& colour = count > 0 ? kSeen : count == 0 ? kMissing : kUnseen;
      for (const std::uint8_t value : {colour.blue, colour.green, colour.red})
        picture.bgr[at++] = value;
    }
}

void add_grid(const ColourImage& picture, const ImageCoverage& coverage, Overlay& overlay) {
  const double width = picture.width, height = picture.height;
  for (int i = 1; i < coverage.columns; ++i) {
    const double x = width * i / coverage.columns - 0.5;
    overlay.strokes.push_back({{{x, 0.0}, {x, height}}, kGrid});
  }
  for (int i = 1; i < coverage.rows; ++i) {
    const double y = height * i / coverage.rows - 0.5;
    overlay.strokes.push_back({{{0.0, y}, {width, y}}, kGrid});
  }
}

void add_cross(const Vector2d& at, double size, const Colour& colour, Overlay& overlay) {
  for (const double sign : {-1.0, 1.0}) {
    const Vector2d arm = size * Vector2d(1.0, sign);
    overlay.strokes.push_back({{at - arm, at + arm}, colour});
  }
}

/// A round factor by which residuals are drawn a few per cent of the picture long.
double enlargement(const Calibration& calibration, int width) {
  const double wanted = 0.02 * width / std::max(calibration.rms_px, 1e-3);
  const double power = std::pow(10.0, std::floor(std::log10(std::max(wanted, 1.0))));
  return std::max(1.0, std::floor(wanted / power) * power);
}

}  // namespace

ColourImage coverage_picture(const std::vector<TargetView>& views, const Calibration& calibration,
                             const ImageCoverage& coverage) {
  const Camera& camera = calibration.camera;
  ColourImage picture{camera.width, camera.height, {}};
  fill(picture, coverage);
  Overlay overlay;
  add_grid(picture, coverage, overlay);
  const double factor = enlargement(calibration, camera.width);
  const double dot = std::max(1.0, camera.width / 640.0);
  std::size_t kept = 0, left_out = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const FittedView& fitted = calibration.views[v];
    for (std::size_t i = 0; i < views[v].features.size(); ++i) {
      const Feature& feature = views[v].features[i];
      for (std::size_t j = 0; j < feature.image_px.size(); ++j) {
        const Vector2d& seen = feature.image_px[j];
        const Vector2d& target = feature.target_m[j];
        const auto expected =
            camera.project(fitted.camera_T_target * Eigen::Vector3d(target.x(), target.y(), 0.0));
        if (fitted.used && fitted.kept[i] && expected) {
          ++kept;
          overlay.strokes.push_back({{seen, seen + factor * (seen - *expected)}, kResidual});
          overlay.strokes.push_back(
              {{seen, seen}, kDot, false, static_cast<int>(std::lround(2.0 * dot))});
        } else {
          ++left_out;
          add_cross(seen, 2.5 * dot, kLeftOut, overlay);
        }
      }
    }
  }
  const double text = 10.0 * dot;
  overlay.labels.push_back(
      {{text, 2.0 * text},
       fmt::format("{} points, {:.0f} % of the image covered, residuals x {:.0f} (rms {:.3f} px)",
                   kept, 100.0 * coverage.share(), factor, calibration.rms_px),
       kText,
       text});
  if (left_out > 0)
    overlay.labels.push_back(
        {{text, 4.0 * text}, fmt::format("crosses: {} points left out", left_out), kText, text});
  media().draw(overlay, picture);
  return picture;
}

}  // namespace harco::cli
