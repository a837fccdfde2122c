#include "dictionary/search.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "dictionary/packing.hpp"
#include "dictionary/pool.hpp"
#include "dictionary/random.hpp"
#include "dictionary/symmetry.hpp"
#include "dictionary/turns.hpp"

namespace harco {
namespace {

constexpr double kSlice = 1e7;         // work units (distances) that the first symmetry gets
constexpr double kSliceGrowth = 2.0;   // from round to round: what works does so soon, or late
constexpr double kPoolWork = 50.0;     // what it costs to put one code into a pool
constexpr int kSlicesPerRound = 8;     // the last of which goes to the identity
constexpr int kPreview = 400;          // codes on which a symmetry is judged
constexpr int kSymmetriesLooked = 20;  // of which the best gets the slice

class Search {
 public:
  Search(const Demand& demand, Random& random, Monitor& monitor, int& reached)
      : demand_(demand),
        turns_(demand.cells),
        random_(random),
        candidates_(demand, turns_, random_),
        monitor_(monitor),
        reached_(reached) {}

  /// A dictionary without regard to distance.
  CodeGroups random_codes() {
    if (!quick(1))
      throw std::invalid_argument("dictionary: there are fewer than " +
                                  std::to_string(demand_.size()) +
                                  " different codes with these black and fixed cells");
    return best_;
  }

  CodeGroups run(int most_distance) {
    random_codes();
    // What needs no search, by bisection; then step by step.
    for (int too_much = most_distance + 1; too_much - reached_ > 1 && !monitor_.cut();) {
      const int tau = (reached_ + too_much) / 2;
      if (!quick(tau)) too_much = tau;
    }
    while (reached_ < most_distance && thorough(reached_ + 1)) continue;
    return best_;
  }

 private:
  void keep(const Packing& packing) {
    best_ = packing.codes();
    reached_ = dictionary_distance(joined(best_));
  }

  bool quick(int tau) {
    const auto codes = candidates_.with_inner_distance(tau, random_);
    const Pool pool = pool_of(codes, identity_, tau);
    Packing packing(pool, demand_, turns_, tau);
    if (!packing.fill(random_, monitor_)) return false;
    keep(packing);
    return true;
  }

  /// Searches for tau until it is found, or the work allowed is done.
  bool thorough(int tau) {
    const auto codes = candidates_.with_inner_distance(tau, random_);
    const Pool plain_pool = pool_of(codes, identity_, tau);
    Packing plain(plain_pool, demand_, turns_, tau);
    double work = kSlice;
    for (int slice = 1; monitor_.spend(0.0); ++slice) {
      if (slice % kSlicesPerRound == 0) {
        if (plain.run(work, random_, monitor_)) {
          keep(plain);
          return true;
        }
        work *= kSliceGrowth;
        continue;
      }
      const Pool pool = pool_of(codes, promising_symmetry(codes, tau), tau);
      Packing packing(pool, demand_, turns_, tau);
      if (!packing.run(work, random_, monitor_)) continue;
      keep(packing);
      return true;
    }
    return false;
  }

  Pool pool_of(const std::vector<std::uint64_t>& codes, const Symmetry& symmetry, int tau) {
    monitor_.spend(kPoolWork * static_cast<double>(codes.size()));
    return make_pool(codes, demand_, turns_, symmetry, tau);
  }

  /// Of some random symmetries, the one under which the most codes have images to choose along
  /// with them.
  Symmetry promising_symmetry(const std::vector<std::uint64_t>& codes, int tau) {
    std::vector<std::uint64_t> preview;
    for (int i = 0; i < kPreview && !codes.empty(); ++i)
      preview.push_back(codes[random_.below(codes.size())]);
    Symmetry best = identity_;
    std::size_t most = 0;
    for (int i = 0; i < kSymmetriesLooked; ++i) {
      const Symmetry symmetry = Symmetry::random(demand_, turns_, random_);
      const Pool pool = pool_of(preview, symmetry, tau);
      const std::size_t images = pool.members.size() - pool.size();
      if (images <= most) continue;
      most = images;
      best = symmetry;
    }
    return best;
  }

  const Demand& demand_;
  const Turns turns_;
  Random& random_;
  Candidates candidates_;
  Symmetry identity_{turns_.size()};
  Monitor& monitor_;
  int& reached_;
  CodeGroups best_;
};

}  // namespace

CodeGroups random_dictionary(const Demand& demand, Random& random, Monitor& monitor) {
  int reached = 0;
  return Search(demand, random, monitor, reached).random_codes();
}

CodeGroups search_dictionary(const Demand& demand, int most_distance, std::uint64_t seed,
                             Monitor& monitor, int& reached) {
  Random random(seed);
  return Search(demand, random, monitor, reached).run(most_distance);
}

}  // namespace harco
