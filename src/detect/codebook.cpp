#include "detect/codebook.hpp"

#include <algorithm>
#include <bit>

namespace harco::detect {

Codebook::Codebook(int cells, const std::vector<PlacedMarker>& placed, bool children)
    : cells_(cells) {
  std::vector<Code> codes;
  for (std::size_t i = 0; i < placed.size(); ++i) {
    const PlacedMarker& marker = placed[i];
    if (marker.code.cells != cells || (marker.layer > 1) != children) continue;
    codes.push_back(marker.code);
    for (int turns = 0; turns < 4; ++turns) {
      exact_.emplace(rotated(marker.code, turns).bits, entries_.size());
      entries_.push_back({rotated(marker.code, turns).bits, static_cast<int>(i), turns});
    }
  }
  int least = cells * cells;
  for (const Code& code : codes) least = std::min(least, inner_distance(code));
  // Entry 0 of each group of four is the upright code; one side of a pair needs no other turns.
  for (std::size_t i = 0; i < entries_.size(); i += 4)
    for (std::size_t j = 0; j < i; ++j)
      least = std::min(least, std::popcount(entries_[i].bits ^ entries_[j].bits));
  safe_errors_ = std::max(0, (least - 1) / 2);
}

void Codebook::find(std::uint64_t bits, int max_errors, std::vector<Match>& matches) const {
  if (max_errors <= 0) {
    if (const auto found = exact_.find(bits); found != exact_.end()) {
      const Entry& entry = entries_[found->second];
      matches.push_back({entry.placed, entry.turns, 0});
    }
    return;
  }
  for (const Entry& entry : entries_) {
    const int errors = std::popcount(bits ^ entry.bits);
    if (errors <= max_errors) matches.push_back({entry.placed, entry.turns, errors});
  }
}

}  // namespace harco::detect
