#include "camera_simulator.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>

#include "coverage.hpp"
#include "pixel_map.hpp"
#include "plane_view.hpp"

namespace harco::lab {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kRowSteps = 16;      // of the poses over a rolling shutter's rows
constexpr int kMostInstants = 40;  // of an exposure
constexpr int kMostPhotoInstants = 3;
constexpr int kBlobCorners = 48;

// --- Shutter
// ---------------------------------------------------------------------------------------

/// A plane as it is seen while the shutter is open.
class Exposure {
 public:
  Exposure(const FieldOfView& field, const CameraEffects& effects, const Motion& world_T_camera,
           const Motion& world_T_plane, double time_s)
      : field_(field),
        effects_(effects),
        camera_(world_T_camera),
        plane_(world_T_plane),
        time_s_(time_s) {}

  Eigen::Isometry3d camera_T_plane(double time_s) const {
    return camera_(time_s).inverse() * plane_(time_s);
  }

  /// `share` of the exposure from its middle, -0.5 … 0.5.
  PlaneView view(double share) const {
    const double time_s = time_s_ + share * effects_.exposure_s;
    if (effects_.readout_s == 0.0) return {field_, camera_T_plane(time_s)};
    std::vector<Eigen::Isometry3d> poses;
    for (int i = 0; i <= kRowSteps; ++i)
      poses.push_back(
          camera_T_plane(time_s + effects_.readout_s * (static_cast<double>(i) / kRowSteps - 0.5)));
    return {field_, poses};
  }

  /// Views that together stand for the exposure: the mean place of every point and its variance are
  /// those of the whole motion. Not more than `spacing_px` apart, as far as `most` allows.
  std::vector<PlaneView> views(const Rect& seen, double spacing_px, int most) const {
    std::vector<PlaneView> all{view(0.0)};
    if (effects_.exposure_s == 0.0) return all;
    const double smear_px = smear(all.front(), seen);
    if (smear_px < 0.02) return all;
    const int count = std::min(most, 1 + static_cast<int>(std::ceil(smear_px / spacing_px)));
    const double stretch = 1.0 / std::sqrt(1.0 - 1.0 / (1.0 * count * count));
    all.clear();
    for (int i = 0; i < count; ++i) all.push_back(view(stretch * ((i + 0.5) / count - 0.5)));
    return all;
  }

 private:
  /// How far points of a rectangle move in the image, in pixels.
  double smear(const PlaneView& middle, const Rect& seen) const {
    constexpr int kSteps = 4;
    const Camera& camera = field_.camera();
    const PlaneView first = view(-0.5);
    const PlaneView last = view(0.5);
    double most = 0.0;
    const auto follow = [&](const Vector2d& point) {
      const auto from = first.pixel(point);
      const auto to = last.pixel(point);
      if (from && to) most = std::max(most, (*to - *from).norm());
    };
    bool any = false;
    for (int i = 0; i <= kSteps; ++i)
      for (int k = 0; k <= kSteps; ++k) {
        const auto point =
            middle.point({(camera.width - 1.0) * i / kSteps, (camera.height - 1.0) * k / kSteps});
        if (!point || point->x() < seen.x0 || point->x() > seen.x1 || point->y() < seen.y0 ||
            point->y() > seen.y1)
          continue;
        follow(*point);
        any = true;
      }
    if (!any) follow({0.5 * (seen.x0 + seen.x1), 0.5 * (seen.y0 + seen.y1)});
    return most;
  }

  const FieldOfView& field_;
  const CameraEffects& effects_;
  const Motion& camera_;
  const Motion& plane_;
  double time_s_;
};

// --- Light
// -----------------------------------------------------------------------------------------

/// The stage's light on one plane.
class Light {
 public:
  Light(const Stage& stage, const Eigen::Isometry3d& world_T_plane, double psf_sigma_px)
      : even_(stage.light_slope_per_m.isZero(0.0) && stage.shadows.empty()),
        psf_sigma_px_(psf_sigma_px) {
    const Vector3d origin = world_T_plane.translation();
    const auto in_plane = [&](const Vector3d& slope, double offset) -> Linear {
      return {slope.dot(world_T_plane.linear().col(0)), slope.dot(world_T_plane.linear().col(1)),
              slope.dot(origin) + offset};
    };
    slope_ = in_plane(stage.light_slope_per_m, 1.0);
    for (const Shadow& shadow : stage.shadows)
      shadows_.emplace_back(in_plane(shadow.towards, -shadow.offset_m), shadow);
  }

  bool even() const { return even_; }

  float at(float u, float v, float metres_per_pixel) const {
    double gain = std::max(0.0, slope_(u, v));
    for (const auto& [depth, shadow] : shadows_) {
      const double soft_m = 2.5 * psf_sigma_px_ * static_cast<double>(metres_per_pixel);
      const double width_m =
          std::max(1e-9, std::sqrt(shadow.penumbra_m * shadow.penumbra_m + soft_m * soft_m));
      const double t = std::clamp(0.5 + depth(u, v) / width_m, 0.0, 1.0);
      gain *= 1.0 + t * t * (3.0 - 2.0 * t) * (shadow.light - 1.0);
    }
    return static_cast<float>(gain);
  }

 private:
  struct Linear {
    double u = 0.0, v = 0.0, constant = 0.0;
    double operator()(float x, float y) const {
      return u * static_cast<double>(x) + v * static_cast<double>(y) + constant;
    }
  };
  bool even_;
  double psf_sigma_px_;
  Linear slope_;
  std::vector<std::pair<Linear, Shadow>> shadows_;
};

// --- Painting
// --------------------------------------------------------------------------------------

/// One picture in the making.
class Painter {
 public:
  Painter(const FieldOfView& field, const CameraEffects& effects, const Stage& stage,
          const Motion& world_T_camera, double time_s)
      : field_(field),
        effects_(effects),
        stage_(stage),
        world_T_camera_(world_T_camera),
        time_s_(time_s),
        image_(camera().width, camera().height, static_cast<float>(stage.grey)) {
    const bool moderate = effects.quality == Quality::moderate;
    spacing_px_ = moderate ? 1.0 : 0.5;
    // A disc that is drawn on whole pixels brings the variance of their squares along.
    const double variance = effects.psf_sigma_px * effects.psf_sigma_px;
    const double spared = effects.defocus_px > 0.0 ? 1.0 / 12.0 : 0.0;
    psf_ = {std::sqrt(std::max(0.0, variance - spared)), moderate ? 2 : 4};
  }

  FloatImage painted() {
    const auto hides_all = [this](const StagedSheet& sheet) {
      const Rect& paper = sheet.sheet.paper;
      const auto views = exposure_of(sheet.world_T_marker).views(paper, spacing_px_, kMostInstants);
      return views.front().shows_face() && fills_image(views, paper);
    };
    const auto& sheets = stage_.sheets;
    const auto last = std::find_if(sheets.rbegin(), sheets.rend(), hides_all);
    if (last == sheets.rend()) {
      if (stage_.far) paint_far(*stage_.far);
      for (const Surface& surface : stage_.surfaces) paint(surface);
    }
    for (auto sheet = last == sheets.rend() ? sheets.begin() : std::prev(last.base());
         sheet != sheets.end(); ++sheet)
      paint(*sheet);
    return std::move(image_);
  }

 private:
  const Camera& camera() const { return field_.camera(); }
  Exposure exposure_of(const Motion& world_T_plane) const {
    return {field_, effects_, world_T_camera_, world_T_plane, time_s_};
  }

  void paint_far(const Photo& photo) {
    const double middle = 0.5 * (camera().height - 1);
    const double rows_per_s = camera().height / std::max(1e-12, effects_.readout_s);
    const PixelMap map(camera(), [&](const Vector2d& pixel) -> std::optional<Vector2d> {
      const auto ray = camera().unproject(pixel);
      if (!ray) return std::nullopt;
      const double time_s = time_s_ + (pixel.y() - middle) / rows_per_s;
      const Vector3d way = (world_T_camera_(time_s).linear() * ray->homogeneous()).normalized();
      return Vector2d(std::atan2(way.x(), way.z()), std::asin(std::clamp(way.y(), -1.0, 1.0)));
    });
    const auto density = static_cast<float>(stage_.far_pixels_per_radian);
    PixelMap::Row row(camera().width);
    for (int y = 0; y < camera().height; ++y) {
      map.read(y, row);
      std::fill(image_.row(y), image_.row(y) + image_.width, 0.0F);
      add(photo, row, density, 1.0F, 1.0F, image_.row(y));
      for (int x = 0; x < image_.width; ++x)
        if (row.seen[static_cast<std::size_t>(x)] == 0)
          image_.row(y)[x] = static_cast<float>(stage_.grey);
    }
  }

  /// Adds a row of a photograph of so many pixels a unit of the row's places.
  static void add(const Photo& photo, const PixelMap::Row& row, float density, float blur,
                  float share, float* sum) {
    const auto width = static_cast<int>(row.u.size());
    for (int x = 0; x < width; x += PixelMap::kStep) {
      const auto at = static_cast<std::size_t>(x);
      photo.add(row.u.data() + at, row.v.data() + at, std::min(PixelMap::kStep, width - x), density,
                photo.level_for(static_cast<double>(blur * density * row.size[at])), share,
                sum + x);
    }
  }

  void paint(const Surface& surface) {
    if (!surface.photo) return;
    constexpr double kFar = 1e4;
    const Rect extent = surface.extent.value_or(Rect{-kFar, -kFar, kFar, kFar});
    const Exposure exposure = exposure_of(surface.world_T_surface);
    const auto views = exposure.views(extent, 4.0 * spacing_px_, kMostPhotoInstants);
    if (!views.front().shows_face()) return;
    const Photo& photo = *surface.photo;
    const Light light(stage_, surface.world_T_surface(time_s_), psf_.sigma_px);
    PixelWindow window{0, 0, camera().width, camera().height};
    std::optional<FloatImage> cover;
    if (surface.extent && !fills_image(views, extent)) {
      cover = coverage_of(views, extent, window);
      if (window.empty()) return;
    }

    std::vector<PixelMap> maps;
    maps.reserve(views.size());
    for (const PlaneView& view : views)
      maps.emplace_back(camera(), [&](const Vector2d& pixel) { return view.point(pixel); });
    const auto density = static_cast<float>(1.0 / surface.metres_per_pixel);
    const auto blur = static_cast<float>(std::max(1.0, 1.5 * psf_.sigma_px));
    const float share = 1.0F / static_cast<float>(views.size());
    PixelMap::Row row(camera().width);
    std::vector<float> grey(row.u.size());
    for (int y = window.y; y < window.y + window.height; ++y) {
      std::fill(grey.begin(), grey.end(), 0.0F);
      for (const PixelMap& map : maps) {
        map.read(y, row);
        add(photo, row, density, blur, share, grey.data());
      }
      float* to = image_.row(y);
      for (int x = window.x; x < window.x + window.width; ++x) {
        const auto i = static_cast<std::size_t>(x);
        if (row.seen[i] == 0) continue;
        if (!light.even()) grey[i] *= light.at(row.u[i], row.v[i], row.size[i]);
        const float covered = cover ? cover->row(y - window.y)[x - window.x] : 1.0F;
        to[x] += covered * (grey[i] - to[x]);
      }
    }
  }

  void paint(const StagedSheet& staged) {
    const Sheet& sheet = staged.sheet;
    const Exposure exposure = exposure_of(staged.world_T_marker);
    const auto views = exposure.views(sheet.paper, spacing_px_, kMostInstants);
    if (!views.front().shows_face()) return;
    PixelWindow window{0, 0, camera().width, camera().height};
    std::optional<FloatImage> cover;
    if (!fills_image(views, sheet.paper)) {
      cover = coverage_of(views, sheet.paper, window);
      if (window.empty()) return;
    }
    Coverage ink(window, psf_);
    const double share = 1.0 / static_cast<double>(views.size());
    for (const PlaneView& view : views) {
      ink.add(view.outline(sheet.ink.square), share);
      for (const Rect& rect : sheet.ink.white) ink.add(view.outline(rect), -share);
      for (const Rect& rect : sheet.ink.black) ink.add(view.outline(rect), share);
    }
    const FloatImage inked = ink.blurred();

    const PlaneView& middle = views[views.size() / 2];
    const Light light(stage_, staged.world_T_marker(time_s_), psf_.sigma_px);
    std::optional<PixelMap> map;
    if (!light.even())
      map.emplace(camera(), [&](const Vector2d& pixel) { return middle.point(pixel); });
    PixelMap::Row row(camera().width);
    const auto white = static_cast<float>(staged.white);
    const auto step = static_cast<float>(staged.white - staged.black);
    for (int y = 0; y < window.height; ++y) {
      float* to = image_.row(window.y + y) + window.x;
      const float* ink_here = inked.row(y);
      const float* paper_here = cover ? cover->row(y) : nullptr;
      if (map) map->read(window.y + y, row);
      for (int x = 0; x < window.width; ++x) {
        const float paper = paper_here != nullptr ? paper_here[x] : 1.0F;
        float lit = white * paper - step * ink_here[x];
        if (map && paper != 0.0F) lit *= gain_at(light, row, window.x + x);
        to[x] = to[x] * (1.0F - paper) + lit;
      }
    }
    for (const Blob& blob : staged.blobs) paint(blob, views, light, map ? &*map : nullptr);
  }

  void paint(const Blob& blob, const std::vector<PlaneView>& views, const Light& light,
             const PixelMap* map) {
    Polygon round;
    for (int i = 0; i < kBlobCorners; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / kBlobCorners;
      round.emplace_back(blob.centre + blob.radius * Vector2d(std::cos(angle), std::sin(angle)));
    }
    PixelWindow window;
    const FloatImage cover = coverage_of(views, round, window);
    PixelMap::Row row(camera().width);
    for (int y = 0; y < window.height; ++y) {
      float* to = image_.row(window.y + y) + window.x;
      if (map != nullptr) map->read(window.y + y, row);
      for (int x = 0; x < window.width; ++x) {
        auto grey = static_cast<float>(blob.grey);
        if (map != nullptr) grey *= gain_at(light, row, window.x + x);
        to[x] += cover.row(y)[x] * (grey - to[x]);
      }
    }
  }

  static float gain_at(const Light& light, const PixelMap::Row& row, int x) {
    const auto i = static_cast<std::size_t>(x);
    return row.seen[i] != 0 ? light.at(row.u[i], row.v[i], row.size[i]) : 1.0F;
  }

  /// Which share of each pixel of `window`, which is set, a shape covers over the exposure.
  template <typename Shape>
  FloatImage coverage_of(const std::vector<PlaneView>& views, const Shape& shape,
                         PixelWindow& window) const {
    std::vector<Polygon> outlines;
    Polygon all;
    for (const PlaneView& view : views) {
      outlines.push_back(view.outline(shape));
      all.insert(all.end(), outlines.back().begin(), outlines.back().end());
    }
    window = window_around(all, camera(), psf_.reach_px() + 1);
    if (window.empty()) return {};
    Coverage cover(window, psf_);
    for (const Polygon& outline : outlines)
      cover.add(outline, 1.0 / static_cast<double>(views.size()));
    return cover.blurred();
  }

  /// Whether a rectangle reaches beyond all edges of the image throughout.
  bool fills_image(const std::vector<PlaneView>& views, const Rect& rect) const {
    constexpr int kSteps = 8;
    const double margin = psf_.reach_px() + 2.0;
    const double left = -margin, right = camera().width - 1.0 + margin;
    const double top = -margin, bottom = camera().height - 1.0 + margin;
    const auto inside = [&](const PlaneView& view, double x, double y) {
      const auto p = view.point({x, y});
      return p && p->x() > rect.x0 && p->x() < rect.x1 && p->y() > rect.y0 && p->y() < rect.y1;
    };
    for (const PlaneView* view : {&views.front(), &views[views.size() / 2], &views.back()})
      for (int i = 0; i <= kSteps; ++i) {
        const double x = left + (right - left) * i / kSteps;
        const double y = top + (bottom - top) * i / kSteps;
        if (!inside(*view, x, top) || !inside(*view, x, bottom) || !inside(*view, left, y) ||
            !inside(*view, right, y))
          return false;
      }
    return true;
  }

  const FieldOfView& field_;
  const CameraEffects& effects_;
  const Stage& stage_;
  const Motion& world_T_camera_;
  double time_s_;
  FloatImage image_;
  double spacing_px_;
  Psf psf_;
};

// --- Defocus
// ---------------------------------------------------------------------------------------

/// How much of each pixel around a point a disc covers, summing to one.
FloatImage covered_by_disc(double radius, int reach) {
  const int sub = reach > 8 ? 8 : 32;
  FloatImage kernel(2 * reach + 1, 2 * reach + 1);
  float sum = 0.0F;
  for (int y = -reach; y <= reach; ++y)
    for (int x = -reach; x <= reach; ++x) {
      int inside = 0;
      for (int row = 0; row < sub; ++row)
        for (int column = 0; column < sub; ++column) {
          const double dx = x - 0.5 + (column + 0.5) / sub;
          const double dy = y - 0.5 + (row + 0.5) / sub;
          inside += dx * dx + dy * dy < radius * radius ? 1 : 0;
        }
      kernel.row(y + reach)[x + reach] = static_cast<float>(inside);
      sum += static_cast<float>(inside);
    }
  for (float& weight : kernel.pixels) weight /= sum;
  return kernel;
}

double variance_of(const FloatImage& kernel) {
  const int reach = kernel.width / 2;
  double variance = 0.0;
  for (int y = 0; y < kernel.height; ++y)
    for (int x = 0; x < kernel.width; ++x)
      variance += static_cast<double>(kernel.row(y)[x]) * (x - reach) * (x - reach);
  return variance;
}

/// The kernel of a disc on whole pixels. Those are coarse for a small disc, so it is drawn as large
/// as gives the variance of the disc and of a pixel's square.
FloatImage disc(double radius) {
  constexpr double kLarge = 6.0;
  const int reach = static_cast<int>(std::ceil(radius + 1.0));
  if (radius > kLarge) return covered_by_disc(radius, reach);
  const double wanted = radius * radius / 4.0 + 1.0 / 12.0;
  double small = 0.05;
  double large = radius + 1.0;
  for (int i = 0; i < 20; ++i) {
    const double middle = 0.5 * (small + large);
    (variance_of(covered_by_disc(middle, reach)) < wanted ? small : large) = middle;
  }
  return covered_by_disc(large, reach);
}

/// Beyond its edges the picture goes on as it is there.
FloatImage convolved(const FloatImage& image, const FloatImage& kernel) {
  const int reach = kernel.width / 2;
  FloatImage wide(image.width + 2 * reach, image.height + 2 * reach);
  for (int y = 0; y < wide.height; ++y) {
    const float* from = image.row(std::clamp(y - reach, 0, image.height - 1));
    float* to = wide.row(y);
    std::fill(to, to + reach, from[0]);
    std::copy(from, from + image.width, to + reach);
    std::fill(to + reach + image.width, to + wide.width, from[image.width - 1]);
  }
  FloatImage result(image.width, image.height);
  for (int y = 0; y < image.height; ++y)
    for (int ky = 0; ky < kernel.height; ++ky)
      for (int kx = 0; kx < kernel.width; ++kx) {
        const float weight = kernel.row(ky)[kx];
        if (weight == 0.0F) continue;
        const float* from = wide.row(y + ky) + kx;
        float* to = result.row(y);
        for (int x = 0; x < image.width; ++x) to[x] += weight * from[x];
      }
  return result;
}

// --- Sensor
// ----------------------------------------------------------------------------------------

/// The nearest whole number to one that isn't negative; quicker than the standard library's.
int nearest(float value) {
  const float raised = value + 0.5F;
  return static_cast<int>(raised);
}

/// Normal numbers from a table of equally likely ones, four from every 64 random bits.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15ULL + 0x1234567ULL) {}

  float next() {
    if (left_ == 0) {
      state_ += 0x9E3779B97F4A7C15ULL;  // SplitMix64 (Steele, Lea and Flood 2014)
      std::uint64_t z = state_;
      z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
      z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
      bits_ = z ^ (z >> 31);
      left_ = 4;
    }
    const std::size_t index = bits_ & (kSize - 1);
    bits_ >>= 16;
    --left_;
    return table()[index];
  }

 private:
  static constexpr std::size_t kSize = 4096;

  static const std::array<float, kSize>& table() {
    static const std::array<float, kSize> numbers = [] {
      std::array<double, kSize> quantiles{};
      double squares = 0.0;
      double x = -4.0;
      for (std::size_t i = 0; i < kSize; ++i) {
        const double wanted = (static_cast<double>(i) + 0.5) / kSize;
        for (int step = 0; step < 40; ++step) {
          const double density =
              std::exp(-0.5 * x * x) / std::sqrt(2.0 * std::numbers::pi) + 1e-300;
          const double error = 0.5 * std::erfc(-x / std::numbers::sqrt2) - wanted;
          x -= std::clamp(error / density, -0.5, 0.5);
        }
        quantiles[i] = x;
        squares += x * x;
      }
      const double scale = std::sqrt(kSize / squares);
      std::array<float, kSize> made{};
      for (std::size_t i = 0; i < kSize; ++i) made[i] = static_cast<float>(scale * quantiles[i]);
      return made;
    }();
    return numbers;
  }

  std::uint64_t state_;
  std::uint64_t bits_ = 0;
  int left_ = 0;
};

}  // namespace

Motion still(const Eigen::Isometry3d& pose) {
  return [pose](double) { return pose; };
}

void validate(const CameraEffects& effects) {
  const auto require = [](bool holds, const char* what) {
    if (!holds) throw std::invalid_argument(std::string("camera effects: ") + what);
  };
  const auto within = [](double value, double least, double most) {
    return value >= least && value <= most;
  };
  constexpr double kMost = 1e6;
  require(within(effects.psf_sigma_px, 0.0, 100.0), "psf_sigma_px must be 0 … 100");
  require(within(effects.defocus_px, 0.0, 50.0), "defocus_px must be 0 … 50");
  require(within(effects.vignetting, 0.0, 1.0), "vignetting must be 0 … 1");
  require(within(effects.exposure_s, 0.0, kMost), "exposure_s must not be negative");
  require(within(effects.readout_s, 0.0, kMost), "readout_s must not be negative");
  require(within(effects.gain, 1e-6, kMost), "gain must be positive");
  require(within(effects.black_level, -255.0, 255.0), "black_level must be -255 … 255");
  require(within(effects.gamma, 0.1, 10.0), "gamma must be 0.1 … 10");
  require(within(effects.read_noise, 0.0, kMost), "read_noise must not be negative");
  require(within(effects.electrons_per_level, 0.0, 1e12),
          "electrons_per_level must not be negative");
  require(effects.bits >= 1 && effects.bits <= 8, "bits must be 1 … 8");
}

CameraSimulator::CameraSimulator(const Camera& camera, const CameraEffects& effects)
    : camera_((harco::validate(camera), camera)),
      effects_((validate(effects), effects)),
      field_(camera, effects.readout_s > 0.0 ? std::max(32, camera.height / 4)
                                             : Psf{effects.psf_sigma_px, 4}.reach_px() + 2) {
  if (effects.defocus_px > 0.0) defocus_ = disc(effects.defocus_px);
  const auto lost = [&](int size) {
    std::vector<float> share;
    const double corner =
        0.25 * (1.0 * camera.width * camera.width + camera.height * camera.height);
    for (int i = 0; i < size; ++i) {
      const double away = i - 0.5 * (size - 1);
      share.push_back(static_cast<float>(effects.vignetting * away * away / corner));
    }
    return share;
  };
  vignette_x_ = lost(camera.width);
  vignette_y_ = lost(camera.height);
}

FloatImage CameraSimulator::light(const Stage& stage, const Motion& world_T_camera,
                                  double time_s) const {
  FloatImage image = Painter(field_, effects_, stage, world_T_camera, time_s).painted();
  if (!defocus_.pixels.empty()) image = convolved(image, defocus_);
  if (effects_.vignetting > 0.0)
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x)
        image.row(y)[x] *= 1.0F - vignette_x_[static_cast<std::size_t>(x)] -
                           vignette_y_[static_cast<std::size_t>(y)];
  return image;
}

Image CameraSimulator::expose(FloatImage light, std::uint64_t seed) const {
  const double gain = effects_.gain;
  const double a_level =
      effects_.electrons_per_level > 0.0 ? gain / effects_.electrons_per_level : 0.0;
  const double read_variance = std::pow(gain * effects_.read_noise, 2);
  std::array<float, 512> sd{};  // by the light's level after gain
  for (std::size_t i = 0; i < sd.size(); ++i)
    sd[i] = static_cast<float>(std::sqrt(read_variance + a_level * static_cast<double>(i)));
  constexpr std::size_t kCurve = 4096;
  std::vector<float> curve;  // response, if it isn't linear
  if (effects_.gamma != 1.0)
    for (std::size_t i = 0; i <= kCurve; ++i)
      curve.push_back(static_cast<float>(
          255.0 * std::pow(static_cast<double>(i) / kCurve, 1.0 / effects_.gamma)));
  const float to_code = static_cast<float>(((1 << effects_.bits) - 1) / 255.0);
  const bool noisy = read_variance > 0.0 || a_level > 0.0;
  Noise noise(seed);

  Image image(light.width, light.height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    float level = static_cast<float>(gain) * light.pixels[i];
    if (noisy)
      level += sd[static_cast<std::size_t>(std::clamp(level, 0.0F, 511.0F))] * noise.next();
    level = std::clamp(level + static_cast<float>(effects_.black_level), 0.0F, 255.0F);
    if (!curve.empty()) level = curve[static_cast<std::size_t>(nearest(level * (kCurve / 255.0F)))];
    if (effects_.bits < 8) level = std::floor(level * to_code + 0.5F) / to_code;
    image.pixels[i] = static_cast<std::uint8_t>(nearest(level));
  }
  return image;
}

Shot CameraSimulator::shoot(const Stage& stage, const Motion& world_T_camera, double time_s,
                            std::uint64_t seed) const {
  Shot shot;
  shot.time_s = time_s;
  shot.image = expose(light(stage, world_T_camera, time_s), seed);
  const Eigen::Isometry3d camera_T_world = world_T_camera(time_s).inverse();
  for (const StagedSheet& sheet : stage.sheets)
    shot.camera_T_marker.push_back(camera_T_world * sheet.world_T_marker(time_s));
  return shot;
}

}  // namespace harco::lab
