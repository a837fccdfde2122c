// What a report says about one experiment: findings, and below them text, tables, plots and
// pictures.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "lab/report/plot.hpp"

namespace harco::lab {

/// One line of the summary: what the paper reports, what was measured here, and with the paper's
/// baseline. Empty where there is nothing to say.
struct Finding {
  std::string what;
  std::string paper;
  std::string ours;
  std::string baseline;
  std::string goal;             ///< what ours is to be
  std::optional<bool> reached;  ///< whether it is
};

struct Paragraph {
  std::string text;
};

struct Table {
  std::string caption;
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows;  ///< each as long as the head
};

/// A drawing, as an <svg> element (plot.hpp).
struct Figure {
  std::string caption;
  std::string svg;
};

/// A small picture that can stand in an item's result (picture.hpp).
struct Picture {
  std::string label;
  std::string jpeg_base64;
};

/// Pictures side by side, such as those of one flight.
struct Strip {
  std::string caption;
  std::vector<Picture> pictures;
};

using Block = std::variant<Paragraph, Table, Figure, Strip>;

struct Chapter {
  std::vector<Finding> findings;
  std::vector<Block> blocks;                    ///< in the order of reading
  std::optional<Plot> overview = std::nullopt;  ///< the one plot that says it all, if there is one
};

}  // namespace harco::lab
