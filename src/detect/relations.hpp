// Last stage: detections of one sheet have to agree with one another.
#pragma once

#include <vector>

#include "detect/lens.hpp"
#include "harco/detect.hpp"

namespace harco::detect {

/// Knows where each marker of the set stands, and so where a detection would have to see its
/// relatives.
class Relations {
 public:
  Relations(const std::vector<PlacedMarker>& placed, const Lens& lens)
      : placed_(placed), lens_(lens) {}

  /// Both are of one parent, and the larger in the image sees the smaller where it is.
  bool agree(const Detection& a, const Detection& b) const;

  /// Both are of one parent, the smaller is seen within the larger, but not where it belongs. A
  /// partly covered marker contradicts what it doesn't agree with.
  bool contradict(const Detection& a, const Detection& b) const;

 private:
  /// Distance between the smaller's centre as seen and as the larger predicts it, in sides of the
  /// smaller; empty for markers that can't be compared.
  std::optional<double> disagreement(const Detection& larger, const Detection& smaller) const;

  const std::vector<PlacedMarker>& placed_;
  const Lens& lens_;
};

}  // namespace harco::detect
