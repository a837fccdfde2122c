#include "pgm_stream.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>

#include "harco/error.hpp"

namespace harco::cli {
namespace {

// What a header may ask for: wider than any camera, and too small to exhaust the memory.
constexpr int kMaxSide = 65535;
constexpr std::int64_t kMaxPixels = std::int64_t{1} << 28;
constexpr std::size_t kMaxComment = 4096;

bool is_space(int c) { return c != EOF && std::isspace(c) != 0; }

}  // namespace

void PgmStream::Close::operator()(std::FILE* file) const {
  if (file != stdin) std::fclose(file);
}

PgmStream::PgmStream(const std::string& path)
    : name_(path == "-" ? "standard input" : path),
      file_(path == "-" ? stdin : std::fopen(path.c_str(), "rb")) {
  if (!file_) throw Error(name_ + ": can't be opened");
}

void PgmStream::fail(const std::string& what) const { throw Error(name_ + ": " + what); }

bool PgmStream::read(PgmFrame& frame) {
  frame.timestamp_s.reset();
  int c = std::getc(file_.get());
  while (is_space(c)) c = std::getc(file_.get());
  if (c == EOF) {
    if (std::ferror(file_.get()) != 0) fail("can't be read");
    return false;
  }
  if (c != 'P' || std::getc(file_.get()) != '5') fail("is no binary PGM image (P5)");

  const int width = read_number("width", kMaxSide, frame);
  const int height = read_number("height", kMaxSide, frame);
  const int white = read_number("number of grey levels", kMaxSide, frame);
  if (!is_space(std::getc(file_.get()))) fail("is no PGM image: no white space ends the header");
  if (white > 255) fail("has more than 8 bits a pixel (" + std::to_string(white) + " grey levels)");
  if (std::int64_t{width} * height > kMaxPixels)
    fail("is too large (" + std::to_string(width) + " x " + std::to_string(height) + ")");

  frame.image = Image(width, height);
  std::vector<std::uint8_t>& pixels = frame.image.pixels;
  if (std::fread(pixels.data(), 1, pixels.size(), file_.get()) != pixels.size())
    fail("ends in the middle of an image");
  if (white < 255)
    for (std::uint8_t& pixel : pixels)
      pixel = static_cast<std::uint8_t>((std::min<int>(pixel, white) * 255 + white / 2) / white);
  return true;
}

void PgmStream::read_comment(PgmFrame& frame) {
  std::string text;
  for (int c = std::getc(file_.get()); c != '\n'; c = std::getc(file_.get())) {
    if (c == EOF) fail("ends in the middle of a header");
    if (text.size() < kMaxComment) text.push_back(static_cast<char>(c));
  }
  const auto skip_space = [&](std::size_t from) {
    while (from < text.size() && is_space(static_cast<unsigned char>(text[from]))) ++from;
    return from;
  };
  constexpr std::string_view kKey = "timestamp_s";
  const std::size_t key = skip_space(0);
  const std::size_t after = key + kKey.size();
  const bool named = text.compare(key, kKey.size(), kKey) == 0 && after < text.size() &&
                     is_space(static_cast<unsigned char>(text[after]));
  if (!named) return;
  std::size_t value = skip_space(after);
  if (value < text.size() && text[value] == '+') ++value;
  double seconds = 0.0;
  const auto [end, failed] =
      std::from_chars(text.data() + value, text.data() + text.size(), seconds);
  const bool whole = skip_space(static_cast<std::size_t>(end - text.data())) == text.size();
  if (failed != std::errc{} || !whole || !std::isfinite(seconds))
    fail("has a timestamp_s that is no number: '" + text.substr(value, 40) + "'");
  frame.timestamp_s = seconds;
}

/// White space and comments, then a whole number from 1 to `limit`.
int PgmStream::read_number(const char* name, int limit, PgmFrame& frame) {
  int c = std::getc(file_.get());
  while (is_space(c) || c == '#') {
    if (c == '#') read_comment(frame);
    c = std::getc(file_.get());
  }
  if (c == EOF) fail("ends in the middle of a header");
  int value = 0;
  bool digits = false;
  for (; c >= '0' && c <= '9'; c = std::getc(file_.get())) {
    digits = true;
    value = std::min(value * 10 + (c - '0'), limit + 1);
  }
  std::ungetc(c, file_.get());
  if (!digits || value < 1 || value > limit)
    fail(std::string("is no PGM image: its ") + name + " is not a number from 1 to " +
         std::to_string(limit));
  return value;
}

}  // namespace harco::cli
