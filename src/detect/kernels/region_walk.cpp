#include "detect/kernels/region_walk.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

// Highway compiles this file once for every instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "detect/kernels/region_walk.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.
#include <hwy/highway.h>

#ifndef HARCO_REGION_WALK_ONCE
#define HARCO_REGION_WALK_ONCE
namespace harco::detect::kernels {

// Pixels on one side of an end and the end itself.
constexpr std::int32_t kHalf = (1 << (kWalkReach + 1)) - 1;

// Beside the index of a region, as one number.
constexpr std::int32_t kLeftInwards = 1 << 30;
constexpr std::int32_t kRightInwards = 1 << 29;
constexpr std::int32_t kIndex = kRightInwards - 1;

// Rows are listed and read so many at a time, of which some are none.
constexpr std::size_t kMostLanes = 64;

/// Of how many rows a list takes the room.
constexpr std::size_t listed_length(std::size_t count) {
  return (count + kMostLanes - 1) / kMostLanes * kMostLanes;
}

}  // namespace harco::detect::kernels
#endif

HWY_BEFORE_NAMESPACE();
namespace harco::detect::kernels::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

void walk_regions_simd(const RegionMap& map, const RegionStart* starts, std::size_t count,
                       const WalkedRows& rows, RegionWalk* walks, WalkEnd* ends) {
  walk_regions_scalar(map, starts, count, rows, walks, ends);
}

#else

namespace hn = hwy::HWY_NAMESPACE;
using Lanes = hn::ScalableTag<std::int32_t>;
using Lane = hn::Vec<Lanes>;
using Mask = hn::Mask<Lanes>;
constexpr Lanes kLanes;
constexpr hn::RebindToUnsigned<Lanes> kUnsigned;

/// Regions that are walked together, row by row; who is done leaves the list.
struct Walks {
  using List = std::int32_t[kWalkTogether + kMostLanes];
  alignas(64) List offset;                       // of the row above, in bytes
  alignas(64) List left_extreme, right_extreme;  // as for a Side
  alignas(64) List least, most;                  // of all ends
  alignas(64) List area;
  alignas(64) List index;  // and, as the highest bits, whether the sides go inwards

  RegionWalk walk(std::size_t at, int rows, std::int32_t last_row) const {
    return {rows,
            last_row,
            left_extreme[at],
            right_extreme[at],
            (index[at] & kLeftInwards) != 0,
            (index[at] & kRightInwards) != 0,
            least[at],
            most[at],
            area[at]};
  }
};

HWY_INLINE Lane load(const std::int32_t* list, std::size_t at) {
  return hn::LoadU(kLanes, list + at);
}

#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL
HWY_INLINE Lane words_at(const std::uint8_t* bytes, Lane at) {
  return hn::GatherOffset(kLanes, reinterpret_cast<const std::int32_t*>(bytes), at);
}
#else
HWY_INLINE Lane words_at(const std::uint8_t* bytes, Lane at) {
  alignas(64) std::int32_t offsets[kMostLanes];
  alignas(64) std::int32_t words[kMostLanes];
  hn::Store(at, kLanes, offsets);
  for (std::size_t i = 0; i < hn::Lanes(kLanes); ++i)
    std::memcpy(&words[i], bytes + offsets[i], sizeof words[i]);
  return hn::Load(kLanes, words);
}
#endif

/// 32 pixels of a row from `x` on, the first one lowest; 25 are valid.
HWY_INLINE Lane pixels_from(const std::uint8_t* bits, Lane offset, Lane x) {
  const auto byte = hn::Add(offset, hn::ShiftRight<3>(x));
  const auto shift = hn::BitCast(kUnsigned, hn::And(x, hn::Set(kLanes, 7)));
  return hn::BitCast(kLanes, hn::Shr(hn::BitCast(kUnsigned, words_at(bits, byte)), shift));
}

/// Which bit is the highest one set; of something positive below 2^24.
HWY_INLINE Lane highest_bit(Lane bits) {
  const hn::RebindToFloat<Lanes> floats;
  const auto exponent = hn::ShiftRight<23>(hn::BitCast(kLanes, hn::ConvertTo(floats, bits)));
  return hn::Sub(exponent, hn::Set(kLanes, 127));
}

HWY_INLINE Mask at_least(Lane a, Lane b) { return hn::Not(hn::Lt(a, b)); }

HWY_INLINE Lane one_at(Lane bit) {
  return hn::BitCast(kLanes, hn::Shl(hn::Set(kUnsigned, 1), hn::BitCast(kUnsigned, bit)));
}

HWY_INLINE Lane lowest_one(Lane bits) { return hn::And(bits, hn::Neg(bits)); }

/// One side, which counts outwards: false where it goes out again after it has come in.
HWY_INLINE Mask goes_on(Lane at, Lane tolerance, Lane& extreme, Mask& inwards) {
  const auto is_inwards = inwards;
  const auto turns = hn::AndNot(is_inwards, hn::Lt(at, hn::Sub(extreme, tolerance)));
  const auto fine = hn::Not(hn::And(is_inwards, hn::Gt(at, hn::Add(extreme, tolerance))));
  const auto farther = hn::Or(turns, hn::And(is_inwards, hn::Lt(at, extreme)));
  const auto outer = hn::AndNot(is_inwards, hn::Gt(at, extreme));
  extreme = hn::IfThenElse(hn::Or(farther, outer), at, extreme);
  inwards = hn::Or(inwards, turns);
  return fine;
}

/// Puts those lanes that go on behind those before them. Whole vectors: storing single lanes is
/// slow on some machines, and what lies behind has been read. The lanes beyond hold anything.
HWY_INLINE void store_kept(Lane lanes, Mask kept, std::int32_t* to) {
  hn::StoreU(hn::Compress(lanes, kept), kLanes, to);
}

/// Walks those in the lists until none is left, or no room.
void walk_together(const RegionMap& map, Walks& lists, std::size_t count, const WalkedRows& listed,
                   RegionWalk* walks, WalkEnd* ends) {
  const std::size_t lanes = hn::Lanes(kLanes);
  const auto zero = hn::Zero(kLanes);
  const auto one = hn::Set(kLanes, 1);
  const auto reach = hn::Set(kLanes, kWalkReach);
  const auto half = hn::Set(kLanes, kHalf);
  const auto beyond = hn::Set(kLanes, kHalf >> 2);  // of pixels that don't touch the end
  const auto touch = hn::Set(kLanes, map.dark ? 1 : 0);
  const auto flip = hn::Set(kLanes, map.dark ? 0 : -1);
  const auto stride = hn::Set(kLanes, static_cast<std::int32_t>(map.stride));
  const auto last = hn::Set(kLanes, map.width - 1);
  const auto end = hn::Set(kLanes, static_cast<std::int32_t>(map.height * map.stride));
  const auto left_flag = hn::Set(kLanes, kLeftInwards);
  const auto right_flag = hn::Set(kLanes, kRightInwards);
  std::size_t first = 0;  // where the last rows are listed
  int rows = 1;
  for (std::size_t next = 0; count >= kWalkFewest; first = next, ++rows) {
    next = first + listed_length(count);
    if (next + listed_length(count) > kWalkRoom) break;
    const std::int32_t* lefts = listed.left + first;
    const std::int32_t* rights = listed.right + first;
    const auto height = hn::Set(kLanes, rows * map.row_step);
    const auto tolerance = hn::Set(kLanes, walk_tolerance(rows * map.row_step));
    std::size_t kept = 0;
    for (std::size_t at = 0; at < count; at += lanes) {
      const auto real = hn::FirstN(kLanes, count - at);
      const auto above = load(lists.offset, at);
      const auto here = hn::Add(above, stride);
      const auto low = hn::Sub(load(lefts, at), touch);
      const auto high = hn::Add(load(rights, at), touch);

      // The left end: ones up to `low`, or else zeros from there on.
      const auto around_low = hn::Xor(pixels_from(map.bits, here, hn::Sub(low, reach)), flip);
      const auto free_out = hn::AndNot(around_low, half);
      const auto set_in = hn::And(hn::ShiftRight<kWalkReach>(around_low), half);
      const auto tall_out = hn::And(pixels_from(map.tall, above, hn::Sub(low, reach)), beyond);
      const auto first_free = highest_bit(hn::Max(free_out, one));
      const auto left_steps = hn::Sub(highest_bit(lowest_one(hn::Max(set_in, one))),
                                      hn::Max(hn::Sub(hn::Sub(reach, first_free), one), zero));
      const auto left = hn::Add(low, left_steps);

      // The right end, from `high` the other way round.
      const auto around_high = hn::Xor(pixels_from(map.bits, here, hn::Sub(high, reach)), flip);
      const auto free_right = hn::AndNot(hn::ShiftRight<kWalkReach>(around_high), half);
      const auto set_left = hn::And(around_high, half);
      const auto tall_right = hn::And(
          hn::ShiftRight<kWalkReach + 2>(pixels_from(map.tall, above, hn::Sub(high, reach))),
          beyond);
      const auto next_free = hn::IfThenElse(
          hn::Eq(free_right, zero), hn::Set(kLanes, 1 << kWalkReach), lowest_one(free_right));
      const auto right_steps = hn::Sub(hn::Max(hn::Sub(highest_bit(next_free), one), zero),
                                       hn::Sub(reach, highest_bit(hn::Max(set_left, one))));
      const auto right = hn::Add(high, right_steps);

      // Within reach of both ends there are none of the region's pixels left between them.
      const auto none = hn::And(hn::Or(hn::Eq(set_in, zero), hn::Eq(set_left, zero)),
                                hn::Not(hn::Gt(hn::Sub(high, low), reach)));
      const auto far =
          hn::AndNot(none, hn::Or(hn::Or(hn::Eq(free_out, zero), hn::Eq(set_in, zero)),
                                  hn::Or(hn::Eq(free_right, zero), hn::Eq(set_left, zero))));
      const auto closed = hn::Or(none, hn::AndNot(far, hn::Gt(left, high)));
      auto least = load(lists.least, at);
      auto most = load(lists.most, at);
      const auto columns = hn::Add(hn::Sub(most, least), one);
      auto area = load(lists.area, at);
      const auto large = hn::And(
          at_least(hn::Min(columns, height), hn::Set(kLanes, map.least_extent)),
          at_least(hn::ShiftLeft<1>(hn::Add(columns, height)), hn::Set(kLanes, map.least_length)));
      const auto wide = at_least(area, hn::Set(kLanes, map.least_area));
      area = hn::Add(area, hn::Add(hn::Sub(right, left), one));

      const auto bottom = at_least(here, end);
      // Pixels farther out than the first free one don't count.
      const auto up_to_free = hn::Sub(hn::ShiftLeft<1>(one_at(first_free)), one);
      const auto tall_met = hn::Or(hn::AndNot(up_to_free, tall_out),
                                   hn::And(tall_right, hn::ShiftRight<2>(hn::Sub(next_free, one))));
      const auto border = hn::Or(hn::Lt(left, one), at_least(right, last));
      auto left_extreme = load(lists.left_extreme, at);
      auto right_extreme = load(lists.right_extreme, at);
      auto index = load(lists.index, at);
      auto left_inwards = hn::TestBit(index, left_flag);
      auto right_inwards = hn::TestBit(index, right_flag);
      const auto convex = hn::And(goes_on(hn::Neg(left), tolerance, left_extreme, left_inwards),
                                  goes_on(right, tolerance, right_extreme, right_inwards));
      least = hn::Min(least, left);
      most = hn::Max(most, right);

      const auto seen = hn::AndNot(bottom, real);
      const auto met = hn::AndNot(closed, hn::Ne(tall_met, zero));
      const auto given_up = hn::Or(border, hn::Not(convex));
      const auto stays =
          hn::AndNot(met, hn::And(seen, hn::Or(far, hn::And(closed, hn::And(large, wide)))));
      const auto walks_on = hn::AndNot(hn::Or(hn::Or(far, closed), hn::Or(given_up, met)), seen);
      if (!hn::AllFalse(kLanes, stays)) {
        alignas(64) std::int32_t who[kMostLanes];
        store_kept(hn::Iota(kLanes, static_cast<std::int32_t>(at)), stays, who);
        const std::size_t staying = hn::CountTrue(kLanes, stays);
        alignas(64) std::int32_t is_far[kMostLanes];
        store_kept(hn::VecFromMask(kLanes, far), stays, is_far);
        for (std::size_t i = 0; i < staying; ++i) {
          const auto place = static_cast<std::size_t>(who[i]);
          const std::int32_t region = lists.index[place] & kIndex;
          walks[region] = lists.walk(place, rows, static_cast<std::int32_t>(first + place));
          ends[region] = is_far[i] != 0 ? WalkEnd::open : WalkEnd::closed;
        }
      }
      index = hn::Or(index, hn::Or(hn::IfThenElseZero(left_inwards, left_flag),
                                   hn::IfThenElseZero(right_inwards, right_flag)));
      const auto places = hn::Iota(kLanes, static_cast<std::int32_t>(first + at));
      store_kept(left, walks_on, listed.left + next + kept);
      store_kept(right, walks_on, listed.right + next + kept);
      store_kept(places, walks_on, listed.above + next + kept);
      store_kept(here, walks_on, lists.offset + kept);
      store_kept(left_extreme, walks_on, lists.left_extreme + kept);
      store_kept(right_extreme, walks_on, lists.right_extreme + kept);
      store_kept(least, walks_on, lists.least + kept);
      store_kept(most, walks_on, lists.most + kept);
      store_kept(area, walks_on, lists.area + kept);
      store_kept(index, walks_on, lists.index + kept);
      kept += hn::CountTrue(kLanes, walks_on);
    }
    // What fills up the last lanes has to be readable.
    for (std::int32_t* list : {lists.offset, listed.left + next, listed.right + next})
      hn::StoreU(zero, kLanes, list + kept);
    count = kept;
  }
  for (std::size_t place = 0; place < count; ++place) {
    const std::int32_t region = lists.index[place] & kIndex;
    walks[region] = lists.walk(place, rows, static_cast<std::int32_t>(first + place));
    ends[region] = WalkEnd::open;
  }
}

void walk_regions_simd(const RegionMap& map, const RegionStart* starts, std::size_t count,
                       const WalkedRows& rows, RegionWalk* walks, WalkEnd* ends) {
  std::fill_n(ends, count, WalkEnd::given_up);
  if (count == 0) return;
  Walks lists;
  // Likewise.
  for (std::size_t i = 0; i < count + hn::Lanes(kLanes); ++i) {
    const RegionStart& start = starts[std::min(i, count - 1)];
    lists.offset[i] = static_cast<std::int32_t>(start.y * map.stride);
    rows.left[i] = lists.least[i] = start.left;
    rows.right[i] = lists.most[i] = lists.right_extreme[i] = start.right;
    lists.left_extreme[i] = -start.left;
    lists.area[i] = start.right - start.left + 1;
    lists.index[i] = static_cast<std::int32_t>(i);
  }
  walk_together(map, lists, count, rows, walks, ends);
}

#endif

}  // namespace harco::detect::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace harco::detect::kernels {
namespace {

/// One side, which counts outwards.
struct Side {
  int extreme;
  bool inwards = false;

  /// False where it goes out again after it has come in.
  bool goes_on(int at, int tolerance) {
    if (inwards) {
      const bool fine = at <= extreme + tolerance;
      extreme = std::min(extreme, at);
      return fine;
    }
    inwards = at < extreme - tolerance;
    if (inwards || at > extreme) extreme = at;
    return true;
  }
};

std::uint32_t pixels_from(const std::uint8_t* row, int x) {
  std::uint32_t word = 0;
  std::memcpy(&word, row + (x >> 3), sizeof word);
  return word >> (x & 7);
}

/// A region on its way down.
struct Walk {
  std::size_t region;
  int y, left, right;
  Side left_side, right_side;
  int least, most, area;

  RegionWalk so_far(int rows, std::int32_t last_row) const {
    return {rows,
            last_row,
            left_side.extreme,
            right_side.extreme,
            left_side.inwards,
            right_side.inwards,
            least,
            most,
            area};
  }

  /// To the next row. False if there is an end to it.
  bool go_down(const RegionMap& map, int rows, WalkEnd& end) {
    end = WalkEnd::given_up;
    if (++y >= map.height) return false;
    constexpr std::uint32_t kHalfBits = kHalf;
    const std::uint32_t flip = map.dark ? 0 : ~std::uint32_t{0};
    const int touch = map.dark ? 1 : 0;
    const std::uint8_t* row = map.bits + y * map.stride;
    const std::uint8_t* tall = map.tall + (y - 1) * map.stride;
    const int low = left - touch, high = right + touch;
    const std::uint32_t around_low = pixels_from(row, low - kWalkReach) ^ flip;
    const std::uint32_t around_high = pixels_from(row, high - kWalkReach) ^ flip;
    const std::uint32_t free_out = ~around_low & kHalfBits;
    const std::uint32_t set_in = around_low >> kWalkReach & kHalfBits;
    const std::uint32_t free_right = ~(around_high >> kWalkReach) & kHalfBits;
    const std::uint32_t set_left = around_high & kHalfBits;
    const bool none = (set_in == 0 || set_left == 0) && high - low <= kWalkReach;
    const bool far = !none && (free_out == 0 || set_in == 0 || free_right == 0 || set_left == 0);
    const int left_ones = std::min(kWalkReach, std::countl_zero(free_out) - (31 - kWalkReach));
    const int right_ones = std::min(kWalkReach, std::countr_zero(free_right));
    const int new_left = low + std::countr_zero(set_in) - std::max(left_ones - 1, 0);
    const int new_right =
        high - (std::countl_zero(set_left) - (31 - kWalkReach)) + std::max(right_ones - 1, 0);
    const int height = rows * map.row_step;
    if (none || (!far && new_left > high)) {
      const int columns = most - least + 1;
      if (std::min(height, columns) >= map.least_extent &&
          2 * (height + columns) >= map.least_length && area >= map.least_area)
        end = WalkEnd::closed;
      return false;
    }
    // The pixel next to the last end may hang on to it.
    for (int out = 2; out < left_ones; ++out)
      if ((pixels_from(tall, low - out) & 1) != 0) return false;
    for (int out = 2; out < right_ones; ++out)
      if ((pixels_from(tall, high + out) & 1) != 0) return false;
    if (far) {
      end = WalkEnd::open;
      return false;
    }
    left = new_left;
    right = new_right;
    if (left <= 0 || right >= map.width - 1) return false;
    const int tolerance = walk_tolerance(height);
    if (!left_side.goes_on(-left, tolerance) || !right_side.goes_on(right, tolerance)) return false;
    least = std::min(least, left);
    most = std::max(most, right);
    area += right - left + 1;
    return true;
  }
};

}  // namespace

HWY_EXPORT(walk_regions_simd);

void walk_regions(const RegionMap& map, const RegionStart* starts, std::size_t count,
                  const WalkedRows& listed, RegionWalk* walks, WalkEnd* ends) {
  HWY_DYNAMIC_DISPATCH(walk_regions_simd)(map, starts, count, listed, walks, ends);
}

void walk_regions_scalar(const RegionMap& map, const RegionStart* starts, std::size_t count,
                         const WalkedRows& listed, RegionWalk* walks, WalkEnd* ends) {
  std::fill_n(ends, count, WalkEnd::given_up);
  std::array<Walk, kWalkTogether> going;
  for (std::size_t i = 0; i < count; ++i) {
    const auto [left, right, y] = starts[i];
    going[i] = {i, y, left, right, {-left}, {right}, left, right, right - left + 1};
    listed.left[i] = left;
    listed.right[i] = right;
  }
  std::size_t first = 0;
  int rows = 1;
  for (std::size_t next = 0; count >= kWalkFewest; first = next, ++rows) {
    next = first + listed_length(count);
    if (next + listed_length(count) > kWalkRoom) break;
    std::size_t kept = 0;
    for (std::size_t place = 0; place < count; ++place) {
      Walk walk = going[place];
      const auto last_row = static_cast<std::int32_t>(first + place);
      walks[walk.region] = walk.so_far(rows, last_row);
      if (!walk.go_down(map, rows, ends[walk.region])) continue;
      listed.left[next + kept] = walk.left;
      listed.right[next + kept] = walk.right;
      listed.above[next + kept] = last_row;
      going[kept++] = walk;
    }
    count = kept;
  }
  for (std::size_t place = 0; place < count; ++place) {
    const Walk& walk = going[place];
    walks[walk.region] = walk.so_far(rows, static_cast<std::int32_t>(first + place));
    ends[walk.region] = WalkEnd::open;
  }
}

}  // namespace harco::detect::kernels
#endif
