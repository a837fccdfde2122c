#include "detect/cells.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "detect/kernels/bilinear.hpp"
#include "detect/sample.hpp"
#include "detect/square_homography.hpp"

namespace harco::detect {
namespace {

/// A grey level that changes evenly over the marker: a + b x + c y.
struct Plane {
  Eigen::Vector3d coefficients = Eigen::Vector3d::Zero();
  double operator()(double x, double y) const {
    return coefficients.dot(Eigen::Vector3d(1.0, x, y));
  }
};

class PlaneFit {
 public:
  void add(double x, double y, double value) {
    const Eigen::Vector3d row(1.0, x, y);
    normal_ += row * row.transpose();
    right_ += row * value;
  }
  Plane solve() const { return {normal_.inverse() * right_}; }

 private:
  Eigen::Matrix3d normal_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_ = Eigen::Vector3d::Zero();
};

bool on_ring(int row, int column, int m) {
  return row == 0 || column == 0 || row == m - 1 || column == m - 1;
}

/// Blur mixes every cell with its neighbours; taking the same share of them off again sharpens.
/// `share` is what a cell gives to each of the two neighbours along a row or a column.
void unmix(std::span<double> values, int m, double share) {
  const double gain = share / (1.0 - 2.0 * share);
  std::array<double, CellGrid::kMost> room;
  const std::span<double> once(room.data(), values.size());
  std::copy(values.begin(), values.end(), once.begin());
  const auto at = [m](std::span<const double> v, int row, int column) {
    return v[static_cast<std::size_t>(std::clamp(row, 0, m - 1) * m +
                                      std::clamp(column, 0, m - 1))];
  };
  for (int row = 0; row < m; ++row)
    for (int column = 0; column < m; ++column)
      once[static_cast<std::size_t>(row * m + column)] +=
          gain * (2.0 * at(values, row, column) - at(values, row, column - 1) -
                  at(values, row, column + 1));
  std::copy(once.begin(), once.end(), values.begin());
  for (int row = 0; row < m; ++row)
    for (int column = 0; column < m; ++column)
      values[static_cast<std::size_t>(row * m + column)] +=
          gain *
          (2.0 * at(once, row, column) - at(once, row - 1, column) - at(once, row + 1, column));
}

/// Reads greys at places given in cells.
class CellSampler {
 public:
  CellSampler(const ImageView& image, const Lens& lens, const Eigen::Matrix3d& image_H_cells,
              double cell_px)
      : image_(image),
        lens_(lens),
        image_H_cells_(image_H_cells),
        across_(cell_px < 3.0    ? 1
                : cell_px < 8.0  ? 2
                : cell_px < 24.0 ? 3
                                 : 5) {}

  std::optional<double> grey_at(double x, double y) const {
    const auto pixel = lens_.from_ideal(ideal(x, y));
    return pixel ? sample(image_, pixel->x(), pixel->y()) : std::nullopt;
  }

  /// Fills in the mean of points within each of the m x m cells; false if some are outside of the
  /// image.
  bool means(int m, std::span<double> values) const {
    return lens_.bends() ? bent_means(m, values) : straight_means(m, values);
  }

 private:
  static constexpr int kMostAcross = 5;

  Eigen::Vector2d ideal(double x, double y) const {
    return (image_H_cells_ * Eigen::Vector3d(x, y, 1.0)).hnormalized();
  }

  /// Of the i-th point from the cell's first border, in cells; away from both.
  double offset(int i) const {
    constexpr double kSpread = 0.5;
    return 0.5 + (across_ == 1 ? 0.0 : kSpread * (i / (across_ - 1.0) - 0.5));
  }

  bool bent_means(int m, std::span<double> values) const {
    for (int row = 0; row < m; ++row)
      for (int column = 0; column < m; ++column) {
        double sum = 0.0;
        for (int i = 0; i < across_; ++i)
          for (int j = 0; j < across_; ++j) {
            const auto grey = grey_at(column + offset(j), row + offset(i));
            if (!grey) return false;
            sum += *grey;
          }
        values[static_cast<std::size_t>(row * m + column)] = sum / (across_ * across_);
      }
    return true;
  }

  /// A row of points at once: the first ones of all cells, the second ones, and so on.
  bool straight_means(int m, std::span<double> values) const {
    constexpr double kRounding = 0.01;  // pixels
    constexpr auto kMost = static_cast<std::size_t>(kMostAcross * (Code::kMaxCells + 2));
    for (const double x : {offset(0), m - offset(0)})
      for (const double y : {offset(0), m - offset(0)}) {
        const Eigen::Vector2d at = ideal(x, y);
        if (!between_pixels(image_, at.x() - kRounding, at.y() - kRounding) ||
            !between_pixels(image_, at.x() + kRounding, at.y() + kRounding))
          return false;
      }
    const auto count = static_cast<std::size_t>(across_ * m);
    std::array<float, kMost> places;
    for (int j = 0; j < across_; ++j)
      for (int column = 0; column < m; ++column)
        places[static_cast<std::size_t>(j * m + column)] = static_cast<float>(column + offset(j));
    std::array<std::int32_t, kMost> x;
    std::array<std::int32_t, kMost> y;
    std::array<float, kMost> greys;
    const Eigen::Vector3f by_x = (scaled() * Eigen::Vector3d::UnitX()).cast<float>();
    for (int row = 0; row < m; ++row) {
      std::array<float, Code::kMaxCells + 2> sums{};
      for (int i = 0; i < across_; ++i) {
        const Eigen::Vector3f start =
            (scaled() * Eigen::Vector3d(0.0, row + offset(i), 1.0)).cast<float>();
        for (std::size_t k = 0; k < count; ++k) {
          const float scale = 1.0F / (start.z() + places[k] * by_x.z());
          x[k] = static_cast<std::int32_t>((start.x() + places[k] * by_x.x()) * scale);
          y[k] = static_cast<std::int32_t>((start.y() + places[k] * by_x.y()) * scale);
        }
        kernels::bilinear(image_, x.data(), y.data(), 0, 0, static_cast<int>(count), greys.data());
        for (int j = 0; j < across_; ++j)
          for (int column = 0; column < m; ++column)
            sums[static_cast<std::size_t>(column)] +=
                greys[static_cast<std::size_t>(j * m + column)];
      }
      for (int column = 0; column < m; ++column)
        values[static_cast<std::size_t>(row * m + column)] =
            static_cast<double>(sums[static_cast<std::size_t>(column)]) / (across_ * across_);
    }
    return true;
  }

  /// To the places of kernels::bilinear().
  Eigen::Matrix3d scaled() const {
    Eigen::Matrix3d places_H_cells = image_H_cells_;
    places_H_cells.topRows<2>() *= 1 << kernels::kPlaceBits;
    return places_H_cells;
  }

  const ImageView& image_;
  const Lens& lens_;
  const Eigen::Matrix3d& image_H_cells_;
  int across_;
};

/// What a cell gives to each of the two neighbours along a row or a column.
double share_of_blur(double cell_px, double blur_px) {
  constexpr double kMost = 0.22;
  return std::min(kMost, 0.5 * (1.0 - std::erf(cell_px / (2.0 * std::sqrt(2.0) * blur_px))));
}

}  // namespace

std::size_t upright_cell(int row, int column, int turns, int m) {
  for (int k = 0; k < turns; ++k) {
    const int upright_row = m - 1 - column;
    column = row;
    row = upright_row;
  }
  return static_cast<std::size_t>(row * m + column);
}

bool has_bright_cells(const ImageView& image, const Quad& corners, int n, int least) {
  constexpr int kLeastShare = 15;  // per cent of what paper is brighter than the ring
  const int m = n + 2;
  Eigen::Matrix3d image_H_cells = square_homography(corners);
  image_H_cells.leftCols<2>() /= m;
  image_H_cells.topRows<2>().rowwise() += 0.5 * image_H_cells.row(2);  // from pixels' upper left
  const auto grey_at = [&](double x, double y) -> int {
    const Eigen::Vector3d h = image_H_cells * Eigen::Vector3d(x, y, 1.0);
    // Steep squares may reach beyond the horizon there: clamped before it is a whole number.
    const double column = std::clamp(h.x() / h.z(), 0.0, image.width() - 1.0);
    const double row = std::clamp(h.y() / h.z(), 0.0, image.height() - 1.0);
    return image(static_cast<int>(column), static_cast<int>(row));
  };
  std::array<int, 4 * (Code::kMaxCells + 2)> ring{};
  std::array<int, 4 * (Code::kMaxCells + 2)> paper{};
  std::size_t count = 0;
  for (int i = 0; i < m; ++i) {
    const double along = i + 0.5;
    for (const double side : {0.0, 1.0}) {
      const double inside = 0.5 + side * (m - 1.0);
      const double outside = -0.5 + side * (m + 1.0);
      ring[count] = grey_at(along, inside);
      paper[count++] = grey_at(along, outside);
      ring[count] = grey_at(inside, along);
      paper[count++] = grey_at(outside, along);
    }
  }
  const auto middle = [count](auto& greys) {
    const auto half = greys.begin() + static_cast<std::ptrdiff_t>(count / 2);
    std::nth_element(greys.begin(), half, greys.begin() + static_cast<std::ptrdiff_t>(count));
    return *half;
  };
  const int black = middle(ring);
  const int white = middle(paper);
  int bright = 0;
  for (int row = 1; row <= n; ++row)
    for (int column = 1; column <= n; ++column)
      bright += 100 * (grey_at(column + 0.5, row + 0.5) - black) >= kLeastShare * (white - black);
  return bright >= least;
}

std::optional<CellGreys> sample_cells(const ImageView& image, const Lens& lens,
                                      const Eigen::Matrix3d& image_H_cells, int n, double cell_px) {
  const CellSampler sampler(image, lens, image_H_cells, cell_px);
  const int m = n + 2;
  std::optional<CellGreys> seen(std::in_place);
  seen->greys.cells = n;
  seen->cell_px = cell_px;
  if (!sampler.means(m, seen->greys.values())) return std::nullopt;
  for (int i = 0; i < m; ++i) {
    const double along = i + 0.5;
    for (const auto& [x, y] : std::array<std::pair<double, double>, 4>{
             {{along, -0.5}, {along, m + 0.5}, {-0.5, along}, {m + 0.5, along}}})
      if (const auto grey = sampler.grey_at(x, y))
        seen->paper[seen->paper_seen++] = {x - 0.5, y - 0.5, *grey};
  }
  return seen;
}

std::optional<CellGrid> read_cells(const CellGreys& seen, double blur_px, bool child,
                                   int least_black) {
  const int n = seen.greys.cells;
  const int m = n + 2;
  std::optional<CellGrid> result(seen.greys);
  CellGrid& grid = *result;
  const std::span<double> values = grid.values();
  PlaneFit ring;
  for (int row = 0; row < m; ++row)
    for (int column = 0; column < m; ++column)
      if (on_ring(row, column, m))
        ring.add(column, row, values[static_cast<std::size_t>(row * m + column)]);
  unmix(values, m, share_of_blur(seen.cell_px, blur_px));

  const Plane ring_level = ring.solve();
  if (child) {
    // White comes from the ring; black is the darkest that the code is sure to hold.
    std::array<double, CellGrid::kMost> ratios;
    std::size_t count = 0;
    for (int row = 0; row < m; ++row)
      for (int column = 0; column < m; ++column) {
        double& value = values[static_cast<std::size_t>(row * m + column)];
        const double white = std::max(1.0, ring_level(column, row));
        value /= white;
        if (!on_ring(row, column, m)) ratios[count++] = value;
      }
    const int darkest = std::clamp(least_black, 1, n * n);
    std::partial_sort(ratios.begin(), ratios.begin() + darkest,
                      ratios.begin() + static_cast<std::ptrdiff_t>(count));
    double black = 0.0;
    for (int i = 0; i < darkest; ++i) black += ratios[static_cast<std::size_t>(i)] / darkest;
    grid.contrast = (1.0 - black) * ring_level(0.5 * (m - 1), 0.5 * (m - 1));
    if (grid.contrast < kMinContrast) return result;
    for (double& value : values) value = (value - black) / (1.0 - black);
    return result;
  }
  // White is the paper just outside of the black ring, where the image shows it.
  if (seen.paper_seen < static_cast<std::size_t>(2 * m)) return std::nullopt;
  PlaneFit paper;
  for (std::size_t i = 0; i < seen.paper_seen; ++i)
    paper.add(seen.paper[i].x(), seen.paper[i].y(), seen.paper[i].z());
  const Plane paper_level = paper.solve();
  const double middle = 0.5 * (m - 1);
  grid.contrast = paper_level(middle, middle) - ring_level(middle, middle);
  if (grid.contrast < kMinContrast) return result;
  for (int row = 0; row < m; ++row)
    for (int column = 0; column < m; ++column) {
      double& value = values[static_cast<std::size_t>(row * m + column)];
      const double black = ring_level(column, row);
      value = (value - black) / std::max(kMinContrast, paper_level(column, row) - black);
    }
  return result;
}

std::optional<ShadedCells> read_shaded_cells(const CellGreys& seen, double blur_px) {
  // Dirt, glare and blur may spoil some of the ring's cells and of the paper's places.
  constexpr double kSpoilt = 0.08;
  // Children and blur make white cells darker than paper, black ones stay as dark as the ring.
  constexpr double kBetween = 0.3;
  const int m = seen.greys.cells + 2;
  if (seen.paper_seen < static_cast<std::size_t>(2 * m)) return std::nullopt;
  ShadedCells shaded{seen};
  const std::span<double> values = shaded.seen.greys.values();
  unmix(values, m, share_of_blur(seen.cell_px, blur_px));

  std::array<double, CellGrid::kMost> sorted{};
  const auto at_share = [&](std::size_t count, double share) {
    const auto i = static_cast<std::ptrdiff_t>(share * static_cast<double>(count - 1));
    std::nth_element(sorted.begin(), sorted.begin() + i,
                     sorted.begin() + static_cast<std::ptrdiff_t>(count));
    return sorted[static_cast<std::size_t>(i)];
  };
  std::size_t count = 0;
  for (int row = 0; row < m; ++row)
    for (int column = 0; column < m; ++column)
      if (on_ring(row, column, m))
        sorted[count++] = values[static_cast<std::size_t>(row * m + column)];
  const double brightest_black = at_share(count, 1.0 - kSpoilt);
  shaded.black = at_share(count, 0.5);
  for (std::size_t i = 0; i < seen.paper_seen; ++i) sorted[i] = seen.paper[i].z();
  const double darkest_white = at_share(seen.paper_seen, kSpoilt);
  if (darkest_white - brightest_black < kMinContrast) return std::nullopt;
  shaded.threshold = brightest_black + kBetween * (darkest_white - brightest_black);
  return shaded;
}

CellGrid in_even_light(const ShadedCells& shaded, const std::vector<double>& predicted, int turns) {
  constexpr double kWhite = 0.5;
  constexpr std::size_t kNeighbours = 5;
  const auto& [greys, cell_px, paper, paper_seen] = shaded.seen;
  const int m = greys.cells + 2;
  // Where light is known: place and grey of white paper above black.
  std::array<Eigen::Vector3d, CellGrid::kMost + std::tuple_size_v<decltype(CellGreys::paper)>>
      lights;
  std::size_t known = 0;
  for (std::size_t i = 0; i < paper_seen; ++i)
    lights[known++] = paper[i] - Eigen::Vector3d(0.0, 0.0, shaded.black);
  for (int row = 0; row < m; ++row)
    for (int column = 0; column < m; ++column) {
      const double white = predicted[upright_cell(row, column, turns, m)];
      if (white < kWhite) continue;
      const double grey = greys.values()[static_cast<std::size_t>(row * m + column)];
      lights[known++] = {double(column), double(row), (grey - shaded.black) / white};
    }
  CellGrid even;
  even.cells = greys.cells;
  for (int row = 0; row < m; ++row)
    for (int column = 0; column < m; ++column) {
      // The nearest others, and their median.
      std::array<std::pair<double, double>, kNeighbours> nearest;
      nearest.fill({std::numeric_limits<double>::max(), 0.0});
      for (std::size_t i = 0; i < known; ++i) {
        const double away = (lights[i].head<2>() - Eigen::Vector2d(column, row)).squaredNorm();
        if (away < 0.25 || away >= nearest.back().first) continue;
        nearest.back() = {away, lights[i].z()};
        for (std::size_t k = kNeighbours - 1; k > 0 && nearest[k] < nearest[k - 1]; --k)
          std::swap(nearest[k], nearest[k - 1]);
      }
      std::sort(nearest.begin(), nearest.end(),
                [](const auto& a, const auto& b) { return a.second < b.second; });
      const double light = std::max(kMinContrast, nearest[kNeighbours / 2].second);
      const auto at = static_cast<std::size_t>(row * m + column);
      even.values()[at] = (greys.values()[at] - shaded.black) / light;
    }
  return even;
}

int wrong_ring_cells(const CellGrid& grid, bool child) {
  const int m = grid.cells + 2;
  int wrong = 0;
  for (int row = 0; row < m; ++row)
    for (int column = 0; column < m; ++column)
      if (on_ring(row, column, m))
        wrong += (grid.values()[static_cast<std::size_t>(row * m + column)] > 0.5) != child;
  return wrong;
}

std::uint64_t read_bits(const CellGrid& grid, double white_level) {
  const int n = grid.cells;
  const int m = n + 2;
  std::uint64_t bits = 0;
  for (int row = 0; row < n; ++row)
    for (int column = 0; column < n; ++column)
      if (grid.values()[static_cast<std::size_t>((row + 1) * m + column + 1)] >= white_level)
        bits |= std::uint64_t{1} << (row * n + column);
  return bits;
}

double agreement(const CellGrid& grid, const std::vector<double>& predicted, int turns) {
  const int m = grid.cells + 2;
  double sum_a = 0.0;
  double sum_b = 0.0;
  double sum_aa = 0.0;
  double sum_bb = 0.0;
  double sum_ab = 0.0;
  for (int row = 0; row < m; ++row)
    for (int column = 0; column < m; ++column) {
      const double a =
          std::clamp(grid.values()[static_cast<std::size_t>(row * m + column)], -0.3, 1.3);
      const double b = predicted[upright_cell(row, column, turns, m)];
      sum_a += a;
      sum_b += b;
      sum_aa += a * a;
      sum_bb += b * b;
      sum_ab += a * b;
    }
  const double count = m * m;
  const double var_a = sum_aa - sum_a * sum_a / count;
  const double var_b = sum_bb - sum_b * sum_b / count;
  if (var_a <= 0.0 || var_b <= 0.0) return 0.0;
  return std::clamp((sum_ab - sum_a * sum_b / count) / std::sqrt(var_a * var_b), 0.0, 1.0);
}

}  // namespace harco::detect
