// Where regions begin, for one row of a map of bits.
#pragma once

#include <cstdint>

namespace harco::detect::kernels {

/// A row of bits and what is known of its pixels; bit 0 of a word is the leftmost. The word behind
/// the last one is read as well.
struct TopsRow {
  const std::uint64_t* here;   ///< ones are the region's; word -1 is read as well
  const std::uint64_t* above;  ///< likewise, of the row above
  std::uint64_t flip;          ///< all ones if it is zeros that are the region's, in both
  const std::uint64_t* steep;
  const std::uint64_t* ways;
  int words;
};

/// What begins in a row.
struct Tops {
  std::uint64_t* ends;  ///< as many words as the row
  std::uint64_t* open;  ///< likewise
  std::uint64_t* some;  ///< a bit for each word
};

/// Finds stretches of a region's pixels with none of them above, and among them one that is set in
/// both `steep` and `ways`. Of those that begin and end within a word, the bit behind the end is
/// set in `ends`. Of a word whose last bit belongs to a stretch that begins in the word and may be
/// one, by that word and the next, all bits are set in `open`, else none. Where anything is set in
/// either, it is in `some`.
void region_tops(const TopsRow& row, const Tops& tops);

/// The same in plain C++.
void region_tops_scalar(const TopsRow& row, const Tops& tops);

}  // namespace harco::detect::kernels
