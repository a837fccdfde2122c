#include "dictionary/mutation.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "dictionary/search.hpp"

namespace harco {
namespace {

constexpr double kScale = 0.2;  // of Eq. 15

std::vector<double> word_rates(const std::vector<Code>& dictionary) {
  std::vector<double> rates;
  for (int row = 0; row < dictionary.front().cells; ++row)
    rates.push_back(word_rate(dictionary, row));
  return rates;
}

int least_distance(const std::vector<FourTurns>& dictionary) {
  int least = distance_to_dictionary(dictionary, 0);
  for (std::size_t i = 1; i < dictionary.size(); ++i)
    least = std::min(least, distance_to_dictionary(dictionary, i));
  return least;
}

/// The codes of one row, group by group.
CodeGroups split(const std::vector<Code>& codes, const Demand& demand) {
  CodeGroups groups;
  auto next = codes.begin();
  for (const CodeGroup& group : demand.groups) {
    groups.emplace_back(next, next + group.count);
    next += group.count;
  }
  return groups;
}

/// N_loop: unproductive iterations before tau is lowered; fewer the longer one takes.
int loop_limit(std::size_t codes, double effort) {
  const double pairs = static_cast<double>(codes) * static_cast<double>(codes);
  return static_cast<int>(std::clamp(effort * 5e7 / pairs, 10.0, 1e4));
}

}  // namespace

double word_mean(const Code& code, int row) {
  int ones = 0;
  for (int k = 0; k < code.cells; ++k) ones += code.white(row * code.cells + k) ? 1 : 0;
  return static_cast<double>(ones) / code.cells;
}

double word_rate(const std::vector<Code>& dictionary, int row) {
  double sum = 0.0;
  for (const Code& code : dictionary) sum += word_mean(code, row);
  return sum / static_cast<double>(dictionary.size());
}

int distance_to_dictionary(const std::vector<FourTurns>& dictionary, std::size_t i) {
  const std::uint64_t code = dictionary[i][0];
  int least = std::numeric_limits<int>::max();
  for (std::size_t j = 0; j < dictionary.size(); ++j)
    for (std::size_t k = j == i ? 1 : 0; k < 4; ++k)
      least = std::min(least, std::popcount(code ^ dictionary[j][k]));
  return least;
}

double mutation_probability(bool bit, double rate, double scale) {
  return scale * (1.0 - std::abs((bit ? 1.0 : 0.0) - rate));
}

double child_mutation_probability(double probability, bool bit, double black_share, double alpha) {
  if (!bit) return probability;
  return std::max(0.0, (alpha - black_share) / alpha) * probability;
}

void mutate(Code& code, const std::vector<double>& word_rates, std::uint64_t fixed_white,
            const BlackRange& black, bool child, Random& random) {
  const double alpha = static_cast<double>(black.most) / code.size();
  for (int cell = 0; cell < code.size(); ++cell) {
    if (((fixed_white >> cell) & 1U) != 0) continue;
    const bool bit = code.white(cell);
    const int blacks = code.black_count();
    if (bit ? blacks >= black.most : blacks <= black.least) continue;
    const double rate = word_rates[static_cast<std::size_t>(cell / code.cells)];
    double probability = mutation_probability(bit, rate, kScale);
    if (child)
      probability = child_mutation_probability(probability, bit,
                                               static_cast<double>(blacks) / code.size(), alpha);
    if (random.unit() < probability) code.bits ^= std::uint64_t{1} << cell;
  }
}

CodeGroups mutate_dictionary(const Demand& demand, bool children, int first_distance, double effort,
                             std::uint64_t seed, Monitor& monitor, int& reached) {
  Random random(seed);
  const Turns turns(demand.cells);
  CodeGroups best = random_dictionary(demand, random, monitor);
  std::vector<Code> codes = joined(best);
  std::vector<FourTurns> turned;
  for (const Code& code : codes) turned.push_back(turns.all(code.bits));
  std::vector<std::uint64_t> fixed;
  for (const CodeGroup& group : demand.groups)
    fixed.insert(fixed.end(), static_cast<std::size_t>(group.count), group.white);
  reached = dictionary_distance(codes);

  const double work = 8.0 * static_cast<double>(codes.size() * codes.size());
  const int loops = loop_limit(codes.size(), effort);
  for (int tau = first_distance; reached < tau; --tau)
    for (int loop = 0; loop < loops && reached < tau; ++loop) {
      for (std::size_t i = 0; i < codes.size(); ++i) {
        if (distance_to_dictionary(turned, i) >= tau) continue;
        mutate(codes[i], word_rates(codes), fixed[i], demand.black, children, random);
        turned[i] = turns.all(codes[i].bits);
      }
      const int now = least_distance(turned);  // T of Algorithm 1
      if (now > reached) {
        reached = now;
        best = split(codes, demand);
      }
      monitor.count_iteration();
      monitor.spend(work);
      if (monitor.cut()) return best;
    }
  return best;
}

}  // namespace harco
