#include "harco/dictionary.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <set>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "dictionary/bounds.hpp"
#include "dictionary/mutation.hpp"
#include "dictionary/symmetry.hpp"

namespace harco {
namespace {

/// tau by the definition alone, from code.hpp's plain functions.
int tau_by_definition(const std::vector<Code>& codes) {
  int least = 64;
  for (std::size_t i = 0; i < codes.size(); ++i) {
    least = std::min(least, inner_distance(codes[i]));
    for (std::size_t j = 0; j < i; ++j) least = std::min(least, distance(codes[i], codes[j]));
  }
  return least;
}

std::vector<Code> all_children(const Dictionary& dictionary) {
  std::vector<Code> all;
  for (const auto& layer : dictionary.children) all.insert(all.end(), layer.begin(), layer.end());
  return all;
}

void expect_white(const std::vector<Code>& codes, const std::vector<int>& cells) {
  for (const Code& code : codes)
    for (const int cell : cells) EXPECT_TRUE(code.white(cell)) << to_string(code) << " " << cell;
}

void expect_black_within(const std::vector<Code>& codes, const BlackRange& black) {
  for (const Code& code : codes) {
    EXPECT_GE(code.black_count(), black.least);
    EXPECT_LE(code.black_count(), black.most);
  }
}

/// Everything that a dictionary promises, checked from scratch.
void expect_sound(const Dictionary& dictionary, const DictionaryOptions& options) {
  const std::size_t layers = options.child_cells.size();
  ASSERT_EQ(dictionary.children.size(), layers);
  std::size_t count = static_cast<std::size_t>(options.parents);
  EXPECT_EQ(dictionary.parents.size(), count);
  expect_black_within(dictionary.parents,
                      options.parent_black.value_or(default_parent_black(options.cells)));
  if (layers > 0) expect_white(dictionary.parents, options.child_cells[0]);
  for (std::size_t layer = 0; layer < layers; ++layer) {
    count *= options.child_cells[layer].size();
    EXPECT_EQ(dictionary.children[layer].size(), count);
    expect_white(dictionary.children[layer], options.white_cells);
    if (layer + 1 < layers)
      expect_white(dictionary.children[layer], options.child_cells[layer + 1]);
  }
  expect_black_within(all_children(dictionary),
                      options.child_black.value_or(default_child_black(options.cells)));
  EXPECT_EQ(dictionary.parent_distance, tau_by_definition(dictionary.parents));
  EXPECT_GE(dictionary.parent_distance, 1);
  EXPECT_LE(dictionary.parent_distance, dictionary.parent_bound->distance);
  if (layers == 0) return;
  EXPECT_EQ(dictionary.child_distance, tau_by_definition(all_children(dictionary)));
  EXPECT_GE(dictionary.child_distance, 1);
  EXPECT_LE(dictionary.child_distance, dictionary.child_bound->distance);
}

DictionaryOptions tree(int cells, int parents, int layers) {
  DictionaryOptions options;
  options.cells = cells;
  options.parents = parents;
  options.child_cells.assign(static_cast<std::size_t>(layers - 1), quincunx(cells));
  return options;
}

std::string complaint(const DictionaryOptions& options) {
  try {
    generate_dictionary(options);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(ChildCells, QuincunxAndCheckerboard) {
  EXPECT_EQ(quincunx(5), (std::vector<int>{0, 4, 12, 20, 24}));
  EXPECT_EQ(quincunx(4), (std::vector<int>{0, 3, 5, 12, 15}));
  EXPECT_EQ(checkerboard(4), (std::vector<int>{0, 2, 5, 7, 8, 10, 13, 15}));
  EXPECT_EQ(checkerboard(5).size(), 13U);
  EXPECT_THROW(quincunx(3), std::invalid_argument);
  EXPECT_THROW(checkerboard(9), std::invalid_argument);
}

TEST(ChildCells, NoneShareAnEdge) {
  for (int n = 4; n <= 8; ++n)
    for (const auto& cells : {quincunx(n), checkerboard(n)})
      for (const int a : cells)
        for (const int b : cells)
          EXPECT_NE(std::abs(a / n - b / n) + std::abs(a % n - b % n), 1) << n;
}

TEST(BlackCells, DefaultsFollowThePapersShare) {
  EXPECT_EQ(default_child_black(5).least, 5);
  EXPECT_EQ(default_child_black(5).most, 6);  // the paper's alpha: 6 of 49
  EXPECT_EQ(default_child_black(4).most, 4);  // 6/49 of 36 is 4.4
  EXPECT_EQ(default_child_black(4).least, 4);
  EXPECT_EQ(default_child_black(8).most, 12);  // 6/49 of 100 is 12.2
}

// Rows 100, 110, 000.
TEST(Mutation, MeanOfAWordEquation13) {
  const Code code = parse_code("100110000");
  EXPECT_DOUBLE_EQ(word_mean(code, 0), 1.0 / 3.0);
  EXPECT_DOUBLE_EQ(word_mean(code, 1), 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(word_mean(code, 2), 0.0);
}

TEST(Mutation, RateOfAWordEquation14) {
  const std::vector<Code> dictionary{parse_code("100110000"), parse_code("111000000")};
  EXPECT_DOUBLE_EQ(word_rate(dictionary, 0), 2.0 / 3.0);  // (1/3 + 1) / 2
  EXPECT_DOUBLE_EQ(word_rate(dictionary, 1), 1.0 / 3.0);  // (2/3 + 0) / 2
  EXPECT_DOUBLE_EQ(word_rate(dictionary, 2), 0.0);
}

TEST(Mutation, ProbabilityEquation15) {
  EXPECT_DOUBLE_EQ(mutation_probability(true, 0.7, 0.5), 0.35);   // 0.5 (1 - |1 - 0.7|)
  EXPECT_DOUBLE_EQ(mutation_probability(false, 0.7, 0.5), 0.15);  // 0.5 (1 - |0 - 0.7|)
}

TEST(Mutation, ProbabilityOfAChildEquation16WithErratum6) {
  // alpha 6/25, 3 of 25 black: the factor is (6 - 3) / 6 = 1/2.
  EXPECT_DOUBLE_EQ(child_mutation_probability(0.4, true, 3.0 / 25.0, 6.0 / 25.0), 0.2);
  EXPECT_DOUBLE_EQ(child_mutation_probability(0.4, true, 6.0 / 25.0, 6.0 / 25.0), 0.0);
  EXPECT_DOUBLE_EQ(child_mutation_probability(0.4, true, 7.0 / 25.0, 6.0 / 25.0), 0.0);
  // From black to white is never damped, or codes at the limit froze.
  EXPECT_DOUBLE_EQ(child_mutation_probability(0.4, false, 6.0 / 25.0, 6.0 / 25.0), 0.4);
}

TEST(Mutation, DistanceToTheDictionaryEquation12WithErratum8) {
  const Turns turns(3);
  const std::vector<FourTurns> one{turns.all(parse_code("111000000").bits)};
  // A single code: its inner distance. 111000000 against 001001001 differs in 4 cells.
  EXPECT_EQ(distance_to_dictionary(one, 0), 4);
  // 110001001 differs from its turn 001001001 in cells 0, 1 and 2.
  const std::vector<FourTurns> two{one[0], turns.all(parse_code("110001001").bits)};
  EXPECT_EQ(distance_to_dictionary(two, 0), 3);
}

TEST(Mutation, LeavesFixedCellsAndLimitsAlone) {
  Random random(3);
  const BlackRange black{4, 6};
  const std::uint64_t fixed = parse_code("1000100000001000000010001").bits;
  Code code = parse_code("1000100111111111111111111");  // black: 1, 2, 3, 5 and 6
  std::set<std::uint64_t> met;
  for (int i = 0; i < 2000; ++i) {
    mutate(code, std::vector<double>(5, 0.8), fixed, black, true, random);
    met.insert(code.bits);
    ASSERT_EQ(code.bits & fixed, fixed);
    ASSERT_GE(code.black_count(), black.least);
    ASSERT_LE(code.black_count(), black.most);
  }
  EXPECT_GT(met.size(), 100U);
}

TEST(Symmetry, ChangesNoDistance) {
  Random random(5);
  for (int n = 4; n <= 8; ++n) {
    const Turns turns(n);
    const Demand demand{n, {4, 6}, {{5, 1}, {10, 0}}};
    const std::uint64_t mask = ~std::uint64_t{0} >> (64 - n * n);
    for (int trial = 0; trial < 50; ++trial) {
      const Symmetry symmetry = Symmetry::random(demand, turns, random);
      const Code a{n, (random.below(std::size_t{1} << 62) * 0x9e3779b97f4a7c15) & mask};
      const Code b{n, (random.below(std::size_t{1} << 62) * 0x9e3779b97f4a7c15) & mask};
      const Code a2{n, symmetry(a.bits)};
      const Code b2{n, symmetry(b.bits)};
      EXPECT_EQ(distance(a, b), distance(a2, b2));
      EXPECT_EQ(inner_distance(a), inner_distance(a2));
    }
  }
}

TEST(Bounds, KnownValues) {
  EXPECT_EQ(johnson_bound(24, 8, 4), 6.0);    // disjoint quadruples
  EXPECT_EQ(johnson_bound(26, 8, 6), 130.0);  // met by the inversive plane of order 5
  EXPECT_EQ(johnson_bound(25, 8, 5), 30.0);   // met by the lines of AG(2, 5)
  EXPECT_EQ(johnson_bound(25, 7, BlackRange{5, 6}), 130.0);
  EXPECT_EQ(plotkin_bound(11, 6), 12.0);           // a Hadamard code
  EXPECT_EQ(sphere_packing_bound(23, 7), 4096.0);  // the perfect Golay code
}

TEST(Bounds, GreatestInnerDistanceAgreesWithEveryCodeOfFourByFour) {
  for (const std::uint64_t white : {std::uint64_t{0}, std::uint64_t{0x9029}})
    for (int black = 1; black < 16; ++black) {
      int greatest = -1;
      for (std::uint64_t bits = 0; bits < 65536; ++bits)
        if (16 - std::popcount(bits) == black && (bits & white) == white)
          greatest = std::max(greatest, inner_distance({4, bits}));
      EXPECT_EQ(greatest_inner_distance(4, white, {black, black}), greatest) << black;
    }
}

TEST(Dictionary, DistanceOfASet) {
  EXPECT_EQ(dictionary_distance({}), 0);
  EXPECT_EQ(dictionary_distance({parse_code("111000000")}), 4);
  EXPECT_EQ(dictionary_distance({parse_code("111000000"), parse_code("001001001")}), 0);
  EXPECT_THROW(dictionary_distance({parse_code("111000000"), parse_code("1110000000000000")}),
               std::invalid_argument);
}

TEST(Dictionary, ThreeLayersReachDistance7) {
  DictionaryOptions options = tree(5, 1, 3);
  options.child_distance = 7;
  const Dictionary dictionary = generate_dictionary(options);
  expect_sound(dictionary, options);
  EXPECT_EQ(dictionary.child_distance, 7);
  EXPECT_EQ(dictionary.parent_distance, 12);
  EXPECT_FALSE(dictionary.cut_short);
}

TEST(Dictionary, TwoParentsReachDistance6WhichIsTheMostPossible) {
  const DictionaryOptions options = tree(5, 2, 3);
  const Dictionary dictionary = generate_dictionary(options);
  expect_sound(dictionary, options);
  EXPECT_EQ(dictionary.child_distance, 6);
  EXPECT_EQ(dictionary.child_bound->distance, 6);
}

TEST(Dictionary, ThousandChildrenReachDistance4) {
  DictionaryOptions options = tree(5, 200, 2);
  options.parent_distance = 3;
  const Dictionary dictionary = generate_dictionary(options);
  expect_sound(dictionary, options);
  EXPECT_EQ(all_children(dictionary).size(), 1000U);
  EXPECT_EQ(dictionary.child_distance, 4);
}

TEST(Dictionary, ParentsReachTheirDistances) {
  for (const auto& [count, tau] : {std::pair{1, 12}, {10, 8}, {50, 6}, {250, 5}}) {
    DictionaryOptions options = tree(5, count, 2);
    options.parent_distance = tau;
    options.child_distance = 1;
    const Dictionary dictionary = generate_dictionary(options);
    expect_sound(dictionary, options);
    EXPECT_GE(dictionary.parent_distance, tau);
  }
}

TEST(Dictionary, EverySizeOfCodeByBothMethods) {
  for (int n = 4; n <= 8; ++n)
    for (const auto method : {DictionaryMethod::search, DictionaryMethod::mutation}) {
      DictionaryOptions options = tree(n, 2, 3);
      options.method = method;
      options.effort = 0.02;
      expect_sound(generate_dictionary(options), options);
    }
}

TEST(Dictionary, SameSeedSameResultOtherSeedOther) {
  for (const auto method : {DictionaryMethod::search, DictionaryMethod::mutation}) {
    DictionaryOptions options = tree(5, 2, 2);
    options.method = method;
    options.effort = 0.02;
    const Dictionary a = generate_dictionary(options);
    const Dictionary b = generate_dictionary(options);
    EXPECT_EQ(a.parents, b.parents);
    EXPECT_EQ(a.children, b.children);
    EXPECT_EQ(a.iterations, b.iterations);
    options.seed = 2;
    EXPECT_NE(generate_dictionary(options).children, a.children);
  }
}

TEST(Dictionary, OtherTreesBlackCellsAndCellsKeptWhite) {
  DictionaryOptions options;
  options.child_cells = {{7, 11}, {1, 2, 3}};  // not the same when turned
  options.white_cells = {12};
  options.child_black = BlackRange{4, 8};
  options.parent_black = BlackRange{6, 9};
  options.parents = 3;
  options.effort = 0.02;
  expect_sound(generate_dictionary(options), options);
}

TEST(Dictionary, ParentsAlone) {
  DictionaryOptions options;
  options.parents = 20;
  options.effort = 0.1;
  const Dictionary dictionary = generate_dictionary(options);
  expect_sound(dictionary, options);
  EXPECT_EQ(dictionary.child_distance, 0);
  EXPECT_FALSE(dictionary.child_bound.has_value());
  EXPECT_EQ(build_markers(dictionary, 1.0).layers(), 1);
}

TEST(Dictionary, StopsWhenToldAndKeepsTheBest) {
  for (const auto method : {DictionaryMethod::search, DictionaryMethod::mutation}) {
    DictionaryOptions options = tree(5, 50, 3);
    options.method = method;
    const Dictionary dictionary =
        generate_dictionary(options, [](const DictionaryProgress&) { return false; });
    EXPECT_TRUE(dictionary.cut_short);
    expect_sound(dictionary, options);
    options.time_limit_s = 1e-9;
    const Dictionary timed = generate_dictionary(options);
    EXPECT_TRUE(timed.cut_short);
    expect_sound(timed, options);
  }
}

TEST(Dictionary, ProgressGrows) {
  DictionaryOptions options = tree(5, 1, 3);
  options.effort = 0.3;
  options.child_distance = 8;
  double last = 0.0;
  int calls = 0;
  generate_dictionary(options, [&](const DictionaryProgress& progress) {
    EXPECT_GE(progress.share, last);
    EXPECT_LE(progress.share, 1.0);
    last = progress.share;
    ++calls;
    return true;
  });
  EXPECT_GE(calls, 2);
}

TEST(Dictionary, GivenParentsCarryChildrenInTheirWhiteCells) {
  DictionaryOptions options;
  options.given_parents = {parse_code("1011001011010010"), parse_code("0110100110011111")};
  options.child_cells = {checkerboard(4), quincunx(5)};
  options.effort = 0.02;
  const Dictionary dictionary = generate_dictionary(options);
  EXPECT_EQ(dictionary.parents, options.given_parents);
  EXPECT_FALSE(dictionary.parent_bound.has_value());
  const MarkerSet markers = build_markers(dictionary, 0.5);
  for (const Parent& parent : markers.parents) {
    std::set<int> expected;
    for (const int cell : checkerboard(4))
      if (parent.marker.code.white(cell)) expected.insert(cell);
    std::set<int> found;
    for (const Marker& child : parent.marker.children) {
      found.insert(child.cell);
      EXPECT_EQ(child.code.cells, 5);
      EXPECT_EQ(child.children.size(), 5U);
    }
    EXPECT_EQ(found, expected);
  }
  options.given_child_cells = {{0}, {}};
  const MarkerSet chosen = build_markers(generate_dictionary(options), 0.5);
  ASSERT_EQ(chosen.parents[0].marker.children.size(), 1U);
  EXPECT_EQ(chosen.parents[0].marker.children[0].cell, 0);
  EXPECT_TRUE(chosen.parents[1].marker.children.empty());
}

TEST(Dictionary, BuildsTheTreeLayerByLayer) {
  DictionaryOptions options = tree(5, 2, 3);
  options.effort = 0.02;
  const Dictionary dictionary = generate_dictionary(options);
  const MarkerSet markers = build_markers(dictionary, 1.6, kPaperLine);
  ASSERT_EQ(markers.parents.size(), 2U);
  EXPECT_EQ(markers.layers(), 3);
  EXPECT_EQ(markers.cells, 5);
  EXPECT_DOUBLE_EQ(markers.line.inside, kPaperLine.inside);
  const Marker& second = markers.parents[1].marker;
  EXPECT_EQ(second.id, 1);
  EXPECT_EQ(second.code, dictionary.parents[1]);
  const Marker& child = second.children[2];
  EXPECT_EQ(child.cell, 12);
  EXPECT_EQ(child.id, 7);  // five of the first parent, two before it
  EXPECT_EQ(child.code, dictionary.children[0][7]);
  const Marker& leaf = child.children[4];
  EXPECT_EQ(leaf.id, 10 + 7 * 5 + 4);
  EXPECT_EQ(leaf.code, dictionary.children[1][7 * 5 + 4]);
}

TEST(Dictionary, RefusesToBuildWhatDoesNotFit) {
  DictionaryOptions options = tree(5, 1, 2);
  options.effort = 0.02;
  const Dictionary sound = generate_dictionary(options);
  EXPECT_THROW(build_markers(sound, 0.0), std::invalid_argument);
  EXPECT_THROW(build_markers(sound, std::nan("")), std::invalid_argument);
  Dictionary few = sound;
  few.children[0].pop_back();
  EXPECT_THROW(build_markers(few, 1.0), std::invalid_argument);
  Dictionary many = sound;
  many.child_cells[0].pop_back();
  EXPECT_THROW(build_markers(many, 1.0), std::invalid_argument);
  Dictionary layers = sound;
  layers.child_cells.clear();
  EXPECT_THROW(build_markers(layers, 1.0), std::invalid_argument);
  EXPECT_THROW(build_markers(Dictionary{}, 1.0), std::invalid_argument);
}

TEST(Dictionary, SaysWhatIsWrongWithTheOptions) {
  const auto expect = [](const std::string& part, auto&& change) {
    DictionaryOptions options = tree(5, 1, 3);
    change(options);
    const std::string said = complaint(options);
    EXPECT_NE(said.find(part), std::string::npos) << part << ": '" << said << "'";
  };
  expect("cells must be 4", [](auto& o) { o.cells = 3; });
  expect("cells must be 4", [](auto& o) { o.cells = 9; });
  expect("parents must be at least 1", [](auto& o) { o.parents = 0; });
  expect("more than 20000 parents", [](auto& o) { o.parents = 20001; });
  expect("no cell 25", [](auto& o) { o.child_cells[1] = {25}; });
  expect("no cell -1", [](auto& o) { o.child_cells[0] = {-1}; });
  expect("stands twice", [](auto& o) { o.child_cells[0] = {3, 3}; });
  expect("list is empty", [](auto& o) { o.child_cells[1] = {}; });
  expect("at most 8 layers", [](auto& o) { o.child_cells.resize(8, {0}); });
  expect("more than 20000 children", [](auto& o) { o.child_cells.resize(7, quincunx(5)); });
  expect("black cells of children", [](auto& o) { o.child_black = BlackRange{6, 5}; });
  expect("black cells of children", [](auto& o) { o.child_black = BlackRange{0, 5}; });
  expect("black cells of parents", [](auto& o) { o.parent_black = BlackRange{5, 25}; });
  expect("leave only 12", [](auto& o) {
    o.child_cells[1] = checkerboard(5);
    o.child_black = BlackRange{13, 14};
  });
  expect("look the same when turned", [](auto& o) {
    o.child_cells = {{12}};
    o.parent_black = BlackRange{24, 24};
  });
  expect("fewer than", [](auto& o) {
    o.child_cells = {checkerboard(5)};
    o.parents = 20;
    o.child_black = BlackRange{1, 1};
  });
  expect("must be 1", [](auto& o) { o.child_distance = 0; });
  expect("must be 1", [](auto& o) { o.parent_distance = 26; });
  expect("is impossible: the inner distance allows 12", [](auto& o) { o.parent_distance = 13; });
  expect("is impossible: the Johnson bound", [](auto& o) { o.child_distance = 9; });
  expect("effort", [](auto& o) { o.effort = 0.0; });
  expect("effort", [](auto& o) { o.effort = std::nan(""); });
  expect("time_limit_s", [](auto& o) { o.time_limit_s = -1.0; });
  expect("time_limit_s", [](auto& o) { o.time_limit_s = std::nan(""); });
  expect("same n", [](auto& o) { o.given_parents = {Code{4, 1}, Code{5, 1}}; });
  expect("a list for every", [](auto& o) {
    o.given_parents = {Code{5, 1}};
    o.given_child_cells = {{0}, {0}};
  });
  expect("cell 1 is black", [](auto& o) {
    o.given_parents = {Code{5, 1}};
    o.given_child_cells = {{0, 1}};
  });
  expect("no child cell is white", [](auto& o) { o.given_parents = {Code{5, 2}}; });
  expect("no cell 99", [](auto& o) { o.white_cells = {99}; });
}

}  // namespace
}  // namespace harco
