// Which pixels are dark, as bits.
#pragma once

#include <cstdint>

namespace harco::detect::kernels {

/// Bit i of `bits` (the lowest bit of the first byte is bit 0) says whether pixels[i] <
/// thresholds[i]. Writes as many bytes as hold `width` bits, the rest of the last one zero.
void dark_bits(const std::uint8_t* pixels, const std::uint8_t* thresholds, int width,
               std::uint8_t* bits);

/// The same in plain C++.
void dark_bits_scalar(const std::uint8_t* pixels, const std::uint8_t* thresholds, int width,
                      std::uint8_t* bits);

}  // namespace harco::detect::kernels
