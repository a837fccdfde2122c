// A plan as users and programs read it.
#pragma once

#include <string>

#include "harco/plan.hpp"

namespace harco::cli {

/// A number with `digits` significant digits and no exponent.
std::string significant(double value, int digits);

/// A table of the layers, the warnings and the command that makes the marker.
std::string plan_table(const PlanRequest& request, const Plan& plan);

/// The same as one JSON object. What does not apply to a layer is null.
std::string plan_json(const PlanRequest& request, const Plan& plan);

/// The layers' ranges over the distance, as the text of an SVG file: a bar a layer, the wanted
/// range and the overlaps shaded, the markers' sides in pixels at the bars' ends.
std::string plan_chart(const PlanRequest& request, const Plan& plan);

}  // namespace harco::cli
