#include "detect/segments.hpp"

#include <algorithm>
#include <cmath>

namespace harco::detect {
namespace {

constexpr int kApart = StepMap::kApart;
// Even samples on either side of a step; two where there are few steps, so that edges between
// things that cover the rest show as well. Before texture, three find more markers than two: of
// texture there is a third of the steps.
constexpr int kEven = 2, kEvenInTexture = 3;
constexpr int kFewSteps = 700;  // along rows
// A step belongs to an edge if it lies within this of where the edge goes on, in pixels, and if its
// levels differ by no more than this share of the contrast.
constexpr float kBeside = 0.5F;
constexpr double kLevelShare = 0.3;
// Steeper ones are found the other way; somewhat more is allowed for what noise does.
constexpr float kSteepest = 1.25F;
// Scan lines that an edge crosses, and the share of those between its ends.
constexpr int kLeastSteps = 3;
constexpr double kLeastShare = 0.7;
// Root mean square distance from the fitted line, pixels, and share of the length more: a lens
// bends it.
constexpr double kStraight = 0.25;
constexpr double kBend = 0.0025;

}  // namespace

// What is done for each step is inline: shared libraries wouldn't let compilers do it otherwise.
inline double SegmentFinder::Chain::slope() const {
  return (count * sum_st - sum_s * sum_t) / (count * sum_ss - sum_s * sum_s);
}

inline double SegmentFinder::Chain::place_at(int s) const {
  return static_cast<double>(first_t) + sum_t / count + slope() * (s - first_s - sum_s / count);
}

inline void SegmentFinder::Chain::add(const Step& step) {
  if (count == 0) {
    first_s = step.s;
    first_t = step.t;
  }
  last_s = step.s;
  ++count;
  const double s = step.s - first_s;
  const double t = static_cast<double>(step.t) - static_cast<double>(first_t);
  sum_s += s;
  sum_t += t;
  sum_ss += s * s;
  sum_st += s * t;
  sum_tt += t * t;
  sum_before += step.twice_before;
  sum_behind += step.twice_behind;
}

void SegmentFinder::Scan::start(int places) {
  // One more on either side.
  latest.assign(static_cast<std::size_t>(places + 2), {});
  chains.clear();
}

/// How far a step lies beside where the edge of an earlier one goes on.
inline float SegmentFinder::beside(const Step& before, const Step& step) {
  const float lean = before.lean + before.unsure * (step.slope - before.lean);
  return std::abs(before.at + lean * static_cast<float>(step.s - before.s) - step.t);
}

/// Adds the step to the edge that it continues, if there is one.
inline void SegmentFinder::Scan::link(Step& step) {
  constexpr int kEnough = 4;  // steps, for their places to tell more than their gradients
  const auto most = static_cast<float>(latest.size() - 3);
  const int slack = static_cast<int>(kLevelShare * std::abs(step.twice_behind - step.twice_before));
  Step* before = nullptr;
  float nearest = kBeside;
  // On the scan line before, or on the one before that.
  for (int back = kApart; back <= 2 * kApart && !before; back += kApart) {
    const int s = step.s - back;
    const float place = std::clamp(step.t - step.slope * static_cast<float>(back), 0.0F, most);
    Step* const around = &latest[static_cast<std::size_t>(place)];
    for (Step* other = around; other < around + 3; ++other) {
      if (other->s != s || std::abs(other->twice_before - step.twice_before) > slack ||
          std::abs(other->twice_behind - step.twice_behind) > slack)
        continue;
      const float away = beside(*other, step);
      if (away >= nearest) continue;
      nearest = away;
      before = other;
    }
  }
  step.at = step.t;
  step.lean = step.slope;
  if (before) {
    if (before->chain < 0) {
      before->chain = static_cast<int>(chains.size());
      chains.emplace_back().add(*before);
    }
    step.chain = before->chain;
    Chain& chain = chains[static_cast<std::size_t>(step.chain)];
    chain.add(step);
    if (chain.count >= kEnough) {
      step.at = static_cast<float>(chain.place_at(step.s));
      step.lean = static_cast<float>(chain.slope());
      step.unsure = 0.0F;
    }
  }
  latest[static_cast<std::size_t>(std::clamp(step.t, 0.0F, most)) + 1] = step;
}

/// Measures the step behind pixel (x, y) and links it.
inline void SegmentFinder::Scan::read(const ImageView& image, bool rows, int x, int y) {
  const std::ptrdiff_t along = rows ? 1 : image.stride();
  const std::ptrdiff_t across = rows ? image.stride() : 1;
  const std::uint8_t* const pixel = image.row(y) + x;
  const auto grey = [&](int k) { return int{pixel[k * along]}; };
  const int before = grey(-2) + grey(-1);
  const int behind = grey(2) + grey(3);
  const float share = 1.0F / static_cast<float>(behind - before);
  // An ideal step turns by twice the slope from the line before to the line behind.
  int turned = 0;
  for (int k = -2; k <= 3; ++k) turned += pixel[k * along - across] - pixel[k * along + across];
  Step step;
  step.slope = share * static_cast<float>(turned);
  if (std::abs(step.slope) > kSteepest) return;
  // So many of the four pixels in the middle are like those before.
  const int sum = grey(-1) + grey(0) + grey(1) + grey(2);
  const float like_before = share * static_cast<float>(2 * (2 * behind - sum));
  step.t = static_cast<float>(rows ? x : y) - 1.5F + like_before;
  step.s = rows ? y : x;
  step.twice_before = static_cast<std::int16_t>(before);
  step.twice_behind = static_cast<std::int16_t>(behind);
  link(step);
}

void SegmentFinder::scan(const ImageView& image, bool rows, int even, int least_contrast,
                         Scan& scan) {
  scan.start(rows ? image.width() : image.height());
  scan.steps.find(image, rows, even, least_contrast);
  scan.steps.for_each([&](int s, int t) { scan.read(image, rows, rows ? t : s, rows ? s : t); });
}

void SegmentFinder::keep(const Scan& scan, bool rows, double least_px) {
  for (const Chain& chain : scan.chains) {
    const int span = chain.last_s - chain.first_s;
    const int lines = span / kApart + 1;
    if (chain.count < kLeastSteps || chain.count < kLeastShare * lines) continue;
    const double slope = chain.slope();
    // Each way finds its own.
    if (rows ? std::abs(slope) > 1.0 : std::abs(slope) >= 1.0) continue;
    const double stretch = std::hypot(1.0, slope);
    // On average, the ends lie half a scan line beyond.
    const double length = (span + kApart) * stretch;
    if (length < least_px) continue;
    const double n = chain.count;
    const double spread = chain.sum_tt - chain.sum_t * chain.sum_t / n -
                          slope * (chain.sum_st - chain.sum_s * chain.sum_t / n);
    const double off = std::sqrt(std::max(0.0, spread) / n) / stretch;
    if (off > kStraight + kBend * length) continue;
    const auto at = [&](int s) {
      const double t = chain.place_at(s);
      return rows ? Point(t, s) : Point(s, t);
    };
    const double before = 0.5 * chain.sum_before / n;
    const double behind = 0.5 * chain.sum_behind / n;
    Segment segment{at(chain.first_s), at(chain.last_s), std::min(before, behind),
                    std::max(before, behind)};
    if (rows != (before < behind)) std::swap(segment.a, segment.b);
    segments_.push_back(segment);
  }
}

const std::vector<Segment>& SegmentFinder::find(const ImageView& image, double least_px,
                                                int least_contrast, Workers& workers) {
  segments_.clear();
  if (std::min(image.width(), image.height()) <= StepMap::kBefore + StepMap::kBehind)
    return segments_;
  const bool few = scans_[0].steps.count_roughly(image, kEven, least_contrast) <= kFewSteps;
  const int even = few ? kEven : kEvenInTexture;
  workers.share(scans_.size(), [&](std::size_t way, std::size_t) {
    scan(image, way == 0, even, least_contrast, scans_[way]);
  });
  keep(scans_[0], true, least_px);
  keep(scans_[1], false, least_px);
  return segments_;
}

}  // namespace harco::detect
