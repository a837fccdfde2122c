#include "photo_scene.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <stdexcept>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "coverage.hpp"
#include "harco/error.hpp"
#include "render.hpp"

namespace harco::lab {
namespace {

namespace fs = std::filesystem;

constexpr const char* kOpenCvDoc = "/usr/share/doc/opencv-doc";

// --- Calibration --------------------------------------------------------------------------------

cv::Mat to_cv(const Image& image) {
  cv::Mat mat(image.height, image.width, CV_8U);
  std::copy(image.pixels.begin(), image.pixels.end(), mat.begin<unsigned char>());
  return mat;
}

std::vector<cv::Point3f> board_points(const Chessboard& board) {
  std::vector<cv::Point3f> points;
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column)
      points.emplace_back(static_cast<float>(column * board.square_m),
                          static_cast<float>(row * board.square_m), 0.0F);
  return points;
}

/// Empty if the board isn't seen as a whole.
std::vector<cv::Point2f> find_corners(const Image& image, const Chessboard& board) {
  const cv::Mat grey = to_cv(image);
  std::vector<cv::Point2f> corners;
  if (!cv::findChessboardCorners(grey, {board.columns, board.rows}, corners)) return {};
  cv::cornerSubPix(grey, corners, {5, 5}, {-1, -1},
                   {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-3});
  return corners;
}

Camera camera_from(const cv::Mat& matrix, const cv::Mat& coefficients, cv::Size size) {
  Camera camera;
  camera.width = size.width;
  camera.height = size.height;
  camera.fx = matrix.at<double>(0, 0);
  camera.fy = matrix.at<double>(1, 1);
  camera.cx = matrix.at<double>(0, 2);
  camera.cy = matrix.at<double>(1, 2);
  for (int i = 0; i < static_cast<int>(coefficients.total()); ++i)
    camera.coefficients[static_cast<std::size_t>(i)] = coefficients.at<double>(i);
  return camera;
}

Eigen::Isometry3d pose_from(const cv::Mat& rotation_vector, const cv::Mat& translation) {
  const Eigen::Vector3d rotation(rotation_vector.at<double>(0), rotation_vector.at<double>(1),
                                 rotation_vector.at<double>(2));
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  if (rotation.norm() > 0.0)
    pose.linear() = Eigen::AngleAxisd(rotation.norm(), rotation.normalized()).toRotationMatrix();
  pose.translation() = Eigen::Vector3d(translation.at<double>(0), translation.at<double>(1),
                                       translation.at<double>(2));
  return pose;
}

// --- What a photograph tells about light, lens and sensor ---------------------------------------

/// Where points of the board, counted in squares from its middle, are seen.
class BoardView {
 public:
  BoardView(const Camera& camera, const Eigen::Isometry3d& camera_T_board, const Chessboard& board)
      : camera_(camera),
        camera_T_board_(camera_T_board),
        board_T_camera_(camera_T_board.inverse()),
        square_(board.square_m),
        middle_(0.5 * (board.columns - 1), 0.5 * (board.rows - 1)) {}

  Eigen::Vector2d pixel(const Eigen::Vector2d& squares) const {
    const Eigen::Vector2d on_board = (squares + middle_) * square_;
    const auto seen =
        camera_.project(camera_T_board_ * Eigen::Vector3d(on_board.x(), on_board.y(), 0.0));
    if (!seen) throw std::invalid_argument("the board is not before the camera");
    return *seen;
  }

  Eigen::Vector2d squares(const Eigen::Vector2d& pixel) const {
    const auto ray = camera_.unproject(pixel);
    if (!ray) throw std::invalid_argument("the lens model doesn't reach a pixel of the board");
    const Eigen::Vector3d origin = board_T_camera_.translation();
    const Eigen::Vector3d direction =
        board_T_camera_.linear() * Eigen::Vector3d(ray->x(), ray->y(), 1.0);
    const Eigen::Vector3d point = origin - origin.z() / direction.z() * direction;
    return point.head<2>() / square_ - middle_;
  }

 private:
  const Camera& camera_;
  Eigen::Isometry3d camera_T_board_, board_T_camera_;
  double square_;
  Eigen::Vector2d middle_;
};

bool inside(const Image& image, const Eigen::Vector2d& pixel, double margin) {
  return pixel.x() >= margin && pixel.y() >= margin && pixel.x() <= image.width - 1 - margin &&
         pixel.y() <= image.height - 1 - margin;
}

double nearest_value(const Image& image, const Eigen::Vector2d& pixel) {
  return image.row(static_cast<int>(std::lround(pixel.y())))[std::lround(pixel.x())];
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Grey levels in the middle of one square.
struct SquareSample {
  Eigen::Vector2d at;  ///< in squares from the board's middle
  double level = 0.0;
  double spread = 0.0;  ///< standard deviation
  int parity = 0;       ///< of row + column: squares of one colour share it
};

std::vector<SquareSample> sample_squares(const ChessboardPhoto& photo, const BoardView& view,
                                         const Chessboard& board) {
  // Half a square's width, sampled so densely that neighbours are at least a pixel apart in any
  // photograph where the board fills half of a VGA image.
  constexpr int kSteps = 7;
  constexpr double kHalf = 0.25;
  std::vector<SquareSample> samples;
  for (int row = 0; row + 1 < board.rows; ++row)
    for (int column = 0; column + 1 < board.columns; ++column) {
      SquareSample sample;
      sample.at = {column + 1 - 0.5 * board.columns, row + 1 - 0.5 * board.rows};
      sample.parity = (row + column) % 2;
      double sum = 0.0;
      double squares_sum = 0.0;
      for (int i = 0; i < kSteps * kSteps; ++i) {
        const Eigen::Vector2d offset(i % kSteps, i / kSteps);
        const Eigen::Vector2d at =
            sample.at + kHalf * (2.0 / (kSteps - 1) * offset - Eigen::Vector2d::Ones());
        const double value = nearest_value(photo.image, view.pixel(at));
        sum += value;
        squares_sum += value * value;
      }
      constexpr int kCount = kSteps * kSteps;
      sample.level = sum / kCount;
      sample.spread = std::sqrt(std::max(0.0, squares_sum / kCount - sample.level * sample.level));
      samples.push_back(sample);
    }
  return samples;
}

Eigen::Matrix<double, 1, 6> monomials(const Eigen::Vector2d& p) {
  Eigen::Matrix<double, 1, 6> terms;
  terms << 1.0, p.x(), p.y(), p.x() * p.x(), p.x() * p.y(), p.y() * p.y();
  return terms;
}

SmoothField fit_field(const std::vector<SquareSample>& samples, int parity) {
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
  for (const SquareSample& sample : samples) {
    if (sample.parity != parity) continue;
    const auto terms = monomials(sample.at);
    normal += terms.transpose() * terms;
    right += terms.transpose() * sample.level;
  }
  return {normal.ldlt().solve(right)};
}

double normal_cdf(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }
double normal_pdf(double z) { return std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi); }

/// Pixels across one edge: distance from its line, and value.
struct EdgeProfile {
  std::vector<double> distance, value;
};

EdgeProfile edge_profile(const Image& image, const Eigen::Vector2d& from,
                         const Eigen::Vector2d& to) {
  constexpr double kReach = 5.0;   // pixels to both sides
  constexpr double kShare = 0.25;  // of the edge left out at both ends, where others begin
  const Eigen::Vector2d along = (to - from).normalized();
  const Eigen::Vector2d across(-along.y(), along.x());
  const Eigen::Vector2d low = from.cwiseMin(to).array() - kReach;
  const Eigen::Vector2d high = from.cwiseMax(to).array() + kReach;
  EdgeProfile profile;
  for (int y = static_cast<int>(std::ceil(low.y())); y <= high.y(); ++y)
    for (int x = static_cast<int>(std::ceil(low.x())); x <= high.x(); ++x) {
      const Eigen::Vector2d pixel(x, y);
      const double share = (pixel - from).dot(along) / (to - from).norm();
      const double distance = (pixel - from).dot(across);
      if (share < kShare || share > 1.0 - kShare || std::abs(distance) > kReach) continue;
      if (!inside(image, pixel, 0.0)) continue;
      profile.distance.push_back(distance);
      profile.value.push_back(image.row(y)[x]);
    }
  return profile;
}

/// Standard deviation of the Gaussian that blurs an edge, in pixels, the pixel's square included:
/// low + step * Phi((d - offset) / sigma), by Gauss-Newton. Not positive where it doesn't converge.
double edge_blur(const EdgeProfile& profile) {
  const auto [least, most] = std::minmax_element(profile.value.begin(), profile.value.end());
  const bool rises = profile.value[static_cast<std::size_t>(
                         std::max_element(profile.distance.begin(), profile.distance.end()) -
                         profile.distance.begin())] > 0.5 * (*least + *most);
  Eigen::Vector4d p(rises ? *least : *most, rises ? *most - *least : *least - *most, 0.0, 0.8);
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    for (std::size_t i = 0; i < profile.value.size(); ++i) {
      const double z = (profile.distance[i] - p[2]) / p[3];
      const double slope = p[1] * normal_pdf(z) / p[3];
      const Eigen::Vector4d jacobian(1.0, normal_cdf(z), -slope, -slope * z);
      normal += jacobian * jacobian.transpose();
      right += jacobian * (profile.value[i] - p[0] - p[1] * normal_cdf(z));
    }
    const Eigen::Vector4d step = normal.ldlt().solve(right);
    p += step;
    if (!(p[3] > 0.05 && p[3] < 5.0)) return 0.0;
    if (step.norm() < 1e-6) break;
  }
  return p[3];
}

double measure_psf(const ChessboardPhoto& photo, const Chessboard& board) {
  const auto corner = [&](int row, int column) {
    return photo.corners[static_cast<std::size_t>(row * board.columns + column)];
  };
  std::vector<double> variances;
  const auto add = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const EdgeProfile profile = edge_profile(photo.image, from, to);
    if (profile.value.size() < 50) return;
    const double blur = edge_blur(profile);
    constexpr double kPixelVariance = 1.0 / 12.0;
    if (blur > 0.0) variances.push_back(std::max(0.0, blur * blur - kPixelVariance));
  };
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column) {
      if (column + 1 < board.columns) add(corner(row, column), corner(row, column + 1));
      if (row + 1 < board.rows) add(corner(row, column), corner(row + 1, column));
    }
  return variances.empty() ? 0.0 : std::sqrt(median(std::move(variances)));
}

// --- Laying a marker into it --------------------------------------------------------------------

/// Half the size, in squares, of what is printed on the board, the outer squares included.
Eigen::Vector2d half_board(const Chessboard& board) {
  return {0.5 * (board.columns + 1), 0.5 * (board.rows + 1)};
}

/// Outline in pixels of the paper, finely divided since the lens bends it.
std::vector<Eigen::Vector2d> paper_outline(const BoardView& view, const Chessboard& board) {
  constexpr int kSteps = 64;
  constexpr double kRim = 0.06;  // squares; the print isn't cut exactly
  const Eigen::Vector2d half = half_board(board).array() + kRim;
  const std::array<Eigen::Vector2d, 4> corners{Eigen::Vector2d(-half.x(), -half.y()),
                                               Eigen::Vector2d(half.x(), -half.y()), half,
                                               Eigen::Vector2d(-half.x(), half.y())};
  std::vector<Eigen::Vector2d> outline;
  for (std::size_t side = 0; side < 4; ++side)
    for (int i = 0; i < kSteps; ++i) {
      const double share = static_cast<double>(i) / kSteps;
      outline.push_back(
          view.pixel((1.0 - share) * corners[side] + share * corners[(side + 1) % 4]));
    }
  return outline;
}

/// Of the only parent's markers of one layer, the one nearest to its middle.
PlacedMarker middle_marker(const MarkerSet& markers, int layer) {
  const Eigen::Vector2d middle = Eigen::Vector2d::Constant(0.5 * markers.parents.front().side_m);
  std::optional<PlacedMarker> nearest;
  const auto off = [&](const PlacedMarker& marker) {
    return (marker.origin_m.array() + 0.5 * marker.side_m - middle.array()).matrix().norm();
  };
  for (const PlacedMarker& marker : place(markers))
    if (marker.layer == layer && (!nearest || off(marker) < off(*nearest))) nearest = marker;
  if (!nearest)
    throw std::invalid_argument("lay_marker: the parent has no layer " + std::to_string(layer));
  return *nearest;
}

/// Side of the parent with which the middle marker of a layer, with its quiet zone, fits the board.
double fitting_side(const MarkerSet& markers, int layer, const Chessboard& board) {
  const PlacedMarker middle = middle_marker(markers, layer);
  const double with_quiet_zone = middle.side_m + 2.0 * middle.cell_side_m();
  const double board_m = 2.0 * half_board(board).minCoeff() * board.square_m;
  return markers.parents.front().side_m * board_m / with_quiet_zone;
}

Eigen::Translation3d board_T_marker(const MarkerSet& markers, int layer, const Chessboard& board) {
  const PlacedMarker middle = middle_marker(markers, layer);
  const Eigen::Vector2d board_middle_m =
      0.5 * board.square_m * Eigen::Vector2d(board.columns - 1, board.rows - 1);
  const Eigen::Vector2d origin_m =
      board_middle_m - middle.origin_m - Eigen::Vector2d::Constant(0.5 * middle.side_m);
  return {origin_m.x(), origin_m.y(), 0.0};
}

/// Share of every pixel that the marker's ink covers.
FloatImage ink_share(const Camera& camera, const MarkerSet& markers,
                     const Eigen::Isometry3d& camera_T_marker, double psf_sigma_px) {
  Scene scene;
  scene.camera = camera;
  scene.parents.push_back({0, camera_T_marker});
  scene.quiet_zone_cells = 0.0;
  scene.black = 1.0;
  scene.white = 0.0;
  scene.grey = 0.0;
  scene.psf_sigma_px = psf_sigma_px;
  scene.noise_sigma = 0.0;
  return render_exact(scene, markers);
}

}  // namespace

double SmoothField::at(const Eigen::Vector2d& squares) const {
  return monomials(squares).dot(coefficients);
}

PhotoSeries calibrate(const std::vector<fs::path>& files, const Chessboard& board) {
  PhotoSeries series;
  series.board = board;
  std::vector<std::vector<cv::Point2f>> corners;
  for (const fs::path& file : files) {
    ChessboardPhoto photo;
    photo.name = file.stem().string();
    photo.image = load_grey(file);
    if (!series.photos.empty() && (photo.image.width != series.photos.front().image.width ||
                                   photo.image.height != series.photos.front().image.height))
      throw Error(file.string() + ": is not as large as the photographs before it");
    const std::vector<cv::Point2f> found = find_corners(photo.image, board);
    if (found.empty()) continue;
    for (const cv::Point2f& corner : found)
      photo.corners.emplace_back(static_cast<double>(corner.x), static_cast<double>(corner.y));
    corners.push_back(found);
    series.photos.push_back(std::move(photo));
  }
  if (series.photos.size() < 3)
    throw Error("calibration: the chessboard is seen in " + std::to_string(series.photos.size()) +
                " photographs; at least 3 are needed");

  const cv::Size size(series.photos.front().image.width, series.photos.front().image.height);
  const std::vector<std::vector<cv::Point3f>> points(corners.size(), board_points(board));
  cv::Mat matrix, coefficients;
  std::vector<cv::Mat> rotations, translations;
  series.rms_px =
      cv::calibrateCamera(points, corners, size, matrix, coefficients, rotations, translations);
  series.camera = camera_from(matrix, coefficients, size);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    cv::Mat rotation, translation;
    cv::solvePnP(points[i], corners[i], matrix, coefficients, rotation, translation);
    series.photos[i].camera_T_board = pose_from(rotation, translation);
  }
  return series;
}

BoardLook measure_look(const ChessboardPhoto& photo, const Camera& camera,
                       const Chessboard& board) {
  const BoardView view(camera, photo.camera_T_board, board);
  const std::vector<SquareSample> samples = sample_squares(photo, view, board);
  std::array<double, 2> sum{};
  std::vector<double> spreads;
  for (const SquareSample& sample : samples) {
    sum[static_cast<std::size_t>(sample.parity)] += sample.level;
    spreads.push_back(sample.spread);
  }
  const int white_parity = sum[1] > sum[0] ? 1 : 0;
  BoardLook look;
  look.white = fit_field(samples, white_parity);
  look.black = fit_field(samples, 1 - white_parity);
  look.psf_sigma_px = measure_psf(photo, board);
  look.noise_sigma = median(std::move(spreads));
  return look;
}

StagedPhoto lay_marker(const ChessboardPhoto& photo, const Camera& camera, const Chessboard& board,
                       const MarkerSet& markers, int parent_index, int layer,
                       std::uint64_t noise_seed) {
  if (parent_index < 0 || parent_index >= static_cast<int>(markers.parents.size()))
    throw std::invalid_argument("lay_marker: there is no parent " + std::to_string(parent_index));
  StagedPhoto staged;
  staged.markers = markers;
  staged.markers.parents = {markers.parents[static_cast<std::size_t>(parent_index)]};
  staged.markers.parents.front().side_m = fitting_side(staged.markers, layer, board);
  staged.camera_T_marker = photo.camera_T_board * board_T_marker(staged.markers, layer, board);

  const BoardLook look = measure_look(photo, camera, board);
  const BoardView view(camera, photo.camera_T_board, board);
  Coverage paper({0, 0, camera.width, camera.height}, {look.psf_sigma_px, 4});
  paper.add(paper_outline(view, board));
  const FloatImage paper_share = paper.blurred();
  const FloatImage ink =
      ink_share(camera, staged.markers, staged.camera_T_marker, look.psf_sigma_px);

  // Less is rounding, not paper, and far from the paper its light can't be told.
  constexpr double kNothing = 1e-4;
  staged.image = photo.image;
  std::mt19937_64 random(noise_seed);
  std::normal_distribution<double> noise(0.0, look.noise_sigma);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const double covered = static_cast<double>(paper_share.row(y)[x]);
      if (covered < kNothing) continue;
      const Eigen::Vector2d at = view.squares({x, y});
      const double white = look.white.at(at);
      const double black = look.black.at(at);
      const double inked = static_cast<double>(ink.row(y)[x]);
      std::uint8_t& pixel = staged.image.row(y)[x];
      const double paper_value = white - inked * (white - black) + noise(random);
      const double value = (1.0 - covered) * pixel + covered * paper_value;
      pixel = static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
    }
  return staged;
}

PoseError pose_error(const Eigen::Isometry3d& estimate, const Eigen::Isometry3d& truth) {
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(truth.linear().transpose() * estimate.linear()));
  return {
      100.0 * (estimate.translation() - truth.translation()).norm() / truth.translation().norm(),
      turn.angle() * 180.0 / std::numbers::pi};
}

std::vector<fs::path> opencv_chessboard_photos(const std::string& camera) {
  const fs::path folder = fs::path(kOpenCvDoc) / "examples" / "data";
  std::vector<fs::path> files;
  for (int number = 1; number <= 14; ++number) {
    std::string digits = std::to_string(number);
    if (number < 10) digits.insert(digits.begin(), '0');
    const fs::path file = folder / (camera + digits + ".jpg");
    if (fs::exists(file)) files.push_back(file);  // number 10 has never been there
  }
  if (files.empty())
    throw Error(folder.string() + ": has no photographs " + camera +
                "01.jpg ...; they come with the package opencv-doc");
  return files;
}

fs::path opencv_desk_photo() {
  fs::path file = fs::path(kOpenCvDoc) / "opencv4" / "html" / "singlemarkersoriginal.jpg";
  if (!fs::exists(file))
    throw Error(file.string() + ": is missing; it comes with the package opencv-doc");
  return file;
}

Image load_grey(const fs::path& file) {
  if (!fs::is_regular_file(file)) throw Error(file.string() + ": there is no such file");
  const cv::Mat grey = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
  if (grey.empty()) throw Error(file.string() + ": can't be read as a picture");
  Image image(grey.cols, grey.rows);
  std::copy(grey.begin<unsigned char>(), grey.end<unsigned char>(), image.pixels.begin());
  return image;
}

}  // namespace harco::lab
