// Where one row of pixels is much darker than another, as bits.
#pragma once

#include <cstdint>

namespace harco::detect::kernels {

/// Bit i of `bits` (the lowest bit of the first byte is bit 0) says whether from[i] - to[i], or 0
/// if that is negative, is least[i] or more. Writes as many bytes as hold `width` bits, the rest of
/// the last one zero.
void steep_bits(const std::uint8_t* from, const std::uint8_t* to, const std::uint8_t* least,
                int width, std::uint8_t* bits);

/// The same in plain C++.
void steep_bits_scalar(const std::uint8_t* from, const std::uint8_t* to, const std::uint8_t* least,
                       int width, std::uint8_t* bits);

}  // namespace harco::detect::kernels
