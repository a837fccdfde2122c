// Places near set bits.
#pragma once

#include <cstdint>

namespace harco::detect::kernels {

/// The bits of `words` words that lie within three of a set one, whichever word that is in. Bit 0
/// of a word follows bit 63 of the one before; word -1 and the one behind the last are read as
/// well. `spread` doesn't overlap `bits`.
void spread_bits(const std::uint64_t* bits, int words, std::uint64_t* spread);

/// The same in plain C++.
void spread_bits_scalar(const std::uint64_t* bits, int words, std::uint64_t* spread);

}  // namespace harco::detect::kernels
