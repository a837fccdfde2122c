// Calibration from points: derivatives, recovered parameters and their standard deviations, what
// doesn't fit, and the verdict's rules.
#include "calibration.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "calibration_verdict.hpp"
#include "harco/error.hpp"

namespace harco::cli {
namespace {

using Eigen::Isometry3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

Camera camera_for(CalibrationModel model) {
  Camera camera = Camera::pinhole(640, 480, 520.0);
  camera.fy = 523.0;
  camera.cx = 331.0;
  camera.cy = 232.0;
  switch (model) {
    case CalibrationModel::pinhole:
      camera.coefficients = {-0.25, 0.08, 0.001, -0.0007, -0.01};
      break;
    case CalibrationModel::rational:
      camera.coefficients = {0.3, -0.1, 0.001, -0.0007, 0.02, 0.55, -0.05, 0.01};
      break;
    case CalibrationModel::fisheye:
      camera.lens = LensModel::equidistant;
      camera.fx = 210.0;
      camera.fy = 211.0;
      camera.coefficients = {-0.02, 0.006, -0.003, 0.0004};
      break;
  }
  return camera;
}

const std::vector<CalibrationModel> kModels{CalibrationModel::pinhole, CalibrationModel::rational,
                                            CalibrationModel::fisheye};

/// Views of a 9 x 6 grid of points 25 mm apart, `tilt` radians to all sides and aimed all over the
/// image, each coordinate with `noise` pixels.
class Views {
 public:
  Views(const Camera& camera, unsigned seed) : camera_(camera), random_(seed) {}

  TargetView next(double noise, double tilt = 0.6) {
    for (;;) {
      TargetView view;
      const Isometry3d pose = random_pose(tilt);
      for (int i = 0; i < 54; ++i) {
        const Vector2d target(0.025 * (i % 9), 0.025 * static_cast<double>(i / 9));
        const auto pixel = camera_.project(pose * Vector3d(target.x(), target.y(), 0.0));
        if (!pixel || !inside(*pixel)) break;
        std::normal_distribution<double> error(0.0, noise);
        const Vector2d off(error(random_), error(random_));
        view.features.push_back({{target}, {*pixel + off}, Eigen::Matrix2d::Zero()});
      }
      if (view.features.size() == 54) return view;
    }
  }

  std::vector<TargetView> some(int count, double noise, double tilt = 0.6) {
    std::vector<TargetView> views;
    for (int i = 0; i < count; ++i) {
      views.push_back(next(noise, tilt));
      views.back().picture = static_cast<std::size_t>(i);
    }
    return views;
  }

 private:
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  bool inside(const Vector2d& pixel) const {
    return pixel.minCoeff() > 0.0 && pixel.x() < camera_.width - 1.0 &&
           pixel.y() < camera_.height - 1.0;
  }

  Isometry3d random_pose(double tilt) {
    const double axis = between(0.0, 6.28);
    Isometry3d pose = Isometry3d::Identity();
    pose.linear() =
        Eigen::AngleAxisd(between(0.0, tilt), Vector3d(std::cos(axis), std::sin(axis), 0.0)) *
        Eigen::AngleAxisd(between(0.0, 6.28), Vector3d::UnitZ()).toRotationMatrix();
    const double distance = between(0.3, 0.6) * camera_.fx / 520.0;
    const Vector2d aim(between(0.1, 0.9) * camera_.width, between(0.1, 0.9) * camera_.height);
    const Vector2d ray = camera_.unproject(aim).value_or(Vector2d::Zero());
    pose.translation() = distance * ray.homogeneous() - pose.linear() * Vector3d(0.1, 0.0625, 0.0);
    return pose;
  }

  Camera camera_;
  std::mt19937 random_;
};

/// Not far from the truth, as OpenCV's would be.
Camera rough(const Camera& truth) {
  Camera camera = truth;
  camera.fx *= 1.03;
  camera.fy *= 1.02;
  camera.cx += 6.0;
  camera.cy -= 5.0;
  camera.coefficients = {};
  camera.coefficients[0] = 0.7 * truth.coefficients[0];
  return camera;
}

/// Errors of the parameters in their standard deviations.
VectorXd scores(const Calibration& found, const Camera& truth, CalibrationModel model) {
  return (parameters_of(found.camera, model) - parameters_of(truth, model)).array() /
         found.covariance.diagonal().array().sqrt();
}

TEST(Calibration, DerivativesAgreeWithDifferences) {
  constexpr double kStep = 1e-6;
  for (const CalibrationModel model : kModels) {
    const Camera camera = camera_for(model);
    for (const Vector3d& point :
         {Vector3d(0.1, -0.2, 1.0), Vector3d(-0.4, 0.3, 0.9), Vector3d(1e-9, 0.0, 1.0)}) {
      ProjectedPoint at;
      ASSERT_TRUE(project(camera, model, point, at));
      ASSERT_EQ(at.by_parameters.cols(), parameter_count(model));
      ASSERT_EQ(parameter_names(model).size(), static_cast<std::size_t>(parameter_count(model)));
      for (int i = 0; i < parameter_count(model); ++i) {
        Camera more = camera;
        double* const intrinsics[] = {&more.fx, &more.fy, &more.cx, &more.cy};
        (i < 4 ? *intrinsics[i] : more.coefficients[static_cast<std::size_t>(i - 4)]) += kStep;
        const Vector2d difference = (*more.project(point) - at.pixel) / kStep;
        EXPECT_LT((difference - at.by_parameters.col(i)).norm(), 1e-3)
            << parameter_names(model)[static_cast<std::size_t>(i)];
      }
    }
  }
}

TEST(Calibration, ExactPointsGiveTheExactCamera) {
  for (const CalibrationModel model : kModels) {
    const Camera truth = camera_for(model);
    const std::vector<TargetView> views = Views(truth, 3).some(10, 0.0);
    const Calibration found = calibrate(views, model, rough(truth));
    EXPECT_NEAR(found.camera.fx, truth.fx, 1e-3);
    EXPECT_NEAR(found.camera.cy, truth.cy, 1e-3);
    EXPECT_LT(found.rms_px, 1e-4);
    EXPECT_LT(found.held_out_rms_px, 1e-3);
    for (const FittedView& view : found.views) EXPECT_TRUE(view.used);
  }
}

TEST(Calibration, ErrorsAreAsLargeAsStated) {
  for (const CalibrationModel model : {CalibrationModel::pinhole, CalibrationModel::fisheye}) {
    const Camera truth = camera_for(model);
    double sum = 0.0;
    int count = 0;
    for (unsigned seed = 0; seed < 12; ++seed) {
      const Calibration found = calibrate(Views(truth, seed).some(10, 0.2), model, rough(truth));
      const VectorXd z = scores(found, truth, model);
      EXPECT_LT(z.cwiseAbs().maxCoeff(), 4.5);
      EXPECT_NEAR(found.noise_px, 0.2, 0.02);
      EXPECT_NEAR(found.rms_px, 0.2 * std::sqrt(2.0), 0.03);
      EXPECT_NEAR(found.held_out_rms_px, found.rms_px, 0.05);
      sum += z.squaredNorm();
      count += static_cast<int>(z.size());
    }
    // Parameters are correlated: about a third as many are independent.
    EXPECT_GT(sum / count, 0.5);
    EXPECT_LT(sum / count, 1.7);
  }
}

TEST(Calibration, WeighsMeasurementsByTheirCovariance) {
  const CalibrationModel model = CalibrationModel::pinhole;
  const Camera truth = camera_for(model);
  std::vector<TargetView> views = Views(truth, 5).some(10, 0.0);
  std::vector<TargetView> accurate = views;  // without the other half
  std::mt19937 random(1);
  for (std::size_t k = 0; k < views.size(); ++k) {
    accurate[k].features.clear();
    for (std::size_t i = 0; i < views[k].features.size(); ++i) {
      const double sigma = i % 2 == 0 ? 0.05 : 2.0;
      std::normal_distribution<double> error(0.0, sigma);
      auto& feature = views[k].features[i];
      feature.image_px[0] += Vector2d(error(random), error(random));
      feature.covariance_px2 = sigma * sigma * Eigen::Matrix2d::Identity();
      if (i % 2 == 0) accurate[k].features.push_back(feature);
    }
  }
  const Calibration found = calibrate(views, model, rough(truth));
  EXPECT_LT(scores(found, truth, model).cwiseAbs().maxCoeff(), 4.0);
  EXPECT_LT(found.noise_px, 0.03);  // the covariances explain it all
  // What is forty times less accurate adds next to nothing, and harms as little.
  const double without = calibrate(accurate, model, rough(truth)).covariance(0, 0);
  EXPECT_LT(found.covariance(0, 0), 1.05 * without);
  EXPECT_GT(found.covariance(0, 0), 0.9 * without);
}

TEST(Calibration, LeavesOutPointsAndViewsThatDontFit) {
  const CalibrationModel model = CalibrationModel::pinhole;
  const Camera truth = camera_for(model);
  std::vector<TargetView> views = Views(truth, 7).some(12, 0.1);
  views[2].features[10].image_px[0] += Vector2d(4.0, -3.0);
  views[5].features[0].image_px[0] += Vector2d(0.0, 50.0);
  // A board that was bent.
  for (Feature& feature : views[8].features)
    feature.image_px[0].y() += 4.0 * std::cos(60.0 * feature.target_m[0].x());
  const Calibration found = calibrate(views, model, rough(truth));
  EXPECT_FALSE(found.views[2].kept[10]);
  EXPECT_FALSE(found.views[5].kept[0]);
  EXPECT_TRUE(found.views[2].used);
  EXPECT_FALSE(found.views[8].used);
  EXPECT_LT(scores(found, truth, model).cwiseAbs().maxCoeff(), 4.0);
  EXPECT_NEAR(found.noise_px, 0.1, 0.015);
}

TEST(Calibration, RefusesWhatDoesntDetermineACamera) {
  const Camera truth = camera_for(CalibrationModel::pinhole);
  EXPECT_THROW(calibrate(Views(truth, 1).some(2, 0.1), CalibrationModel::pinhole, rough(truth)),
               Error);
  // Points at random belong to no board.
  std::vector<TargetView> views = Views(truth, 1).some(6, 0.1);
  std::mt19937 random(1);
  for (TargetView& view : views)
    for (Feature& feature : view.features)
      feature.image_px[0] = {std::uniform_real_distribution<double>(0.0, 639.0)(random),
                             std::uniform_real_distribution<double>(0.0, 479.0)(random)};
  try {
    const Calibration found = calibrate(views, CalibrationModel::pinhole, rough(truth));
    EXPECT_EQ(judge(evidence_of(views, found, CalibrationModel::pinhole)).grade, Grade::bad);
  } catch (const Error&) {
  }
}

// --- The verdict --------------------------------------------------------------------------------

TEST(ImageCoverage, CountsCellsAndNamesWhatIsMissing) {
  const Camera camera = Camera::pinhole(640, 480, 500.0);
  const ImageCoverage none = coverage_of({}, camera);
  EXPECT_EQ(none.columns, 8);  // the diagonal of 800 px has ten cells
  EXPECT_EQ(none.rows, 6);
  EXPECT_EQ(none.share(), 0.0);
  EXPECT_EQ(none.missing().size(), 9U);

  std::vector<Vector2d> left;
  for (int x = 40; x < 320; x += 80)
    for (int y = 40; y < 480; y += 80) left.emplace_back(x, y);
  left.emplace_back(-0.5, 479.4);  // the rim belongs to the image
  const ImageCoverage half = coverage_of(left, camera);
  EXPECT_DOUBLE_EQ(half.share(), 0.5);
  EXPECT_EQ(half.points[5 * 8], 2);
  EXPECT_EQ(half.missing(), (std::vector<std::string>{"the top right corner", "the right edge",
                                                      "the bottom right corner"}));
}

TEST(ImageCoverage, AFisheyesBlackCornersDontCount) {
  Camera camera = camera_for(CalibrationModel::fisheye);
  camera.coefficients = {};
  camera.fx = camera.fy = 120.0;  // 90 degrees at a radius of 188 px
  camera.cx = 319.5;
  camera.cy = 239.5;
  const ImageCoverage coverage = coverage_of({}, camera);
  EXPECT_EQ(coverage.points.front(), ImageCoverage::kUnseen);
  const auto missing = coverage.missing();
  EXPECT_EQ(std::count(missing.begin(), missing.end(), "the top left corner"), 0);
  EXPECT_EQ(std::count(missing.begin(), missing.end(), "the middle"), 1);
}

Calibration with_normals(const std::vector<double>& tilts_deg) {
  Calibration calibration;
  for (const double tilt : tilts_deg) {
    FittedView view;
    view.used = true;
    view.camera_T_target.linear() =
        Eigen::AngleAxisd(tilt * M_PI / 180.0, Vector3d::UnitX()).toRotationMatrix();
    calibration.views.push_back(view);
  }
  return calibration;
}

TEST(TiltDiversity, IsTheAngleBetweenNormals) {
  Calibration calibration = with_normals({-20.0, 0.0, 20.0, 30.0});
  calibration.views[3].used = false;
  const TiltDiversity tilt = tilt_diversity(calibration);
  EXPECT_NEAR(tilt.widest_deg, 40.0, 1e-9);
  EXPECT_EQ(tilt.tilted, 2);
  EXPECT_NEAR(tilt_diversity(with_normals({33.0, 33.0, 33.0})).widest_deg, 0.0, 1e-5);
}

TEST(DirectionUncertainty, OfTheFocalLengthGrowsOutwardsAndOfTheCentreIsARotation) {
  const CalibrationModel model = CalibrationModel::pinhole;
  Calibration calibration;
  calibration.camera = Camera::pinhole(641, 481, 500.0);
  calibration.covariance = MatrixXd::Zero(9, 9);
  calibration.covariance(0, 0) = 4.0;  // fx +- 2
  DirectionUncertainty uncertainty = direction_uncertainty(calibration, model);
  EXPECT_NEAR(uncertainty.middle_px, 0.0, 1e-9);
  EXPECT_NEAR(uncertainty.worst_px, 2.0 * 320.0 / 500.0, 0.01);
  EXPECT_TRUE(uncertainty.everywhere);

  calibration.covariance.setZero();
  calibration.covariance(2, 2) = 4.0;  // cx +- 2
  uncertainty = direction_uncertainty(calibration, model);
  EXPECT_LT(uncertainty.middle_px, 0.2);
  EXPECT_LT(uncertainty.worst_px, 1.5);  // what a rotation can't imitate

  calibration.camera.coefficients[0] = -1.2;  // folds over well inside the image
  EXPECT_FALSE(direction_uncertainty(calibration, model).everywhere);
}

/// What a good calibration shows.
Evidence good_evidence() {
  Evidence evidence;
  evidence.width = 640;
  evidence.height = 480;
  evidence.views = 15;
  evidence.noise_px = 0.1;
  evidence.rms_px = 0.14;
  evidence.held_out_rms_px = 0.15;
  evidence.focal_px = 500.0;
  evidence.focal_sigma_px = 0.3;
  evidence.coverage = {8, 6, std::vector<int>(48, 3)};
  evidence.direction = {0.02, 0.2, true};
  evidence.tilt = {60.0, 12};
  return evidence;
}

TEST(Verdict, IsGoodIfNothingIsWrong) {
  const Verdict verdict = judge(good_evidence());
  EXPECT_EQ(verdict.grade, Grade::good);
  EXPECT_TRUE(verdict.reasons.empty());
}

TEST(Verdict, NamesWhatIsWrong) {
  struct Case {
    void (*spoil)(Evidence&);
    Grade grade;
    const char* reason;
  };
  const std::vector<Case> cases{
      {[](Evidence& e) {
         e.tilt = {3.0, 0};
       },
       Grade::bad, "all pictures are parallel"},
      {[](Evidence& e) { e.focal_sigma_px = 30.0; }, Grade::bad, "focal length is known to 6 %"},
      {[](Evidence& e) { e.noise_px = 5.0; }, Grade::bad, "5.0 px off"},
      {[](Evidence& e) { e.noise_px = 0.7; }, Grade::usable, "0.7 px off"},
      {[](Evidence& e) { e.tilt.tilted = 2; }, Grade::usable, "too few tilted pictures"},
      {[](Evidence& e) { e.views = 5; }, Grade::usable, "only 5 pictures"},
      {[](Evidence& e) { e.focal_sigma_px = 3.0; }, Grade::usable, "known to 0.6 % only"},
      {[](Evidence& e) { e.direction.worst_px = 3.0; }, Grade::usable, "rim are known to 3.0 px"},
      {[](Evidence& e) { e.direction.everywhere = false; }, Grade::usable, "formula fails"},
      {[](Evidence& e) { e.held_out_rms_px = 0.4; }, Grade::usable, "held out are 0.40 px off"},
      {[](Evidence& e) { e.dropped = 9; }, Grade::usable, "9 pictures don't agree"},
      {[](Evidence& e) { e.coverage.points[0] = e.coverage.points[1] = e.coverage.points[8] = 0; },
       Grade::usable, "corners of the image not covered: hold the target into the top left corner"},
      {[](Evidence& e) { std::fill_n(e.coverage.points.begin() + 16, 2, 0); }, Grade::good, ""},
      {[](Evidence& e) {
         std::fill_n(e.coverage.points.begin() + 16, 2, 0);
         std::fill_n(e.coverage.points.begin() + 24, 2, 0);
       },
       Grade::usable, "parts of the image not covered: hold the target into the left edge"},
  };
  for (const Case& one : cases) {
    Evidence evidence = good_evidence();
    one.spoil(evidence);
    const Verdict verdict = judge(evidence);
    EXPECT_EQ(verdict.grade, one.grade) << one.reason;
    if (one.grade == Grade::good) continue;
    ASSERT_EQ(verdict.reasons.size(), 1U) << one.reason;
    EXPECT_NE(verdict.reasons[0].find(one.reason), std::string::npos) << verdict.reasons[0];
  }
}

TEST(Verdict, PutsTheWorstFirst) {
  Evidence evidence = good_evidence();
  evidence.views = 5;
  evidence.tilt = {2.0, 0};
  const Verdict verdict = judge(evidence);
  EXPECT_EQ(verdict.grade, Grade::bad);
  ASSERT_EQ(verdict.reasons.size(), 2U);
  EXPECT_NE(verdict.reasons[0].find("parallel"), std::string::npos);
}

}  // namespace
}  // namespace harco::cli
