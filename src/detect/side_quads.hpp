// Squares of which only parts of the sides are seen.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "detect/quad.hpp"
#include "detect/segments.hpp"

namespace harco::detect {

/// A quad that segments suggest, dark inside.
struct SideQuad {
  Quad corners;
  double seen = 0.0;  ///< share of its outline that the segments cover, 0 ... 1
};

/// Makes quads of segments, with the memory that it needs for it.
class SideQuadFinder {
 public:
  /// Convex quads of at least `least_side_px` mean side on whose every side some segment lies, all
  /// of them between about the same dark and the same bright; those with the longest seen outline
  /// first, none twice, at most `most`. The search is bounded: of many segments, the longest take
  /// part. Valid until the next call.
  ///
  /// With the calibration matrix of the camera (of ideal pixels, see Lens), squares of which three
  /// sides are seen as well: two interpretation planes meet in the direction of the sides between,
  /// the third gives the other direction, and a square's sides are equal.
  const std::vector<SideQuad>& find(const std::vector<Segment>& segments, double least_side_px,
                                    std::size_t most,
                                    const std::optional<Eigen::Matrix3d>& calibration);

 private:
  /// A direction in 256ths of a turn.
  using Heading = std::uint8_t;
  // Segments that take part.
  static constexpr std::size_t kMostSegments = 400;
  /// Some of them, a bit each.
  using Members = std::array<std::uint64_t, (kMostSegments + 63) / 64>;
  /// A segment with what is asked of it often.
  struct Part {
    Segment segment;
    Point direction;
    double length = 0.0;
    double dark = 0.0, bright = 0.0;
  };
  /// From where to where along a line, distances from its `point`.
  struct Stretch {
    double from = 0.0, to = 0.0;
  };
  /// Some of a list.
  struct Range {
    std::size_t begin = 0, end = 0;
  };
  /// Segments along one straight line, the dark on its right.
  struct Line {
    Point point;
    Point direction;
    double dark = 0.0, bright = 0.0;  ///< mean levels
    double length = 0.0;              ///< of all pieces
    Range pieces;                     ///< of `stretches_`, in their order
    Range opposed;                    ///< likewise, the dark on the left
  };
  /// Where line `a` turns right into line `b`.
  struct Turn {
    std::size_t to = 0;
    Point corner;
    double on_from = 0.0, on_to = 0.0;  ///< where the corner lies along both lines
  };
  class LineFit;

  static Heading heading_of(const Point& direction);
  template <typename Visit>
  void for_each_near(Heading heading, const Members& among, const Visit& visit) const;
  static bool along(const Line& line, const Part& part);
  static bool joins(const Line& line, const Part& part);
  static bool opposes(const Line& line, const Part& part);
  void take_longest(const std::vector<Segment>& segments);
  void merge();
  void join_to(std::size_t seed);
  void find_opposed(Line& line);
  double within(const Range& stretches, double from, double to) const;
  bool ends_by(const Line& line, double at) const;
  bool begins_at(const Line& line, double at) const;
  void find_turns();
  double seen(std::size_t line, double from, double to) const;
  void find_quads();
  void add(const Quad& corners, double seen_px);
  void close(std::size_t a, const Turn& ab, const Turn& bc, double seen_b);
  void complete(std::size_t a, const Turn& ab, const Turn& bc, double seen_b);
  void keep_best(std::size_t most);

  double least_side_px_ = 0.0;
  std::optional<Eigen::Matrix3d> calibration_;
  std::vector<std::pair<double, std::size_t>> by_length_;
  std::vector<Part> parts_;  // the longest one first
  std::array<Members, 256> by_heading_{};
  Members all_{}, left_{};            // those in no line yet
  std::vector<std::size_t> members_;  // of one line
  std::vector<Stretch> stretches_;
  std::vector<Line> lines_;  // the longest one first
  std::vector<Turn> turns_;  // from the first line, from the second one, …
  std::vector<Range> turns_from_;
  std::vector<SideQuad> quads_;
  std::vector<SideQuad> best_;
};

}  // namespace harco::detect
