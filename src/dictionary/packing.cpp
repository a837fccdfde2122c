#include "dictionary/packing.hpp"

#include <algorithm>
#include <cstdint>

namespace harco {
namespace {

constexpr int kForceEvery = 100;  // moves without progress between two forced ones
constexpr int kTabu = 5;          // moves for which an orbit stays out, and up to twice as many

// Bit counts by plain arithmetic, so that compilers turn the loop below into SIMD on any machine.
inline int count_bits(std::uint32_t x) {
  x -= (x >> 1) & 0x55555555U;
  x = (x & 0x33333333U) + ((x >> 2) & 0x33333333U);
  x = (x + (x >> 4)) & 0x0f0f0f0fU;
  x += x >> 8;
  x += x >> 16;
  return static_cast<int>(x & 0x3fU);
}
inline int count_bits(std::uint64_t x) {
  x -= (x >> 1) & 0x5555555555555555U;
  x = (x & 0x3333333333333333U) + ((x >> 2) & 0x3333333333333333U);
  x = (x + (x >> 4)) & 0x0f0f0f0f0f0f0f0fU;
  x += x >> 8;
  x += x >> 16;
  x += x >> 32;
  return static_cast<int>(x & 0x7fU);
}

/// hits[i] = 1 where a code is nearer than tau to one of four turns.
template <class Word>
void mark_conflicts(const std::vector<Word>& codes, const FourTurns& turns, int tau,
                    std::vector<std::uint8_t>& hits) {
  const auto a = static_cast<Word>(turns[0]);
  const auto b = static_cast<Word>(turns[1]);
  const auto c = static_cast<Word>(turns[2]);
  const auto d = static_cast<Word>(turns[3]);
  const Word* code = codes.data();
  std::uint8_t* hit = hits.data();
  const std::size_t size = codes.size();  // a byte pointer may alias the vector's own size
  const auto conflicts = [tau](Word difference) {
    return static_cast<unsigned>(count_bits(difference) < tau);
  };
  for (std::size_t i = 0; i < size; ++i) {
    const unsigned near =
        conflicts(static_cast<Word>(code[i] ^ a)) | conflicts(static_cast<Word>(code[i] ^ b)) |
        conflicts(static_cast<Word>(code[i] ^ c)) | conflicts(static_cast<Word>(code[i] ^ d));
    hit[i] = static_cast<std::uint8_t>(hit[i] | near);
  }
}

}  // namespace

struct Packing::State {
  State(const Pool& pool_in, const Demand& demand_in, const Turns& turns_in, int tau_in)
      : pool(pool_in),
        demand(demand_in),
        turns(turns_in),
        tau(tau_in),
        hits(pool.size()),
        conflicts(pool.size()),
        group_of(pool.size(), kOut),
        tabu_until(pool.size()),
        filled(demand.groups.size()) {
    // Distances to one member's orbit are those of all: the pool's symmetry changes none.
    for (std::size_t i = 0; i < pool.size(); ++i)
      if (turns.size() <= 32)
        narrow.push_back(static_cast<std::uint32_t>(pool.members[pool.first[i]]));
      else
        wide.push_back(pool.members[pool.first[i]]);
  }

  static constexpr int kOut = -1;

  /// A group that still needs codes and admits the orbit, if `leaving` were out; or kOut.
  int open_group(std::size_t orbit, std::size_t leaving) const {
    for (std::size_t g = 0; g < filled.size(); ++g) {
      const bool leaves = group_of[leaving] == static_cast<int>(g);
      const int count = filled[g] - (leaves ? pool.length(leaving) : 0);
      if (((pool.admitted[orbit] >> g) & 1U) != 0 && count < needed(g)) return static_cast<int>(g);
    }
    return kOut;
  }

  /// Codes that a group needs: the last one takes those that others have too many of.
  int needed(std::size_t group) const {
    int count = demand.groups[group].count;
    if (group + 1 == filled.size())
      for (std::size_t g = 0; g < group; ++g)
        count -= std::max(0, filled[g] - demand.groups[g].count);
    return count;
  }

  bool complete() const {
    for (std::size_t g = 0; g < filled.size(); ++g)
      if (filled[g] < needed(g)) return false;
    return true;
  }

  int missing() const {
    int count = 0;
    for (std::size_t g = 0; g < filled.size(); ++g) count += std::max(0, needed(g) - filled[g]);
    return count;
  }

  /// Adds `change` to the conflicts of all that are too near to the orbit. Returns the work.
  double count_conflicts(std::size_t orbit, int change) {
    std::fill(hits.begin(), hits.end(), std::uint8_t{0});
    for (std::uint32_t m = pool.first[orbit]; m < pool.first[orbit + 1]; ++m) {
      const auto views = turns.all(pool.members[m]);
      if (narrow.empty())
        mark_conflicts(wide, views, tau, hits);
      else
        mark_conflicts(narrow, views, tau, hits);
    }
    const std::size_t size = pool.size();
    for (std::size_t i = 0; i < size; ++i)
      conflicts[i] = static_cast<std::uint16_t>(conflicts[i] + change * hits[i]);
    const double work_per_orbit = narrow.empty() ? 8.0 : 4.0;  // a vector holds half as many
    return work_per_orbit * pool.length(orbit) * static_cast<double>(pool.size());
  }

  double insert(std::size_t orbit, int group) {
    chosen.push_back(orbit);
    group_of[orbit] = group;
    filled[static_cast<std::size_t>(group)] += pool.length(orbit);
    return count_conflicts(orbit, 1);
  }

  double remove(std::size_t orbit, Random& random) {
    chosen.erase(std::find(chosen.begin(), chosen.end(), orbit));
    filled[static_cast<std::size_t>(group_of[orbit])] -= pool.length(orbit);
    group_of[orbit] = kOut;
    tabu_until[orbit] = moves + kTabu + random.below(std::size_t{kTabu});
    return count_conflicts(orbit, -1);
  }

  bool conflict(std::size_t a, std::size_t b) const {
    for (std::uint32_t m = pool.first[a]; m < pool.first[a + 1]; ++m)
      if (turns.distance(pool.members[m], pool.members[pool.first[b]]) < tau) return true;
    return false;
  }

  /// Work done; 0 if no orbit without a conflict can be added. The first groups come first: they
  /// fix the most cells, so they have the least choice.
  double add(Random& random) {
    const std::size_t size = pool.size();
    const std::size_t start = random.below(size);
    for (std::size_t g = 0; g < filled.size(); ++g) {
      if (filled[g] >= needed(g)) continue;
      for (std::size_t k = 0; k < size; ++k) {
        const std::size_t i = start + k < size ? start + k : start + k - size;
        if (conflicts[i] == 0 && ((pool.admitted[i] >> g) & 1U) != 0)
          return insert(i, static_cast<int>(g));
      }
    }
    return 0.0;
  }

  /// Work done; 0 if no orbit with a single conflict can take the other's place.
  double exchange(Random& random) {
    const std::size_t size = pool.size();
    const std::size_t start = random.below(size);
    for (std::size_t k = 0; k < size; ++k) {
      const std::size_t i = start + k < size ? start + k : start + k - size;
      if (conflicts[i] != 1 || group_of[i] != kOut || tabu_until[i] > moves) continue;
      const std::size_t other = *std::find_if(chosen.begin(), chosen.end(),
                                              [&](std::size_t c) { return conflict(c, i); });
      const int group = open_group(i, other);
      if (group == kOut) continue;
      const double work = remove(other, random);
      return work + insert(i, group);
    }
    return 0.0;
  }

  /// Puts a random orbit in and takes out what conflicts with it. Returns the work.
  double force(Random& random) {
    const std::size_t orbit = random.below(pool.size());
    if (group_of[orbit] != kOut) return 1.0;
    std::vector<std::size_t> out;
    for (const std::size_t c : chosen)
      if (conflict(c, orbit)) out.push_back(c);
    double work = static_cast<double>(4 * chosen.size());
    for (const std::size_t c : out) work += remove(c, random);
    const int group = open_group(orbit, orbit);
    if (group != kOut) work += insert(orbit, group);
    return work;
  }

  const Pool& pool;
  const Demand& demand;
  const Turns& turns;
  int tau;
  std::vector<std::uint32_t> narrow;     ///< first members; either these
  std::vector<std::uint64_t> wide;       ///< or these
  std::vector<std::uint8_t> hits;        ///< scratch
  std::vector<std::uint16_t> conflicts;  ///< with how many chosen orbits
  std::vector<int> group_of;             ///< kOut if not chosen
  std::vector<std::uint64_t> tabu_until;
  std::vector<int> filled;  ///< codes in each group
  std::vector<std::size_t> chosen;
  std::uint64_t moves = 0;
};

Packing::Packing(const Pool& pool, const Demand& demand, const Turns& turns, int tau)
    : state_(std::make_unique<State>(pool, demand, turns, tau)) {}
Packing::~Packing() = default;

bool Packing::fill(Random& random, Monitor& monitor) {
  if (state_->pool.size() == 0) return false;
  while (!state_->complete()) {
    const double work = state_->add(random);
    if (work == 0.0) return false;
    monitor.count_iteration();
    monitor.spend(work);
  }
  return true;
}

bool Packing::run(double work, Random& random, Monitor& monitor) {
  State& state = *state_;
  if (state.pool.size() == 0) return false;
  int fewest_missing = state.missing();
  int fruitless = 0;
  while (!state.complete()) {
    ++state.moves;
    monitor.count_iteration();
    double done = state.add(random);
    if (done == 0.0 && ++fruitless % kForceEvery != 0) done = state.exchange(random);
    if (done == 0.0) done = state.force(random);
    if (state.missing() < fewest_missing) {
      fewest_missing = state.missing();
      fruitless = 0;
    }
    work -= done;
    if (!monitor.spend(done) || work <= 0.0) return state.complete();
  }
  return true;
}

CodeGroups Packing::codes() const {
  const State& state = *state_;
  CodeGroups groups(state.demand.groups.size());
  const auto put = [&](std::uint64_t bits, std::size_t g) {
    const CodeGroup& group = state.demand.groups[g];
    const int k = turns_to_fit(bits, group, state.turns);
    groups[g].push_back({state.demand.cells, state.turns.all(bits)[static_cast<std::size_t>(k)]});
  };
  const std::size_t last = groups.size() - 1;
  for (const std::size_t orbit : state.chosen) {
    const auto g = static_cast<std::size_t>(state.group_of[orbit]);
    for (std::uint32_t m = state.pool.first[orbit]; m < state.pool.first[orbit + 1]; ++m) {
      const bool full = static_cast<int>(groups[g].size()) >= state.demand.groups[g].count;
      put(state.pool.members[m], full ? last : g);
    }
  }
  groups[last].resize(static_cast<std::size_t>(state.demand.groups[last].count));
  return groups;
}

}  // namespace harco
