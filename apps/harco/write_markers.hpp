// The files that `generate` and `import` leave behind, and the options that shape them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "harco/draw.hpp"
#include "harco/marker.hpp"

namespace CLI {
class App;
}

namespace harco::cli {

/// What the user may say about lines and drawings.
struct DrawingOptions {
  std::string line = "harco";         ///< named widths: harco, paper
  std::optional<double> line_inside;  ///< in place of that of the named choice
  std::optional<double> line_outside;
  std::string page = "fit";
  double overlap_mm = 10.0;
  RasterOptions raster;
};

/// --line, --line-inside, --line-outside, --page, --overlap, --pixels-per-cell, --max-pixels.
/// `options` must live as long as `verb`.
void add_drawing_options(CLI::App& verb, DrawingOptions& options);

/// The line width that the options ask for, around children of n x n cells.
LineWidth line_width(const DrawingOptions& options, int cells);

/// Checks that `folder` can be written to (it need not exist). Throws Error. Leaves nothing behind.
void check_writable(const std::filesystem::path& folder);

/// Throws now, before a long search, what write_markers would throw about the options or about
/// pictures of parents with the layers, cells and side of `sample`.
void check_drawing(const MarkerSet& sample, const DrawingOptions& options);

/// Writes markers.json and, for every parent, marker-ID.svg, marker-ID.pdf, marker-ID.png and
/// marker-ID.png.json into `folder`, which is made if need be. All files are there or, after an
/// exception, none; drawings of markers that an older markers.json there named disappear. Names on
/// standard output what it has written and on standard error what may go wrong on paper; shows
/// there how far it is if that is a terminal. Throws Error or std::invalid_argument.
void write_markers(const MarkerSet& markers, const std::filesystem::path& folder,
                   const DrawingOptions& options);

}  // namespace harco::cli
