#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <stdexcept>
#include <string>

#include "draw/only_parent.hpp"
#include "harco/draw.hpp"

namespace harco {
namespace {

// No picture is larger, whatever its options allow.
constexpr std::int64_t kMaxPixels = std::int64_t{1} << 30;

/// The grid on which all edges of one parent lie. Sides are whole numbers of units: the smallest
/// unit in which every cell of every marker is whole.
struct Grid {
  std::int64_t side = 1;       ///< of the black square
  std::int64_t cell = 1;       ///< of a layer-1 cell, which is also the quiet zone
  std::int64_t last_cell = 1;  ///< the smallest cell of all
  std::int64_t child = 0;      ///< greatest common divisor of the children's sides; 0 without any

  std::int64_t width() const { return side + 2 * cell; }
};

[[noreturn]] void refuse(const Marker& marker, const std::string& why) {
  throw std::invalid_argument("marker " + std::to_string(marker.id) + ": " + why);
}

Grid grid_of(const MarkerSet& single) {
  const std::vector<PlacedMarker> placed = place(single);
  // Each marker's side is the square's, divided by a whole number.
  std::vector<std::int64_t> divisors;
  Grid grid;
  std::int64_t finest = 1;
  for (const PlacedMarker& marker : placed) {
    const std::int64_t divisor =
        marker.layer == 1 ? 1
                          : divisors[static_cast<std::size_t>(marker.container)] * marker.parts *
                                (placed[static_cast<std::size_t>(marker.container)].code.cells + 2);
    divisors.push_back(divisor);
    const std::int64_t cells = divisor * (marker.code.cells + 2);
    finest = std::max(finest, cells);
    grid.side = std::lcm(grid.side, cells);
    if (grid.side > kMaxPixels) refuse(single.parents[0].marker, "has too many layers to be drawn");
  }
  grid.cell = grid.side / (placed.front().code.cells + 2);
  grid.last_cell = grid.side / finest;
  for (std::size_t i = 1; i < placed.size(); ++i)
    grid.child = std::gcd(grid.child, grid.side / divisors[i]);
  return grid;
}

/// A line of every child is whole exactly if it is on the greatest common divisor of their sides.
double rounded_width(double width, std::int64_t child_px) {
  if (child_px == 0) return width;
  const auto divisor = static_cast<double>(child_px);
  return std::round(width * divisor) / divisor;
}

LineWidth rounded(const LineWidth& line, std::int64_t child_px) {
  return {rounded_width(line.inside, child_px), rounded_width(line.outside, child_px)};
}

/// How far the lines are from whole pixels, as a share of their width.
double rounding(const LineWidth& line, std::int64_t child_px) {
  const auto share = [&](double width) {
    return width == 0.0 ? 0.0 : std::abs(rounded_width(width, child_px) - width) / width;
  };
  return std::max(share(line.inside), share(line.outside));
}

/// The least number of pixels per unit for which lines are as near to whole as asked.
std::int64_t least_scale(const Grid& grid, const LineWidth& line, double tolerance) {
  std::int64_t scale = 1;
  while (grid.width() * scale < kMaxPixels && rounding(line, grid.child * scale) > tolerance)
    ++scale;
  return scale;
}

std::int64_t free_scale(const Grid& grid, const Marker& marker, const LineWidth& line,
                        const RasterOptions& options) {
  const std::int64_t most = options.max_size_px / grid.width();
  const std::int64_t least =
      std::min(most, (options.min_size_px + grid.width() - 1) / grid.width());
  std::int64_t best = 0;
  double best_rounding = kLineRounding;
  for (std::int64_t scale = std::max<std::int64_t>(1, least); scale <= most; ++scale) {
    const double now = rounding(line, grid.child * scale);
    if (now <= kLineExact) return scale;
    if (now > best_rounding || (best != 0 && now == best_rounding)) continue;
    best = scale;
    best_rounding = now;
  }
  if (best != 0) return best;
  refuse(marker, "its picture needs " +
                     std::to_string(grid.width() * least_scale(grid, line, kLineRounding)) +
                     " pixels a side for every cell and line to be whole, but at most " +
                     std::to_string(options.max_size_px) + " are allowed");
}

std::int64_t given_scale(const Grid& grid, const Marker& marker, const LineWidth& line,
                         const RasterOptions& options) {
  if (options.pixels_per_cell % grid.last_cell != 0)
    refuse(marker, "pixels per cell must be a multiple of " + std::to_string(grid.last_cell));
  const std::int64_t scale = options.pixels_per_cell / grid.last_cell;
  if (scale > options.max_size_px / grid.width())
    refuse(marker, std::to_string(options.pixels_per_cell) + " pixels per cell make " +
                       std::to_string(grid.width() * scale) + " pixels a side, but at most " +
                       std::to_string(options.max_size_px) + " are allowed");
  if (rounding(line, grid.child * scale) > kLineRounding)
    refuse(marker, "with " + std::to_string(options.pixels_per_cell) +
                       " pixels per cell, its lines are no whole number of pixels");
  return scale;
}

void fill(Image& image, const Rect& rect, const Eigen::Vector2i& origin, std::uint8_t value) {
  const auto x0 = std::lround(rect.x0) + origin.x();
  const auto x1 = std::lround(rect.x1) + origin.x();
  const auto y0 = std::lround(rect.y0) + origin.y();
  const auto y1 = std::lround(rect.y1) + origin.y();
  for (auto y = y0; y < y1; ++y) std::fill_n(image.row(static_cast<int>(y)) + x0, x1 - x0, value);
}

/// The factor nearest to whole / length for which factor * length is `whole` to the last bit, where
/// there is one.
double whole_product_factor(double whole, double length) {
  const double factor = whole / length;
  for (const double near :
       {factor, std::nextafter(factor, 0.0), std::nextafter(factor, 2.0 * factor)})
    if (near * length == whole) return near;
  return factor;
}

}  // namespace

Raster raster(const MarkerSet& markers, int parent_index, const RasterOptions& options) {
  if (options.pixels_per_cell < 0 || options.min_size_px < 0 || options.max_size_px < 1)
    throw std::invalid_argument("raster: sizes in pixels must be positive");
  MarkerSet single = only_parent(markers, parent_index);
  Parent& parent = single.parents[0];
  const Grid grid = grid_of(single);
  const std::int64_t scale = options.pixels_per_cell == 0
                                 ? free_scale(grid, parent.marker, single.line, options)
                                 : given_scale(grid, parent.marker, single.line, options);
  const auto side_px = static_cast<double>(grid.side * scale);
  const auto quiet_px = static_cast<int>(grid.cell * scale);
  const auto size_px = static_cast<int>(grid.width() * scale);

  Raster drawn;
  drawn.origin_px = {quiet_px, quiet_px};
  drawn.pixels_per_metre = whole_product_factor(side_px, parent.side_m);
  drawn.line = rounded(single.line, grid.child * scale);

  // The same marker with a pixel for a metre: all its edges are whole numbers.
  parent.side_m = side_px;
  single.line = drawn.line;
  const InkPlan plan = ink_plan(single, 0);
  drawn.image = Image(size_px, size_px, 255);
  fill(drawn.image, plan.square, drawn.origin_px, 0);
  for (const Rect& white : plan.white) fill(drawn.image, white, drawn.origin_px, 255);
  for (const Rect& black : plan.black) fill(drawn.image, black, drawn.origin_px, 0);
  return drawn;
}

}  // namespace harco
