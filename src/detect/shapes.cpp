#include "detect/shapes.hpp"

#include <algorithm>
#include <array>
#include <tuple>
#include <utility>

namespace harco::detect {
namespace {

/// A level of the threshold at which regions are looked for.
struct Pass {
  std::size_t level;
  double least_side;  // pixels
  bool dark() const { return Threshold::kLevels[level].dark; }
};
// A marker in shade beside sunlit ground is rare, and what is dark at the low level is mostly fine
// texture: too much of it to look for small ones.
constexpr std::array<Pass, 3> kPasses{
    {{Threshold::kMiddleLevel, 0.0}, {Threshold::kLineLevel, 0.0}, {Threshold::kLowLevel, 28.0}}};

double least_side(const Pass& pass, double min_side) { return std::max(min_side, pass.least_side); }

int cells_across(const Pass& pass, const ShapeLimits& limits) {
  return pass.dark() ? limits.island_cells : limits.hole_cells;
}
bool is_wanted(const Pass& pass, const ShapeLimits& limits) {
  return cells_across(pass, limits) > 0;
}

RegionLimits outline_of(const Pass& pass, const ShapeLimits& limits) {
  const double side = least_side(pass, limits.min_side);
  // Of a steep marker: nor can cells be read that are less than a pixel wide.
  const double narrow = std::max(0.5 * side, static_cast<double>(cells_across(pass, limits)));
  RegionLimits outline;
  outline.least_extent = static_cast<int>(narrow);
  outline.least_length = static_cast<int>(2.8 * side);
  outline.least_area = 0.5 * narrow * side;
  return outline;
}

/// Corners of one shape at two thresholds are no farther apart than this, in pixels.
double tolerance(const Shape& shape) { return 0.6 + 0.02 * mean_side(shape.corners); }

bool same(const Shape& a, const Shape& b) {
  if (a.hole != b.hole) return false;
  const double limit = tolerance(a);
  // Both run clockwise but may start at different corners.
  for (std::size_t turn = 0; turn < 4; ++turn) {
    bool all = true;
    for (std::size_t i = 0; i < 4 && all; ++i)
      all = (a.corners[i] - b.corners[(i + turn) % 4]).norm() < limit;
    if (all) return true;
  }
  return false;
}

/// How many shapes of one picture are kept. Walls of tiles and pages of print have more.
std::size_t most_shapes(const ImageView& image) {
  constexpr std::size_t kPixelsPerShape = 1000;
  const auto pixels =
      static_cast<std::size_t>(image.width()) * static_cast<std::size_t>(image.height());
  return 300 + pixels / kPixelsPerShape;
}

Image picture_of(const DarkMap& map) {
  Image picture(map.width(), map.height(), 255);
  for (int y = 0; y < map.height(); ++y)
    for (int x = 0; x < map.width(); ++x)
      if (map.dark(x, y)) picture.row(y)[x] = 0;
  return picture;
}

}  // namespace

void ShapeFinder::Index::clear(int width, int height) {
  columns_ = width / kCell + 1;
  rows_ = height / kCell + 1;
  buckets_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), -1);
  before_.clear();
  shapes_.clear();
}

void ShapeFinder::Index::add(const Shape& shape) {
  const Point middle = centre(shape.corners);
  const int column = std::clamp(static_cast<int>(middle.x()) / kCell, 0, columns_ - 1);
  const int row = std::clamp(static_cast<int>(middle.y()) / kCell, 0, rows_ - 1);
  const int reach = 1 + static_cast<int>(tolerance(shape)) / kCell;
  for (int r = std::max(0, row - reach); r <= std::min(rows_ - 1, row + reach); ++r)
    for (int c = std::max(0, column - reach); c <= std::min(columns_ - 1, column + reach); ++c)
      for (int other = bucket(r, c); other >= 0; other = before_[static_cast<std::size_t>(other)])
        if (same(shape, shapes_[static_cast<std::size_t>(other)])) return;
  before_.push_back(std::exchange(bucket(row, column), static_cast<int>(shapes_.size())));
  shapes_.push_back(shape);
}

void ShapeFinder::Index::keep_largest(std::size_t most) {
  if (shapes_.size() <= most) return;
  std::sort(shapes_.begin(), shapes_.end(), [](const Shape& a, const Shape& b) {
    const auto key = [](const Shape& shape) {
      return std::tuple(-mean_side(shape.corners), shape.corners[0].y(), shape.corners[0].x());
    };
    return key(a) < key(b);
  });
  shapes_.resize(most);
}

/// Into passes, and those into rows, from the bottom upwards.
void ShapeFinder::divide(const ShapeLimits& limits, Workers& workers) {
  const int height = threshold_.image().height();
  const auto strips = static_cast<int>(workers.parts());
  count_of_parts_ = 0;
  parts_.resize(kPasses.size() * workers.parts());
  for (std::size_t pass = 0; pass < kPasses.size(); ++pass) {
    if (!is_wanted(kPasses[pass], limits)) continue;
    for (int strip = strips; strip > 0; --strip) {
      Part& part = parts_[count_of_parts_++];
      part.pass = pass;
      part.first_row = height * (strip - 1) / strips;
      part.end_row = height * strip / strips;
    }
  }
}

void ShapeFinder::look_through(Part& part, Scratch& scratch, double min_side, bool tracing) const {
  part.shapes.clear();
  part.contours.clear();
  const Pass& pass = kPasses[part.pass];
  scratch.regions.start(passes_[part.pass], part.first_row, part.end_row);
  scratch.quad.start(threshold_, pass.level);
  const double least_area = scratch.regions.limits().least_area;
  while (const Region* region = scratch.regions.next()) {
    const auto quad = scratch.quad.fit(*region, least_area);
    if (tracing) part.contours.push_back(scratch.quad.border_of(*region));
    if (quad && mean_side(*quad) >= 0.8 * least_side(pass, min_side))
      part.shapes.push_back({*quad, !region->dark});
  }
}

void ShapeFinder::find(const ImageView& image, const ShapeLimits& limits, Workers& workers,
                       Pyramid* half, DetectionTrace* trace) {
  index_.clear(image.width(), image.height());
  const bool islands = limits.island_cells > 0;
  threshold_.measure(image, {islands, limits.hole_cells > 0, islands}, workers, half);
  if (trace)
    for (const Pass& pass : kPasses)
      if (is_wanted(pass, limits)) trace->binary.push_back(picture_of(threshold_.map(pass.level)));
  divide(limits, workers);
  workers.share(kPasses.size(), [&](std::size_t pass, std::size_t) {
    if (is_wanted(kPasses[pass], limits))
      passes_[pass].start(threshold_, kPasses[pass].level, outline_of(kPasses[pass], limits));
  });
  scratch_.resize(workers.count());
  workers.share(count_of_parts_, [&](std::size_t part, std::size_t worker) {
    look_through(parts_[part], scratch_[worker], limits.min_side, trace != nullptr);
  });
  // In the order of a single thread.
  for (std::size_t i = 0; i < count_of_parts_; ++i) {
    for (const Shape& shape : parts_[i].shapes) index_.add(shape);
    if (trace)
      trace->contours.insert(trace->contours.end(), parts_[i].contours.begin(),
                             parts_[i].contours.end());
  }
  count_ = index_.shapes().size();
  index_.keep_largest(most_shapes(image));
}

}  // namespace harco::detect
