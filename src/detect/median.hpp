// The middle one of many values, quickly.
#pragma once

namespace harco::detect {

/// The middle one of `count` values from 0 to less than `most`, of an even number the upper one,
/// rounded down to a multiple of most / 2^rounds. By bisection, which compares many values at once
/// and doesn't ask for their order.
inline float middle_of(const float* values, int count, float most, int rounds) {
  float low = 0.0F;
  float step = most;
  for (int round = 0; round < rounds; ++round) {
    step *= 0.5F;
    const float next = low + step;
    int below = 0;
    for (int i = 0; i < count; ++i) below += values[i] < next ? 1 : 0;
    if (below <= count / 2) low = next;
  }
  return low;
}

}  // namespace harco::detect
