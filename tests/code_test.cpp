#include "harco/code.hpp"

#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

namespace harco {
namespace {

TEST(Code, ReadsRowFirstWithOneAsWhite) {
  const Code code = parse_code("100010001");
  EXPECT_EQ(code.cells, 3);
  EXPECT_TRUE(code.white(0));
  EXPECT_FALSE(code.white(1));
  EXPECT_TRUE(code.white(4));
  EXPECT_EQ(code.black_count(), 6);
  EXPECT_EQ(to_string(code), "100010001");
}

TEST(Code, RefusesWhatIsNoCode) {
  for (const char* text : {"", "1010", "10101010x", "1111111111"})
    EXPECT_THROW(parse_code(text), std::invalid_argument) << text;
}

TEST(Code, TurnsClockwise) {
  // The top row moves to the right column.
  EXPECT_EQ(to_string(rotated(parse_code("111000000"), 1)), "001001001");
  EXPECT_EQ(to_string(rotated(parse_code("110000000"), 1)), "001001000");
  EXPECT_EQ(rotated(parse_code("110000000"), 4), parse_code("110000000"));
  EXPECT_EQ(rotated(parse_code("110000000"), -1), rotated(parse_code("110000000"), 3));
}

TEST(Code, DistanceOfEquation11ByHand) {
  EXPECT_EQ(hamming(parse_code("101000000"), parse_code("111111111")), 7);
  // b is a turned by 90 degrees: distance 0 though 4 cells differ.
  const Code a = parse_code("111000000");
  const Code b = parse_code("001001001");
  EXPECT_EQ(hamming(a, b), 4);
  EXPECT_EQ(distance(a, b), 0);
  // 111000000 against its turns 001001001 (4 differ), 000000111 (6), 100100100 (4).
  EXPECT_EQ(inner_distance(a), 4);
  EXPECT_EQ(inner_distance(parse_code("010111010")), 0);
}

TEST(Code, DistanceIsSymmetricAndBlindToTurns) {
  std::mt19937_64 random(7);
  for (int trial = 0; trial < 1000; ++trial) {
    const int n = 3 + trial % 6;
    const std::uint64_t mask = n == 8 ? ~std::uint64_t{0} : (std::uint64_t{1} << (n * n)) - 1;
    const Code a{n, random() & mask};
    const Code b{n, random() & mask};
    EXPECT_EQ(distance(a, b), distance(b, a));
    const int turns = static_cast<int>(random() % 4);
    EXPECT_EQ(distance(a, rotated(b, turns)), distance(a, b));
    EXPECT_EQ(inner_distance(rotated(a, turns)), inner_distance(a));
    EXPECT_EQ(rotated(rotated(a, turns), 4 - turns), a);
    EXPECT_EQ(parse_code(to_string(a)), a);
  }
}

}  // namespace
}  // namespace harco
