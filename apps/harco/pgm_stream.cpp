#include "pgm_stream.hpp"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <string_view>
#include <vector>

#include <fcntl.h>
#include <unistd.h>

#include "harco/error.hpp"

namespace harco::cli {
namespace {

// What a header may ask for: wider than any camera, and too small to exhaust the memory.
constexpr int kMaxSide = 65535;
constexpr std::int64_t kMaxPixels = std::int64_t{1} << 28;
constexpr std::size_t kMaxComment = 4096;

bool is_space(int c) { return c >= 0 && std::isspace(c) != 0; }

}  // namespace

PgmStream::PgmStream(const std::string& path, const StopSignal& stop)
    : name_(path == "-" ? "standard input" : path),
      stop_(stop),
      // A named pipe is opened at once, whether or not somebody writes to it yet.
      fd_(path == "-" ? STDIN_FILENO : open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)) {
  if (fd_ < 0) throw Error(name_ + ": can't be opened");
}

PgmStream::~PgmStream() {
  if (fd_ != STDIN_FILENO) close(fd_);
}

void PgmStream::fail(const std::string& what) const { throw Error(name_ + ": " + what); }

/// At least one byte, unless the stream has ended.
std::size_t PgmStream::read_bytes(std::uint8_t* to, std::size_t most) {
  for (;;) {
    if (!stop_.wait_for(fd_)) throw Stopped();
    const ssize_t count = ::read(fd_, to, most);
    if (count >= 0) return static_cast<std::size_t>(count);
    if (errno != EAGAIN && errno != EINTR) fail("can't be read");
  }
}

int PgmStream::peek() {
  if (next_ == filled_) {
    next_ = 0;
    filled_ = read_bytes(buffer_.data(), buffer_.size());
  }
  return filled_ == 0 ? kEnd : buffer_[next_];
}

int PgmStream::get() {
  const int c = peek();
  if (c != kEnd) ++next_;
  return c;
}

bool PgmStream::read(PgmFrame& frame) {
  try {
    return read_image(frame);
  } catch (const Stopped&) {
    return false;
  }
}

bool PgmStream::read_image(PgmFrame& frame) {
  frame.timestamp_s.reset();
  int c = get();
  while (is_space(c)) c = get();
  if (c == kEnd) return false;
  if (c != 'P' || get() != '5') fail("is no binary PGM image (P5)");

  const int width = read_number("width", kMaxSide, frame);
  const int height = read_number("height", kMaxSide, frame);
  const int white = read_number("number of grey levels", kMaxSide, frame);
  if (!is_space(get())) fail("is no PGM image: no white space ends the header");
  if (white > 255) fail("has more than 8 bits a pixel (" + std::to_string(white) + " grey levels)");
  if (std::int64_t{width} * height > kMaxPixels)
    fail("is too large (" + std::to_string(width) + " x " + std::to_string(height) + ")");

  frame.image.width = width;
  frame.image.height = height;
  std::vector<std::uint8_t>& pixels = frame.image.pixels;
  pixels.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  std::size_t done = std::min(filled_ - next_, pixels.size());
  std::copy_n(buffer_.begin() + static_cast<std::ptrdiff_t>(next_), done, pixels.begin());
  next_ += done;
  while (done < pixels.size()) {
    const std::size_t more = read_bytes(pixels.data() + done, pixels.size() - done);
    if (more == 0) fail("ends in the middle of an image");
    done += more;
  }
  if (white < 255)
    for (std::uint8_t& pixel : pixels)
      pixel = static_cast<std::uint8_t>((std::min<int>(pixel, white) * 255 + white / 2) / white);
  return true;
}

void PgmStream::read_comment(PgmFrame& frame) {
  std::string text;
  for (int c = get(); c != '\n'; c = get()) {
    if (c == kEnd) fail("ends in the middle of a header");
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
  while (is_space(peek()) || peek() == '#')
    if (get() == '#') read_comment(frame);
  if (peek() == kEnd) fail("ends in the middle of a header");
  int value = 0;
  bool digits = false;
  for (; peek() >= '0' && peek() <= '9'; digits = true)
    value = std::min(value * 10 + (get() - '0'), limit + 1);
  if (!digits || value < 1 || value > limit)
    fail(std::string("is no PGM image: its ") + name + " is not a number from 1 to " +
         std::to_string(limit));
  return value;
}

}  // namespace harco::cli
