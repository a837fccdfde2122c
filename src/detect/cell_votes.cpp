#include "detect/cell_votes.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace harco::detect {
namespace {

// From the first on a cell of the blurred picture is black, and white above the second.
constexpr float kBlack = 0.42F;
constexpr float kWhite = 0.58F;
// A cell looks as it should if it is off by less than this,
constexpr float kAgrees = 0.2F;
// and speaks for or against the marker if so many of its eight neighbours do.
constexpr int kFor = 5;
constexpr int kAgainst = 6;

/// Of a child's cells, row-first.
using Greys = std::array<float, (Code::kMaxCells + 2) * (Code::kMaxCells + 2)>;

float texel_at(const Texels& texels, double x, double y) {
  const int column = std::clamp(static_cast<int>(x), 0, kTexelsAcross - 2);
  const int row = std::clamp(static_cast<int>(y), 0, kTexelsAcross - 2);
  const auto fx = static_cast<float>(x - column);
  const auto fy = static_cast<float>(y - row);
  const float* upper = &texels[texel_index(row, column)];
  const float* lower = upper + kTexelsAcross;
  const float top = upper[0] + fx * (upper[1] - upper[0]);
  return top + fy * (lower[0] + fx * (lower[1] - lower[0]) - top);
}

/// The mean of four places around the middle of each cell, row-first.
void read(const Texels& texels, const CellSquare& square, Greys& greys) {
  const double cell = square.side / square.cells;
  std::size_t next = 0;
  for (int row = 0; row < square.cells; ++row)
    for (int column = 0; column < square.cells; ++column) {
      const Eigen::Vector2d middle =
          square.origin + cell * Eigen::Vector2d(column + 0.5, row + 0.5);
      float sum = 0.0F;
      for (const double dy : {-0.2, 0.2})
        for (const double dx : {-0.2, 0.2})
          sum += texel_at(texels, middle.x() + dx * cell - 0.5, middle.y() + dy * cell - 0.5);
      greys[next++] = 0.25F * sum;
    }
}

}  // namespace

CellVotes cell_votes(const Texels& image, const Texels& picture,
                     const std::vector<CellSquare>& children) {
  CellVotes votes;
  Greys seen{};
  Greys expected{};
  for (const CellSquare& child : children) {
    read(image, child, seen);
    read(picture, child, expected);
    const auto at = [&](int row, int column) {
      return static_cast<std::size_t>(row * child.cells + column);
    };
    const auto agrees = [&](std::size_t i) { return std::abs(seen[i] - expected[i]) < kAgrees; };
    for (int row = 1; row < child.cells - 1; ++row)
      for (int column = 1; column < child.cells - 1; ++column) {
        const std::size_t i = at(row, column);
        int neighbours = agrees(i) ? -1 : 0;  // it is none of its own
        for (int r = row - 1; r <= row + 1; ++r)
          for (int c = column - 1; c <= column + 1; ++c) neighbours += agrees(at(r, c));
        if (expected[i] < kBlack) {
          ++votes.predicted;
          votes.confirmed += agrees(i) && neighbours >= kFor;
        } else if (expected[i] > kWhite && neighbours >= kAgainst) {
          votes.wrong += seen[i] < kBlack && seen[i] > -kAgrees;
        }
      }
  }
  return votes;
}

}  // namespace harco::detect
