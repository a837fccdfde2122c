// How a deck moves: as the paper's platform (section 4.6), or as a ship in a seaway.
//
// World frame of all flights: x and y level, z down, in metres; z = 0 is where the deck's touchdown
// point is at rest. The deck's frame has its origin at the touchdown point, z into the deck.
#pragma once

#include <array>
#include <cstdint>

#include <Eigen/Geometry>

#include "harco/deck.hpp"

namespace harco::lab {

/// A deck that rolls, pitches and heaves, each as a sum of sinusoids: Eq. 19, with as many of them
/// as it takes.
struct DeckMotion {
  std::array<Oscillation, 3> axes;  ///< by DeckAxis: radians, radians, metres upwards

  double value(DeckAxis axis, double time_s) const { return axes[axis].value(time_s); }
  double rate(DeckAxis axis, double time_s) const { return axes[axis].rate(time_s); }

  /// As harco::DeckSample has the angles: Ry(pitch) Rx(roll), raised by heave.
  Eigen::Isometry3d world_T_deck(double time_s) const;
};

/// The paper's oscillating platform: two sinusoids in roll, one in pitch, one in heave; which ones
/// depends on the seed. Roll and pitch of some degrees, periods of 3 to 8 s.
DeckMotion platform_motion(std::uint64_t seed);

/// Waves and the ship in them.
struct Seaway {
  double wave_height_m = 1.88;  ///< significant height
  double peak_period_s = 8.8;   ///< of the spectrum
  double peakedness = 3.3;      ///< JONSWAP's gamma; 1 is Pierson and Moskowitz's sea
  double heading_rad = 2.6;     ///< waves against the ship's course: 0 from astern, pi from ahead
  double spreading_rad = 0.35;  ///< standard deviation of the waves' directions

  double length_m = 110.0;  ///< of the ship, at the waterline
  double beam_m = 14.0;
  double draught_m = 4.2;
  double block = 0.55;          ///< coefficient: displaced volume over length x beam x draught
  double roll_period_s = 10.0;  ///< its own
  double roll_damping = 0.12;   ///< of the critical one
  double deck_aft_m = 40.0;     ///< the landing deck lies so far behind the middle
};

/// WMO's sea states 0 … 6 with the periods usual on the open sea (NATO STANAG 4154). Throws
/// std::invalid_argument for others.
Seaway sea_state(int state);

/// The motion of the deck on a ship without way: heave and pitch by the closed-form response of a
/// box (Jensen, Mansour and Olsen 2004), roll as a damped oscillator that the waves' slope drives.
/// All three come from the same waves. Throws std::invalid_argument for lengths and periods that
/// aren't positive.
DeckMotion ship_motion(const Seaway& sea, std::uint64_t seed);

}  // namespace harco::lab
