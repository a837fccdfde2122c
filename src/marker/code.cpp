#include "harco/code.hpp"

#include <algorithm>
#include <bit>
#include <stdexcept>

namespace harco {
namespace {

std::uint64_t quarter_turn(const Code& code) {
  const int n = code.cells;
  std::uint64_t turned = 0;
  for (int row = 0; row < n; ++row)
    for (int column = 0; column < n; ++column) {
      // Turned clockwise, cell (row, column) shows what stood in (n-1-column, row).
      const std::uint64_t bit = (code.bits >> ((n - 1 - column) * n + row)) & 1U;
      turned |= bit << (row * n + column);
    }
  return turned;
}

}  // namespace

int Code::black_count() const { return size() - std::popcount(bits); }

Code parse_code(const std::string& text) {
  for (int n = Code::kMinCells; n <= Code::kMaxCells; ++n) {
    if (text.size() != static_cast<std::size_t>(n * n)) continue;
    Code code{n, 0};
    for (int i = 0; i < n * n; ++i) {
      const char c = text[static_cast<std::size_t>(i)];
      if (c != '0' && c != '1') throw std::invalid_argument("a code may hold only 0 and 1");
      code.bits |= std::uint64_t{c == '1'} << i;
    }
    return code;
  }
  throw std::invalid_argument("the length of a code must be the square of 3 … 8, not " +
                              std::to_string(text.size()));
}

std::string to_string(const Code& code) {
  std::string text(static_cast<std::size_t>(code.size()), '0');
  for (int i = 0; i < code.size(); ++i)
    if (code.white(i)) text[static_cast<std::size_t>(i)] = '1';
  return text;
}

Code rotated(const Code& code, int quarter_turns) {
  Code turned = code;
  for (int k = ((quarter_turns % 4) + 4) % 4; k > 0; --k) turned.bits = quarter_turn(turned);
  return turned;
}

int hamming(const Code& a, const Code& b) {
  if (a.cells != b.cells) throw std::invalid_argument("hamming: codes of different size");
  return std::popcount(a.bits ^ b.bits);
}

int distance(const Code& a, const Code& b) {
  int least = hamming(a, b);
  Code turned = b;
  for (int k = 1; k < 4; ++k) {
    turned.bits = quarter_turn(turned);
    least = std::min(least, hamming(a, turned));
  }
  return least;
}

int inner_distance(const Code& code) {
  const Code once = rotated(code, 1);
  // The turn by 270 degrees is as far as the one by 90: it compares the same two pictures.
  return std::min(hamming(code, once), hamming(code, rotated(once, 1)));
}

}  // namespace harco
