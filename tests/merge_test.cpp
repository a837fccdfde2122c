#include "harco/merge.hpp"

#include <stdexcept>

#include <gtest/gtest.h>

#include "harco/detect.hpp"
#include "harco/pose.hpp"
#include "lab/render.hpp"
#include "sample_markers.hpp"

namespace harco {
namespace {

/// One layer, another number of cells, another side.
MarkerSet single(int id, const std::vector<int>& black, int cells) {
  MarkerSet set;
  set.cells = cells;
  set.line = {0.0, 0.0};  // nothing has a line
  set.parents.push_back({0.8, {id, -1, test::code_with_black(black, cells), {}}});
  return set;
}

TEST(Merge, HasTheParentsOfAll) {
  const MarkerSet all = merge({single(5, {0, 1, 6, 9}, 4), test::three_layers()});
  ASSERT_EQ(all.parents.size(), 2U);
  EXPECT_EQ(all.parents[0].marker.id, 5);
  EXPECT_EQ(all.parents[0].side_m, 0.8);
  EXPECT_EQ(all.parents[1].marker.id, 0);
  EXPECT_EQ(all.line.outside, test::three_layers().line.outside);
  // A file keeps it.
  const MarkerSet read = parse_markers(format_markers(all));
  EXPECT_EQ(read.parents[0].marker.code.cells, 4);
  EXPECT_EQ(read.parents[1].marker.code.cells, 5);
}

TEST(Merge, RefusesWhatCannotBeToldApart) {
  const MarkerSet set = single(5, {0, 1, 6, 9}, 4);
  EXPECT_THROW(merge({}), std::invalid_argument);
  EXPECT_THROW(merge({set, single(5, {0, 1, 6, 10}, 4)}), std::invalid_argument);  // id
  EXPECT_THROW(merge({set, single(6, {0, 1, 6, 9}, 4)}), std::invalid_argument);   // code
  MarkerSet other = test::three_layers();
  other.line = kPaperLine;
  other.parents[0].marker.id = 1;
  EXPECT_THROW(merge({test::three_layers(), other}), std::invalid_argument);  // line
}

TEST(Merge, IsFoundInOnePass) {
  const MarkerSet all = merge({single(5, {0, 1, 6, 9}, 4), test::three_layers()});
  lab::Scene scene;
  scene.camera = Camera::pinhole(750, 480, 700.0);
  scene.parents = {{0, lab::look_at_marker({-0.9, 0.4}, 4.0)},
                   {1, lab::look_at_marker({2.0, 0.8}, 4.0, 0.3, 1.0, 0.2)}};
  const Image image = lab::render(scene, all, 1);
  const auto detections = Detector(all, scene.camera).detect(image.view());
  const auto poses = estimate_poses(image.view(), detections, all, scene.camera);
  ASSERT_EQ(poses.size(), 2U);
  for (const Pose& pose : poses) {
    const auto& truth = scene.parents[pose.parent == 5 ? 0 : 1].camera_T_marker;
    EXPECT_LT((pose.camera_T_marker.translation() - truth.translation()).norm(), 0.01);
  }
}

}  // namespace
}  // namespace harco
