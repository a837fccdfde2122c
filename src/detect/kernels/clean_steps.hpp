// Where grey values step from one even level to another.
#pragma once

#include <array>
#include <cstdint>

namespace harco::detect::kernels {

/// Six neighbouring samples at each of some places: of place i, `samples[k][i]`.
using SixSamples = std::array<const std::uint8_t*, 6>;

/// Sets bit i where the samples of place i step up or down between the third and the fourth one:
/// the two before and the two behind these lie at least `least_contrast` (1 … 255) apart, differ
/// from one another by no more than a quarter of that step, and the middle grey is passed there.
/// Writes (count + 7) / 8 bytes; bits beyond `count` are zero.
void clean_steps(const SixSamples& samples, int count, int least_contrast, std::uint8_t* bits);

/// The same in plain C++.
void clean_steps_scalar(const SixSamples& samples, int count, int least_contrast,
                        std::uint8_t* bits);

}  // namespace harco::detect::kernels
