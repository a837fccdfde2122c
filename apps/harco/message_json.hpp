// MAVLink messages as JSON, for who reads along and for records.
#pragma once

#include <optional>
#include <string>

#include "harco/mavlink.hpp"

namespace harco::cli {

/// An object of the message's fields, {} for those that nobody wants to know of. Numbers read back
/// to the same values.
std::string fields_json(const mavlink::Message& message);

/// A line: {"message": "LANDING_TARGET", "sent_s": …, "captured_s": …, "fields": {…}}. Times are
/// monotonic.
std::string json_line(const mavlink::Message& message, double sent_s,
                      std::optional<double> captured_s);

}  // namespace harco::cli
