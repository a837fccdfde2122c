// Layer-1 markers of which parts are covered or out of view: squares are made of what is left of
// their sides, looked at shortly, and the few that look like a marker closely.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "detect/covered_squares.hpp"
#include "detect/lens.hpp"
#include "detect/pyramid.hpp"
#include "detect/quad.hpp"
#include "detect/recovery.hpp"
#include "detect/workers.hpp"
#include "harco/detect.hpp"
#include "harco/image.hpp"

namespace harco::detect {

/// What is looked for, and where.
struct CoveredSearch {
  double least_side_px = 80.0;
  int least_contrast = 16;  ///< grey levels between both sides of what is taken for an edge
  std::optional<Eigen::Matrix3d> calibration;  ///< of ideal pixels; then three sides do
};

class CoveredMarkers {
 public:
  CoveredMarkers(const MarkerSet& markers, const std::vector<PlacedMarker>& placed,
                 const std::vector<std::vector<double>>& predicted, std::size_t workers);

  /// To be told of every image before it is read. If the search is `expected`, its half picture is
  /// to be made by Pyramid::halve while it is read; the pyramid lives until the next image. Null
  /// otherwise: then the search does so itself.
  Pyramid* begin(const ImageView& image, bool expected);

  /// The markers found, those that explain most of the image first; several may overlap. `quads`
  /// are squares known already (ideal pixels), which are tried first. Valid until the next call.
  const std::vector<Recovered>& find(const ImageView& image, const Lens& lens,
                                     const CoveredSearch& search, const std::vector<Quad>& quads,
                                     Workers& workers, DetectionTrace* trace);

  /// Whether there were more squares in the last image than its budget allows to look at.
  bool budget_reached() const { return budget_reached_; }

 private:
  void choose_squares(const std::vector<Quad>& quads, const std::vector<SideQuad>& seen,
                      double least_side_px, std::size_t most);
  void choose_glimpses();

  Pyramid pyramid_;
  bool halved_ = false;  // by others
  CoveredSquares covered_;
  std::vector<Recovery> recoveries_;  // of each of those who work
  std::vector<Quad> squares_;
  std::vector<std::optional<Glimpse>> glimpses_;  // of each square and size
  std::vector<std::size_t> chosen_;               // of them, the best one first
  std::vector<double> rivals_;                    // of those
  std::vector<std::optional<Recovered>> looked_at_;
  std::vector<Recovered> found_;
  bool budget_reached_ = false;
};

}  // namespace harco::detect
