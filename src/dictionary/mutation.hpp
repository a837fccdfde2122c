// The paper's way to a dictionary: Algorithm 1, with the mutation of section 3.3.3.
//
// Where the paper slips, the corrected form is implemented and the comment says what was printed.
#pragma once

#include <vector>

#include "dictionary/demand.hpp"
#include "dictionary/monitor.hpp"
#include "dictionary/random.hpp"
#include "dictionary/turns.hpp"

namespace harco {

/// mean(w_q), Eq. 13: the share of ones in row q of a code.
double word_mean(const Code& code, int row);

/// rate(w_q), Eq. 14: the mean of word_mean over all codes of the dictionary.
double word_rate(const std::vector<Code>& dictionary, int row);

/// D(m_i, D_k), Eq. 12: the least distance of code i to the others of its dictionary and to its own
/// other turns, all codes given by their four turns. As printed the equation leaves the latter out,
/// against its text, and has nothing to take the minimum of if there is one code only.
int distance_to_dictionary(const std::vector<FourTurns>& dictionary, std::size_t i);

/// P_m(b), Eq. 15: a bit near the rate of its word mutates more often. `scale` is the factor that
/// the paper calls rho, like its counter of iterations.
double mutation_probability(bool bit, double rate, double scale);

/// P_m^C(b), Eq. 16: the nearer a child comes to its greatest black share alpha, the less its white
/// bits mutate. As printed the factor takes the share of ones, which exceeds alpha always, so that
/// nothing would ever mutate; and it would damp black bits as well, so that codes at the limit
/// froze.
double child_mutation_probability(double probability, bool bit, double black_share, double alpha);

/// Mutates a code bit by bit; bits in `fixed_white` stay, and so does a bit whose change would
/// leave `black`. Eq. 15 for parents, Eq. 16 for children, whose alpha is black.most of n².
void mutate(Code& code, const std::vector<double>& word_rates, std::uint64_t fixed_white,
            const BlackRange& black, bool child, Random& random);

/// Algorithm 1 for one dictionary, from tau = `first_distance` downwards. Its random codes respect
/// the limits from the start and differ from one another. Throws std::invalid_argument if there are
/// fewer codes than asked for. `reached` is kept up to date.
CodeGroups mutate_dictionary(const Demand& demand, bool children, int first_distance, double effort,
                             std::uint64_t seed, Monitor& monitor, int& reached);

}  // namespace harco
