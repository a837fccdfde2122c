// Boards and a first calibration by OpenCV; part of the module harco_opencv.so.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "aruco_dictionary.hpp"
#include "calibration_board.hpp"
#include "harco/error.hpp"
#include "harco/pose.hpp"

namespace harco::cli {
namespace {

using Eigen::Vector2d;

/// A view: OpenCV wants a pointer that isn't const even where it only reads.
cv::Mat mat_of(const ImageView& image) {
  return {image.height(), image.width(), CV_8UC1, const_cast<std::uint8_t*>(image.row(0)),
          static_cast<std::size_t>(image.stride())};
}

constexpr int kLargestWindow = 11, kSmallestWindow = 2;  // half widths in pixels

/// Moves a corner to where the grey values put it. `room_px` is how far away other edges begin.
/// False if it doesn't stay near.
bool sharpen(const cv::Mat& image, double room_px, Vector2d& corner) {
  const int half =
      std::clamp(static_cast<int>(std::floor(room_px)), kSmallestWindow, kLargestWindow);
  const auto inside = [&](double at, int size) { return at > half && at < size - 1 - half; };
  if (!inside(corner.x(), image.cols) || !inside(corner.y(), image.rows)) return false;
  std::vector<cv::Point2f> point{{static_cast<float>(corner.x()), static_cast<float>(corner.y())}};
  cv::cornerSubPix(image, point, {half, half}, {-1, -1},
                   {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-4});
  const Vector2d found(point[0].x, point[0].y);
  const bool near = (found - corner).norm() <= half;
  corner = found;
  return near;
}

// --- Chessboard ---------------------------------------------------------------------------------

/// How far from each corner of a grid its nearest neighbour is.
std::vector<double> spacing(const std::vector<cv::Point2f>& corners, const cv::Size& size) {
  std::vector<double> nearest(corners.size(), std::numeric_limits<double>::infinity());
  const auto compare = [&](int i, int j) {
    const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
    const double distance = cv::norm(corners[a] - corners[b]);
    nearest[a] = std::min(nearest[a], distance);
    nearest[b] = std::min(nearest[b], distance);
  };
  for (int row = 0; row < size.height; ++row)
    for (int column = 0; column < size.width; ++column) {
      const int i = row * size.width + column;
      if (column + 1 < size.width) compare(i, i + 1);
      if (row + 1 < size.height) compare(i, i + size.width);
    }
  return nearest;
}

/// The image in a size in which a board is found quickly, and how many of its pixels are one of
/// that.
std::pair<cv::Mat, double> handy(const cv::Mat& image) {
  constexpr double kLargest = 1600.0;
  const double factor = std::max(image.cols, image.rows) / kLargest;
  if (factor <= 1.0) return {image, 1.0};
  cv::Mat small;
  cv::resize(image, small, {}, 1.0 / factor, 1.0 / factor, cv::INTER_AREA);
  return {small, static_cast<double>(image.cols) / small.cols};
}

std::vector<BoardCorner> find_chessboard(const Board& board, const cv::Mat& image) {
  const cv::Size size(board.columns, board.rows);
  const auto [small, factor] = handy(image);
  std::vector<cv::Point2f> seen;
  // What the one misses, the other often finds. (The older findChessboardCorners may take a minute
  // for a picture of a board of another size.)
  for (const int flag : {cv::CALIB_CB_NORMALIZE_IMAGE, cv::CALIB_CB_ACCURACY})
    if (cv::findChessboardCornersSB(small, size, seen, cv::CALIB_CB_EXHAUSTIVE | flag)) break;
  if (seen.size() != static_cast<std::size_t>(size.area())) return {};
  for (cv::Point2f& corner : seen) {
    const cv::Point2f half(0.5F, 0.5F);
    corner = (corner + half) * factor - half;
  }
  const std::vector<double> room = spacing(seen, size);
  std::vector<BoardCorner> corners;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const int index = static_cast<int>(i);
    BoardCorner corner{Vector2d(index % size.width, index / size.width), {seen[i].x, seen[i].y}};
    if (sharpen(image, 0.4 * room[i], corner.pixel)) corners.push_back(corner);
  }
  return corners;
}

// --- ChArUco ------------------------------------------------------------------------------------

/// An ArUco marker as it is seen: top-left, top-right, bottom-right, bottom-left.
using SeenMarkers = std::map<int, std::vector<cv::Point2f>>;

/// Which marker stands in which square: they fill the white squares row by row, and the top-left
/// square is either black or white. (OpenCV prints boards with an even number of rows in one way
/// from version 4.7 on, in the other way before.)
std::map<std::pair<int, int>, int> markers_by_square(const Board& board, bool white_first) {
  std::map<std::pair<int, int>, int> ids;
  int next = 0;
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column)
      if (((row + column) % 2 == 0) == white_first) ids[{column, row}] = next++;
  return ids;
}

/// Takes squares of the board to the image, as one marker's four corners say.
Eigen::Matrix3d homography(const std::vector<cv::Point2f>& seen, int column, int row,
                           double share) {
  const double margin = 0.5 * (1.0 - share);
  const double left = column + margin, top = row + margin;
  std::vector<Vector2d> image;
  for (const cv::Point2f& corner : seen) image.emplace_back(corner.x, corner.y);
  return fit_homography(
      {{left, top}, {left + share, top}, {left + share, top + share}, {left, top + share}}, image);
}

/// The board's corners as the markers of the two white squares at each of them agree.
std::vector<BoardCorner> corners_between(const Board& board, const cv::Mat& image,
                                         const SeenMarkers& seen, bool white_first) {
  const auto ids = markers_by_square(board, white_first);
  std::vector<BoardCorner> corners;
  for (int row = 1; row < board.rows; ++row)
    for (int column = 1; column < board.columns; ++column) {
      const Vector2d squares(column, row);
      std::vector<Vector2d> expected;
      double side = 0.0;
      for (const int dy : {-1, 0})
        for (const int dx : {-1, 0}) {
          const auto id = ids.find({column + dx, row + dy});
          if (id == ids.end()) continue;
          const auto marker = seen.find(id->second);
          if (marker == seen.end()) continue;
          const Eigen::Matrix3d map =
              homography(marker->second, column + dx, row + dy, board.marker_share);
          expected.emplace_back((map * squares.homogeneous()).hnormalized());
          side += 0.25 * cv::arcLength(marker->second, true) / board.marker_share / 2.0;
        }
      if (expected.size() != 2 || (expected[0] - expected[1]).norm() > 0.25 * side) continue;
      BoardCorner corner{squares, 0.5 * (expected[0] + expected[1])};
      const double gap = 0.5 * (1.0 - board.marker_share) * side;
      if (sharpen(image, 0.9 * gap, corner.pixel)) corners.push_back(corner);
    }
  return corners;
}

std::vector<BoardCorner> find_charuco(const Board& board, const cv::Mat& image) {
  std::vector<std::vector<cv::Point2f>> outlines;
  std::vector<int> ids;
  cv::aruco::detectMarkers(image, aruco_dictionary(board.dictionary), outlines, ids);
  SeenMarkers seen;
  for (std::size_t i = 0; i < ids.size(); ++i) seen[ids[i]] = outlines[i];
  std::vector<BoardCorner> best = corners_between(board, image, seen, false);
  std::vector<BoardCorner> other = corners_between(board, image, seen, true);
  return other.size() > best.size() ? other : best;
}

// --- Calibration --------------------------------------------------------------------------------

/// Points as OpenCV takes them.
struct Points {
  std::vector<std::vector<cv::Point3f>> target;
  std::vector<std::vector<cv::Point2f>> image;
};

/// Of so many views at most, evenly chosen: the time grows with their cube.
Points points_of(const std::vector<TargetView>& views) {
  constexpr std::size_t kMost = 40;
  Points points;
  const std::size_t count = std::min(views.size(), kMost);
  for (std::size_t i = 0; i < count; ++i) {
    std::vector<cv::Point3f> target;
    std::vector<cv::Point2f> image;
    for (const Feature& feature : views[i * views.size() / count].features)
      for (std::size_t j = 0; j < feature.target_m.size(); ++j) {
        target.emplace_back(static_cast<float>(feature.target_m[j].x()),
                            static_cast<float>(feature.target_m[j].y()), 0.0F);
        image.emplace_back(static_cast<float>(feature.image_px[j].x()),
                           static_cast<float>(feature.image_px[j].y()));
      }
    if (target.size() < 6) continue;
    points.target.push_back(std::move(target));
    points.image.push_back(std::move(image));
  }
  return points;
}

Camera camera_of(const cv::Mat& matrix, const cv::Mat& coefficients, LensModel lens, int width,
                 int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = matrix.at<double>(0, 0);
  camera.fy = matrix.at<double>(1, 1);
  camera.cx = matrix.at<double>(0, 2);
  camera.cy = matrix.at<double>(1, 2);
  camera.lens = lens;
  for (std::size_t i = 0; i < std::min<std::size_t>(coefficients.total(), 8); ++i)
    camera.coefficients[i] = coefficients.at<double>(static_cast<int>(i));
  validate(camera);
  return camera;
}

/// OpenCV's fisheye calibration wants points in double precision and a focal length near the truth.
Camera start_fisheye(const Points& points, int width, int height) {
  cv::Mat matrix = cv::Mat::eye(3, 3, CV_64F), coefficients = cv::Mat::zeros(4, 1, CV_64F);
  std::vector<cv::Mat> rotations, translations;
  cv::fisheye::calibrate(points.target, points.image, {width, height}, matrix, coefficients,
                         rotations, translations,
                         cv::fisheye::CALIB_RECOMPUTE_EXTRINSIC | cv::fisheye::CALIB_FIX_SKEW,
                         {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 100, 1e-8});
  return camera_of(matrix, coefficients, LensModel::equidistant, width, height);
}

/// The richer models start from this one, too: their last coefficients begin at zero.
Camera start_pinhole(const Points& points, int width, int height) {
  cv::Mat matrix, coefficients;
  std::vector<cv::Mat> rotations, translations;
  cv::calibrateCamera(points.target, points.image, {width, height}, matrix, coefficients, rotations,
                      translations, cv::CALIB_FIX_K3);
  return camera_of(matrix, coefficients, LensModel::brown_conrady, width, height);
}

}  // namespace

void harco_check_board(const Board& board) { aruco_dictionary(board.dictionary); }

void harco_find_board(const Board& board, const ImageView& image,
                      std::vector<BoardCorner>& corners) {
  const cv::Mat pixels = mat_of(image);
  corners = board.kind == Board::Kind::chessboard ? find_chessboard(board, pixels)
                                                  : find_charuco(board, pixels);
}

void harco_rough_calibration(const std::vector<TargetView>& views, CalibrationModel model,
                             int width, int height, Camera& camera) {
  const Points points = points_of(views);
  try {
    camera = model == CalibrationModel::fisheye ? start_fisheye(points, width, height)
                                                : start_pinhole(points, width, height);
  } catch (const cv::Exception&) {
    throw Error(
        "calibration: the pictures don't determine the camera; take some with the target tilted to "
        "all sides");
  }
}

}  // namespace harco::cli
