#include "lab/report/plot.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "lab/report/xml.hpp"

namespace harco::lab {
namespace {

constexpr double kLeft = 64.0, kRight = 16.0, kTop = 44.0, kBottom = 46.0;
constexpr double kLetter = 5.8;    // mean width of a letter in the legend, px
constexpr double kTickSpace = 75;  // px that a tick of the x axis wants

/// Values to pixels along one axis.
class Axis {
 public:
  Axis(AxisRange range, bool logarithmic, double from_px, double to_px)
      : range_(range), log_(logarithmic), from_(from_px), to_(to_px) {
    if (log_ && !(range.low > 0.0))
      throw std::invalid_argument("plot: a logarithmic axis begins above 0");
    if (!(range_.high > range_.low)) range_.high = log_ ? range_.low * 10.0 : range_.low + 1.0;
  }

  double px(double value) const {
    const double v = std::clamp(value, range_.low, range_.high);
    const double share = log_ ? std::log(v / range_.low) / std::log(range_.high / range_.low)
                              : (v - range_.low) / (range_.high - range_.low);
    return from_ + share * (to_ - from_);
  }

  bool shows(double value) const {
    const double slack = 1e-9 * (range_.high - range_.low);
    return value >= range_.low - slack && value <= range_.high + slack;
  }

  /// About `wanted` round values.
  std::vector<double> ticks(int wanted) const {
    return log_ ? log_ticks(wanted) : linear_ticks(wanted);
  }

 private:
  std::vector<double> linear_ticks(int wanted) const {
    const double rough = (range_.high - range_.low) / std::max(1, wanted);
    const double decade = std::pow(10.0, std::floor(std::log10(rough)));
    double step = 10.0 * decade;
    for (const double round : {5.0, 2.0, 1.0})
      if (round * decade >= rough) step = round * decade;
    std::vector<double> ticks;
    for (double k = std::ceil(range_.low / step - 1e-9); k * step <= range_.high + 1e-9 * step; ++k)
      ticks.push_back(k == 0.0 ? 0.0 : k * step);  // never -0
    return ticks;
  }

  std::vector<double> log_ticks(int wanted) const {
    const double decades = std::log10(range_.high / range_.low);
    std::vector<double> digits{1.0};
    if (3.0 * decades <= wanted + 1.0) digits = {1.0, 2.0, 5.0};
    const double first = std::floor(std::log10(range_.low));
    const int skip = std::max(1, static_cast<int>(std::ceil(decades / std::max(1, wanted))));
    std::vector<double> ticks;
    for (int k = 0; first + k <= std::log10(range_.high) + 1e-9; k += skip)
      for (const double digit : digits)
        if (const double tick = digit * std::pow(10.0, first + k); shows(tick))
          ticks.push_back(tick);
    return ticks;
  }

  AxisRange range_;
  bool log_;
  double from_, to_;
};

/// What the values need, a little more on linear axes, from zero where zero is near.
AxisRange range_of(const std::vector<Series>& series, std::vector<double> Series::*values,
                   bool logarithmic) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Series& one : series) {
    if (one.mark == Mark::bars && values == &Series::y) low = std::min(low, 0.0);
    for (const double value : one.*values)
      if (std::isfinite(value) && (!logarithmic || value > 0.0)) {
        low = std::min(low, value);
        high = std::max(high, value);
      }
  }
  if (!(low <= high)) return {logarithmic ? 1.0 : 0.0, logarithmic ? 10.0 : 1.0};
  if (logarithmic) return {low / 1.1, high * 1.1};
  if (values == &Series::x) return {low, high};
  if (low > 0.0 && low < 0.5 * high) low = 0.0;
  const double margin = high > low ? 0.06 * (high - low) : 0.5;
  return {low == 0.0 ? 0.0 : low - margin, high + margin};
}

std::string text(double x, double y, const std::string& content, const char* anchor = "middle",
                 const std::string& more = "") {
  return fmt::format(R"(<text x="{:.1f}" y="{:.1f}" text-anchor="{}"{}>{}</text>)", x, y, anchor,
                     more, escaped(content));
}

std::string line(double x0, double y0, double x1, double y1, const std::string& look) {
  return fmt::format(R"(<line x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}" {}/>)", x0, y0, x1,
                     y1, look);
}

/// One plot on its way to text.
class Drawing {
 public:
  explicit Drawing(const Plot& plot)
      : plot_(plot),
        x_(plot.x_range.value_or(range_of(plot.series, &Series::x, plot.log_x)), plot.log_x, kLeft,
           plot.width - kRight),
        y_(plot.y_range.value_or(range_of(plot.series, &Series::y, plot.log_y)), plot.log_y,
           plot.height - kBottom, kTop) {
    for (const Series& one : plot.series)
      if (one.x.size() != one.y.size())
        throw std::invalid_argument("plot: a series has x and y of different length");
  }

  std::string inside() {
    frame();
    for (const Series& one : plot_.series) add(one);
    rules();
    legend();
    return out_;
  }

 private:
  double top() const { return kTop; }
  double bottom() const { return plot_.height - kBottom; }
  double right() const { return plot_.width - kRight; }

  void frame() {
    out_ +=
        fmt::format(R"(<rect width="{}" height="{}" fill="#ffffff"/>)", plot_.width, plot_.height);
    for (const Band& band : plot_.bands) {
      const double from = x_.px(band.from), to = x_.px(band.to);
      out_ +=
          fmt::format(R"(<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}" fill="{}"/>)",
                      from, top(), to - from, bottom() - top(), band.colour);
      out_ += text(0.5 * (from + to), top() + 12, band.label, "middle", R"( fill="#777777")");
    }
    const int x_ticks = std::max(2, static_cast<int>((right() - kLeft) / kTickSpace));
    for (const double tick : x_.ticks(x_ticks)) {
      out_ += line(x_.px(tick), top(), x_.px(tick), bottom(), R"(stroke="#e4e4e4")");
      out_ += text(x_.px(tick), bottom() + 15, fmt::format("{:.6g}", tick));
    }
    for (const double tick : y_.ticks(5)) {
      out_ += line(kLeft, y_.px(tick), right(), y_.px(tick), R"(stroke="#e4e4e4")");
      out_ += text(kLeft - 6, y_.px(tick) + 4, fmt::format("{:.6g}", tick), "end");
    }
    out_ += fmt::format(
        R"(<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}" fill="none" stroke="#888888"/>)",
        kLeft, top(), right() - kLeft, bottom() - top());
    out_ += text(0.5 * (kLeft + right()), plot_.height - 12.0, plot_.x_label);
    const double middle = 0.5 * (top() + bottom());
    out_ += text(14, middle, plot_.y_label, "middle",
                 fmt::format(R"_( transform="rotate(-90 14 {:.1f})")_", middle));
    out_ += text(kLeft, 16, plot_.title, "start", R"( font-weight="bold" font-size="13")");
  }

  void rules() {
    for (const Rule& rule : plot_.rules) {
      const std::string look = fmt::format(R"(stroke="{}" stroke-dasharray="5 4")", rule.colour);
      const std::string ink = fmt::format(R"( fill="{}")", rule.colour);
      if (rule.vertical && x_.shows(rule.at)) {
        out_ += line(x_.px(rule.at), top(), x_.px(rule.at), bottom(), look);
        out_ += text(x_.px(rule.at) + 4, bottom() - 6, rule.label, "start", ink);
      } else if (!rule.vertical && y_.shows(rule.at)) {
        out_ += line(kLeft, y_.px(rule.at), right(), y_.px(rule.at), look);
        out_ += text(right() - 4, y_.px(rule.at) - 4, rule.label, "end", ink);
      }
    }
  }

  void add(const Series& series) {
    switch (series.mark) {
      case Mark::dots:
        return dots(series);
      case Mark::bars:
        return bars(series);
      case Mark::line:
      case Mark::dashed:
      case Mark::steps:
        return path(series);
    }
  }

  bool drawable(const Series& series, std::size_t i) const {
    const double x = series.x[i], y = series.y[i];
    return std::isfinite(x) && std::isfinite(y) && (!plot_.log_y || y > 0.0) &&
           (!plot_.log_x || x > 0.0) && x_.shows(x);
  }

  void path(const Series& series) {
    std::string d;
    bool down = false;
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      if (!drawable(series, i)) {
        down = false;
        continue;
      }
      const double x = x_.px(series.x[i]), y = y_.px(series.y[i]);
      if (!down)
        d += fmt::format("M{:.1f} {:.1f}", x, y);
      else if (series.mark == Mark::steps)
        d += fmt::format("H{:.1f}V{:.1f}", x, y);
      else
        d += fmt::format("L{:.1f} {:.1f}", x, y);
      down = true;
    }
    if (d.empty()) return;
    out_ += fmt::format(
        R"(<path d="{}" fill="none" stroke="{}" stroke-width="1.8" stroke-linejoin="round"{}/>)", d,
        series.colour, series.mark == Mark::dashed ? R"( stroke-dasharray="6 4")" : "");
  }

  void dots(const Series& series) {
    for (std::size_t i = 0; i < series.x.size(); ++i)
      if (drawable(series, i))
        out_ += fmt::format(R"(<circle cx="{:.1f}" cy="{:.1f}" r="1.8" fill="{}"/>)",
                            x_.px(series.x[i]), y_.px(series.y[i]), series.colour);
  }

  void bars(const Series& series) {
    double width = 20.0;
    for (std::size_t i = 0; i + 1 < series.x.size(); ++i)
      width = std::min(width, 0.9 * std::abs(x_.px(series.x[i + 1]) - x_.px(series.x[i])));
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      if (!drawable(series, i)) continue;
      const double foot = plot_.log_y ? bottom() : y_.px(0.0), head = y_.px(series.y[i]);
      out_ += fmt::format(
          R"(<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}" fill="{}" fill-opacity="0.75"/>)",
          x_.px(series.x[i]) - 0.5 * width, std::min(foot, head), width, std::abs(foot - head),
          series.colour);
    }
  }

  void legend() {
    double x = kLeft;
    for (const Series& one : plot_.series) {
      if (one.name.empty()) continue;
      out_ += line(x, 31, x + 18, 31,
                   fmt::format(R"(stroke="{}" stroke-width="{}"{})", one.colour,
                               one.mark == Mark::bars ? 8 : 3,
                               one.mark == Mark::dashed ? R"( stroke-dasharray="6 4")" : ""));
      out_ += text(x + 23, 35, one.name, "start");
      x += 36.0 + kLetter * static_cast<double>(one.name.size());
    }
  }

  const Plot& plot_;
  Axis x_, y_;
  std::string out_;
};

std::string svg(double width, double height, const std::string& inside) {
  return fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" width="{0}" height="{1}" viewBox="0 0 {0} {1}" font-family="Helvetica, Arial, sans-serif" font-size="11" fill="#333333">{2}</svg>)",
      width, height, inside);
}

}  // namespace

std::string draw(const Plot& plot) { return svg(plot.width, plot.height, Drawing(plot).inside()); }

std::string draw_grid(const std::vector<Plot>& plots, int columns) {
  if (columns < 1) throw std::invalid_argument("plot: a grid has at least one column");
  std::string inside;
  double x = 0.0, y = 0.0, row_height = 0.0, width = 0.0;
  for (std::size_t i = 0; i < plots.size(); ++i) {
    if (i > 0 && i % static_cast<std::size_t>(columns) == 0) {
      x = 0.0;
      y += row_height;
      row_height = 0.0;
    }
    inside += fmt::format(R"_(<g transform="translate({} {})">{}</g>)_", x, y,
                          Drawing(plots[i]).inside());
    x += plots[i].width;
    width = std::max(width, x);
    row_height = std::max(row_height, static_cast<double>(plots[i].height));
  }
  return svg(width, y + row_height, inside);
}

}  // namespace harco::lab
