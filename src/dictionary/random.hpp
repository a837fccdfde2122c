// Random numbers that are the same on every machine: the standard fixes the generator, not its
// distributions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

namespace harco {

class Random {
 public:
  explicit Random(std::uint64_t seed) : generator_(seed) {}

  /// 0 … count - 1.
  std::size_t below(std::size_t count) { return generator_() % count; }
  int below(int count) { return static_cast<int>(below(static_cast<std::size_t>(count))); }

  /// 0 … 1, without 1.
  double unit() { return static_cast<double>(generator_() >> 11) * 0x1p-53; }

  template <class T>
  void shuffle(std::vector<T>& values) {
    for (std::size_t i = values.size(); i > 1; --i) std::swap(values[i - 1], values[below(i)]);
  }

 private:
  std::mt19937_64 generator_;
};

}  // namespace harco
