// Prints the distances that dictionaries of typical sizes reach, with what bounds allow.
//
//   dictionary_table [effort [seed]]
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <optional>
#include <string>
#include <vector>

#include "harco/dictionary.hpp"

namespace {

struct Row {
  std::string name;
  harco::DictionaryOptions options;
};

harco::DictionaryOptions tree(int cells, int parents, int layers,
                              std::vector<int> (*pattern)(int)) {
  harco::DictionaryOptions options;
  options.cells = cells;
  options.parents = parents;
  options.child_cells.assign(static_cast<std::size_t>(layers - 1), pattern(cells));
  return options;
}

/// Parents with quincunx cells kept white, of which only the codes matter.
harco::DictionaryOptions parents(int count) { return tree(5, count, 2, harco::quincunx); }

std::vector<Row> rows() {
  std::vector<Row> all{{"1 parent, 3 layers", tree(5, 1, 3, harco::quincunx)},
                       {"2 parents, 3 layers", tree(5, 2, 3, harco::quincunx)},
                       {"1 parent, 4 layers", tree(5, 1, 4, harco::quincunx)},
                       {"1 parent, 3 layers, checkerboard", tree(5, 1, 3, harco::checkerboard)},
                       {"200 parents, 2 layers", tree(5, 200, 2, harco::quincunx)}};
  for (const int count : {10, 50, 250})
    all.push_back({std::to_string(count) + " parents, 2 layers", parents(count)});
  for (const int cells : {4, 6, 7, 8})
    all.push_back({"n = " + std::to_string(cells) + ", 1 parent, 3 layers",
                   tree(cells, 1, 3, harco::quincunx)});
  return all;
}

std::string bound(const std::optional<harco::DistanceBound>& known) {
  return known ? std::to_string(known->distance) + " (" + known->reason + ")" : "-";
}

void print(const Row& row) {
  const auto start = std::chrono::steady_clock::now();
  const harco::Dictionary dictionary = harco::generate_dictionary(row.options);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  std::size_t children = 0;
  for (const auto& layer : dictionary.children) children += layer.size();
  const char* method =
      row.options.method == harco::DictionaryMethod::search ? "search" : "mutation";
  std::printf("%-34s %-8s %6zu %4d  %-26s %6zu %4d  %-26s %6.2f\n", row.name.c_str(), method,
              dictionary.parents.size(), dictionary.parent_distance,
              bound(dictionary.parent_bound).c_str(), children, dictionary.child_distance,
              bound(dictionary.child_bound).c_str(), elapsed.count());
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) try {
  std::printf("%-34s %-8s %6s %4s  %-26s %6s %4s  %-26s %6s\n", "set", "method", "D_F", "tau",
              "at most", "D_C", "tau", "at most", "s");
  for (Row row : rows()) {
    if (argc > 1) row.options.effort = std::stod(argv[1]);
    if (argc > 2) row.options.seed = std::stoull(argv[2]);
    for (const auto method : {harco::DictionaryMethod::search, harco::DictionaryMethod::mutation}) {
      row.options.method = method;
      print(row);
    }
  }
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "dictionary_table: %s\n", error.what());
  return 2;
}
