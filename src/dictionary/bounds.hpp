// What no dictionary can exceed.
#pragma once

#include "dictionary/demand.hpp"

namespace harco {

/// The greatest inner distance of any code with these cells fixed to white and so many black ones:
/// exact. 0 if every such code looks the same when turned, -1 if there is none.
int greatest_inner_distance(int cells, std::uint64_t white, const BlackRange& black);

/// Bounds on the number of binary words with pairwise Hamming distance >= d. None is tight in
/// general; all are capped at 1e18.
/// Johnson: words of length n with w ones each; his recursion down to trivial cases.
double johnson_bound(int n, int d, int w);
/// Words of length n with `ones.least` to `ones.most` ones, by Johnson's bound on each weight, and
/// on both at once, a parity bit added, where there are two.
double johnson_bound(int n, int d, const BlackRange& ones);
/// Plotkin: any words, for 2d > n, and by A(n, d) <= 2 A(n-1, d) below that.
double plotkin_bound(int n, int d);
/// Hamming: balls around any words don't overlap.
double sphere_packing_bound(int n, int d);

/// The greatest tau that none of the bounds rules out for a dictionary. A code with inner
/// distance >= tau counts as four words: its turns.
DistanceBound distance_bound(const Demand& demand);

}  // namespace harco
