#include "draw/sheet.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <vector>

#include "draw/only_parent.hpp"
#include "draw/text.hpp"

namespace harco {
namespace {

using Eigen::Vector2d;

constexpr double kMm = 1000.0;      ///< in a metre
constexpr double kBorder_mm = 5.0;  ///< around everything, which most printers can't reach

// What stands around the marker grows with it, within what is read well and doesn't waste paper.
constexpr double kFontOfSide = 0.018;
constexpr double kLeastFont_mm = 2.4;
constexpr double kGreatestFont_mm = 8.0;

// Wide enough for a ruler of 100 mm; no line of text has more than this many times the font size.
constexpr double kLeastWidth_mm = 104.0;
constexpr double kLongestLine = 75.0;

// Distances outside the quiet zone, in font sizes.
constexpr double kAxis = 1.7;        ///< from the quiet zone to an axis
constexpr double kDimension = 1.4;   ///< from the quiet zone to a dimension line
constexpr double kSideBand = 3.4;    ///< room to the left, on top and to the right
constexpr double kBottomBand = 4.4;  ///< room below, down to the text
constexpr double kStroke = 0.09;     ///< width of drawn lines

constexpr Color kAxisX{0.78, 0.10, 0.10};
constexpr Color kAxisY{0.10, 0.50, 0.10};
constexpr Color kAxisZ{0.10, 0.25, 0.75};

/// Sizes of one sheet in millimetres, from its marker's.
struct Measures {
  explicit Measures(const MarkerSet& single)
      : side(single.parents[0].side_m * kMm),
        quiet(side / (single.parents[0].marker.code.cells + 2)),
        font(std::clamp(kFontOfSide * side, kLeastFont_mm, kGreatestFont_mm)) {}

  double side;
  double quiet;
  double font;
  /// From the black square's edge to something `distance` font sizes outside the quiet zone.
  double outside(double distance) const { return quiet + distance * font; }
};

/// A slender triangle with its tip at `tip`.
Loop arrow_head(const Vector2d& tip, const Vector2d& direction, double length) {
  const Vector2d back = tip - length * direction;
  const Vector2d across(-direction.y(), direction.x());
  return {tip, back + 0.3 * length * across, back - 0.3 * length * across};
}

/// An arrow from `from` to `to`.
void add_arrow(DisplayList& shapes, const Vector2d& from, const Vector2d& to, double font,
               const Color& color) {
  const Vector2d direction = (to - from).normalized();
  const double head = 0.8 * font;
  shapes.push_back(Strokes{{{from, to - 0.9 * head * direction}}, kStroke * font, color});
  shapes.push_back(Fill{{arrow_head(to, direction, head)}, color});
}

/// A dimension line: arrows at both ends, and lines that lead to what is measured.
void add_dimension(DisplayList& shapes, const Vector2d& from, const Vector2d& to, double font) {
  const Vector2d direction = (to - from).normalized();
  const Vector2d across(-direction.y(), direction.x());
  const double head = std::min(0.9 * font, 0.25 * (to - from).norm());
  const double width = kStroke * font;
  shapes.push_back(Strokes{{{from + 0.9 * head * direction, to - 0.9 * head * direction},
                            {from - 0.7 * font * across, from + 0.7 * font * across},
                            {to - 0.7 * font * across, to + 0.7 * font * across}},
                           width});
  shapes.push_back(
      Fill{{arrow_head(from, -direction, head), arrow_head(to, direction, head)}, kBlack});
}

/// The side is the black square's: two dimension lines, below and to the right.
void add_dimensions(DisplayList& shapes, const Vector2d& marker, const Measures& m) {
  const double far = m.side + m.outside(kDimension);
  const std::string text = "side " + number(m.side, 3) + " mm";
  const Vector2d below = marker + Vector2d(0.0, far);
  const Vector2d right = marker + Vector2d(far, 0.0);
  add_dimension(shapes, below, below + Vector2d(m.side, 0.0), m.font);
  add_dimension(shapes, right, right + Vector2d(0.0, m.side), m.font);
  const double text_off = 1.25 * m.font;
  shapes.push_back(Text{below + Vector2d(0.5 * m.side, text_off), m.font, text, Anchor::middle});
  shapes.push_back(
      Text{right + Vector2d(text_off, 0.5 * m.side), m.font, text, Anchor::middle, false, true});
}

/// The axes of the marker frame, moved out of the marker along its edges: the ticks at 0 are in
/// line with the black square's top-left corner.
void add_axes(DisplayList& shapes, const Vector2d& marker, const Measures& m) {
  const double off = m.outside(kAxis);
  const double length = std::max(0.2 * m.side, 3.0 * m.font);
  const double tick = 0.5 * m.font;
  const double radius = 0.5 * m.font;
  const double width = kStroke * m.font;
  const Vector2d corner = marker - Vector2d(off, off);
  const Vector2d x_zero = marker - Vector2d(0.0, off);
  const Vector2d y_zero = marker - Vector2d(off, 0.0);
  const Vector2d x_tip = x_zero + Vector2d(length, 0.0);
  const Vector2d y_tip = y_zero + Vector2d(0.0, length);

  add_arrow(shapes, corner + Vector2d(radius, 0.0), x_tip, m.font, kAxisX);
  add_arrow(shapes, corner + Vector2d(0.0, radius), y_tip, m.font, kAxisY);
  shapes.push_back(
      Strokes{{{x_zero - Vector2d(0.0, tick), x_zero + Vector2d(0.0, tick)}}, width, kAxisX});
  shapes.push_back(
      Strokes{{{y_zero - Vector2d(tick, 0.0), y_zero + Vector2d(tick, 0.0)}}, width, kAxisY});
  // An arrow that flies away shows its feathers: a cross in a circle.
  const double cross = radius * 0.7071;
  shapes.push_back(Ring{corner, radius, width, kAxisZ});
  shapes.push_back(Strokes{{{corner - Vector2d(cross, cross), corner + Vector2d(cross, cross)},
                            {corner + Vector2d(-cross, cross), corner + Vector2d(cross, -cross)}},
                           width,
                           kAxisZ});

  const double drop = 0.35 * m.font;  // from a letter's middle to its base line
  shapes.push_back(Text{x_zero + Vector2d(0.0, -0.75 * m.font), 0.8 * m.font, "0", Anchor::middle,
                        false, false, kAxisX});
  shapes.push_back(Text{y_zero + Vector2d(-0.75 * m.font, drop), 0.8 * m.font, "0", Anchor::end,
                        false, false, kAxisY});
  shapes.push_back(
      Text{x_tip + Vector2d(0.4 * m.font, drop), m.font, "x", Anchor::start, true, false, kAxisX});
  shapes.push_back(
      Text{y_tip + Vector2d(0.0, m.font), m.font, "y", Anchor::middle, true, false, kAxisY});
  shapes.push_back(Text{corner + Vector2d(-radius, -0.9 * m.font), m.font, "z", Anchor::start, true,
                        false, kAxisZ});
}

/// Marks outside the quiet zone's corners: whoever cuts here leaves white enough.
void add_quiet_zone_marks(DisplayList& shapes, const Vector2d& marker, const Measures& m) {
  const double near = 0.3 * m.font;
  const double far = 1.0 * m.font;
  std::vector<Segment> segments;
  for (const double x : {-1.0, 1.0})
    for (const double y : {-1.0, 1.0}) {
      const Vector2d corner =
          marker + Vector2d::Constant(0.5 * m.side) + Vector2d(x, y) * (0.5 * m.side + m.quiet);
      segments.push_back({corner + Vector2d(x * near, 0.0), corner + Vector2d(x * far, 0.0)});
      segments.push_back({corner + Vector2d(0.0, y * near), corner + Vector2d(0.0, y * far)});
    }
  shapes.push_back(Strokes{std::move(segments), 0.5 * kStroke * m.font, kGrey});
}

/// Layers, their sides and the lines, for whoever finds the sheet years later.
std::string description(const MarkerSet& single, const std::string& set_name) {
  const std::vector<PlacedMarker> placed = place(single);
  std::set<double, std::greater<>> sides;
  double thinnest = single.parents[0].side_m;
  const LineWidth& line = single.line;
  for (const PlacedMarker& marker : placed) {
    sides.insert(std::round(marker.side_m * kMm * 1e3) / 1e3);
    thinnest = std::min(thinnest, marker.side_m * (line.inside + line.outside));
  }
  const int cells = placed.front().code.cells;
  const int layers = single.layers();
  std::string text = set_name.empty() ? "" : set_name + ": ";
  text += std::to_string(layers) + (layers == 1 ? " layer" : " layers") + " of " +
          std::to_string(cells) + " × " + std::to_string(cells) + " cells";
  if (layers == 1) return text + ".";
  text += ", sides";
  for (const double side : sides) text += (side == *sides.begin() ? " " : " / ") + number(side, 3);
  text += " mm. Lines: " + number(line.inside, 4) + " inside, " + number(line.outside, 4) +
          " outside of a child's side; the thinnest is " + number(thinnest * kMm, 3) + " mm wide.";
  return text;
}

/// The least width of a sheet without the border.
double least_width(const Paper& page) {
  if (page.fits_sheet()) return kLeastWidth_mm;
  return std::min(kLeastWidth_mm, std::min(page.width_mm, page.height_mm) - 2.0 * kBorder_mm);
}

}  // namespace

double add_paragraph(DisplayList& shapes, const Vector2d& at, double width, double font,
                     const std::string& text) {
  constexpr double kLineHeight = 1.35;
  constexpr double kFilled = 0.85;  // of a line, since fonts that stand in for Helvetica are wider
  double y = at.y();
  for (const std::string& line : wrapped(text, kFilled * width / font)) {
    shapes.push_back(Text{{at.x(), y + font}, font, line});
    y += kLineHeight * font;
  }
  return y;
}

double add_ruler(DisplayList& shapes, const Vector2d& at, double width, double font) {
  int length = 10;
  for (const int candidate : {20, 50, 100})
    if (candidate <= width) length = candidate;
  constexpr double kLongTick = 4.0;
  const double label = std::min(font, 3.0);
  const double base = at.y() + 1.2 * font + kLongTick;
  std::vector<Segment> ticks{{Vector2d(at.x(), base), Vector2d(at.x() + length, base)}};
  for (int mm = 0; mm <= length; ++mm) {
    const double tick = mm % 10 == 0 ? kLongTick : mm % 5 == 0 ? 2.8 : 1.8;
    ticks.push_back({Vector2d(at.x() + mm, base), Vector2d(at.x() + mm, base - tick)});
    if (mm % 10 != 0) continue;
    shapes.push_back(Text{{at.x() + mm, base - kLongTick - 0.3 * font},
                          label,
                          std::to_string(mm),
                          mm == 0 ? Anchor::start : Anchor::middle,
                          false,
                          false,
                          kGrey});
  }
  shapes.push_back(Text{{at.x() + length + label, base - kLongTick - 0.3 * font},
                        label,
                        "mm",
                        Anchor::start,
                        false,
                        false,
                        kGrey});
  shapes.push_back(Strokes{std::move(ticks), 0.15});
  return add_paragraph(shapes, {at.x(), base + 0.3 * font}, width, font,
                       "This ruler must measure " + std::to_string(length) +
                           " mm. If it does not, print again at 100 % (actual size, not fitted to "
                           "the page).");
}

Sheet make_sheet(const MarkerSet& markers, int parent_index, const SheetOptions& options) {
  const MarkerSet single = only_parent(markers, parent_index);
  const Parent& parent = single.parents[0];
  const Measures m(single);
  const double band = kSideBand * m.font;
  const double content = std::max(m.side + 2.0 * (m.quiet + band), least_width(options.page));

  Sheet sheet;
  sheet.title =
      "Marker " + std::to_string(parent.marker.id) + " · side " + number(m.side, 3) + " mm";
  sheet.width_mm = content + 2.0 * kBorder_mm;
  sheet.marker_mm = {0.5 * (sheet.width_mm - m.side), kBorder_mm + m.outside(kSideBand)};

  Fill ink{black_outline(ink_plan(single, 0)), kBlack};
  for (Loop& loop : ink.loops)
    for (Vector2d& corner : loop) corner = sheet.marker_mm + corner * kMm;
  DisplayList& shapes = sheet.shapes;
  shapes.push_back(std::move(ink));
  add_quiet_zone_marks(shapes, sheet.marker_mm, m);
  add_axes(shapes, sheet.marker_mm, m);
  add_dimensions(shapes, sheet.marker_mm, m);

  const double width = std::min(content, kLongestLine * m.font);
  double y = sheet.marker_mm.y() + m.side + m.outside(kBottomBand);
  const double title_font = 1.6 * m.font;
  shapes.push_back(Text{{kBorder_mm, y}, title_font, sheet.title, Anchor::start, true});
  y = add_paragraph(shapes, {kBorder_mm, y + 0.6 * m.font}, width, m.font,
                    description(single, options.set_name));
  y = add_paragraph(shapes, {kBorder_mm, y}, width, m.font,
                    "Side is that of the black square, without its white margin. The margin of " +
                        number(m.quiet, 2) +
                        " mm is part of the marker: keep it white. Marker frame: origin at the "
                        "black square's top-left corner, x right, y down, z into the paper.");
  sheet.height_mm =
      add_ruler(shapes, {kBorder_mm, y + 0.8 * m.font}, width, m.font) + 0.3 * m.font + kBorder_mm;
  return sheet;
}

}  // namespace harco
