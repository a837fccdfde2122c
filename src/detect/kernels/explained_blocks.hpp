// In how many blocks two pictures look alike.
#pragma once

#include <cstdint>

namespace harco::detect::kernels {

/// How many of the blocks that are meant differ by no more than `most` (below 32767).
struct Explained {
  int all = 0;
  int marked = 0;  ///< of them, those marked
};

/// Of two pictures of `count` blocks each: texel k of block i is `[k * count + i]`, and a block's
/// difference is the sum of the squares of those of its `texels` texels. `marked` is 0 or 1 for
/// each block. Values may be up to 16000 apart.
Explained explained_blocks(const std::int16_t* seen, const std::int16_t* predicted,
                           const std::uint8_t* marked, int count, int texels, int most);

/// The same in plain C++.
Explained explained_blocks_scalar(const std::int16_t* seen, const std::int16_t* predicted,
                                  const std::uint8_t* marked, int count, int texels, int most);

}  // namespace harco::detect::kernels
