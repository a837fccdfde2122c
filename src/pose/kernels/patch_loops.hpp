// The loops in which alignment spends its time. Compiled for every instruction set; all give the
// same bits, since sums are kept in a fixed order and nothing is fused.
#pragma once

#include <cstddef>

namespace harco::kernels {

/// sums[a * n + b] = sum over i < count of weights[i] * columns[a][i] * columns[b][i], for
/// 1 <= a < n and b <= a; the rest is zero. So columns[0] may be what is to be explained.
void normal_products(const float* weights, const float* const* columns, std::size_t n,
                     std::size_t count, float* sums);

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

/// A picture's slopes at some pixels, which are (dx, dy) from the middle of their patch.
struct Gradients {
  const float *by_x, *by_y, *dx, *dy;
};

/// How pixels move with an unknown: (value, change by x, change by y) for each coordinate.
struct Flow {
  float x[3], y[3];
};

/// How much the unknowns k < n change what the pixels see, row by row.
void flow_rows(const Gradients& gradients, const Flow* flows, std::size_t n, std::size_t count,
               float* const* rows);

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

/// `grid` has 2 (kSide + 2 margin) rows of half pixels, `stride` apart, of which as many columns
/// are read. `scratch` holds (2 + 2 * 3) * (kSide + 2 margin) * 2 * kSide values or more.
void blur_patch(const float* grid, std::size_t stride, std::size_t margin, const Taps& taps,
                float* scratch, const Channels& to);

}  // namespace harco::kernels
