// Lists of ids and cells as users write them.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace harco::cli {

/// A whole number, not negative, that fills `text`; empty if it is none.
std::optional<int> whole_number(const std::string& text);

/// "0-9,23" -> 0 … 9, 23. Throws std::invalid_argument, saying what `option` this is, for text that
/// is no such list, a range that falls, a number twice, or one that is not below `end`.
std::vector<int> parse_list(const std::string& text, int end, const std::string& option);

/// Cells of n x n: quincunx, checkerboard, or a list of them. Throws as parse_list.
std::vector<int> parse_cells(const std::string& text, int cells, const std::string& option);

}  // namespace harco::cli
