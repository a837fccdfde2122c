// Text and numbers on a page.
#pragma once

#include <string>
#include <vector>

namespace harco {

/// A number as SVG, PDF and readers like it: a decimal point whatever the locale, at most
/// `decimals` digits behind it, no zeros at the end.
std::string number(double value, int decimals = 5);

/// UTF-8 as one byte a character of Windows-1252, which is what a PDF's standard fonts know; what
/// isn't in it becomes a question mark.
std::string to_windows_1252(const std::string& utf8);

/// Length of a line of text in Helvetica, in units of the font's size. Bold is somewhat wider.
double text_width(const std::string& utf8, bool bold = false);

/// Breaks at spaces, so that no line is longer than `width` (in units of the font's size) unless a
/// single word is.
std::vector<std::string> wrapped(const std::string& utf8, double width);

}  // namespace harco
