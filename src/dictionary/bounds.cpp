#include "dictionary/bounds.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "dictionary/turns.hpp"

namespace harco {
namespace {

constexpr double kMost = 1e18;

/// Floor of a bound on a whole number, which rounding errors must not lower.
double whole(double bound) { return std::min(kMost, std::floor(bound * (1.0 + 1e-12) + 1e-9)); }

/// Black cells and the distances to the turns by 90 and by 180 degrees: for one ring of four
/// cells, or for all looked at so far.
using RingSum = std::tuple<int, int, int>;

/// What a ring can contribute, every choice of its cells that leaves the fixed ones white.
std::set<RingSum> ring_choices(const std::array<int, 4>& ring, std::uint64_t white) {
  std::set<RingSum> choices;
  for (unsigned black = 0; black < 16; ++black) {
    bool allowed = true;
    for (std::size_t k = 0; k < 4; ++k)
      allowed = allowed && !(((black >> k) & 1U) != 0 && ((white >> ring[k]) & 1U) != 0);
    if (!allowed) continue;
    const unsigned by_90 = ((black << 1) | (black >> 3)) & 15U;
    const unsigned by_180 = ((black << 2) | (black >> 2)) & 15U;
    choices.emplace(std::popcount(black), std::popcount(black ^ by_90),
                    std::popcount(black ^ by_180));
  }
  return choices;
}

struct Johnson {
  std::map<std::tuple<int, int, int>, double> known;

  /// `d` is even.
  double operator()(int n, int d, int w) {
    w = std::min(w, n - w);
    if (w < 0) return 0.0;
    if (2 * w < d) return 1.0;
    if (2 * w == d) return whole(double(n) / w);
    const auto [place, is_new] = known.try_emplace({n, d, w}, 0.0);
    if (!is_new) return place->second;
    double bound = whole(double(n) / w * (*this)(n - 1, d, w - 1));
    bound = std::min(bound, whole(double(n) / (n - w) * (*this)(n - 1, d, w)));
    // The mean distance of M words is at most that of evenly spread ones.
    const double spread = 2.0 * w * w - 2.0 * w * n + double(d) * n;
    if (spread > 0.0) bound = std::min(bound, whole(double(d) * n / spread));
    return known[{n, d, w}] = bound;
  }
};

}  // namespace

int greatest_inner_distance(int cells, std::uint64_t white, const BlackRange& black) {
  const Turns turns(cells);
  std::set<RingSum> sums{{0, 0, 0}};
  for (const auto& ring : turns.rings()) {
    const std::set<RingSum> choices = ring_choices(ring, white);
    std::set<RingSum> next;
    for (const auto& [blacks, by_90, by_180] : sums)
      for (const auto& [b, d90, d180] : choices)
        if (blacks + b <= black.most) next.emplace(blacks + b, by_90 + d90, by_180 + d180);
    sums = std::move(next);
  }
  const int centre = cells * cells / 2;
  const bool free_centre = cells % 2 == 1 && ((white >> centre) & 1U) == 0;
  int greatest = -1;
  for (const auto& [blacks, by_90, by_180] : sums)
    if (blacks + (free_centre ? 1 : 0) >= black.least)
      greatest = std::max(greatest, std::min(by_90, by_180));
  return greatest;
}

double johnson_bound(int n, int d, int w) { return Johnson()(n, d + d % 2, w); }

double johnson_bound(int n, int d, const BlackRange& ones) {
  Johnson johnson;
  const int even = d + d % 2;  // words of one weight have even distances
  double sum = 0.0;
  for (int w = ones.least; w <= std::min(n, ones.most); ++w) sum += johnson(n, even, w);
  // A bit that marks the lighter words makes all equally heavy, and no distance smaller.
  if (ones.most == ones.least + 1 && ones.most <= n)
    sum = std::min(sum, johnson(n + 1, even, ones.most));
  return std::min(kMost, sum);
}

double plotkin_bound(int n, int d) {
  if (d % 2 == 1) return plotkin_bound(n + 1, d + 1);
  if (d > n) return 1.0;
  if (2 * d > n) return 2.0 * whole(double(d) / (2 * d - n));
  if (2 * d == n) return 2.0 * n;
  return std::min(kMost, 2.0 * plotkin_bound(n - 1, d));
}

double sphere_packing_bound(int n, int d) {
  double ball = 0.0;
  double shell = 1.0;
  for (int radius = 0; radius <= (d - 1) / 2; ++radius) {
    ball += shell;
    shell *= double(n - radius) / (radius + 1);
  }
  return whole(std::exp2(n) / ball);
}

DistanceBound distance_bound(const Demand& demand) {
  const int size = demand.cells * demand.cells;
  DistanceBound bound{size, "inner distance"};
  for (const CodeGroup& group : demand.groups)
    bound.distance =
        std::min(bound.distance, greatest_inner_distance(demand.cells, group.white, demand.black));

  const Turns turns(demand.cells);
  const auto lower = [&](int words, int free, const char* reason, auto&& most) {
    while (bound.distance > 1 && most(free, bound.distance) < words) {
      --bound.distance;
      bound.reason = reason;
    }
  };
  const auto check = [&](int words, int free) {
    lower(words, free, "Johnson bound",
          [&](int n, int d) { return johnson_bound(n, d, demand.black); });
    lower(words, free, "Plotkin bound", plotkin_bound);
    lower(words, free, "sphere packing bound", sphere_packing_bound);
  };
  // Any groups together leave free what the least fixed of them does. Turns of a code fit its
  // group only where the fixed cells look the same when turned.
  for (const CodeGroup& least_fixed : demand.groups) {
    int codes = 0;
    for (const CodeGroup& group : demand.groups)
      if ((group.white & least_fixed.white) == least_fixed.white) codes += group.count;
    const bool turnable = turns.turned(least_fixed.white) == least_fixed.white;
    check(turnable ? 4 * codes : codes, size - std::popcount(least_fixed.white));
  }
  return bound;
}

}  // namespace harco
