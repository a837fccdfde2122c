#include "number_list.hpp"

#include <algorithm>
#include <charconv>
#include <set>
#include <stdexcept>

#include "harco/dictionary.hpp"

namespace harco::cli {

std::optional<int> whole_number(const std::string& text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || value < 0) return std::nullopt;
  return value;
}

std::vector<int> parse_list(const std::string& text, int end, const std::string& option) {
  const auto wrong = [&](const std::string& what) {
    return std::invalid_argument(option + " '" + text + "': " + what);
  };
  if (text.empty()) throw wrong("is empty");
  std::vector<int> list;
  std::set<int> known;
  for (std::size_t start = 0; start <= text.size();) {
    const std::size_t comma = std::min(text.find(',', start), text.size());
    const std::string part = text.substr(start, comma - start);
    const std::size_t dash = part.find('-');
    const auto first = whole_number(part.substr(0, dash));
    const auto last = dash == std::string::npos ? first : whole_number(part.substr(dash + 1));
    if (!first || !last) throw wrong("'" + part + "' is neither a number nor a range such as 3-7");
    if (*last < *first) throw wrong("the range " + part + " falls");
    if (*last >= end)
      throw wrong("there is no " + std::to_string(*last) + "; the last is " +
                  std::to_string(end - 1));
    for (int value = *first; value <= *last; ++value) {
      if (!known.insert(value).second) throw wrong(std::to_string(value) + " stands there twice");
      list.push_back(value);
    }
    start = comma + 1;
  }
  return list;
}

std::vector<int> parse_cells(const std::string& text, int cells, const std::string& option) {
  if (text == "quincunx") return quincunx(cells);
  if (text == "checkerboard") return checkerboard(cells);
  if (text.find_first_of("0123456789") == std::string::npos)
    throw std::invalid_argument(option + " '" + text +
                                "': is no layout that is known, nor a list of cells");
  return parse_list(text, cells * cells, option);
}

}  // namespace harco::cli
