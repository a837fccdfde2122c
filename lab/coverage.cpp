#include "coverage.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>

namespace harco::lab {
namespace {

// The Gaussian is cut where it has fallen to 4e-6 of its top.
constexpr double kReachInSigmas = 5.0;

/// Sigma of the kernel on sub-pixels, such that with a sub-pixel's own box (variance 1/12) the
/// whole has the variance asked for.
double kernel_sigma(const Psf& psf) {
  const double wanted = psf.sigma_px * psf.oversampling;
  return std::sqrt(std::max(0.0, wanted * wanted - 1.0 / 12.0));
}

int kernel_radius(const Psf& psf) {
  return static_cast<int>(std::ceil(kReachInSigmas * kernel_sigma(psf)));
}

/// What one pixel takes from the sub-pixels along one axis: the Gaussian, averaged over the
/// pixel's own sub-pixels. Element k belongs to the sub-pixel `k - radius` from the pixel's first.
std::vector<float> pixel_weights(const Psf& psf) {
  const double sigma = kernel_sigma(psf);
  const int radius = kernel_radius(psf);
  std::vector<double> gaussian;
  double sum = 0.0;
  for (int k = -radius; k <= radius; ++k) {
    gaussian.push_back(sigma > 0.0 ? std::exp(-0.5 * k * k / (sigma * sigma)) : 1.0);
    sum += gaussian.back();
  }
  std::vector<double> weights(gaussian.size() + static_cast<std::size_t>(psf.oversampling) - 1);
  for (std::size_t j = 0; j < static_cast<std::size_t>(psf.oversampling); ++j)
    for (std::size_t k = 0; k < gaussian.size(); ++k)
      weights[j + k] += gaussian[k] / (sum * psf.oversampling);
  return {weights.begin(), weights.end()};
}

}  // namespace

int Psf::reach_px() const { return (kernel_radius(*this) + oversampling - 1) / oversampling; }

Coverage::Coverage(const PixelWindow& window, const Psf& psf) : window_(window), psf_(psf) {
  if (window.width <= 0 || window.height <= 0)
    throw std::invalid_argument("Coverage: the window is empty");
  if (!(psf.sigma_px >= 0.0 && psf.sigma_px <= 1000.0) || psf.oversampling < 1 ||
      psf.oversampling > 64)
    throw std::invalid_argument("Coverage: needs 0 <= sigma_px <= 1000, 1 <= oversampling <= 64");
  margin_px_ = psf.reach_px();
  grid_width_ = (window.width + 2 * margin_px_) * psf.oversampling;
  grid_height_ = (window.height + 2 * margin_px_) * psf.oversampling;
}

void Coverage::add(const Polygon& polygon, double weight) {
  const Eigen::Vector2d first(window_.x - margin_px_, window_.y - margin_px_);
  const auto to_grid = [&](const Eigen::Vector2d& pixel) -> Eigen::Vector2d {
    return (pixel - first + Eigen::Vector2d(0.5, 0.5)) * psf_.oversampling;
  };
  for (std::size_t i = 0; i < polygon.size(); ++i)
    add_edge(to_grid(polygon[i]), to_grid(polygon[(i + 1) % polygon.size()]), weight);
}

void Coverage::add_edge(Eigen::Vector2d from, Eigen::Vector2d to, double weight) {
  // Clockwise with y down, the left side goes up: what lies to the right of it is covered.
  weight = -weight;
  if (from.y() > to.y()) {
    std::swap(from, to);
    weight = -weight;
  }
  const double top = std::max(from.y(), 0.0);
  const double bottom = std::min(to.y(), static_cast<double>(grid_height_));
  if (!(top < bottom)) return;
  const double slope = (to.x() - from.x()) / (to.y() - from.y());
  const auto x_at = [&](double y) { return from.x() + slope * (y - from.y()); };

  // Cut where it crosses the grid's left and right border; each part is then on one side.
  std::array<double, 4> cuts{top, bottom, bottom, bottom};
  for (std::size_t i = 1; const double border : {0.0, static_cast<double>(grid_width_)}) {
    const double y = from.y() + (border - from.x()) / slope;
    if (y > top && y < bottom) cuts[i++] = y;
  }
  std::sort(cuts.begin(), cuts.end());
  for (std::size_t i = 0; cuts[i] < bottom; ++i)
    keep(x_at(cuts[i]), cuts[i], x_at(cuts[i + 1]), cuts[i + 1], weight);
}

void Coverage::keep(double x0, double y0, double x1, double y1, double weight) {
  // What passes on the left still covers all to its right: it moves onto the border. What passes
  // on the right covers nothing.
  const double right = grid_width_;
  if (x0 + x1 >= 2.0 * right) return;
  edges_.push_back({std::clamp(x0, 0.0, right), y0, std::clamp(x1, 0.0, right), y1, weight});
}

/// One row of sub-pixels after the other, from the top.
struct Coverage::Sweep {
  explicit Sweep(const Coverage& coverage)
      : edges(coverage.edges_),
        steps(static_cast<std::size_t>(coverage.grid_width_) + 2),
        over(coverage.psf_.oversampling),
        touched(static_cast<std::size_t>(coverage.grid_width_ / over) + 2) {
    std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) { return a.y0 < b.y0; });
  }

  /// Brings `steps` to the given row: the running sum over it is the coverage. False if the row is
  /// empty.
  bool go_to(int row) {
    std::erase_if(active, [&](std::size_t i) { return edges[i].y1 <= row; });
    for (; next < edges.size() && edges[next].y0 < row + 1; ++next)
      if (edges[next].y1 > row) active.push_back(next);
    if (active.empty()) return false;
    std::fill(steps.begin(), steps.end(), 0.0F);
    std::fill(touched.begin(), touched.end(), false);
    for (const std::size_t i : active) add(edges[i], row);
    return true;
  }

  void add(const Edge& edge, int row) {
    const double slope = (edge.x1 - edge.x0) / (edge.y1 - edge.y0);
    const double top = std::max(edge.y0, static_cast<double>(row));
    const double bottom = std::min(edge.y1, row + 1.0);
    double left = edge.x0 + slope * (top - edge.y0);
    double right = edge.x0 + slope * (bottom - edge.y0);
    if (left > right) std::swap(left, right);
    left = std::max(left, std::min(edge.x0, edge.x1));
    right = std::min(right, std::max(edge.x0, edge.x1));

    const double cover = (bottom - top) * edge.weight;
    const double width = right - left;
    const int last = static_cast<int>(right);
    int cell = static_cast<int>(left);
    std::fill(touched.begin() + cell / over, touched.begin() + (last + 1) / over + 1, true);
    if (cell == last || width <= 0.0) {
      add_step(cell, 0.5 * (left + right), cover);
      return;
    }
    for (; cell <= last; ++cell) {
      const double a = std::max(left, static_cast<double>(cell));
      const double b = std::min(right, cell + 1.0);
      add_step(cell, 0.5 * (a + b), cover * (b - a) / width);
    }
  }

  /// An edge piece within one cell, with its middle at x: the cell itself is covered from x on,
  /// its right neighbours whole.
  void add_step(int cell, double x, double cover) {
    const double share = cell + 1.0 - x;
    const auto index = static_cast<std::size_t>(cell);
    steps[index] += static_cast<float>(cover * share);
    steps[index + 1] += static_cast<float>(cover * (1.0 - share));
  }

  std::vector<Edge> edges;
  std::vector<std::size_t> active;
  std::size_t next = 0;
  std::vector<float> steps;
  int over;
  std::vector<char> touched;  ///< whether a pixel's sub-pixels have steps, margins included
};

FloatImage Coverage::blurred() const {
  const std::vector<float> weights = pixel_weights(psf_);
  const int radius = kernel_radius(psf_);
  const int over = psf_.oversampling;
  const int taps = static_cast<int>(weights.size());
  const int lead = margin_px_ * over - radius;  // first sub-pixel that pixel 0 takes from

  // Sub-pixel s of a row stands in plane s % over at s / over: so the inner loops run over
  // neighbouring pixels.
  const auto plane_width = static_cast<std::size_t>(grid_width_ / over);
  const auto phases = static_cast<std::size_t>(over);
  const auto reach = static_cast<std::size_t>(2 * margin_px_);
  std::vector<float> planes(plane_width * phases);
  std::vector<float> line(static_cast<std::size_t>(window_.width));
  const auto filter = [&](std::size_t first, std::size_t last) {
    std::fill(line.begin() + static_cast<std::ptrdiff_t>(first),
              line.begin() + static_cast<std::ptrdiff_t>(last), 0.0F);
    for (int k = 0; k < taps; ++k) {
      const float weight = weights[static_cast<std::size_t>(k)];
      const float* from = planes.data() +
                          static_cast<std::size_t>((lead + k) % over) * plane_width +
                          (lead + k) / over;
      for (std::size_t x = first; x < last; ++x) line[x] += weight * from[x];
    }
  };

  FloatImage image(window_.width, window_.height);
  Sweep sweep(*this);
  for (int row = 0; row < grid_height_; ++row) {
    if (!sweep.go_to(row)) continue;
    double sum = 0.0;
    for (std::size_t column = 0; column < plane_width; ++column) {
      const float* steps = sweep.steps.data() + column * phases;
      for (std::size_t phase = 0; phase < phases; ++phase) {
        if (sweep.touched[column] != 0) sum += static_cast<double>(steps[phase]);
        planes[phase * plane_width + column] = static_cast<float>(sum);
      }
    }
    // Pixel x takes from the columns x ... x + reach. Where these have no step, it has their value.
    std::size_t done = 0;
    for (std::size_t column = 0; column < plane_width && done < line.size(); ++column) {
      if (sweep.touched[column] == 0) continue;
      const std::size_t first = std::max(done, column > reach ? column - reach : 0);
      for (std::size_t next = column + 1; next < plane_width && next <= column + 1 + reach; ++next)
        if (sweep.touched[next] != 0) column = next;
      const std::size_t last = std::min(column + 1, line.size());
      for (; done < first; ++done) line[done] = planes[done];
      filter(first, last);
      done = last;
    }
    for (; done < line.size(); ++done) line[done] = planes[done + reach];

    // Pixel row y takes this row as its tap k = row - lead - y * over.
    const int newest = std::min((row - lead) / over, window_.height - 1);
    for (int y = newest; y >= 0; --y) {
      const int k = row - lead - y * over;
      if (k >= taps) break;
      if (k < 0) continue;
      const float weight = weights[static_cast<std::size_t>(k)];
      float* to = image.row(y);
      for (std::size_t x = 0; x < line.size(); ++x) to[x] += weight * line[x];
    }
  }
  return image;
}

}  // namespace harco::lab
