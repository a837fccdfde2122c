// Flights as results of experiments.
#pragma once

#include <string>

#include "lab/experiments/experiment.hpp"
#include "lab/flight/flight.hpp"

namespace harco::lab {

/// What happened; its course (ten moments a second) and its pictures if they are wanted.
Json to_json(const FlightLog& log, bool pictures, bool course = true);

/// The pictures of a flight, if it has any.
void add_strip(Chapter& chapter, const std::string& caption, const Json& flight);

}  // namespace harco::lab
