// Layer-1 markers of which something covers parts: found from the sides' remains, told apart by
// the edges that are still to be seen.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "detect/cell_votes.hpp"
#include "detect/lens.hpp"
#include "detect/likeness.hpp"
#include "detect/pyramid.hpp"
#include "detect/quad.hpp"
#include "detect/registration.hpp"
#include "harco/image.hpp"
#include "harco/marker.hpp"

namespace harco::detect {

/// A partly covered layer-1 marker.
struct Recovered {
  int placed = 0;             ///< index into place(markers)
  Registration registration;  ///< of the upright marker
  Evidence evidence;
  Likeness likeness;
  double lead = 0.0;  ///< of the likeness, over the next best reading's of the same square
  CellVotes votes;
  int foreign = 0;        ///< edges seen where the marker has none but another one may
  int wrong_cells = 0;    ///< inner cells that don't show their colour
  int opposed_cells = 0;  ///< of them: those that show the other one
  double quality = 0.0;   ///< agreement of those cells that show black or white, 0 ... 1
};

class Recovery {
 public:
  Recovery(const MarkerSet& markers, const std::vector<PlacedMarker>& placed,
           const std::vector<std::vector<double>>& predicted);

  /// The marker whose border is near `quad` (ideal pixels, right to a few pixels, dark inside);
  /// empty if none of the set is borne out by enough of its edges, or two are.
  std::optional<Recovered> at(const Pyramid& image, const Lens& lens, const Quad& quad);

 private:
  /// What is known of a parent beforehand, made when first needed.
  struct Description {
    std::vector<TemplateEdge> edges;
    std::vector<TemplateEdge> blank;  ///< where it has none, but others may
    Texels picture;
    std::vector<CellSquare> children;  ///< of layer 2
  };
  /// One of the markers of the set in one of its four turns.
  struct Reading {
    std::size_t parent = 0;
    int turns = 0;
    double score = 0.0;  ///< the more of its cells show what the marker has there, the higher
    int wrong = 0;       ///< cells that don't show their colour,
    int opposed = 0;     ///< of them: those that show the other one
    double quality = 0.0;
    Likeness likeness;
  };
  const Description& describe(std::size_t parent);
  void rank(const ImageView& image, const Lens& lens, const Registration& registration, int cells);
  void compare(const Pyramid& image, const Lens& lens, const Registration& registration, int cells);
  template <class Score>
  void keep_best(std::size_t most, Score score);
  std::optional<Recovered> best_reading(const Pyramid& image, const Lens& lens, const Quad& quad);
  bool borne_out(const ImageView& image, const Lens& lens, const Recovered& reading) const;
  bool borne_out_by_edges(const ImageView& image, const Lens& lens, const Recovered& reading) const;

  const MarkerSet& markers_;
  const std::vector<PlacedMarker>& placed_;
  const std::vector<std::vector<double>>& predicted_;
  std::vector<int> placed_of_;  // of each parent
  std::vector<int> sizes_;      // the different n of parents
  std::vector<Description> descriptions_;
  std::vector<Reading> readings_;
  Unwarped unwarped_;
  std::array<Texels, 4> turned_;
  Texels smooth_;  // a picture as blurred as the image
};

}  // namespace harco::detect
