// Which pixels go on upwards, for one row of a map of bits.
#pragma once

#include <cstdint>

namespace harco::detect::kernels {

/// Those bits that are set in three rows, one above the other; in all of them inverted if `flip` is
/// all ones.
void tall_bits(const std::uint64_t* here, const std::uint64_t* above, const std::uint64_t* top,
               std::uint64_t flip, int words, std::uint64_t* tall);

/// The same in plain C++.
void tall_bits_scalar(const std::uint64_t* here, const std::uint64_t* above,
                      const std::uint64_t* top, std::uint64_t flip, int words, std::uint64_t* tall);

}  // namespace harco::detect::kernels
