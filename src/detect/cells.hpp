// Fifth stage: what stands in the cells of a quad.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "detect/lens.hpp"
#include "detect/quad.hpp"
#include "harco/code.hpp"
#include "harco/image.hpp"

namespace harco::detect {

/// Grey levels between black and white below which there is no marker to be read.
inline constexpr double kMinContrast = 8.0;

/// The cells of a quad that may be a marker, border ring included.
struct CellGrid {
  int cells = 0;  ///< n
  /// (n+2)^2 values, row-first, 0 black … 1 white; without meaning if the contrast is below
  /// kMinContrast.
  std::span<double> values() { return {room.data(), count()}; }
  std::span<const double> values() const { return {room.data(), count()}; }
  double contrast = 0.0;  ///< grey levels between black and white

  static constexpr std::size_t kMost = (Code::kMaxCells + 2) * (Code::kMaxCells + 2);
  std::size_t count() const { return static_cast<std::size_t>((cells + 2) * (cells + 2)); }
  std::array<double, kMost> room;
};

/// A glance at a dark quad of the image, right to about a pixel, before anything is fitted: whether
/// the middles of at least so many of its n x n inner cells stand out from the ring as paper would,
/// be it in shade.
bool has_bright_cells(const ImageView& image, const Quad& corners, int n, int least);

/// Cell (row, column) of a marker of m x m cells as seen, turned clockwise `turns` times, is this
/// cell of the upright one, row-first.
std::size_t upright_cell(int row, int column, int turns, int m);

/// Grey levels of a quad's cells, and of the paper around, as the image shows them.
struct CellGreys {
  CellGrid greys;        ///< not yet related to black and white
  double cell_px = 0.0;  ///< the least side of a cell in pixels
  /// Of the paper just outside of the ring, as far as it is in the image, and where: in cells,
  /// (0, 0) the middle of the first.
  std::array<Eigen::Vector3d, 4 * (Code::kMaxCells + 2)> paper;
  std::size_t paper_seen = 0;
};

/// Samples the cells of a quad. `image_H_cells` maps cell coordinates, (0, 0) … (n+2, n+2), to
/// ideal pixels. Empty if part of it lies outside of the image.
std::optional<CellGreys> sample_cells(const ImageView& image, const Lens& lens,
                                      const Eigen::Matrix3d& image_H_cells, int n, double cell_px);

/// The cells of a parent (black ring, white paper around it) or a child (white ring). `blur_px` is
/// the standard deviation of the blur that is taken off again, `least_black` the least number of
/// black cells in a code of this kind. Empty if too little of a parent's paper is in the image.
std::optional<CellGrid> read_cells(const CellGreys& seen, double blur_px, bool child,
                                   int least_black);

/// A parent's cells where light changes abruptly, at a shadow's edge: paper in shade need not be
/// brighter than the middle between black and white in the sun, but it is brighter than any black.
struct ShadedCells {
  CellGreys seen;          ///< without blur
  double black = 0.0;      ///< of the ring, the middle one
  double threshold = 0.0;  ///< between all of the ring's greys and all of the paper's
};

/// Reads the cells of a parent as read_cells() does. Empty if too little of the paper around it is
/// in the image, or if some of that is no brighter than the ring.
std::optional<ShadedCells> read_shaded_cells(const CellGreys& seen, double blur_px);

/// The cells in units of the light nearby, 0 black … 1 white, if they are those predicted for a
/// marker that is turned clockwise `turns` times: light is what white cells and paper around show.
CellGrid in_even_light(const ShadedCells& shaded, const std::vector<double>& predicted, int turns);

/// Number of cells of the ring that are not of its colour.
int wrong_ring_cells(const CellGrid& grid, bool child);

/// The inner cells as bits, row-first; a cell is white from `white_level` on, in units of the grid.
std::uint64_t read_bits(const CellGrid& grid, double white_level);

/// Correlation of the cells with those predicted for a marker that is turned clockwise `turns`
/// times, from 1 (equal up to gain and offset) down to 0 (nothing in common, or the inverse).
double agreement(const CellGrid& grid, const std::vector<double>& predicted, int turns);

}  // namespace harco::detect
