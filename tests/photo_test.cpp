// Real photographs: a marker laid onto OpenCV's chessboards, ArUco markers on a desk, AprilTags on
// toy rovers. The numbers only ever get stricter.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "families.hpp"
#include "harco/harco.hpp"
#include "lab/photo_scene.hpp"

namespace harco {
namespace {

namespace fs = std::filesystem;

// --- The chessboards ----------------------------------------------------------------------------

/// One parent of three layers.
MarkerSet three_layers() {
  DictionaryOptions options;
  options.child_cells = {quincunx(5), quincunx(5)};
  options.child_distance = 6;  // soon found
  return build_markers(generate_dictionary(options), 1.0);
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// What a fresh look at every photograph gives, with the marker of one layer filling the board.
struct Tally {
  int photos = 0;
  std::vector<double> distance_percent, rotation_deg;  ///< of those with a pose
  int strangers = 0;                                   ///< detections off their true place
};

Tally tally(const MarkerSet& markers, int layer) {
  Tally result;
  for (const char* name : {"left", "right"}) {
    const lab::PhotoSeries series = lab::calibrate(lab::opencv_chessboard_photos(name));
    EXPECT_EQ(series.photos.size(), 13U) << name;
    EXPECT_LT(series.rms_px, 0.25) << name;
    for (const lab::ChessboardPhoto& photo : series.photos) {
      const lab::StagedPhoto staged =
          lab::lay_marker(photo, series.camera, series.board, markers, 0, layer, 7);
      DetectorOptions options;
      options.camera = series.camera;
      Detector detector(staged.markers, options);
      const auto detections = detector.detect(staged.image.view());
      for (const Detection& seen : detections) {
        const auto corners = detector.placed()[static_cast<std::size_t>(seen.placed)].corners_m();
        for (std::size_t i = 0; i < 4; ++i) {
          const auto true_corner = series.camera.project(
              staged.camera_T_marker * Eigen::Vector3d(corners[i].x(), corners[i].y(), 0.0));
          if (!true_corner || (*true_corner - seen.corners[i]).norm() > 3.0) {
            ++result.strangers;
            break;
          }
        }
      }
      ++result.photos;
      const auto poses =
          estimate_poses(staged.image.view(), detections, staged.markers, series.camera);
      if (poses.empty()) continue;
      const lab::PoseError error =
          lab::pose_error(poses.front().camera_T_marker, staged.camera_T_marker);
      result.distance_percent.push_back(error.distance_percent);
      result.rotation_deg.push_back(error.rotation_deg);
    }
  }
  return result;
}

TEST(Photos, OfChessboardsWithAMarkerOnThem) {
  const MarkerSet markers = three_layers();
  for (int layer = 1; layer <= markers.layers(); ++layer) {
    SCOPED_TRACE("layer " + std::to_string(layer));
    const Tally result = tally(markers, layer);
    ASSERT_EQ(result.photos, 26);
    EXPECT_GE(result.distance_percent.size(), 25U);  // 95 %
    EXPECT_LT(median(result.distance_percent), 0.05);
    EXPECT_LT(median(result.rotation_deg), 0.05);
    EXPECT_EQ(result.strangers, 0);
  }
}

TEST(Photos, OfChessboardsWithoutAMarkerShowNone) {
  Detector detector(three_layers());
  for (const char* name : {"left", "right"})
    for (const fs::path& file : lab::opencv_chessboard_photos(name))
      EXPECT_TRUE(detector.detect(lab::load_grey(file).view()).empty()) << file;
}

/// A staged photograph keeps to the photograph: its surroundings, its light, its blur.
TEST(Photos, StagedOnesKeepTheirSurroundingsAndLight) {
  const lab::PhotoSeries series = lab::calibrate(lab::opencv_chessboard_photos("left"));
  const MarkerSet markers = three_layers();
  for (const lab::ChessboardPhoto& photo : series.photos) {
    SCOPED_TRACE(photo.name);
    const lab::BoardLook look = lab::measure_look(photo, series.camera, series.board);
    EXPECT_GT(look.white.at({0.0, 0.0}), look.black.at({0.0, 0.0}) + 100.0);
    EXPECT_GT(look.psf_sigma_px, 0.3);
    EXPECT_LT(look.psf_sigma_px, 1.2);
    EXPECT_GT(look.noise_sigma, 0.3);
    EXPECT_LT(look.noise_sigma, 5.0);

    const lab::StagedPhoto staged =
        lab::lay_marker(photo, series.camera, series.board, markers, 0, 1, 7);
    // Far from the board nothing has changed; the marker's middle row crosses its left border.
    EXPECT_EQ(staged.image.row(0)[0], photo.image.row(0)[0]);
    EXPECT_EQ(staged.image.row(479)[0], photo.image.row(479)[0]);
    const double side = staged.markers.parents.front().side_m;
    const auto pixel = series.camera.project(staged.camera_T_marker *
                                             Eigen::Vector3d(side / 14.0, side / 2.0, 0.0));
    ASSERT_TRUE(pixel);
    const double border = staged.image.row(
        static_cast<int>(std::lround(pixel->y())))[static_cast<int>(std::lround(pixel->x()))];
    EXPECT_LT(std::abs(border - look.black.at({0.0, 0.0})), 25.0);
  }
}

TEST(Photos, StagingRefusesWhatIsNotThere) {
  const lab::PhotoSeries series = lab::calibrate(lab::opencv_chessboard_photos("left"));
  const auto lay = [&](int parent, int layer) {
    return lab::lay_marker(series.photos.front(), series.camera, series.board, three_layers(),
                           parent, layer, 7);
  };
  EXPECT_THROW(lay(1, 1), std::invalid_argument);
  EXPECT_THROW(lay(-1, 1), std::invalid_argument);
  EXPECT_THROW(lay(0, 4), std::invalid_argument);
  EXPECT_THROW(lab::calibrate({}), Error);
  EXPECT_THROW(lab::load_grey("no-such-picture.jpg"), Error);
}

// --- Other people's markers ---------------------------------------------------------------------

/// A whole family, as plain parents.
MarkerSet family(const std::string& name) {
  cli::Family read;
  cli::harco_load_family(name, read);
  MarkerSet markers;
  markers.cells = read.codes.front().cells;
  for (std::size_t id = 0; id < read.codes.size(); ++id)
    markers.parents.push_back({0.05, Marker{static_cast<int>(id), -1, read.codes[id], {}}});
  return markers;
}

TEST(Photos, OfADeskShowAllSixArucoMarkers) {
  Detector detector(family("aruco:6x6_250"));
  std::vector<int> ids;
  for (const Detection& seen : detector.detect(lab::load_grey(lab::opencv_desk_photo()).view()))
    ids.push_back(seen.id);
  std::sort(ids.begin(), ids.end());
  EXPECT_EQ(ids, (std::vector<int>{23, 40, 62, 98, 124, 203}));
}

/// Photographs that can't come with the sources; HARCO_SHARED_DATA names their folder.
std::optional<fs::path> shared_data() {
  if (const char* folder = std::getenv("HARCO_SHARED_DATA")) return fs::path(folder);
  const fs::path beside = fs::path(HARCO_SOURCE_FOLDER).parent_path() / "shared" / "data";
  if (fs::exists(beside)) return beside;
  return std::nullopt;
}

/// "id, (x y), (x y), (x y), (x y)" a line, in AprilTag's order and pixels; ours are top-left first
/// and half a pixel less.
std::vector<std::array<Eigen::Vector2d, 4>> read_truth(const fs::path& file) {
  std::ifstream stream(file);
  std::vector<std::array<Eigen::Vector2d, 4>> tags;
  for (std::string line; std::getline(stream, line);) {
    std::array<Eigen::Vector2d, 4> corners;
    int id = 0;
    if (std::sscanf(line.c_str(), "%d, (%lf %lf), (%lf %lf), (%lf %lf), (%lf %lf)", &id,
                    &corners[3].x(), &corners[3].y(), &corners[2].x(), &corners[2].y(),
                    &corners[1].x(), &corners[1].y(), &corners[0].x(), &corners[0].y()) != 9)
      continue;
    EXPECT_EQ(id, 0);
    for (Eigen::Vector2d& corner : corners) corner.array() -= 0.5;
    tags.push_back(corners);
  }
  return tags;
}

TEST(Photos, OfRoversShowNineOfTenAprilTags) {
  const auto folder = shared_data();
  if (!folder) GTEST_SKIP() << "no folder with the photograph: set HARCO_SHARED_DATA";
  const auto tags = read_truth(*folder / "apriltag-36h11-rovers.txt");
  ASSERT_EQ(tags.size(), 10U);
  Detector detector(family("apriltag:36h11"));
  const auto detections =
      detector.detect(lab::load_grey(*folder / "apriltag-36h11-rovers.jpg").view());
  std::size_t found = 0;
  for (const auto& corners : tags)
    found += std::any_of(detections.begin(), detections.end(), [&](const Detection& seen) {
      for (std::size_t i = 0; i < 4; ++i)
        if ((seen.corners[i] - corners[i]).norm() > 2.0) return false;
      return seen.id == 0;
    });
  EXPECT_GE(found, 9U);
}

}  // namespace
}  // namespace harco
