#include "draw/text.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <sstream>

namespace harco {
namespace {

// Widths of Helvetica's characters 32 … 126, from Adobe's font metrics, in thousandths.
constexpr std::array<int, 95> kWidths{
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333,  278, 278, 556, 556, 556,
    556, 556, 556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667,
    611, 778, 722, 278, 500, 667, 556, 833, 722, 778, 667, 778, 722, 667,  611, 722, 667, 944, 667,
    667, 611, 278, 278, 278, 469, 556, 333, 556, 556, 500, 556, 556, 278,  556, 556, 222, 222, 500,
    222, 833, 556, 556, 556, 556, 333, 500, 278, 556, 500, 722, 500, 500,  500, 334, 260, 334, 584};
constexpr int kOtherWidth = 556;
constexpr int kMiddleDotWidth = 278;
constexpr double kBoldOverRegular = 1.08;

/// The next character of a UTF-8 text; damaged ones become U+FFFD.
std::uint32_t next_character(const std::string& text, std::size_t& at) {
  const auto lead = static_cast<unsigned char>(text[at++]);
  if (lead < 0x80) return lead;
  const int more = lead >= 0xF0 ? 3 : lead >= 0xE0 ? 2 : lead >= 0xC0 ? 1 : 0;
  std::uint32_t character = lead & (0x3FU >> more);
  for (int i = 0; i < more; ++i) {
    if (at >= text.size() || (static_cast<unsigned char>(text[at]) & 0xC0U) != 0x80) return 0xFFFD;
    character = (character << 6U) | (static_cast<unsigned char>(text[at++]) & 0x3FU);
  }
  return more == 0 ? 0xFFFD : character;
}

int width_of(unsigned char c) {
  if (c >= 32 && c < 127) return kWidths[c - 32U];
  return c == 0xB7 ? kMiddleDotWidth : kOtherWidth;
}

}  // namespace

std::string number(double value, int decimals) {
  std::array<char, 400> buffer;
  const auto written = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value,
                                     std::chars_format::fixed, decimals);
  std::string text(buffer.data(), written.ptr);
  if (text.find('.') != std::string::npos) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
  }
  return text == "-0" ? "0" : text;
}

std::string to_windows_1252(const std::string& utf8) {
  std::string text;
  for (std::size_t at = 0; at < utf8.size();) {
    const std::uint32_t character = next_character(utf8, at);
    const bool known =
        (character >= 32 && character < 127) || (character >= 0xA0 && character <= 0xFF);
    text += known ? static_cast<char>(character) : '?';
  }
  return text;
}

double text_width(const std::string& utf8, bool bold) {
  int width = 0;
  for (const char c : to_windows_1252(utf8)) width += width_of(static_cast<unsigned char>(c));
  return width / 1000.0 * (bold ? kBoldOverRegular : 1.0);
}

std::vector<std::string> wrapped(const std::string& utf8, double width) {
  std::vector<std::string> lines;
  std::istringstream words(utf8);
  for (std::string word; words >> word;) {
    if (!lines.empty() && text_width(lines.back() + " " + word) <= width)
      lines.back() += " " + word;
    else
      lines.push_back(word);
  }
  return lines;
}

}  // namespace harco
