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

/// One of the markers of the set in one of its four turns, for a square.
struct Reading {
  std::size_t parent = 0;
  int turns = 0;
  float score = 0.0F;  ///< the more of its cells show what the marker has there, the higher
  Likeness likeness;
};

/// A square after a first look.
struct Glimpse {
  int cells = 0;  ///< across, the border ring left out
  Registration border;
  std::array<Reading, 4> readings;  ///< the likeliest ones, best first
  std::size_t count = 0;            ///< of them
  double sum() const { return readings.front().likeness.sum(); }
};

class Recovery {
 public:
  Recovery(const MarkerSet& markers, const std::vector<PlacedMarker>& placed,
           const std::vector<std::vector<double>>& predicted);

  /// The different numbers of cells across that layer-1 markers have.
  std::size_t sizes() const { return tables_.size(); }

  /// What the square whose border is near `quad` (ideal pixels, right to a few pixels, dark inside)
  /// may be, of the markers of one of those sizes. Empty if nothing of it looks like any.
  std::optional<Glimpse> glimpse(const Pyramid& image, const Lens& lens, const Quad& quad,
                                 std::size_t size);

  /// The marker that it is; empty if none is borne out by enough of its edges, or two are. `rival`
  /// is the likeness of another marker there.
  std::optional<Recovered> at(const Pyramid& image, const Lens& lens, const Glimpse& glimpse,
                              double rival);

 private:
  /// What is known of a parent beforehand, made when first needed: for a glimpse its picture is
  /// enough.
  struct Description {
    std::vector<TemplateEdge> edges;
    std::vector<TemplateEdge> blank;   ///< where it has none, but others may
    std::vector<CellSquare> children;  ///< of layer 2
  };
  /// The cells of all readings of one size.
  struct Table {
    int cells = 0;
    std::vector<Reading> readings;
    std::vector<float> expected;  ///< [cell][reading], how white it should look
  };
  /// A picture at one of the blurs for which pictures are kept.
  struct Kept {
    std::size_t parent = 0;
    int step = 0;
    BlurredPicture picture;
  };
  const Description& describe(std::size_t parent);
  const Texels& printed(std::size_t parent);
  const BlurredPicture& picture_of(std::size_t parent, int cells, double blur);
  void read_cells(const ImageView& image, const Lens& lens, const Registration& registration,
                  int cells);
  void rank(const Table& table);
  void compare(const Pyramid& image, const Lens& lens, Glimpse& glimpse);
  void count_cells(const Reading& reading, int cells, Recovered& recovered) const;
  std::optional<Recovered> best_reading(const Pyramid& image, const Lens& lens,
                                        const Glimpse& glimpse, double rival);
  bool borne_out(const ImageView& image, const Lens& lens, const Recovered& reading) const;
  bool borne_out_by_edges(const ImageView& image, const Lens& lens, const Recovered& reading) const;

  const MarkerSet& markers_;
  const std::vector<PlacedMarker>& placed_;
  const std::vector<std::vector<double>>& predicted_;
  std::vector<int> placed_of_;  // of each parent
  std::vector<Table> tables_;
  std::vector<Description> descriptions_;
  std::vector<Texels> pictures_;
  std::vector<Kept> kept_;
  std::size_t next_kept_ = 0;  // of them, the one to be given up next
  std::vector<float> cells_;   // how white those of the square look
  std::vector<float> scores_;  // of all readings
  std::vector<Reading> readings_;
  FitMemory memory_;
  Unwarped unwarped_;
  std::array<Blocks, 4> turned_;
  // Of a picture as blurred as the image.
  Texels smooth_;
  BlurredPicture blurred_;
};

}  // namespace harco::detect
