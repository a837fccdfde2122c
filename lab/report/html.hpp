// The report: one HTML file that holds all it shows, without scripts and without a network.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "lab/report/chapter.hpp"

namespace harco::lab {

/// A chapter with what stands above it.
struct ReportSection {
  std::string name;   ///< the paper's section, such as "4.1"
  std::string title;  ///< a few words
  std::string note;   ///< such as how much of it is done
  Chapter chapter;
};

struct Report {
  std::string title;
  std::string introduction;
  std::vector<std::pair<std::string, std::string>> facts;  ///< machine, version, …
  std::vector<ReportSection> sections;
};

/// The overview plots of all chapters side by side, as an SVG file; empty if there are none.
std::string format_overview(const Report& report);

/// Well-formed as XML, too.
std::string format_html(const Report& report);

}  // namespace harco::lab
