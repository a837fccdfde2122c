#include <initializer_list>
#include <string>
#include <vector>

#include "draw/pdf_file.hpp"
#include "draw/sheet.hpp"
#include "draw/text.hpp"
#include "draw/tiling.hpp"

namespace harco {
namespace {

constexpr double kPointsPerMm = 72.0 / 25.4;

std::string operands(std::initializer_list<double> values, const char* operation) {
  std::string out;
  for (const double value : values) out += number(value) + " ";
  return out + operation + "\n";
}

/// Writes a display list as PDF operators, in millimetres, y down.
struct Writer {
  std::string& out;

  void operator()(const Fill& fill) const {
    out += operands({fill.color.r, fill.color.g, fill.color.b}, "rg");
    for (const Loop& loop : fill.loops) {
      for (std::size_t i = 0; i < loop.size(); ++i)
        out += operands({loop[i].x(), loop[i].y()}, i == 0 ? "m" : "l");
      out += "h\n";
    }
    out += "f\n";
  }

  void operator()(const Strokes& strokes) const {
    pen(strokes.color, strokes.width);
    for (const auto& [from, to] : strokes.segments)
      out += operands({from.x(), from.y()}, "m") + operands({to.x(), to.y()}, "l");
    out += "S\n";
  }

  void operator()(const Ring& ring) const {
    pen(ring.color, ring.width);
    const double x = ring.centre.x();
    const double y = ring.centre.y();
    const double r = ring.radius;
    const double k = 0.5522847498 * r;  // a quarter of a circle as a Bezier curve
    out += operands({x + r, y}, "m") + operands({x + r, y + k, x + k, y + r, x, y + r}, "c") +
           operands({x - k, y + r, x - r, y + k, x - r, y}, "c") +
           operands({x - r, y - k, x - k, y - r, x, y - r}, "c") +
           operands({x + k, y - r, x + r, y - k, x + r, y}, "c") + "s\n";
  }

  void operator()(const Text& text) const {
    const double back = (text.anchor == Anchor::start    ? 0.0
                         : text.anchor == Anchor::middle ? 0.5
                                                         : 1.0) *
                        text.size * text_width(text.text, text.bold);
    // Letters stand upright although y leads down: their matrix turns it back.
    out += "BT\n" + operands({text.color.r, text.color.g, text.color.b}, "rg") +
           (text.bold ? "/Bold " : "/Regular ") + number(text.size) + " Tf\n";
    out += text.upwards ? operands({0, -1, -1, 0, text.at.x(), text.at.y() + back}, "Tm")
                        : operands({1, 0, 0, -1, text.at.x() - back, text.at.y()}, "Tm");
    out += pdf_string(text.text) + " Tj\nET\n";
  }

  void pen(const Color& color, double width) const {
    out += operands({color.r, color.g, color.b}, "RG") + operands({width}, "w");
  }
};

std::string operators(const DisplayList& shapes) {
  std::string out;
  for (const Shape& shape : shapes) std::visit(Writer{out}, shape);
  return out;
}

/// The sheet, once in the file and shown on every page.
std::string show_sheet(const Eigen::Vector2d& at, double scale) {
  return operands({scale, 0, 0, scale, at.x(), at.y()}, "cm") + "/Sheet Do\n";
}

std::string isolated(const std::string& content) { return "q\n" + content + "Q\n"; }

std::string tile_page(const SheetLayout& layout, const Tile& tile, const std::string& title,
                      double overlap_mm) {
  const Rect& window = tile.window_mm;
  const Eigen::Vector2d& at = tile.page_mm;
  const std::string clip =
      operands({at.x(), at.y(), window.width(), window.height()}, "re") + "W n\n";
  std::string page = isolated(clip + show_sheet(at - Eigen::Vector2d(window.x0, window.y0), 1.0));
  if (layout.tiles.size() > 1) page += operators(tile_marks(layout, tile, title, overlap_mm));
  return page;
}

std::string overview_page(const SheetLayout& layout, const std::string& title, double overlap_mm) {
  const Overview page = overview(layout, title, overlap_mm);
  return operators(page.below) + isolated(show_sheet(page.sheet_mm, page.scale)) +
         operators(page.above);
}

class Document {
 public:
  explicit Document(const Sheet& sheet) {
    const auto font = [&](const std::string& name) {
      return reference(file_.add("<< /Type /Font /Subtype /Type1 /BaseFont /" + name +
                                 " /Encoding /WinAnsiEncoding >>"));
    };
    fonts_ = "/Font << /Regular " + font("Helvetica") + " /Bold " + font("Helvetica-Bold") + " >>";
    sheet_ =
        file_.add_stream(operators(sheet.shapes),
                         " /Type /XObject /Subtype /Form /BBox [0 0 " + number(sheet.width_mm) +
                             " " + number(sheet.height_mm) + "] /Resources << " + fonts_ + " >>");
    pages_ = file_.reserve();
    info_ = file_.add("<< /Title " + pdf_string(sheet.title) + " /Producer (HArCo) >>");
  }

  /// `content` in millimetres from the page's top-left corner, y down.
  void add_page(double width_mm, double height_mm, const std::string& content) {
    const double height = height_mm * kPointsPerMm;
    const int stream =
        file_.add_stream(operands({kPointsPerMm, 0, 0, -kPointsPerMm, 0, height}, "cm") + content);
    page_list_.push_back(file_.add("<< /Type /Page /Parent " + reference(pages_) +
                                   " /MediaBox [0 0 " + number(width_mm * kPointsPerMm) + " " +
                                   number(height) + "] /Resources << " + fonts_ +
                                   " /XObject << /Sheet " + reference(sheet_) +
                                   " >> >> /Contents " + reference(stream) + " >>"));
  }

  std::string finish() {
    std::string kids;
    for (const int page : page_list_) kids += reference(page) + " ";
    file_.set(pages_, "<< /Type /Pages /Count " + std::to_string(page_list_.size()) + " /Kids [ " +
                          kids + "] >>");
    // Viewers that heed it don't offer to fit the page to the paper.
    const int catalog = file_.add("<< /Type /Catalog /Pages " + reference(pages_) +
                                  " /ViewerPreferences << /PrintScaling /None >> >>");
    return file_.finish(catalog, info_);
  }

 private:
  PdfFile file_;
  std::string fonts_;
  int sheet_ = 0;
  int pages_ = 0;
  int info_ = 0;
  std::vector<int> page_list_;
};

}  // namespace

std::string draw_pdf(const MarkerSet& markers, int parent_index, const SheetOptions& options) {
  const Sheet sheet = make_sheet(markers, parent_index, options);
  const SheetLayout pages = layout(sheet, options);
  Document document(sheet);
  const auto add = [&](const std::string& content) {
    document.add_page(pages.page_width_mm, pages.page_height_mm, content);
  };
  if (pages.tiles.size() > 1) add(overview_page(pages, sheet.title, options.overlap_mm));
  for (const Tile& tile : pages.tiles) add(tile_page(pages, tile, sheet.title, options.overlap_mm));
  return document.finish();
}

}  // namespace harco
