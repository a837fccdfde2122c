#include "frames.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <numbers>
#include <random>

#include "apps/harco/families.hpp"
#include "lab/photo_scene.hpp"
#include "lab/render.hpp"

namespace harco::bench {
namespace {

constexpr const char* kExamples = "/usr/share/doc/opencv-doc/examples/";
constexpr std::array kScenery{
    "data/aero1.jpg",    "data/aloeL.jpg",  "data/baboon.jpg",       "data/board.jpg",
    "data/building.jpg", "data/fruits.jpg", "data/graf1.png",        "data/home.jpg",
    "data/leuvenA.jpg",  "data/stuff.jpg",  "data/starry_night.jpg", "data/rubberwhale1.png",
    "data/messi5.jpg",   "data/aloeR.jpg",  "data/leuvenB.jpg",      "data/squirrel_cls.jpg"};
constexpr std::array kLetters{"text/scenetext01.jpg", "data/imageTextN.png",
                              "data/text_defocus.jpg", "data/digits.png"};
constexpr int kMarkers = 30;
constexpr double kFocalWidths = 0.95;  // focal length over the image's width

const Image& photograph(std::size_t index, bool letters) {
  static const auto load = [](const auto& names) {
    std::vector<Image> images;
    for (const char* name : names)
      images.push_back(lab::load_grey(std::filesystem::path(kExamples) / name));
    return images;
  };
  static const std::vector<Image> scenery = load(kScenery);
  static const std::vector<Image> text = load(kLetters);
  const std::vector<Image>& from = letters ? text : scenery;
  return from[index % from.size()];
}

/// One photograph at its own resolution, mirrored where it ends.
Image mirrored(const Image& from, Size size, std::mt19937_64& random) {
  const auto fold = [](int i, int n) {
    const int k = i % (2 * n);
    return k < n ? k : 2 * n - 1 - k;
  };
  const int x0 = static_cast<int>(random() % static_cast<std::uint64_t>(2 * from.width));
  const int y0 = static_cast<int>(random() % static_cast<std::uint64_t>(2 * from.height));
  Image image(size.width, size.height);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x)
      image.row(y)[x] = from.row(fold(y0 + y, from.height))[fold(x0 + x, from.width)];
  return image;
}

Image checkerboard(Size size) {
  constexpr int kSquare = 12;
  Image image(size.width, size.height);
  const auto ink = [](int x, int y) { return (x / kSquare + y / kSquare) % 2 == 0 ? 30.0 : 210.0; };
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      double sum = 0.0;
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) sum += ink(std::max(0, x + i), std::max(0, y + j));
      image.row(y)[x] = static_cast<std::uint8_t>(std::lround(sum / 9.0));
    }
  return image;
}

void add_noise(Image& image, double sigma, std::mt19937_64& random) {
  std::normal_distribution<double> noise(0.0, sigma);
  for (std::uint8_t& pixel : image.pixels)
    pixel = static_cast<std::uint8_t>(std::lround(std::clamp(pixel + noise(random), 0.0, 255.0)));
}

void place(lab::Scene& scene, Frame& frame, const MarkerSet& markers, int index,
           const Eigen::Vector2d& at_px, double side_px, double most_tilt,
           std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const auto parent = static_cast<std::size_t>(index);
  const double side = markers.parents[parent].side_m;
  const Camera& camera = scene.camera;
  const double distance = camera.fx * side / side_px;
  Eigen::Isometry3d pose = lab::look_at_marker(
      {0.5 * side, 0.5 * side}, distance, most_tilt * unit(random),
      2.0 * std::numbers::pi * unit(random), 2.0 * std::numbers::pi * unit(random));
  pose.pretranslate(Eigen::Vector3d(distance * (at_px.x() - camera.cx) / camera.fx,
                                    distance * (at_px.y() - camera.cy) / camera.fy, 0.0));
  scene.parents.push_back({index, pose});
  Truth truth{markers.parents[parent].marker.id, {}};
  const std::array<Eigen::Vector3d, 4> corners{
      {{0, 0, 0}, {side, 0, 0}, {side, side, 0}, {0, side, 0}}};
  for (std::size_t i = 0; i < 4; ++i) truth.corners[i] = *camera.project(pose * corners[i]);
  frame.markers.push_back(truth);
}

lab::Scene empty_scene(Size size) {
  lab::Scene scene;
  scene.camera = Camera::pinhole(size.width, size.height, kFocalWidths * size.width);
  return scene;
}

}  // namespace

const char* to_string(Content content) {
  switch (content) {
    case Content::one:
      return "one";
    case Content::thirty:
      return "thirty";
    case Content::texture:
      return "texture";
    case Content::night:
      return "night";
    case Content::noise:
      return "noise";
    case Content::checkerboard:
      return "checkerboard";
    case Content::text:
      return "text";
  }
  return "unknown";
}

MarkerSet apriltag_set() {
  cli::Family family;
  cli::harco_load_family("apriltag:36h11", family);
  MarkerSet markers;
  markers.cells = family.codes.front().cells;
  for (int id = 0; id < kMarkers; ++id)
    markers.parents.push_back(
        {0.2, Marker{id, -1, family.codes[static_cast<std::size_t>(id)], {}}});
  return markers;
}

Frame make_frame(const MarkerSet& markers, Size size, Content content, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  Frame frame;
  if (content == Content::thirty) return make_grid(markers, size, kMarkers, seed);
  if (content == Content::noise) {
    frame.image = Image(size.width, size.height, 128);
    add_noise(frame.image, 40.0, random);
    return frame;
  }
  if (content == Content::checkerboard) {
    frame.image = checkerboard(size);
    add_noise(frame.image, 2.0, random);
    return frame;
  }
  lab::Scene scene = empty_scene(size);
  Image background = mirrored(photograph(seed, content == Content::text), size, random);
  const bool night = content == Content::night;
  if (night) {
    for (std::uint8_t& pixel : background.pixels) pixel = static_cast<std::uint8_t>(5 + pixel / 10);
    add_noise(background, 6.0, random);
    scene.black = 10.0;
    scene.white = 70.0;
    scene.noise_sigma = 6.0;
  }
  scene.background = std::move(background);
  if (content == Content::one || night) {
    const double side = (0.125 + 0.375 * unit(random)) * size.height;
    const double clear = 0.9 * side;
    place(scene, frame, markers, static_cast<int>(random() % kMarkers),
          Eigen::Vector2d(clear + unit(random) * (size.width - 2.0 * clear),
                          clear + unit(random) * (size.height - 2.0 * clear)),
          side, 0.8, random);
  }
  frame.image = scene.parents.empty() ? *scene.background : lab::render(scene, markers, random());
  return frame;
}

Frame make_grid(const MarkerSet& markers, Size size, int count, std::uint64_t seed) {
  constexpr int kColumns = 6;
  constexpr int kRows = 5;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  Frame frame;
  lab::Scene scene = empty_scene(size);
  scene.background = mirrored(photograph(seed, false), size, random);
  const Eigen::Vector2d cell(size.width / double(kColumns), size.height / double(kRows));
  for (int i = 0; i < count; ++i) {
    const int at = i * kMarkers / count;
    place(scene, frame, markers, at,
          Eigen::Vector2d((at % kColumns + 0.5) * cell.x(), (at / kColumns + 0.5) * cell.y()),
          (0.25 + 0.2 * unit(random)) * cell.minCoeff(), 0.8, random);
  }
  frame.image = lab::render(scene, markers, random());
  return frame;
}

}  // namespace harco::bench
