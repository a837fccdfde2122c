#include <cmath>
#include <initializer_list>
#include <string>

#include "draw/sheet.hpp"
#include "draw/text.hpp"

namespace harco {
namespace {

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const bool control = static_cast<unsigned char>(c) < 0x20;
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else
      out += control ? ' ' : c;
  }
  return out;
}

std::string hex(const Color& color) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string out = "#";
  for (const double share : {color.r, color.g, color.b}) {
    const int byte = static_cast<int>(std::lround(share * 255.0));
    out += kDigits[byte / 16];
    out += kDigits[byte % 16];
  }
  return out;
}

std::string attribute(const char* name, const std::string& value) {
  return std::string(" ") + name + "=\"" + value + "\"";
}

std::string attribute(const char* name, double value) { return attribute(name, number(value)); }

/// A command of path data with its numbers.
std::string command(char letter, std::initializer_list<double> values) {
  std::string out(1, letter);
  for (const double value : values) {
    if (out.size() > 1) out += ' ';
    out += number(value);
  }
  return out;
}

/// A polygon as path data; sides along the axes, which is nearly all, take one number.
std::string path(const Loop& loop) {
  std::string out = command('M', {loop[0].x(), loop[0].y()});
  for (std::size_t i = 1; i < loop.size(); ++i) {
    const Eigen::Vector2d& to = loop[i];
    if (to.y() == loop[i - 1].y())
      out += command('H', {to.x()});
    else if (to.x() == loop[i - 1].x())
      out += command('V', {to.y()});
    else
      out += command('L', {to.x(), to.y()});
  }
  return out + "Z";
}

struct Writer {
  std::string& out;

  void operator()(const Fill& fill) const {
    out += "<path" + attribute("fill", hex(fill.color)) + " d=\"";
    for (const Loop& loop : fill.loops) out += path(loop) + "\n";
    out += "\"/>\n";
  }

  void operator()(const Strokes& strokes) const {
    out += "<path fill=\"none\"" + attribute("stroke", hex(strokes.color)) +
           attribute("stroke-width", strokes.width) + " d=\"";
    for (const auto& [from, to] : strokes.segments)
      out += command('M', {from.x(), from.y()}) + command('L', {to.x(), to.y()});
    out += "\"/>\n";
  }

  void operator()(const Ring& ring) const {
    out += "<circle fill=\"none\"" + attribute("stroke", hex(ring.color)) +
           attribute("stroke-width", ring.width) + attribute("cx", ring.centre.x()) +
           attribute("cy", ring.centre.y()) + attribute("r", ring.radius) + "/>\n";
  }

  void operator()(const Text& text) const {
    const std::string at = "translate(" + number(text.at.x()) + " " + number(text.at.y()) + ")";
    out += "<text" + attribute("transform", text.upwards ? at + " rotate(-90)" : at) +
           attribute("font-size", text.size) + attribute("fill", hex(text.color));
    if (text.anchor != Anchor::start)
      out += attribute("text-anchor", text.anchor == Anchor::middle ? "middle" : "end");
    if (text.bold) out += attribute("font-weight", "bold");
    out += '>' + escaped(text.text) + "</text>\n";
  }
};

}  // namespace

std::string draw_svg(const MarkerSet& markers, int parent_index, const SheetOptions& options) {
  const Sheet sheet = make_sheet(markers, parent_index, {options.set_name, {}, 0.0});
  const std::string width = number(sheet.width_mm);
  const std::string height = number(sheet.height_mm);
  std::string out = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg" +
                    attribute("xmlns", "http://www.w3.org/2000/svg") +
                    attribute("width", width + "mm") + attribute("height", height + "mm") +
                    attribute("viewBox", "0 0 " + width + " " + height) +
                    attribute("font-family", "Helvetica, Arial, sans-serif") + ">\n";
  out += "<title>" + escaped(sheet.title) + "</title>\n";
  out += "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n";
  for (const Shape& shape : sheet.shapes) std::visit(Writer{out}, shape);
  return out + "</svg>\n";
}

}  // namespace harco
