#include "picture_file.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <string_view>
#include <system_error>
#include <vector>

#include "harco/error.hpp"
#include "pgm_stream.hpp"
#include "png_decode.hpp"

namespace harco::cli {
namespace {

std::vector<std::uint8_t> read_bytes(const std::filesystem::path& file) {
  errno = 0;
  std::ifstream in(file, std::ios::binary);
  if (!in)
    throw Error(file.string() + ": can't be opened (" + std::generic_category().message(errno) +
                ")");
  std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(in),
                                  std::istreambuf_iterator<char>()};
  if (in.bad()) throw Error(file.string() + ": can't be read");
  if (bytes.empty()) throw Error(file.string() + ": is empty");
  return bytes;
}

bool starts_with(const std::vector<std::uint8_t>& bytes, std::string_view text) {
  return bytes.size() >= text.size() &&
         std::equal(text.begin(), text.end(), bytes.begin(),
                    [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; });
}

/// JPEG decoders fill what is missing with grey and carry on; we want to know.
bool is_cut_jpeg(const std::vector<std::uint8_t>& bytes) {
  if (!starts_with(bytes, "\xff\xd8")) return false;
  constexpr std::uint8_t kEnd[] = {0xff, 0xd9};
  return std::search(bytes.begin() + 2, bytes.end(), std::begin(kEnd), std::end(kEnd)) ==
         bytes.end();
}

}  // namespace

PictureFile read_picture(const std::filesystem::path& file, bool colour) {
  const std::vector<std::uint8_t> bytes = read_bytes(file);
  PictureFile result;
  if (starts_with(bytes, "P5")) {
    PgmFrame frame;
    const StopSignal never;
    PgmStream(file.string(), never).read(frame);
    result.timestamp_s = frame.timestamp_s;
    result.picture.grey = std::move(frame.image);
    if (colour) result.picture.colour = to_colour(result.picture.grey);
  } else if (starts_with(bytes, "\x89PNG")) {
    result.picture = decode_png(bytes, file.string(), colour);
  } else {
    if (is_cut_jpeg(bytes)) throw Error(file.string() + ": is cut short");
    result.picture = media().decode(bytes, file.string(), colour);
  }
  return result;
}

}  // namespace harco::cli
