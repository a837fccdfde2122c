// How a camera's grey values bend between black and white.
#pragma once

#include <array>
#include <cstddef>

#include "pose/kernels/patch_loops.hpp"

namespace harco {

/// What a camera whose grey values go with the power 1/gamma of the light makes of a mixture of
/// black and white, as a share of the contrast. Tabulated, as it is asked for every pixel.
class Response {
 public:
  /// `black` is the grey value of black as a share of white's.
  void set(double log_gamma, double black);

  /// For a share of white of 0 ... 1; what lies beyond counts as the end.
  float seen(float white_share) const;

  /// Tables over the share of white, in steps of 1 / cells: what is seen, how that changes with
  /// the share and with the logarithm of gamma.
  void tell(kernels::LightTerms& terms) const;

 private:
  static constexpr std::size_t kCells = 128;
  using Table = std::array<float, kCells + 1>;

  static void tabulate(double log_gamma, double black, Table& table);

  Table seen_{}, slope_{}, by_log_gamma_{};
};

}  // namespace harco
