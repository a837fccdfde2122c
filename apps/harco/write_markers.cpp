#include "write_markers.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <set>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "harco/error.hpp"
#include "harco/layout.hpp"
#include "png_file.hpp"
#include "progress.hpp"
#include "staged_folder.hpp"

namespace harco::cli {
namespace {

namespace fs = std::filesystem;

constexpr double kLargestAcrobatPage_mm = 5080.0;  ///< 14 400 points

void write_text(const fs::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out << text;
  out.close();
  if (!out) throw Error(file.string() + ": can't be written");
}

void warn(const std::string& what) { fmt::print(stderr, "harco: warning: {}\n", what); }

/// The last part of a folder's name, for people to tell sheets apart.
std::string name_of(const fs::path& folder) {
  const fs::path whole = fs::absolute(folder).lexically_normal();
  return (whole.has_filename() ? whole : whole.parent_path()).filename().string();
}

/// How far the drawn lines are from those asked for, as a share of their width.
double rounding(const LineWidth& drawn, const LineWidth& wanted) {
  const auto share = [](double is, double should) {
    return should == 0.0 ? 0.0 : std::abs(is - should) / should;
  };
  return std::max(share(drawn.inside, wanted.inside), share(drawn.outside, wanted.outside));
}

constexpr std::array kEndings{".svg", ".pdf", ".png", ".png.json"};

std::string file_name(int id) { return fmt::format("marker-{}", id); }

/// Drawings of markers that an older markers.json in the folder names and the new one doesn't go
/// with it; what else lies there stays.
void remove_older(const fs::path& folder, const MarkerSet& markers, StagedFolder& files) {
  std::error_code ignored;
  const fs::path older = folder / "markers.json";
  if (!fs::exists(older, ignored)) return;
  std::set<int> kept;
  for (const Parent& parent : markers.parents) kept.insert(parent.marker.id);
  try {
    for (const Parent& parent : load_markers(older).parents)
      if (!kept.contains(parent.marker.id))
        for (const char* ending : kEndings) files.remove(file_name(parent.marker.id) + ending);
  } catch (const Error&) {  // not ours
  }
}

/// Writes the files of one parent. Returns how far its picture's lines are rounded.
double write_parent(const MarkerSet& markers, int index, StagedFolder& files,
                    const SheetOptions& sheet, const RasterOptions& raster_options) {
  const std::string name = file_name(markers.parents[static_cast<std::size_t>(index)].marker.id);
  write_text(files.file(name + ".svg"), draw_svg(markers, index, sheet));
  write_text(files.file(name + ".pdf"), draw_pdf(markers, index, sheet));
  const Raster drawn = raster(markers, index, raster_options);
  write_png(drawn.image.view(), files.file(name + ".png"), drawn.pixels_per_metre);
  write_text(files.file(name + ".png.json"),
             fmt::format("{{\"origin_px\": [{}, {}], \"pixels_per_metre\": {}}}\n",
                         drawn.origin_px.x(), drawn.origin_px.y(), drawn.pixels_per_metre));
  return rounding(drawn.line, markers.line);
}

/// What the PDF of the largest parent looks like, for the summary.
std::string describe_pages(const MarkerSet& markers, const SheetOptions& sheet,
                           const std::string& page) {
  const auto largest =
      std::max_element(markers.parents.begin(), markers.parents.end(),
                       [](const Parent& a, const Parent& b) { return a.side_m < b.side_m; });
  const SheetLayout layout =
      layout_sheet(markers, static_cast<int>(largest - markers.parents.begin()), sheet);
  if (sheet.page.fits_sheet()) {
    if (std::max(layout.width_mm, layout.height_mm) > kLargestAcrobatPage_mm)
      warn("the PDF's page is larger than 5.08 m, which some viewers don't show: --page tiles it");
    return fmt::format("one page of {:.0f} x {:.0f} mm (--page a4 tiles it over pages)",
                       layout.width_mm, layout.height_mm);
  }
  const std::size_t pages = layout.tiles.size();
  if (pages == 1) return fmt::format("one page ({})", page);
  return fmt::format("an overview and {} pages ({}) in {} rows and {} columns", pages, page,
                     layout.rows, layout.columns);
}

}  // namespace

void add_drawing_options(CLI::App& verb, DrawingOptions& options) {
  const std::string group = "Drawing";
  verb.add_option("--line", options.line,
                  "Width of a child's black line: harco (0 inside, half a cell outside, with 5 x 5 "
                  "cells 1/14 of its side) or paper (1/32 of its side on both sides)")
      ->check(CLI::IsMember({"harco", "paper"}))
      ->capture_default_str()
      ->group(group);
  verb.add_option("--line-inside", options.line_inside,
                  "Its part inside the child, as a share of the child's side (0 ... 0.25)")
      ->group(group);
  verb.add_option("--line-outside", options.line_outside, "Its part outside, likewise")
      ->group(group);
  verb.add_option("--page", options.page,
                  "Paper of the PDF. fit makes one page as large as the sheet; others are tiled if "
                  "need be. "
                  "An SVG is always one page")
      ->check(CLI::IsMember(paper_names(), CLI::ignore_case))
      ->capture_default_str()
      ->group(group);
  verb.add_option("--overlap", options.overlap_mm, "What neighbouring pages share, in millimetres")
      ->capture_default_str()
      ->group(group);
  verb.add_option("--pixels-per-cell", options.raster.pixels_per_cell,
                  "Side of the smallest cell in the PNG; 0 chooses the least that is exact")
      ->check(CLI::Range(0, options.raster.max_size_px))
      ->capture_default_str()
      ->group(group);
  verb.add_option("--max-pixels", options.raster.max_size_px, "Greatest width of the PNG")
      ->check(CLI::Range(1, 1 << 17))
      ->capture_default_str()
      ->group(group);
}

LineWidth line_width(const DrawingOptions& options, int cells) {
  LineWidth line = options.line == "paper" ? kPaperLine : default_line(cells);
  if (options.line_inside) line.inside = *options.line_inside;
  if (options.line_outside) line.outside = *options.line_outside;
  return line;
}

void check_writable(const fs::path& folder) { StagedFolder{folder}; }

void check_drawing(const MarkerSet& sample, const DrawingOptions& options) {
  layout_sheet(sample, 0, {"", paper(options.page), options.overlap_mm});
  raster(sample, 0, options.raster);
}

void write_markers(const MarkerSet& markers, const fs::path& folder,
                   const DrawingOptions& options) {
  validate(markers);
  const SheetOptions sheet{name_of(folder), paper(options.page), options.overlap_mm};
  StagedFolder files(folder);
  double rounded = 0.0;
  {
    ProgressBar progress("drawing");
    const int parents = static_cast<int>(markers.parents.size());
    for (int i = 0; i < parents; ++i) {
      progress.show(static_cast<double>(i) / parents);
      rounded = std::max(rounded, write_parent(markers, i, files, sheet, options.raster));
    }
  }
  save_markers(markers, files.file("markers.json"));
  const std::string pages = describe_pages(markers, sheet, options.page);
  remove_older(folder, markers, files);
  files.commit();

  for (const std::string& warning : print_warnings(markers)) warn(warning);
  if (rounded > kLineExact)
    warn(
        fmt::format("lines in the PNG are rounded to whole pixels, by up to {:.1f} % of their "
                    "width; SVG and PDF are exact",
                    100.0 * rounded));
  fmt::print("{}: markers.json and {} marker{}, each as .svg, .pdf, .png and .png.json\n",
             folder.string(), markers.parents.size(), markers.parents.size() == 1 ? "" : "s");
  fmt::print("PDF: {}\n", pages);
}

}  // namespace harco::cli
