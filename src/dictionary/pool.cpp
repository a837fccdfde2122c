#include "dictionary/pool.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <unordered_set>

namespace harco {
namespace {

constexpr double kEnumerable = 1 << 21;  // codes a group
constexpr std::size_t kLongestOrbit = 32;

std::uint64_t all_white(int size) { return ~std::uint64_t{0} >> (64 - size); }

double binomial(std::size_t n, std::size_t k) {
  double count = 1.0;
  for (std::size_t i = 1; i <= k; ++i)
    count *= static_cast<double>(n - k + i) / static_cast<double>(i);
  return std::round(count);
}

/// The next greater number with as many bits set.
std::uint64_t next_combination(std::uint64_t bits) {
  const std::uint64_t lowest = bits & (~bits + 1);
  const std::uint64_t ripple = bits + lowest;
  return ripple | (((bits ^ ripple) >> 2) >> std::countr_zero(lowest));
}

std::uint64_t blacken(std::uint64_t bits, const std::vector<int>& free, std::uint64_t choice) {
  for (; choice != 0; choice &= choice - 1)
    bits &= ~(std::uint64_t{1} << free[static_cast<std::size_t>(std::countr_zero(choice))]);
  return bits;
}

/// Swaps black and white cells, never to a smaller inner distance, until that is at least tau.
/// Returns whether it got there.
bool raise_inner_distance(std::uint64_t& bits, const std::vector<int>& free, int tau,
                          const Turns& turns, Random& random) {
  int inner = turns.inner_distance(bits);
  for (int trial = 0; inner < tau && trial < 8 * turns.size(); ++trial) {
    const std::uint64_t a = std::uint64_t{1} << free[random.below(free.size())];
    const std::uint64_t b = std::uint64_t{1} << free[random.below(free.size())];
    if (((bits & a) != 0) == ((bits & b) != 0)) continue;
    const std::uint64_t swapped = bits ^ a ^ b;
    const int swapped_inner = turns.inner_distance(swapped);
    if (swapped_inner < inner) continue;
    bits = swapped;
    inner = swapped_inner;
  }
  return inner >= tau;
}

}  // namespace

std::vector<Code> joined(const CodeGroups& groups) {
  std::vector<Code> all;
  for (const auto& group : groups) all.insert(all.end(), group.begin(), group.end());
  return all;
}

int turns_to_fit(std::uint64_t bits, const CodeGroup& group, const Turns& turns) {
  const auto views = turns.all(bits);
  for (std::size_t k = 0; k < views.size(); ++k)
    if ((views[k] & group.white) == group.white) return static_cast<int>(k);
  return -1;
}

Candidates::Candidates(const Demand& demand, const Turns& turns, Random& random)
    : demand_(demand), turns_(turns) {
  std::vector<std::uint64_t> masks;
  for (const CodeGroup& group : demand.groups) masks.push_back(group.white);
  std::stable_sort(masks.begin(), masks.end(),
                   [](auto a, auto b) { return std::popcount(a) > std::popcount(b); });
  masks.erase(std::unique(masks.begin(), masks.end()), masks.end());

  for (const std::uint64_t white : masks) {
    Source source;
    for (int cell = 0; cell < turns.size(); ++cell)
      if (((white >> cell) & 1U) == 0) source.free.push_back(cell);
    for (int black = demand.black.least; black <= demand.black.most; ++black) {
      const auto k = static_cast<std::size_t>(black);
      source.counts.push_back(k <= source.free.size() ? binomial(source.free.size(), k) : 0.0);
    }
    if (std::accumulate(source.counts.begin(), source.counts.end(), 0.0) <= kEnumerable) {
      enumerate(source);
      random.shuffle(source.listed);
    }
    sources_.push_back(std::move(source));
  }
}

void Candidates::enumerate(Source& source) const {
  for (std::size_t i = 0; i < source.counts.size(); ++i) {
    const int black = demand_.black.least + static_cast<int>(i);
    std::uint64_t choice = (std::uint64_t{1} << black) - 1;
    for (double left = source.counts[i]; left > 0.0; --left) {
      const std::uint64_t bits = blacken(all_white(turns_.size()), source.free, choice);
      if (turns_.inner_distance(bits) > 0) source.listed.push_back(turns_.canonical(bits));
      if (left > 1.0 && choice != 0) choice = next_combination(choice);
    }
  }
  std::sort(source.listed.begin(), source.listed.end());
  source.listed.erase(std::unique(source.listed.begin(), source.listed.end()), source.listed.end());
}

std::uint64_t Candidates::draw(const Source& source, Random& random) const {
  // Every admissible code is as likely as any other.
  double place = random.unit() * std::accumulate(source.counts.begin(), source.counts.end(), 0.0);
  std::size_t i = 0;
  while (i + 1 < source.counts.size() && place >= source.counts[i]) place -= source.counts[i++];
  std::vector<int> free = source.free;
  std::uint64_t bits = all_white(turns_.size());
  for (std::size_t k = 0; k < static_cast<std::size_t>(demand_.black.least) + i; ++k) {
    std::swap(free[k], free[k + random.below(free.size() - k)]);
    bits &= ~(std::uint64_t{1} << free[k]);
  }
  return bits;
}

std::vector<std::uint64_t> Candidates::with_inner_distance(int tau, Random& random) const {
  std::vector<std::uint64_t> all;
  for (const Source& source : sources_) {
    const std::size_t end = all.size() + kLimit;
    if (!source.listed.empty()) {
      for (const std::uint64_t bits : source.listed)
        if (all.size() < end && turns_.inner_distance(bits) >= tau) all.push_back(bits);
      continue;
    }
    for (std::size_t trial = 0; trial < kLimit; ++trial) {
      std::uint64_t bits = draw(source, random);
      if (raise_inner_distance(bits, source.free, tau, turns_, random))
        all.push_back(turns_.canonical(bits));
    }
  }
  return all;
}

Pool make_pool(const std::vector<std::uint64_t>& codes, const Demand& demand, const Turns& turns,
               const Symmetry& symmetry, int tau) {
  Pool pool;
  std::unordered_set<std::uint64_t> known;
  std::vector<std::uint64_t> orbit;
  for (const std::uint64_t code : codes) {
    orbit.assign(1, code);
    bool apart = true;
    for (std::uint64_t next = turns.canonical(symmetry(code)); next != code && apart;
         next = turns.canonical(symmetry(next))) {
      apart = orbit.size() < kLongestOrbit && turns.distance(code, next) >= tau;
      orbit.push_back(next);
    }
    if (!apart || !known.insert(*std::min_element(orbit.begin(), orbit.end())).second) continue;

    std::uint32_t admitted = 0;
    for (std::size_t g = 0; g < demand.groups.size(); ++g)
      if (std::all_of(orbit.begin(), orbit.end(), [&](std::uint64_t member) {
            return turns_to_fit(member, demand.groups[g], turns) >= 0;
          }))
        admitted |= std::uint32_t{1} << g;
    if (admitted == 0) continue;
    pool.admitted.push_back(admitted);
    pool.first.push_back(static_cast<std::uint32_t>(pool.members.size()));
    pool.members.insert(pool.members.end(), orbit.begin(), orbit.end());
  }
  pool.first.push_back(static_cast<std::uint32_t>(pool.members.size()));
  return pool;
}

}  // namespace harco
