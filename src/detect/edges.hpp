// Fourth stage: the sides of a quad, fitted to the grey values across them.
#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "detect/lens.hpp"
#include "detect/quad.hpp"
#include "harco/detect.hpp"
#include "harco/image.hpp"

namespace harco::detect {

/// What lies along the outside of a quad's sides.
struct SideProfile {
  bool bright_inside = false;  ///< a child's white ring; else a parent's black one
  double cell_share = 0.0;     ///< width of the even band inside the side, as a share of the side
  double line_share = 0.0;     ///< width of the black line outside a bright quad, as a share
};

/// Corners of the fitted sides with their errors, in pixels of the ideal camera (see Lens).
struct FittedQuad {
  Quad corners;
  Matrix8d covariance;  ///< of x and y of the corners one after the other
};

/// Fits the four sides of `quad` (ideal pixels, right to about a pixel). Empty if along some side
/// there is no straight edge with dark and bright on the right sides.
std::optional<FittedQuad> fit_edges(const ImageView& image, const Lens& lens, const Quad& quad,
                                    const SideProfile& profile);

/// The same from the blurred picture of what lies across the sides: an order more accurate, and
/// with the covariance that the grey values bear out. It starts from a quad that is right to a part
/// of a pixel, such as fit_edges finds. Empty where the picture is another one.
std::optional<FittedQuad> sharpen_edges(const ImageView& image, const Lens& lens, const Quad& quad,
                                        const SideProfile& profile);

}  // namespace harco::detect
