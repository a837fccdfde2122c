#include "lab/aruco.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Dense>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "harco/geometry.hpp"
#include "harco/marker.hpp"

namespace harco::lab {
namespace {

constexpr int kArucoCells = 4;
constexpr int kBoardRow = 5;
constexpr int kBoardMarkers = kBoardRow * kBoardRow - 1;
// Half the side of cornerSubPix's window, in cells: of 0.3, 0.6 and 0.9 this has the least errors.
constexpr double kWindowCells = 0.6;
constexpr double kGap = 0.25;  // between the board's markers, in their sides

using Corners = std::vector<cv::Point2f>;

cv::Ptr<cv::aruco::Dictionary> aruco_dictionary() {
  return cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50);
}

Code aruco_code(int id) {
  const cv::Mat bits = cv::aruco::Dictionary::getBitsFromByteList(
      aruco_dictionary()->bytesList.row(id), kArucoCells);
  Code code{kArucoCells, 0};
  for (int cell = 0; cell < code.size(); ++cell) {
    const bool white = bits.at<unsigned char>(cell / kArucoCells, cell % kArucoCells) != 0;
    code.bits |= std::uint64_t{white} << cell;
  }
  return code;
}

double board_marker_side(double side_m) { return side_m / (kBoardRow + (kBoardRow - 1) * kGap); }

/// Top-left corner of one of the board's markers, row-first without the middle.
Eigen::Vector2d board_origin(int id, double side_m) {
  const int place = id < kBoardMarkers / 2 ? id : id + 1;
  const double pitch = board_marker_side(side_m) * (1.0 + kGap);
  const int row = place / kBoardRow, column = place % kBoardRow;
  return {pitch * column, pitch * row};
}

cv::Ptr<cv::aruco::Board> board_of(double side_m) {
  const auto s = static_cast<float>(board_marker_side(side_m));
  std::vector<std::vector<cv::Point3f>> points;
  std::vector<int> ids;
  for (int id = 0; id < kBoardMarkers; ++id) {
    const Eigen::Vector2f o = board_origin(id, side_m).cast<float>();
    points.push_back({{o.x(), o.y(), 0.0F},
                      {o.x() + s, o.y(), 0.0F},
                      {o.x() + s, o.y() + s, 0.0F},
                      {o.x(), o.y() + s, 0.0F}});
    ids.push_back(id);
  }
  return cv::aruco::Board::create(points, aruco_dictionary(), ids);
}

cv::Mat matrix_of(const Camera& camera) {
  return (cv::Mat_<double>(3, 3) << camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0,
          1.0);
}

cv::Mat distortion_of(const Camera& camera) {
  return cv::Mat(camera.coefficients, true).reshape(1, 1);
}

Eigen::Isometry3d to_isometry(const cv::Vec3d& rotation, const cv::Vec3d& translation) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const Eigen::Vector3d turn(rotation[0], rotation[1], rotation[2]);
  if (turn.norm() > 0.0) pose.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  pose.translation() = Eigen::Vector3d(translation[0], translation[1], translation[2]);
  return pose;
}

struct Found {
  std::vector<Corners> corners;
  std::vector<int> ids;
};

/// With a board and the camera, also what the board's found markers promise.
Found find_aruco(const cv::Mat& grey, double marker_px, Refinement refinement,
                 const cv::Ptr<cv::aruco::Board>& board = nullptr, const Camera* camera = nullptr) {
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = refinement == Refinement::sub_pixel
                                           ? cv::aruco::CORNER_REFINE_SUBPIX
                                           : cv::aruco::CORNER_REFINE_APRILTAG;
  parameters->cornerRefinementWinSize =
      std::clamp(static_cast<int>(std::lround(kWindowCells * marker_px / (kArucoCells + 2))), 1, 5);
  parameters->cornerRefinementMaxIterations = 100;
  parameters->cornerRefinementMinAccuracy = 0.001;
  Found found;
  std::vector<Corners> rejected;
  cv::aruco::detectMarkers(grey, aruco_dictionary(), found.corners, found.ids, parameters,
                           rejected);
  if (board && !found.ids.empty())
    cv::aruco::refineDetectedMarkers(grey, board, found.corners, found.ids, rejected,
                                     matrix_of(*camera), distortion_of(*camera), 10.0F, 3.0F, true,
                                     cv::noArray(), parameters);
  // AprilTag's pixel centres are at a half, which OpenCV 4.6 passes on as they are.
  if (refinement == Refinement::edges)
    for (Corners& corners : found.corners)
      for (cv::Point2f& corner : corners) corner -= cv::Point2f(0.5F, 0.5F);
  return found;
}

std::array<Eigen::Vector2d, 4> as_square(const Corners& corners) {
  std::array<Eigen::Vector2d, 4> square;
  for (std::size_t i = 0; i < square.size(); ++i) square[i] = {corners[i].x, corners[i].y};
  return square;
}

/// OpenCV doesn't write to it.
cv::Mat as_mat(const Image& image) {
  return {image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data())};
}

Eigen::Isometry3d mean_of(const std::vector<Eigen::Isometry3d>& poses) {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Matrix4d quaternions = Eigen::Matrix4d::Zero();
  for (const Eigen::Isometry3d& pose : poses) {
    translation += pose.translation() / static_cast<double>(poses.size());
    const Eigen::Vector4d q = Eigen::Quaterniond(pose.linear()).coeffs();
    quaternions += q * q.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(quaternions);
  Eigen::Isometry3d mean = Eigen::Isometry3d::Identity();
  mean.linear() = Eigen::Quaterniond(Eigen::Vector4d(solver.eigenvectors().col(3))).matrix();
  mean.translation() = translation;
  return mean;
}

}  // namespace

Sheet aruco_sheet(double side_m, int id) {
  MarkerSet markers;
  markers.cells = kArucoCells;
  markers.parents.push_back({side_m, Marker{id, -1, aruco_code(id), {}}});
  return sheet_of(markers, 0, 2.0);
}

Sheet aruco_board_sheet(double side_m) {
  // A white board on which every marker's black cells are painted one by one.
  const Rect square{0.0, 0.0, side_m, side_m};
  const double zone = 0.3 * side_m;
  Sheet sheet{{square, {square}, {}}, {-zone, -zone, side_m + zone, side_m + zone}};
  constexpr int kWidth = kArucoCells + 2;
  const double cell = board_marker_side(side_m) / kWidth;
  for (int id = 0; id < kBoardMarkers; ++id) {
    const Code code = aruco_code(id);
    const Eigen::Vector2d origin = board_origin(id, side_m);
    for (int row = 0; row < kWidth; ++row)
      for (int column = 0; column < kWidth; ++column) {
        const bool border = row == 0 || column == 0 || row == kWidth - 1 || column == kWidth - 1;
        if (!border && code.white((row - 1) * kArucoCells + column - 1)) continue;
        const double x = origin.x() + cell * column;
        const double y = origin.y() + cell * row;
        sheet.ink.black.push_back({x, y, x + cell, y + cell});
      }
  }
  return sheet;
}

Eigen::Isometry3d pose_of_square(const std::array<Eigen::Vector2d, 4>& corners,
                                 const Camera& camera, double side_m) {
  // The frame that IPPE_SQUARE asks for: origin in the middle, y up, z out of the plane.
  const double h = side_m / 2.0;
  const std::vector<cv::Point3d> square{{-h, h, 0}, {h, h, 0}, {h, -h, 0}, {-h, -h, 0}};
  std::vector<cv::Point2d> seen;
  for (const Eigen::Vector2d& corner : corners) seen.emplace_back(corner.x(), corner.y());
  const cv::Mat matrix = matrix_of(camera);
  const cv::Mat distortion = distortion_of(camera);
  cv::Vec3d rotation;
  cv::Vec3d translation;
  cv::solvePnP(square, seen, matrix, distortion, rotation, translation, false,
               cv::SOLVEPNP_IPPE_SQUARE);
  cv::solvePnPRefineLM(square, seen, matrix, distortion, rotation, translation);
  Eigen::Isometry3d middle_T_marker = Eigen::Isometry3d::Identity();
  middle_T_marker.linear() = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  middle_T_marker.translation() = Eigen::Vector3d(-h, h, 0.0);
  return to_isometry(rotation, translation) * middle_T_marker;
}

std::vector<ArucoPose> aruco_poses(const Image& image, const Camera& camera, double side_m,
                                   double side_px) {
  const Found found = find_aruco(as_mat(image), side_px, Refinement::sub_pixel);
  std::vector<ArucoPose> poses;
  for (std::size_t i = 0; i < found.ids.size(); ++i)
    poses.push_back({found.ids[i], pose_of_square(as_square(found.corners[i]), camera, side_m)});
  return poses;
}

std::optional<Eigen::Isometry3d> aruco_pose(const Image& image, const Camera& camera, double side_m,
                                            double side_px) {
  for (const ArucoPose& pose : aruco_poses(image, camera, side_m, side_px))
    if (pose.id == 0) return pose.camera_T_marker;
  return std::nullopt;
}

BoardPoses aruco_board_poses(const Image& image, const Camera& camera, double side_m,
                             double side_px, Refinement refinement) {
  const auto board = board_of(side_m);
  const double marker_m = board_marker_side(side_m);
  const Found found =
      find_aruco(as_mat(image), side_px * marker_m / side_m, refinement, board, &camera);
  std::vector<Eigen::Isometry3d> singles;
  for (std::size_t i = 0; i < found.ids.size(); ++i) {
    if (found.ids[i] >= kBoardMarkers) continue;
    const Eigen::Vector2d origin = board_origin(found.ids[i], side_m);
    singles.push_back(pose_of_square(as_square(found.corners[i]), camera, marker_m) *
                      Eigen::Translation3d(-origin.x(), -origin.y(), 0.0));
  }
  BoardPoses poses;
  if (singles.empty()) return poses;
  poses.averaged = mean_of(singles);
  cv::Vec3d rotation;
  cv::Vec3d translation;
  if (cv::aruco::estimatePoseBoard(found.corners, found.ids, board, matrix_of(camera),
                                   distortion_of(camera), rotation, translation) > 0)
    poses.joint = to_isometry(rotation, translation);
  return poses;
}

}  // namespace harco::lab
