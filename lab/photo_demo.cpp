// harco_photo_demo: a marker in real photographs, found and measured.
//
// The photographs are those of Debian's package opencv-doc. In those of a chessboard, taken with
// two cameras, the board gives the lens, the pose and the light; a marker is laid over it, once as
// a whole and once for every further layer as one sees it from nearer by, looked for, and its pose
// compared with the board's. Then real ArUco markers are looked for in a photograph of a desk.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "harco/harco.hpp"
#include "photo_scene.hpp"

namespace harco::lab {
namespace {

namespace fs = std::filesystem;

struct Options {
  fs::path markers, desk_markers, out;
};

// --- Pictures -----------------------------------------------------------------------------------

/// A photograph, twice as large, onto which results are drawn.
class Canvas {
 public:
  explicit Canvas(const Image& image) {
    cv::Mat grey(image.height, image.width, CV_8U);
    std::copy(image.pixels.begin(), image.pixels.end(), grey.begin<unsigned char>());
    cv::cvtColor(grey, picture_, cv::COLOR_GRAY2BGR);
    cv::resize(picture_, picture_, {}, kZoom, kZoom, cv::INTER_CUBIC);
  }

  void line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const cv::Scalar& colour,
            int width) {
    cv::line(picture_, point(from), point(to), colour, width, cv::LINE_AA, kFractionBits);
  }

  /// Text centred at a pixel, on a dark rim.
  void text(const std::string& what, const Eigen::Vector2d& at, const cv::Scalar& colour,
            double scale) {
    int baseline = 0;
    const cv::Size size = cv::getTextSize(what, kFont, scale, 1, &baseline);
    const cv::Point left(cvRound(kZoom * (at.x() + 0.5)) - size.width / 2,
                         cvRound(kZoom * (at.y() + 0.5)) + size.height / 2);
    cv::putText(picture_, what, left, kFont, scale, {0, 0, 0}, 3, cv::LINE_AA);
    cv::putText(picture_, what, left, kFont, scale, colour, 1, cv::LINE_AA);
  }

  const cv::Mat& picture() const { return picture_; }

 private:
  static constexpr double kZoom = 2.0;
  static constexpr int kFractionBits = 4;
  static constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;

  /// A pixel of the photograph in the picture, in fractions of its pixels.
  static cv::Point point(const Eigen::Vector2d& p) {
    const auto fixed = [](double v) {
      return cvRound((kZoom * (v + 0.5) - 0.5) * (1 << kFractionBits));
    };
    return {fixed(p.x()), fixed(p.y())};
  }

  cv::Mat picture_;
};

cv::Scalar colour_of_layer(int layer) {
  static const std::vector<cv::Scalar> colours{{60, 220, 60}, {0, 150, 255}, {255, 80, 220}};
  return colours[static_cast<std::size_t>(layer - 1) % colours.size()];
}

void draw(const std::vector<Detection>& detections, Canvas& canvas) {
  for (const Detection& seen : detections) {
    const cv::Scalar colour = colour_of_layer(seen.layer);
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < 4; ++i) {
      canvas.line(seen.corners[i], seen.corners[(i + 1) % 4], colour, seen.layer == 1 ? 2 : 1);
      middle += 0.25 * seen.corners[i];
    }
    const double side = (seen.corners[1] - seen.corners[0]).norm();
    const double size = std::clamp(side / 60.0, 0.35, 0.7);
    // Where children are seen, the id stands below the lower side, not on them.
    const bool full =
        std::any_of(detections.begin(), detections.end(),
                    [&](const Detection& other) { return other.layer == seen.layer + 1; });
    const Eigen::Vector2d below = 0.5 * (seen.corners[2] + seen.corners[3]);
    const Eigen::Vector2d outwards = (below - middle).normalized();
    canvas.text(std::to_string(seen.id), full ? Eigen::Vector2d(below + 12.0 * outwards) : middle,
                colour, size);
  }
}

/// Axes of the pose at the corner of one of the parent's markers (all frames of a parent are
/// parallel): x red, y green, z blue, which points into the plane, away from the viewer.
void draw_axes(const Eigen::Isometry3d& camera_T_marker, const PlacedMarker& at,
               const Camera& camera, Canvas& canvas) {
  const std::array<cv::Scalar, 3> colours{{{40, 40, 255}, {60, 200, 60}, {255, 90, 30}}};
  const Eigen::Vector3d corner(at.origin_m.x(), at.origin_m.y(), 0.0);
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d tip = corner + 0.4 * at.side_m * Eigen::Vector3d::Unit(axis);
    const auto from = camera.project(camera_T_marker * corner);
    const auto to = camera.project(camera_T_marker * tip);
    if (from && to) canvas.line(*from, *to, colours[static_cast<std::size_t>(axis)], 3);
  }
}

void save(const cv::Mat& picture, const fs::path& file) {
  if (!cv::imwrite(file.string(), picture)) throw Error(file.string() + ": can't be written");
}

/// All pictures at half size on one sheet.
cv::Mat contact_sheet(const std::vector<cv::Mat>& pictures) {
  constexpr std::size_t kColumns = 4;
  cv::Mat sheet;
  for (std::size_t first = 0; first < pictures.size(); first += kColumns) {
    cv::Mat row;
    for (std::size_t i = first; i < first + kColumns; ++i) {
      cv::Mat small;
      cv::resize(pictures[std::min(i, pictures.size() - 1)], small, {}, 0.5, 0.5, cv::INTER_AREA);
      if (i >= pictures.size()) small.setTo(cv::Scalar::all(255));
      if (row.empty())
        row = small;
      else
        cv::hconcat(row, small, row);
    }
    if (sheet.empty())
      sheet = row;
    else
      cv::vconcat(sheet, row, sheet);
  }
  return sheet;
}

// --- The chessboard's photographs ---------------------------------------------------------------

struct Result {
  std::string picture;
  int view = 1;             ///< the layer whose marker fills the board
  std::vector<int> layers;  ///< of which a marker was found
  int markers = 0;          ///< found
  double distance = 0.0;    ///< from the camera, in sides of the parent
  double tilt_deg = 0.0;
  std::optional<PoseError> error;  ///< empty: not found
};

double tilt_deg(const Eigen::Isometry3d& camera_T_marker) {
  return std::acos(std::clamp(camera_T_marker.linear()(2, 2), -1.0, 1.0)) * 180.0 /
         std::numbers::pi;
}

Result measure(const StagedPhoto& staged, const Camera& camera, Canvas& canvas) {
  DetectorOptions options;
  options.camera = camera;
  Detector detector(staged.markers, options);
  const std::vector<Detection> detections = detector.detect(staged.image.view());
  const std::vector<Pose> poses =
      estimate_poses(staged.image.view(), detections, staged.markers, camera);

  const double side_m = staged.markers.parents.front().side_m;
  Result result;
  result.distance = staged.camera_T_marker.translation().norm() / side_m;
  result.tilt_deg = tilt_deg(staged.camera_T_marker);
  result.markers = static_cast<int>(detections.size());
  std::set<int> layers;
  for (const Detection& seen : detections) layers.insert(seen.layer);
  result.layers.assign(layers.begin(), layers.end());
  if (!poses.empty())
    result.error = pose_error(poses.front().camera_T_marker, staged.camera_T_marker);

  draw(detections, canvas);
  // Detections come in the order of the set: the first one is of the topmost layer that was seen.
  if (!poses.empty()) {
    const int placed = detections.front().placed;
    draw_axes(poses.front().camera_T_marker, detector.placed()[static_cast<std::size_t>(placed)],
              camera, canvas);
  }
  return result;
}

/// Every photograph with the marker whose `layer` fills the board.
std::vector<Result> chessboard_photos(const PhotoSeries& series, const MarkerSet& markers,
                                      int layer, const fs::path& out,
                                      std::vector<cv::Mat>& pictures) {
  std::vector<Result> results;
  for (const ChessboardPhoto& photo : series.photos) {
    const StagedPhoto staged =
        lay_marker(photo, series.camera, series.board, markers, 0, layer, results.size());
    Canvas canvas(staged.image);
    Result result = measure(staged, series.camera, canvas);
    result.view = layer;
    result.picture = fmt::format("{}-layer{}.png", photo.name, layer);
    save(canvas.picture(), out / result.picture);
    pictures.push_back(canvas.picture());
    results.push_back(std::move(result));
  }
  return results;
}

// --- Tables -------------------------------------------------------------------------------------

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

std::string table(const std::vector<Result>& results) {
  std::string text =
      "| picture            | layers | markers | distance / side | tilt deg | distance error % | "
      "rotation error deg |\n"
      "|--------------------|--------|---------|-----------------|----------|------------------|"
      "--------------------|\n";
  for (const Result& result : results) {
    const std::string distance =
        result.error ? fmt::format("{:.3f}", result.error->distance_percent) : "not found";
    const std::string rotation =
        result.error ? fmt::format("{:.3f}", result.error->rotation_deg) : "not found";
    text += fmt::format("| {:18} | {:6} | {:7} | {:15.3f} | {:8.1f} | {:>16} | {:>18} |\n",
                        result.picture, fmt::format("{}", fmt::join(result.layers, " ")),
                        result.markers, result.distance, result.tilt_deg, distance, rotation);
  }
  return text;
}

std::string csv(const std::vector<Result>& results) {
  std::string text =
      "picture,view,layers,markers,distance_sides,tilt_deg,distance_error_percent,"
      "rotation_error_deg\n";
  for (const Result& result : results) {
    text += fmt::format("{},{},{},{},{:.6f},{:.4f}", result.picture, result.view,
                        fmt::join(result.layers, " "), result.markers, result.distance,
                        result.tilt_deg);
    text += result.error ? fmt::format(",{:.6f},{:.6f}\n", result.error->distance_percent,
                                       result.error->rotation_deg)
                         : ",,\n";
  }
  return text;
}

/// The same in a line for every layer that filled the board.
std::string summary(const std::vector<Result>& results, int layers) {
  std::string text =
      "| layer in view | found    | distance error %, median, worst | rotation error deg, median, "
      "worst |\n"
      "|---------------|----------|---------------------------------|-----------------------------"
      "------|\n";
  for (int layer = 1; layer <= layers; ++layer) {
    std::vector<double> distance, rotation;
    int pictures = 0;
    for (const Result& result : results) {
      if (result.view != layer) continue;
      ++pictures;
      if (!result.error) continue;
      distance.push_back(result.error->distance_percent);
      rotation.push_back(result.error->rotation_deg);
    }
    const auto both = [](const std::vector<double>& errors) {
      if (errors.empty()) return std::string("none");
      return fmt::format("{:.3f}, {:.3f}", median(errors),
                         *std::max_element(errors.begin(), errors.end()));
    };
    text += fmt::format("| {:13} | {:>8} | {:>31} | {:>33} |\n", layer,
                        fmt::format("{} of {}", distance.size(), pictures), both(distance),
                        both(rotation));
  }
  return text;
}

void write(const std::string& text, const fs::path& file) {
  std::ofstream stream(file, std::ios::binary);
  stream << text;
  stream.close();
  if (!stream) throw Error(file.string() + ": can't be written");
}

// --- The desk's photograph ----------------------------------------------------------------------

std::string desk_photo(const MarkerSet& markers, const fs::path& file) {
  const Image image = load_grey(opencv_desk_photo());
  Detector detector(markers);
  const std::vector<Detection> detections = detector.detect(image.view());
  Canvas canvas(image);
  draw(detections, canvas);
  save(canvas.picture(), file);
  std::vector<int> ids;
  for (const Detection& seen : detections) ids.push_back(seen.id);
  std::sort(ids.begin(), ids.end());
  return fmt::format("Desk: looked for {} markers, found {}: {}\n", markers.parents.size(),
                     ids.size(), fmt::join(ids, ", "));
}

std::vector<PhotoSeries> calibrated_series(const fs::path& out) {
  std::vector<PhotoSeries> all;
  for (const char* name : {"left", "right"}) {
    all.push_back(calibrate(opencv_chessboard_photos(name)));
    const PhotoSeries& series = all.back();
    fmt::print("{} camera: calibrated from {} photographs, f = {:.1f} px, rms {:.2f} px\n", name,
               series.photos.size(), series.camera.fx, series.rms_px);
    save_camera(series.camera, out / fmt::format("{}-camera.yaml", name));
  }
  return all;
}

void run(const Options& options) {
  const MarkerSet markers = load_markers(options.markers);
  fs::create_directories(options.out);
  const std::vector<PhotoSeries> all_series = calibrated_series(options.out);
  std::vector<std::string> look_at;

  std::vector<Result> results;
  for (int layer = 1; layer <= markers.layers(); ++layer) {
    std::vector<cv::Mat> pictures;
    for (const PhotoSeries& series : all_series) {
      const auto more = chessboard_photos(series, markers, layer, options.out, pictures);
      results.insert(results.end(), more.begin(), more.end());
    }
    look_at.push_back(fmt::format("photos-layer{}.png", layer));
    save(contact_sheet(pictures), options.out / look_at.back());
  }
  const std::string overview = summary(results, markers.layers());
  fmt::print("\n{}", overview);
  write(overview + "\n" + table(results), options.out / "photos.md");
  write(csv(results), options.out / "photos.csv");
  look_at.emplace_back("photos.md");
  look_at.push_back(results.front().picture);

  if (!options.desk_markers.empty()) {
    look_at.emplace_back("desk.png");
    fmt::print("\n{}",
               desk_photo(load_markers(options.desk_markers), options.out / look_at.back()));
  }
  fmt::print("\nLook at:\n");
  for (const std::string& name : look_at) fmt::print("  {}\n", (options.out / name).string());
}

}  // namespace
}  // namespace harco::lab

int main(int argc, char** argv) {
  CLI::App app{"Lays a marker into real photographs, finds it and measures how well"};
  harco::lab::Options options;
  app.add_option("--markers", options.markers, "markers.json; its first parent is laid in")
      ->required();
  app.add_option("--desk-markers", options.desk_markers,
                 "markers.json of ArUco's DICT_6X6_250, to be looked for on the desk");
  app.add_option("--out", options.out, "Folder for pictures and tables; made if need be")
      ->required();
  CLI11_PARSE(app, argc, argv);
  try {
    harco::lab::run(options);
  } catch (const std::exception& error) {
    fmt::print(stderr, "harco_photo_demo: {}\n", error.what());
    return 2;
  }
  return 0;
}
