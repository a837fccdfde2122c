#include "harco/pose.hpp"

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace harco {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Corners = std::array<Vector2d, 4>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

Marker marker(int id, int cell, const std::string& code) {
  return {id, cell, parse_code(code), {}};
}

/// Parents 3 and 8 of 0.7 m and 0.35 m; in each cell of a quincunx of the first a child of 0.1 m,
/// and in the first of these one of 1/70 m.
MarkerSet markers() {
  MarkerSet set;
  set.parents.push_back({0.7, marker(3, -1, "1001100110001001101010011")});
  set.parents.push_back({0.35, marker(8, -1, "1011100110001101101010011")});
  int id = 0;
  for (const int cell : {0, 4, 12, 20, 24})
    set.parents[0].marker.children.push_back(marker(id++, cell, "1110111111011111101111101"));
  set.parents[0].marker.children[0].children.push_back(marker(id, 12, "1111111101110111111110111"));
  return set;
}

const std::vector<PlacedMarker>& placed() {
  static const std::vector<PlacedMarker> all = place(markers());
  return all;
}

Camera pinhole() { return Camera::pinhole(750, 480, 700.0); }

Camera with_lens(LensModel lens, std::array<double, 8> coefficients) {
  Camera camera = pinhole();
  camera.lens = lens;
  camera.coefficients = coefficients;
  return camera;
}

Isometry3d pose_of(const Matrix3d& rotation, const Vector3d& translation) {
  Isometry3d pose = Isometry3d::Identity();
  pose.linear() = rotation;
  pose.translation() = translation;
  return pose;
}

Matrix3d about(const Vector3d& axis, double degrees) {
  return AngleAxisd(degrees * std::acos(-1.0) / 180.0, axis.normalized()).toRotationMatrix();
}

Eigen::Block<harco::Matrix8d, 2, 2> corner_block(Detection& detection, std::size_t corner) {
  const auto at = static_cast<Eigen::Index>(2 * corner);
  return detection.corner_covariance.block<2, 2>(at, at);
}

/// The detection that an error-free detector would give, with corners known to `sigma` pixels.
Detection seen(int index, const Isometry3d& pose, const Camera& camera, double sigma = 0.1) {
  const PlacedMarker& at = placed()[static_cast<std::size_t>(index)];
  const Corners corners = at.corners_m();
  Detection detection;
  detection.placed = index;
  detection.parent = markers().parents[static_cast<std::size_t>(at.parent_index)].marker.id;
  detection.layer = at.layer;
  detection.id = at.id;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto pixel = camera.project(pose * Vector3d(corners[i].x(), corners[i].y(), 0.0));
    if (!pixel) throw std::runtime_error("the test's corner is not in view");
    detection.corners[i] = *pixel;
    corner_block(detection, i) = sigma * sigma * Matrix2d::Identity();
  }
  return detection;
}

std::vector<Detection> all_seen(const std::vector<int>& indices, const Isometry3d& pose,
                                const Camera& camera, double sigma = 0.1) {
  std::vector<Detection> detections;
  for (const int index : indices) detections.push_back(seen(index, pose, camera, sigma));
  return detections;
}

std::vector<Pose> estimate(const std::vector<Detection>& detections, const Camera& camera,
                           Fusion fusion = Fusion::joint) {
  PoseOptions options;
  options.fusion = fusion;
  return estimate_poses({}, detections, markers(), camera, options);
}

/// (dt, w) with t_true = t + dt and R_true = R Exp(w).
Vector6d error_of(const Isometry3d& estimate, const Isometry3d& truth) {
  const AngleAxisd turn(estimate.linear().transpose() * truth.linear());
  Vector6d error;
  error << truth.translation() - estimate.translation(), turn.angle() * turn.axis();
  return error;
}

Isometry3d random_pose(std::mt19937& random, double distance) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const Vector3d tilt_axis(uniform(random), uniform(random), 0.0);
  const Matrix3d rotation = about(Vector3d::UnitZ(), 180.0 * uniform(random)) *
                            about(tilt_axis + Vector3d(0.01, 0.0, 0.0), 50.0 * uniform(random));
  const Vector3d middle(0.1 * distance * uniform(random), 0.1 * distance * uniform(random),
                        distance);
  return pose_of(rotation, middle - rotation * Vector3d(0.35, 0.35, 0.0));
}

// --- homography ---------------------------------------------------------------------------------

TEST(Homography, RecoversAMapWrittenByHand) {
  Matrix3d truth;
  truth << 2.0, 0.5, 30.0, -0.3, 1.5, 40.0, 0.01, -0.02, 1.0;
  std::vector<Vector2d> plane{{0, 0}, {4, 0}, {5, 6}, {0, 7}};
  std::vector<Vector2d> image;
  for (int extra = 0; extra < 2; ++extra) {
    image.clear();
    for (const Vector2d& p : plane) image.push_back((truth * p.homogeneous()).hnormalized());
    const Matrix3d h = fit_homography(plane, image);
    EXPECT_TRUE((h / h(2, 2)).isApprox(truth, 1e-12)) << h / h(2, 2);
    plane.insert(plane.end(), {{1, 2}, {3, 3}, {-1, 2}});  // and once more with seven points
  }
}

TEST(Homography, RefusesDegenerateInput) {
  const std::vector<Vector2d> square{{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  const std::vector<Vector2d> line{{0, 0}, {1, 1}, {2, 2}, {3, 3}};
  const std::vector<Vector2d> three_on_line{{0, 0}, {1, 0}, {2, 0}, {0, 1}};
  const std::vector<Vector2d> point(4, Vector2d(1, 2));
  std::vector<Vector2d> nan = square;
  nan[2].y() = std::numeric_limits<double>::quiet_NaN();
  for (const auto& bad : {line, three_on_line, point, nan, {square[0], square[1], square[2]}, {}}) {
    EXPECT_THROW(fit_homography(bad, square), std::invalid_argument);
    EXPECT_THROW(fit_homography(square, bad), std::invalid_argument);
    EXPECT_THROW(solve_planar_pose(bad, square), std::invalid_argument);
    EXPECT_THROW(solve_planar_pose(square, bad), std::invalid_argument);
  }
}

// --- planar pose --------------------------------------------------------------------------------

TEST(PlanarPose, IsExactForExactPoints) {
  std::mt19937 random(11);
  for (int trial = 0; trial < 300; ++trial) {
    const Isometry3d truth = random_pose(random, 0.6 + 0.1 * trial);
    std::vector<Vector2d> plane{{0, 0}, {0.7, 0}, {0.7, 0.7}, {0, 0.7}};
    if (trial % 2 == 1) plane.insert(plane.end(), {{0.2, 0.5}, {0.6, 0.1}});
    std::vector<Vector2d> image;
    for (const Vector2d& p : plane)
      image.push_back((truth * Vector3d(p.x(), p.y(), 0.0)).hnormalized());
    const PlanarPoses poses = solve_planar_pose(plane, image);
    EXPECT_LE(poses.rms[0], poses.rms[1]);
    EXPECT_LT(poses.rms[0], 1e-9);
    // The second may be just as exact where the plane is seen frontally; one of them is the truth.
    const double error = std::min(error_of(poses.camera_T_plane[0], truth).norm(),
                                  error_of(poses.camera_T_plane[1], truth).norm());
    EXPECT_LT(error, 1e-5) << trial;
    for (const Isometry3d& pose : poses.camera_T_plane) {
      EXPECT_TRUE((pose.linear() * pose.linear().transpose()).isIdentity(1e-12));
      EXPECT_NEAR(pose.linear().determinant(), 1.0, 1e-12);
    }
  }
}

TEST(PlanarPose, FindsBothPosesOfAnAffineImage) {
  // Without perspective, a square turned by +30 degrees about its vertical middle line looks as one
  // turned by -30: the image (x cos 30 / 10, y / 10) at the distance 10.
  const std::vector<Vector2d> plane{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  std::vector<Vector2d> image;
  for (const Vector2d& p : plane) image.emplace_back(0.1 * std::sqrt(0.75) * p.x(), 0.1 * p.y());
  const PlanarPoses poses = solve_planar_pose(plane, image);
  EXPECT_NEAR(poses.rms[0], poses.rms[1], 1e-12);
  EXPECT_GT(poses.rms[0], 1e-4);
  double sum = 0.0;
  for (const Isometry3d& pose : poses.camera_T_plane) {
    const double degrees = 180.0 / std::acos(-1.0) * std::asin(pose.linear()(0, 2));
    EXPECT_NEAR(std::abs(degrees), 30.0, 1e-9);
    EXPECT_TRUE(pose.linear().isApprox(about(Vector3d::UnitY(), degrees), 1e-12));
    // Not exact, since the affine image is none of a real camera's.
    EXPECT_NEAR(pose.translation().x(), 0.0, 0.05);
    EXPECT_NEAR(pose.translation().y(), 0.0, 1e-12);
    EXPECT_NEAR(pose.translation().z(), 10.0, 0.05);
    sum += degrees;
  }
  EXPECT_NEAR(sum, 0.0, 1e-9);
}

// --- joint pose ---------------------------------------------------------------------------------

TEST(JointPose, IsExactForExactCornersOfEveryLayerAndLens) {
  const std::vector<Camera> cameras{
      pinhole(), with_lens(LensModel::brown_conrady, {-0.28, 0.09, 0.0012, -0.0008, -0.01}),
      with_lens(LensModel::equidistant, {-0.02, 0.004, -0.003, 0.001})};
  const std::vector<std::vector<int>> views{{0}, {1}, {6}, {0, 1, 2, 3, 4, 5, 6}, {2, 4}, {1, 6}};
  std::mt19937 random(5);
  for (const Camera& camera : cameras)
    for (const std::vector<int>& view : views)
      for (int trial = 0; trial < 20; ++trial) {
        const Isometry3d truth = random_pose(random, 1.5 + 0.2 * trial);
        const auto poses = estimate(all_seen(view, truth, camera, 0.02), camera);
        ASSERT_EQ(poses.size(), 1U);
        const Pose& pose = poses[0];
        EXPECT_EQ(pose.parent, 3);
        EXPECT_EQ(pose.markers, static_cast<int>(view.size()));
        EXPECT_EQ(pose.detections.size(), view.size());
        EXPECT_LT(pose.rms_px, 1e-6);
        EXPECT_LT(error_of(pose.camera_T_marker, truth).norm(), 1e-5)
            << view.size() << " " << trial << " " << truth.matrix();
        ASSERT_TRUE(pose.covariance);
        EXPECT_TRUE(pose.covariance->isApprox(pose.covariance->transpose()));
        EXPECT_EQ(Eigen::LLT<Matrix6d>(*pose.covariance).info(), Eigen::Success);
      }
}

/// Mean of e^T C^-1 e over many noisy views of `view`, whose corners have an error of `sigma` but
/// are said to have `claimed`; 6 where the covariance is right.
double normalised_error(const std::vector<int>& view, const Isometry3d& truth, const Camera& camera,
                        double sigma, double claimed) {
  std::mt19937 random(17);
  std::normal_distribution<double> normal;
  constexpr int kTrials = 500;
  double sum = 0.0;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<Detection> detections = all_seen(view, truth, camera, claimed);
    for (Detection& detection : detections)
      for (std::size_t i = 0; i < 4; ++i) {
        // Noise of different size along two slanted axes.
        Matrix2d shape;
        shape << 1.0, 0.0, 0.6, 0.5;
        detection.corners[i] += sigma * shape * Vector2d(normal(random), normal(random));
        corner_block(detection, i) = claimed * claimed * shape * shape.transpose();
      }
    const auto poses = estimate(detections, camera);
    EXPECT_EQ(poses.size(), 1U);
    const Vector6d error = error_of(poses.at(0).camera_T_marker, truth);
    sum += error.dot(poses[0].covariance->ldlt().solve(error));
  }
  return sum / kTrials;
}

TEST(JointPose, CovarianceIsThatOfTheErrors) {
  const Isometry3d truth =
      pose_of(about({1, 0.3, 0}, 35.0) * about(Vector3d::UnitZ(), 70.0), {0.3, -0.4, 2.0});
  const Camera lens = with_lens(LensModel::brown_conrady, {-0.28, 0.09, 0.001, -0.001, -0.01});
  for (const Camera& camera : {pinhole(), lens}) {
    // Widening by the residuals, never below the noise given, leaves the mean a little below 6.
    const double mean = normalised_error({0, 1, 2, 3, 4, 5}, truth, camera, 0.15, 0.15);
    EXPECT_GT(mean, 5.0);
    EXPECT_LT(mean, 6.5);
    // A child alone, its frame's origin six of its sides away. With two degrees of freedom left,
    // the widening is coarse: E[1 / max(1, chi2 / 2)] = 0.85 of 6.
    const double alone = normalised_error({5}, truth, camera, 0.05, 0.05);
    EXPECT_GT(alone, 4.2);
    EXPECT_LT(alone, 6.2);
  }
}

TEST(JointPose, CovarianceWidensWithResidualsThatTheNoiseDoesNotExplain) {
  const Isometry3d truth = pose_of(about({1, 0.3, 0}, 35.0), {-0.3, -0.4, 2.0});
  const double mean = normalised_error({0, 1, 2, 3, 4, 5}, truth, pinhole(), 0.15, 0.03);
  EXPECT_GT(mean, 4.5);
  EXPECT_LT(mean, 8.0);
}

TEST(JointPose, RmsIsThatOfTheCoordinatesInTheDistortedImage) {
  const Camera camera = with_lens(LensModel::brown_conrady, {-0.28, 0.09});
  const Isometry3d truth = pose_of(about({1, 1, 0}, 30.0), {-0.3, -0.4, 2.0});
  std::vector<Detection> detections = all_seen({0, 3}, truth, camera);
  std::mt19937 random(2);
  std::normal_distribution<double> normal(0.0, 0.1);
  for (Detection& detection : detections)
    for (Vector2d& corner : detection.corners) corner += Vector2d(normal(random), normal(random));
  for (const Fusion fusion : {Fusion::joint, Fusion::paper}) {
    const Pose pose = estimate(detections, camera, fusion).at(0);
    double sum = 0.0;
    for (const Detection& detection : detections) {
      const Detection predicted = seen(detection.placed, pose.camera_T_marker, camera);
      for (std::size_t i = 0; i < 4; ++i)
        sum += (predicted.corners[i] - detection.corners[i]).squaredNorm();
    }
    EXPECT_NEAR(pose.rms_px, std::sqrt(sum / 16.0), 1e-9);
    EXPECT_GT(pose.rms_px, 0.01);
  }
}

TEST(JointPose, NamesTheOtherSolutionOnlyWhereItIsPossible) {
  // Ten pixels of a tilted square: perspective is below the noise, so both tilts are possible.
  const Isometry3d far = pose_of(about(Vector3d::UnitY(), 30.0), {0.0, 0.0, 40.0});
  const Pose small = estimate({seen(0, far, pinhole(), 0.3)}, pinhole()).at(0);
  ASSERT_TRUE(small.alternative);
  EXPECT_NEAR(small.camera_T_marker.linear()(0, 2), 0.5, 0.1);
  EXPECT_NEAR(small.alternative->linear()(0, 2), -0.5, 0.1);
  const Isometry3d near = pose_of(about(Vector3d::UnitY(), 30.0), {-0.3, -0.3, 1.5});
  EXPECT_FALSE(estimate({seen(0, near, pinhole(), 0.1)}, pinhole()).at(0).alternative);
}

TEST(JointPose, GravityTellsTheTwoSolutions) {
  const Isometry3d far = pose_of(about(Vector3d::UnitY(), 30.0), {0.0, 0.0, 40.0});
  const std::vector<Detection> detections{seen(0, far, pinhole(), 0.3)};
  for (const double sign : {1.0, -1.0}) {
    PoseOptions options;
    options.gravity.emplace();
    // The marker lies on the ground, tilted to the camera by 30 degrees one way or the other.
    options.gravity->in_camera = Vector3d(sign * 0.5, 0.0, std::sqrt(0.75));
    const Pose ground = estimate_poses({}, detections, markers(), pinhole(), options).at(0);
    EXPECT_FALSE(ground.alternative);
    EXPECT_FALSE(ground.log_likelihood_ratio);
    EXPECT_NEAR(ground.camera_T_marker.linear()(0, 2), sign * 0.5, 0.1);
    // On a wall: gravity along its y axis, which both solutions have in common, tells nothing.
    options.gravity->in_marker = Vector3d::UnitY();
    options.gravity->in_camera = Vector3d::UnitY();
    EXPECT_TRUE(estimate_poses({}, detections, markers(), pinhole(), options).at(0).alternative);
  }
  PoseOptions bad;
  bad.gravity.emplace();
  bad.gravity->sigma_rad = 0.0;
  EXPECT_THROW(estimate_poses({}, detections, markers(), pinhole(), bad), std::invalid_argument);
  bad.gravity->sigma_rad = 0.1;
  bad.gravity->in_camera.setZero();
  EXPECT_THROW(estimate_poses({}, detections, markers(), pinhole(), bad), std::invalid_argument);
}

TEST(JointPose, NoSilentFlipAndAnHonestRatio) {
  // Squares of 14 to 40 pixels, corners known to 0.1 pixels, tilted by up to 40 degrees.
  constexpr double kSigma = 0.1;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  int open = 0, wrong = 0, silent = 0;
  double expected_wrong = 0.0;
  std::vector<double> normalised;
  constexpr int kFrames = 600;
  for (int frame = 0; frame < kFrames; ++frame) {
    const double turn = 6.2831853 * unit(random);
    const Matrix3d rotation = about({std::cos(turn), std::sin(turn), 0.0}, 40.0 * unit(random)) *
                              about(Vector3d::UnitZ(), 360.0 * unit(random));
    const double distance = 700.0 * 0.7 / (14.0 + 26.0 * unit(random));
    const Isometry3d truth = pose_of(rotation, {0.1 * distance * normal(random), 0.0, distance});
    Detection detection = seen(0, truth, pinhole(), kSigma);
    for (Vector2d& corner : detection.corners)
      corner += kSigma * Vector2d(normal(random), normal(random));
    const Pose pose = estimate({detection}, pinhole()).at(0);
    const Vector6d error = error_of(pose.camera_T_marker, truth);
    normalised.push_back(error.dot(pose.covariance->ldlt().solve(error)));
    const double off = error.tail<3>().norm();
    ASSERT_EQ(pose.alternative.has_value(), pose.log_likelihood_ratio.has_value());
    if (pose.alternative) {
      ++open;
      EXPECT_GE(*pose.log_likelihood_ratio, 0.0);
      EXPECT_LE(*pose.log_likelihood_ratio, kDecidedLogRatio);
      expected_wrong += 1.0 / (1.0 + std::exp(*pose.log_likelihood_ratio));
      wrong += error_of(*pose.alternative, truth).tail<3>().norm() < off ? 1 : 0;
    } else if (off > 0.5) {
      ++silent;
    }
  }
  EXPECT_EQ(silent, 0);
  EXPECT_GT(open, kFrames / 5);
  EXPECT_LT(open, kFrames * 9 / 10);
  // Of so many, by three standard deviations; fewer are welcome.
  EXPECT_LT(wrong, expected_wrong + 3.0 * std::sqrt(expected_wrong));
  EXPECT_GT(wrong, 0.3 * expected_wrong);
  double sum = 0.0;
  for (const double value : normalised) sum += value;
  EXPECT_GT(sum / kFrames, 3.0);
  EXPECT_LT(sum / kFrames, 8.0);
}

TEST(JointPose, OneBadMarkerDoesNotSpoilIt) {
  const Camera camera = pinhole();
  const Isometry3d truth = pose_of(about({1, 0.5, 0}, 25.0), {-0.3, -0.3, 1.6});
  for (const double wrong_by : {3.0, 8.0, 40.0, 90.0}) {
    for (const int bad : {0, 3, 5}) {
      std::vector<Detection> detections = all_seen({0, 1, 2, 3, 4, 5}, truth, camera, 0.1);
      for (Vector2d& corner : detections[static_cast<std::size_t>(bad)].corners)
        corner += Vector2d(wrong_by, -0.5 * wrong_by);
      const auto poses = estimate(detections, camera);
      ASSERT_EQ(poses.size(), 1U) << wrong_by << " " << bad;
      EXPECT_LT(error_of(poses[0].camera_T_marker, truth).norm(), 1e-3) << wrong_by << " " << bad;
      EXPECT_EQ(poses[0].markers, 5);
      for (const int index : poses[0].detections) EXPECT_NE(index, bad);
    }
  }
}

TEST(JointPose, AParentSeenTwiceHasTwoPoses) {
  const Camera camera = pinhole();
  const Isometry3d left = pose_of(about({1, 0.5, 0}, 20.0), {-1.2, -0.3, 3.0});
  const Isometry3d right = pose_of(about({-1, 0.5, 0}, 30.0), {0.3, -0.3, 3.4});
  for (const auto& views : {std::pair<std::vector<int>, std::vector<int>>{{0, 1, 2}, {0, 1, 5}},
                            {{0}, {0}},
                            {{1, 2, 3}, {1, 4, 5}},
                            {{0, 1, 2, 3}, {5}}}) {
    std::vector<Detection> detections = all_seen(views.first, left, camera);
    for (const Detection& detection : all_seen(views.second, right, camera))
      detections.insert(detections.begin() + 1, detection);
    const auto poses = estimate(detections, camera);
    ASSERT_EQ(poses.size(), 2U);
    const bool swapped = poses[0].camera_T_marker.translation().x() > 0.0;
    EXPECT_LT(error_of(poses[swapped ? 1 : 0].camera_T_marker, left).norm(), 1e-5);
    EXPECT_LT(error_of(poses[swapped ? 0 : 1].camera_T_marker, right).norm(), 1e-5);
    EXPECT_EQ(static_cast<std::size_t>(poses[0].markers + poses[1].markers), detections.size());
  }
}

TEST(JointPose, SmallNoisyChildrenOfOneSheetAreOnePose) {
  // Children of about 15 pixels, six of their sides apart, with corners wrong by 0.4 pixels.
  std::mt19937 random(31);
  std::normal_distribution<double> normal(0.0, 0.4);
  for (int trial = 0; trial < 200; ++trial) {
    const Isometry3d truth = random_pose(random, 4.0);
    std::vector<Detection> detections = all_seen({1, 2, 3, 4, 5}, truth, pinhole(), 0.4);
    for (Detection& detection : detections)
      for (Vector2d& corner : detection.corners) corner += Vector2d(normal(random), normal(random));
    const auto poses = estimate(detections, pinhole());
    ASSERT_EQ(poses.size(), 1U) << trial;
    EXPECT_EQ(poses[0].markers, 5) << trial;
  }
}

TEST(JointPose, ASingleContradictionOnAKnownSheetHasNoPose) {
  const Camera camera = pinhole();
  const Isometry3d truth = pose_of(about({1, 0.5, 0}, 20.0), {-0.4, -0.3, 2.0});
  std::vector<Detection> detections = all_seen({0, 1, 2}, truth, camera);
  // Child 3 where child 4 lies.
  Detection wrong = seen(5, truth, camera);
  wrong.placed = 4;
  wrong.id = placed()[4].id;
  detections.push_back(wrong);
  EXPECT_EQ(estimate(detections, camera).size(), 1U);
  // Beside the sheet it may be another one, unless a bit had to be corrected.
  for (Vector2d& corner : detections.back().corners) corner.x() += 200.0;
  EXPECT_EQ(estimate(detections, camera).size(), 2U);
  detections.back().bit_errors = 1;
  EXPECT_EQ(estimate(detections, camera).size(), 1U);
}

TEST(JointPose, EveryParentHasItsOwnTheLargestFirst) {
  const Camera camera = pinhole();
  const Isometry3d first = pose_of(Matrix3d::Identity(), {-1.2, -0.3, 3.0});
  const Isometry3d second = pose_of(about({0, 1, 0}, 10.0), {0.1, -0.2, 1.0});
  const auto poses = estimate({seen(0, first, camera), seen(7, second, camera)}, camera);
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_EQ(poses[0].parent, 8);
  EXPECT_EQ(poses[0].detections, std::vector<int>{1});
  EXPECT_EQ(poses[1].parent, 3);
  EXPECT_LT(error_of(poses[0].camera_T_marker, second).norm(), 1e-6);
}

TEST(JointPose, LeavesOutTentativeDetections) {
  const Isometry3d truth = pose_of(about({1, 0, 0}, 10.0), {-0.3, -0.3, 2.0});
  std::vector<Detection> detections = all_seen({0, 1}, truth, pinhole());
  detections[0].tentative = true;
  const auto poses = estimate(detections, pinhole());
  ASSERT_EQ(poses.size(), 1U);
  EXPECT_EQ(poses[0].detections, std::vector<int>{1});
}

TEST(JointPose, LeavesOutCornersBeyondTheLens) {
  const Isometry3d truth = pose_of(Matrix3d::Identity(), {-0.3, -0.3, 2.0});
  // Nothing is seen beyond r = 0.385: 2/3 / sqrt(3 |k1|).
  const Camera camera = with_lens(LensModel::brown_conrady, {-1.0});
  std::vector<Detection> detections = all_seen({1, 3}, truth, camera);
  for (Vector2d& corner : detections[0].corners) corner.x() -= 270.0;
  const auto poses = estimate(detections, camera);
  ASSERT_EQ(poses.size(), 1U);
  EXPECT_EQ(poses[0].detections, std::vector<int>{1});
}

TEST(JointPose, NothingSeenIsNoPose) { EXPECT_TRUE(estimate({}, pinhole()).empty()); }

TEST(JointPose, RefusesWhatIsNoDetectionOfTheSet) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const Isometry3d truth = pose_of(about({1, 0, 0}, 10.0), {-0.3, -0.3, 2.0});
  const auto refused = [&](auto&& change) {
    std::vector<Detection> detections = all_seen({0, 1}, truth, pinhole());
    change(detections[1]);
    EXPECT_THROW(estimate(detections, pinhole()), std::invalid_argument);
    EXPECT_THROW(estimate(detections, pinhole(), Fusion::paper), std::invalid_argument);
  };
  refused([](Detection& d) { d.placed = -1; });
  refused([](Detection& d) { d.placed = 99; });
  refused([](Detection& d) { d.id = 77; });
  refused([](Detection& d) { d.parent = 8; });
  refused([](Detection& d) { d.layer = 1; });
  refused([](Detection& d) { d.corners[2].x() = kNan; });
  refused([](Detection& d) { d.corners.fill(Vector2d(1, 2)); });
  refused([](Detection& d) { std::swap(d.corners[1], d.corners[3]); });  // seen from behind
  refused([](Detection& d) { std::swap(d.corners[0], d.corners[1]); });  // crossing itself
  refused([](Detection& d) { corner_block(d, 0).setZero(); });
  refused([](Detection& d) { d.corner_covariance(7, 7) = kNan; });
  refused([](Detection& d) { d.corner_covariance(6, 6) = -1.0; });

  const std::vector<Detection> detections = all_seen({0}, truth, pinhole());
  Camera no_camera;
  EXPECT_THROW(estimate(detections, no_camera), std::invalid_argument);
  const Image other_size(640, 480);
  EXPECT_THROW(estimate_poses(other_size.view(), detections, markers(), pinhole()),
               std::invalid_argument);
  const Image right_size(750, 480);
  EXPECT_EQ(estimate_poses(right_size.view(), detections, markers(), pinhole()).size(), 1U);
}

// --- the paper's pose ---------------------------------------------------------------------------

TEST(PaperPose, IsExactForExactCorners) {
  std::mt19937 random(23);
  const Camera camera = with_lens(LensModel::brown_conrady, {-0.28, 0.09, 0.001, 0.0, -0.01});
  for (int trial = 0; trial < 50; ++trial) {
    const Isometry3d truth = random_pose(random, 2.0 + 0.1 * trial);
    const auto poses = estimate(all_seen({0, 1, 2, 5}, truth, camera), camera, Fusion::paper);
    ASSERT_EQ(poses.size(), 1U);
    EXPECT_LT(error_of(poses[0].camera_T_marker, truth).norm(), 1e-6);
    EXPECT_FALSE(poses[0].covariance);
    EXPECT_EQ(poses[0].markers, 4);
  }
}

TEST(PaperPose, AveragesByAreaAsComputedByHand) {
  // Both markers are frontal: the parent at 2 m (245 pixels), a child (35 pixels at 2 m) seen as if
  // the sheet stood at (0.004, 0, 2.002) and were turned by 0.5 degrees.
  const double angle = 0.5 * std::acos(-1.0) / 180.0;
  const Isometry3d first = pose_of(Matrix3d::Identity(), {0.0, 0.0, 2.0});
  const Isometry3d second = pose_of(about(Vector3d::UnitZ(), 0.5), {0.004, 0.0, 2.002});
  const std::vector<Detection> detections{seen(0, first, pinhole(), 1.0),
                                          seen(1, second, pinhole(), 1.0)};
  const double parent = std::pow(700.0 * 0.7 / 2.0, 2);
  const double child = std::pow(700.0 * 0.1 / 2.002, 2);
  const Vector3d translation =
      (parent * first.translation() + child * second.translation()) / (parent + child);
  // The chordal mean of turns about one axis: the direction of the weighted sum of unit vectors.
  const double turn = std::atan2(child * std::sin(angle), parent + child * std::cos(angle));

  const auto poses = estimate(detections, pinhole(), Fusion::paper);
  ASSERT_EQ(poses.size(), 1U);
  EXPECT_LT((poses[0].camera_T_marker.translation() - translation).norm(), 1e-9);
  EXPECT_LT(
      (poses[0].camera_T_marker.linear() - AngleAxisd(turn, Vector3d::UnitZ()).toRotationMatrix())
          .norm(),
      1e-9);
}

TEST(PaperPose, AParentSeenTwiceHasTwoPoses) {
  const Isometry3d left = pose_of(about({1, 0.5, 0}, 20.0), {-1.2, -0.3, 3.0});
  const Isometry3d right = pose_of(about({-1, 0.5, 0}, 30.0), {0.3, -0.3, 3.4});
  std::vector<Detection> detections = all_seen({0, 1}, left, pinhole());
  for (const Detection& detection : all_seen({0, 1}, right, pinhole()))
    detections.push_back(detection);
  EXPECT_EQ(estimate(detections, pinhole(), Fusion::paper).size(), 2U);
}

}  // namespace
}  // namespace harco
