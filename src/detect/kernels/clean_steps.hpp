// Where grey values step from one even level to another.
#pragma once

#include <array>
#include <cstdint>

namespace harco::detect::kernels {

/// Eight neighbouring samples at each of some places: of place i, `samples[k][i]`.
using EightSamples = std::array<const std::uint8_t*, 8>;

/// Sets bit i where the samples of place i step up (`rising`) or down (`falling`) between the
/// fourth and the fifth one: the nearest `even` (2 or 3) before and behind these lie at least
/// `least_contrast` (1 … 255) apart, differ from one another by no more than a quarter of that
/// step, and the middle grey is passed there. Writes (count + 7) / 8 bytes of both; bits beyond
/// `count` are zero.
void clean_steps(const EightSamples& samples, int even, int count, int least_contrast,
                 std::uint8_t* rising, std::uint8_t* falling);

/// The same in plain C++.
void clean_steps_scalar(const EightSamples& samples, int even, int count, int least_contrast,
                        std::uint8_t* rising, std::uint8_t* falling);

}  // namespace harco::detect::kernels
