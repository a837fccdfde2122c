// Frames for timing: photographs with AprilTag 36h11 markers before them, which every detector that
// we compare with can read.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "harco/image.hpp"
#include "harco/marker.hpp"

namespace harco::bench {

struct Size {
  int width;
  int height;
};

/// What a frame shows.
enum class Content {
  one,           ///< one marker, an eighth to a half of the frame's height, before photographs
  thirty,        ///< thirty small ones, in a loose grid
  texture,       ///< photographs, no marker
  night,         ///< one marker in the dark: a tenth of the light, noise of 6 grey levels
  noise,         ///< nothing but noise of 40 grey levels
  checkerboard,  ///< a wall of squares of 12 pixels, slightly blurred
  text           ///< photographs of letters, side by side
};
inline constexpr std::array kContents{Content::one,   Content::thirty, Content::texture,
                                      Content::night, Content::noise,  Content::checkerboard,
                                      Content::text};
const char* to_string(Content content);

struct Truth {
  int id;
  std::array<Eigen::Vector2d, 4> corners;  ///< as Detection::corners
};

struct Frame {
  Image image;
  std::vector<Truth> markers;
};

/// Thirty parents with the codes of AprilTag 36h11 and its ids, without children.
MarkerSet apriltag_set();

/// The same arguments give the same frame. Photographs are OpenCV's, from Debian's package
/// opencv-doc; throws Error if they aren't there.
Frame make_frame(const MarkerSet& markers, Size size, Content content, std::uint64_t seed);

/// As Content::thirty, with `count` of the thirty, 0 … 30; all of a size, however many they are.
Frame make_grid(const MarkerSet& markers, Size size, int count, std::uint64_t seed);

}  // namespace harco::bench
