#include "lab/experiments/flights.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "lab/experiments/picture.hpp"
#include "lab/experiments/setup.hpp"

namespace harco::lab {
namespace {

/// How far the height that the pilot believed was off, root mean square.
double believed_error_m(const FlightLog& log) {
  RootMeanSquare error;
  for (const Moment& moment : log.moments)
    if (std::isfinite(moment.believed_m)) error.add(moment.believed_m - moment.height_m);
  return error.count() > 0 ? error.value() : 0.0;
}

}  // namespace

Json to_json(const FlightLog& log, bool pictures, bool course) {
  Json json{{"frames", log.frames},         {"lost_frames", log.lost_frames},
            {"settled", log.settled},       {"gave_up", log.gave_up},
            {"end_s", log.end_s},           {"normalised", log.normalised},
            {"position_m", log.position_m}, {"believed_error_m", believed_error_m(log)}};
  if (log.contact) {
    const Contact& contact = *log.contact;
    json["contact"] = {{"time_s", contact.time_s},
                       {"sink_mps", contact.sink_mps},
                       {"sideways_mps", contact.sideways_mps},
                       {"x_m", contact.place_m.x()},
                       {"y_m", contact.place_m.y()},
                       {"roll_rad", contact.roll_rad},
                       {"pitch_rad", contact.pitch_rad},
                       {"heave_rate_mps", contact.heave_rate_mps},
                       {"tilt_rad", contact.tilt_rad}};
  }
  if (course) {
    const auto column = [&](auto value) {
      std::vector<double> values;
      for (const Moment& moment : log.moments) values.push_back(value(moment));
      return to_json(values);
    };
    const auto layer = [&](int number) {
      return column([=](const Moment& m) {
        return static_cast<double>(std::count(m.layers.begin(), m.layers.end(), number));
      });
    };
    json["time_s"] = column([](const Moment& m) { return m.time_s; });
    json["height_m"] = column([](const Moment& m) { return m.height_m; });
    json["believed_m"] = column([](const Moment& m) { return m.believed_m; });
    json["commanded_m"] = column([](const Moment& m) { return m.commanded_m; });
    json["beside_m"] = column([](const Moment& m) { return m.beside_m; });
    json["roll_rad"] = column([](const Moment& m) { return m.roll_rad; });
    json["pitch_rad"] = column([](const Moment& m) { return m.pitch_rad; });
    json["layer_1"] = layer(1);
    json["layer_2"] = layer(2);
  }
  if (pictures) {
    json["pictures"] = Json::array();
    for (const FlightPicture& picture : log.pictures)
      json["pictures"].push_back(to_json(picture_of(
          picture.image.view(), fmt::format("{:.2f} m", picture.height_m), picture.detections)));
  }
  return json;
}

void add_strip(Chapter& chapter, const std::string& caption, const Json& flight) {
  if (!flight.contains("pictures") || flight.at("pictures").empty()) return;
  Strip strip{caption, {}};
  for (const Json& picture : flight.at("pictures")) strip.pictures.push_back(picture_from(picture));
  chapter.blocks.emplace_back(strip);
}

}  // namespace harco::lab
