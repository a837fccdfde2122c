// One row of a picture at half its size.
#pragma once

#include <cstdint>

namespace harco::detect::kernels {

/// Each of the `width` pixels written is the mean of four, rounded to nearest (halves up): two
/// neighbours of the upper and two of the lower row, 2 x width of either.
void halve_rows(const std::uint8_t* upper, const std::uint8_t* lower, int width,
                std::uint8_t* half);

/// The same in plain C++.
void halve_rows_scalar(const std::uint8_t* upper, const std::uint8_t* lower, int width,
                       std::uint8_t* half);

}  // namespace harco::detect::kernels
