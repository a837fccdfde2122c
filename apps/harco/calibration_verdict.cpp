#include "calibration_verdict.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Cholesky>

namespace harco::cli {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDegrees = 180.0 / std::numbers::pi;

/// "a, b and c".
std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i)
    text += (i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + words[i];
  return text;
}

Vector3d normal_of(const FittedView& view) { return view.camera_T_target.linear().col(2); }

double angle_deg(const Vector3d& a, const Vector3d& b) {
  return kDegrees * std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

// --- Coverage -----------------------------------------------------------------------------------

ImageCoverage coverage_of(const std::vector<Vector2d>& points, const Camera& camera) {
  constexpr double kCellsAlongDiagonal = 10.0;
  const double cell = std::hypot(camera.width, camera.height) / kCellsAlongDiagonal;
  ImageCoverage coverage;
  coverage.columns = std::max(1, static_cast<int>(std::lround(camera.width / cell)));
  coverage.rows = std::max(1, static_cast<int>(std::lround(camera.height / cell)));
  for (int row = 0; row < coverage.rows; ++row)
    for (int column = 0; column < coverage.columns; ++column) {
      const Vector2d middle((column + 0.5) * camera.width / coverage.columns - 0.5,
                            (row + 0.5) * camera.height / coverage.rows - 0.5);
      const bool seen = camera.lens != LensModel::equidistant || camera.unproject(middle);
      coverage.points.push_back(seen ? 0 : ImageCoverage::kUnseen);
    }
  const auto place = [](double at, int size, int cells) {
    return std::clamp(static_cast<int>(std::floor((at + 0.5) / size * cells)), 0, cells - 1);
  };
  for (const Vector2d& point : points) {
    const int column = place(point.x(), camera.width, coverage.columns);
    const int row = place(point.y(), camera.height, coverage.rows);
    int& count = coverage.points[static_cast<std::size_t>(row * coverage.columns + column)];
    count = std::max(count, 0) + 1;
  }
  return coverage;
}

double ImageCoverage::share() const {
  const auto cells = std::count_if(points.begin(), points.end(), [](int n) { return n >= 0; });
  const auto seen = std::count_if(points.begin(), points.end(), [](int n) { return n > 0; });
  return cells == 0 ? 0.0 : static_cast<double>(seen) / static_cast<double>(cells);
}

std::vector<std::string> ImageCoverage::missing() const {
  constexpr std::array<const char*, 9> kNames{
      "the top left corner",    "the top edge",    "the top right corner",
      "the left edge",          "the middle",      "the right edge",
      "the bottom left corner", "the bottom edge", "the bottom right corner"};
  std::array<int, 9> cells{}, seen{};
  // The outer quarters of the image are its edges.
  const auto third = [](int cell, int count) {
    const double at = (cell + 0.5) / count;
    return at <= 0.25 ? 0 : at < 0.75 ? 1 : 2;
  };
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      const auto region = static_cast<std::size_t>(3 * third(row, rows) + third(column, columns));
      const int count = points[static_cast<std::size_t>(row * columns + column)];
      if (count >= 0) ++cells[region];
      if (count > 0) ++seen[region];
    }
  std::vector<std::string> names;
  for (std::size_t i = 0; i < cells.size(); ++i)
    if (2 * seen[i] < cells[i]) names.emplace_back(kNames[i]);
  return names;
}

std::vector<Vector2d> kept_points(const std::vector<TargetView>& views,
                                  const Calibration& calibration) {
  std::vector<Vector2d> points;
  for (std::size_t view = 0; view < views.size(); ++view) {
    if (!calibration.views[view].used) continue;
    for (std::size_t i = 0; i < views[view].features.size(); ++i) {
      if (!calibration.views[view].kept[i]) continue;
      const auto& seen = views[view].features[i].image_px;
      points.insert(points.end(), seen.begin(), seen.end());
    }
  }
  return points;
}

// --- Geometry -----------------------------------------------------------------------------------

DirectionUncertainty direction_uncertainty(const Calibration& calibration, CalibrationModel model) {
  constexpr int kColumns = 17, kRows = 13, kMiddle = kColumns * kRows / 2;
  const Camera& camera = calibration.camera;
  MatrixXd by_parameters = MatrixXd::Zero(2L * kColumns * kRows, parameter_count(model));
  MatrixXd by_rotation = MatrixXd::Zero(by_parameters.rows(), 3);
  Eigen::Matrix3d rotations = Eigen::Matrix3d::Zero();
  MatrixXd rotated = MatrixXd::Zero(3, by_parameters.cols());
  DirectionUncertainty uncertainty;
  // A fisheye's image may reach beyond the rays that its model knows.
  const bool ends = camera.lens == LensModel::equidistant && camera.in_range({1e5, 0.0});
  for (int i = 0; i < kColumns * kRows; ++i) {
    const int column = i % kColumns;
    const int row = i / kColumns;
    const Vector2d place(static_cast<double>(column) / (kColumns - 1),
                         static_cast<double>(row) / (kRows - 1));
    const auto ray =
        camera.unproject({place.x() * (camera.width - 1.0), place.y() * (camera.height - 1.0)});
    ProjectedPoint at;
    if (!ray || !project(camera, model, ray->homogeneous(), at)) {
      uncertainty.everywhere = uncertainty.everywhere && ends;
      continue;
    }
    auto own = by_parameters.middleRows<2>(2L * i);
    auto turned = by_rotation.middleRows<2>(2L * i);
    own = at.by_parameters;
    for (int axis = 0; axis < 3; ++axis)
      turned.col(axis) = at.by_point * Vector3d::Unit(axis).cross(ray->homogeneous());
    // The rotation is that of the image's inner part, where the lens is known well.
    if ((place - Vector2d(0.5, 0.5)).cwiseAbs().maxCoeff() > 0.25) continue;
    rotations += turned.transpose() * turned;
    rotated += turned.transpose() * own;
  }
  const MatrixXd own = by_parameters - by_rotation * rotations.ldlt().solve(rotated);
  for (int i = 0; i < kColumns * kRows; ++i) {
    const MatrixXd at = own.middleRows<2>(2L * i);
    const double sigma = std::sqrt((at * calibration.covariance * at.transpose()).trace());
    uncertainty.worst_px = std::max(uncertainty.worst_px, sigma);
    if (i == kMiddle) uncertainty.middle_px = sigma;
  }
  return uncertainty;
}

TiltDiversity tilt_diversity(const Calibration& calibration) {
  TiltDiversity tilt;
  std::vector<Vector3d> normals;
  for (const FittedView& view : calibration.views)
    if (view.used) normals.push_back(normal_of(view));
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& normal : normals) mean += normal;
  for (const Vector3d& normal : normals) {
    if (angle_deg(normal, mean) >= kTilted_deg) ++tilt.tilted;
    for (const Vector3d& other : normals)
      tilt.widest_deg = std::max(tilt.widest_deg, angle_deg(normal, other));
  }
  return tilt;
}

// --- Verdict ------------------------------------------------------------------------------------

const char* to_string(Grade grade) {
  switch (grade) {
    case Grade::good:
      return "good";
    case Grade::usable:
      return "usable";
    case Grade::bad:
      return "not usable";
  }
  return "";
}

Evidence evidence_of(const std::vector<TargetView>& views, const Calibration& calibration,
                     CalibrationModel model) {
  Evidence evidence;
  const Camera& camera = calibration.camera;
  evidence.width = camera.width;
  evidence.height = camera.height;
  for (const FittedView& view : calibration.views)
    ++(view.used ? evidence.views : evidence.dropped);
  evidence.noise_px = calibration.noise_px;
  evidence.rms_px = calibration.rms_px;
  evidence.held_out_rms_px = calibration.held_out_rms_px;
  evidence.focal_px = 0.5 * (camera.fx + camera.fy);
  evidence.focal_sigma_px =
      std::sqrt(std::max(calibration.covariance(0, 0), calibration.covariance(1, 1)));
  evidence.coverage = coverage_of(kept_points(views, calibration), camera);
  evidence.direction = direction_uncertainty(calibration, model);
  evidence.tilt = tilt_diversity(calibration);
  return evidence;
}

Verdict judge(const Evidence& e) {
  constexpr double kParallel_deg = 6.0;
  constexpr int kFewTilted = 4;
  constexpr std::size_t kFewViews = 8;
  constexpr double kFocalLost = 0.02, kFocalUncertain = 0.003;  // shares of the focal length
  constexpr double kOverfit = 1.5;
  // In shares of the image's diagonal, so that cameras of any resolution are judged alike.
  constexpr double kMisfit = 1.5e-3, kUnsharp = 6e-4, kDirectionUncertain = 1.25e-3;
  const double diagonal = std::hypot(e.width, e.height);

  std::vector<std::string> bad, weak;
  if (e.tilt.widest_deg < kParallel_deg)
    bad.push_back(fmt::format(
        "all pictures are parallel (the target turns by {:.0f} degrees at most): the focal length "
        "isn't determined; tilt the target by 20 to 45 degrees to all sides",
        e.tilt.widest_deg));
  else if (e.focal_sigma_px > kFocalLost * e.focal_px)
    bad.push_back(
        fmt::format("the focal length is known to {:.0f} % only; take more pictures, with the "
                    "target tilted by 20 to 45 degrees to all sides and as large as the image",
                    100.0 * e.focal_sigma_px / e.focal_px));
  if (e.noise_px > kMisfit * diagonal)
    bad.push_back(
        fmt::format("points are {:.1f} px off where they should be: is the board of the size and "
                    "kind that was named, is it flat, is it the right --model?",
                    e.noise_px));

  if (e.noise_px <= kMisfit * diagonal && e.noise_px > kUnsharp * diagonal)
    weak.push_back(
        fmt::format("points are {:.1f} px off where they should be: pictures are moved or out of "
                    "focus, the target isn't flat, or the lens bends more than --model allows",
                    e.noise_px));
  if (bad.empty() && e.tilt.tilted < kFewTilted)
    weak.push_back(
        fmt::format("too few tilted pictures ({} by {:.0f} degrees or more); tilt the target by 20 "
                    "to 45 degrees to all sides",
                    e.tilt.tilted, kTilted_deg));
  if (e.views < kFewViews)
    weak.push_back(fmt::format("only {} pictures; take {} or more", e.views, 2 * kFewViews));
  std::vector<std::string> corners, others;
  for (const std::string& name : e.coverage.missing())
    (name.find("corner") != std::string::npos ? corners : others).push_back(name);
  if (!corners.empty())
    weak.push_back(fmt::format(
        "corners of the image not covered: hold the target into {}, where the lens bends most",
        joined(corners)));
  if (!others.empty())
    weak.push_back(fmt::format("parts of the image not covered: hold the target into {}, too",
                               joined(others)));
  if (bad.empty() && e.focal_sigma_px > kFocalUncertain * e.focal_px)
    weak.push_back(fmt::format(
        "the focal length is known to {:.1f} % only; take more pictures with the target "
        "tilted",
        100.0 * e.focal_sigma_px / e.focal_px));
  if (e.direction.worst_px > kDirectionUncertain * diagonal)
    weak.push_back(
        fmt::format("directions towards the image's rim are known to {:.1f} px only; take more "
                    "pictures with the target there",
                    e.direction.worst_px));
  if (!e.direction.everywhere)
    weak.emplace_back(
        "the lens's formula fails in parts of the image that no picture covers; cover them, or try "
        "another --model");
  if (e.held_out_rms_px > kOverfit * e.rms_px)
    weak.push_back(fmt::format(
        "pictures that were held out are {:.2f} px off, the others {:.2f} px: take more "
        "pictures, or a simpler --model",
        e.held_out_rms_px, e.rms_px));
  if (2 * e.dropped > e.views)
    weak.push_back(
        fmt::format("{} pictures don't agree with the {} others: is the target flat and "
                    "stiff, did something move?",
                    e.dropped, e.views));

  Verdict verdict;
  verdict.grade = !bad.empty() ? Grade::bad : !weak.empty() ? Grade::usable : Grade::good;
  verdict.reasons = std::move(bad);
  verdict.reasons.insert(verdict.reasons.end(), weak.begin(), weak.end());
  return verdict;
}

}  // namespace harco::cli
