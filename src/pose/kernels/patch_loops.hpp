// The loops in which alignment spends its time. Compiled for every instruction set; all give the
// same bits, since sums are kept in a fixed order and nothing is fused.
#pragma once

#include <cstddef>
#include <cstdint>

namespace harco::kernels {

/// Of these are no more than so many.
inline constexpr std::size_t kMostColumns = 32;

/// sums[a * n + b] = sum over i < count of weights[i] * columns[a][i] * columns[b][i], for
/// b <= a < n; the rest is zero.
void normal_products(const float* weights, const float* const* columns, std::size_t n,
                     std::size_t count, float* sums);

/// sums[k] = sum of weights[i] * columns[k][i] over count samples from the first on, for k < n.
void column_sums(const float* weights, const float* const* columns, std::size_t n,
                 std::size_t first, std::size_t count, float* sums);

/// With q = 1 - z^2 / limit, none below zero: the sums of q^3 and q^2 (Tukey's weight), of the
/// derivative q (5 q - 4) of z q^2, and of its square, z^2 q^4.
struct TukeySums {
  float cubed, weight, slope, square;
};
TukeySums tukey_sums(const float* residuals, float inverse_variance, float inverse_limit,
                     std::size_t count);

/// Median of |values|, the upper one of two; zero of none.
float median_size(const float* values, std::size_t count);

/// left = from - sum over k < n of by[k] * columns[k], for i < count.
void subtract_rows(const float* from, const float* const* columns, const float* by, std::size_t n,
                   std::size_t count, float* left);

/// 1 for residuals of up to one sigma, sigma over their size beyond.
void huber_weights(const float* residuals, float inverse_variance, std::size_t count,
                   float* weights);

/// (1 - z^2 / limit)^2 with z^2 the residual squared over the variance, and zero where that is more
/// than the limit.
void tukey_weights(const float* residuals, float inverse_variance, float inverse_limit,
                   std::size_t count, float* weights);

/// Levels of black and white over the marker, as in Light, and the camera's response as tables of
/// cells + 1 values over the share of white.
struct LightTerms {
  const float *seen, *slope, *by_log_gamma;
  int cells;
  float levels[9];
  float dark_part;               ///< black's level as a share of white's
  float less_white, less_black;  ///< what a shadow takes of their light
  std::size_t pictured;          ///< columns that change with the picture; the light's follow
};

/// Samples of a picture. `depth` is the shadow's, 0 ... 1, or null without one.
struct LitSamples {
  const float *grey, *white_share, *u, *v, *depth;
  float* const* columns;
  float* residuals;
};

/// From shares of white to grey values, for count samples from the first on: the residuals; the
/// pictured columns scaled; then the columns of the response, of black (3), of white (6) and, in a
/// shadow, of what it leaves of white's and of black's light. What is burnt out changes with
/// nothing.
void light_rows(const LitSamples& samples, const LightTerms& light, float gain, std::size_t first,
                std::size_t count);

/// Sides of a patch of pixels, see PatchPainter.
inline constexpr std::size_t kSide = 16;

/// A symmetric blur and its first and second derivative, at the distances 1/2, 3/2 ... half pixels.
struct Taps {
  const float* value;
  const float* slope;
  const float* bend;
  std::size_t count;
};

/// A patch blurred and differentiated.
struct Channels {
  float *ink, *by_x, *by_y, *by_xx, *by_xy, *by_yy;  ///< kSide x kSide each
};

/// How a quantity changes over a patch: (value, change by x, change by y) from its middle.
struct Slope {
  float middle, by_x, by_y;
};

/// How pixels move with an unknown, in each coordinate.
struct Flow {
  Slope x, y;
};

/// A patch as the camera has it and as it is drawn. `bulge`, or null, is by how much the ink
/// changes with the blur's peak.
struct SeenPatch {
  const float* grey;  ///< kSide x kSide, as the channels are
  Channels drawn;
  const float* bulge;
  float peak;
  const Flow* flows;  ///< of the unknowns of the pose
  std::size_t unknowns;
  Slope u, v;  ///< places on the marker
};

/// Where samples go: a column for each unknown of the pose, the blur's three and, if there is a
/// bulge, its peak; `along` are places in the patch, -1 ... 1. There has to be room for kSide
/// values more than are picked.
struct PickedPixels {
  float *grey, *white_share, *u, *v, *along_x, *along_y;
  float* const* flows;
  float *by_xx, *by_xy, *by_yy, *by_peak;
};

/// Takes the pixels of a patch where the ink changes by `least` or more a pixel, and of the others
/// those that are among `some`, as far as they are allowed; a bit a pixel, a word a row. Returns
/// how many.
std::size_t take_pixels(const SeenPatch& patch, float least, const std::uint16_t* some,
                        const std::uint16_t* allowed, const PickedPixels& to);

/// Part of an outline that goes down through a patch: x in pixels from the margin's left end, at
/// `top`; `slope` is its change for each half pixel; `top` and `bottom` in half pixels from the
/// margin's upper end. On its right is `sign` more ink.
struct PatchEdge {
  float x, slope, top, bottom, sign;
};

/// What a row of pixels sees of a step, with the first two derivatives by the pixels' place. The
/// table has, for each phase p, three rows of `stride` values, and pixel k sees a step at x as the
/// value i + k of phase p says, with i + p / kPhases = origin - x.
struct Steps {
  static constexpr std::size_t kPhases = 16;  // of a pixel
  const float* table;
  std::size_t stride;
  float origin;
};

/// Draws edges and `starts`, the ink at the rows' left ends, onto what `scratch` holds (from
/// nothing unless there is `more`): 2 (kSide + 2 margin) times 3 kSide values, aligned to 64 bytes.
/// Then, if there is somewhere to put it, blurs it by the taps downwards.
void draw_patch(const PatchEdge* edges, std::size_t count, const float* starts, std::size_t margin,
                const Steps& steps, const Taps& taps, bool more, float* scratch,
                const Channels& to);

}  // namespace harco::kernels
