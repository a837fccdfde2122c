#include "tracking.hpp"

#include <nlohmann/json.hpp>

namespace harco::cli {

using Json = nlohmann::ordered_json;

Json tracking_json(const TrackingOptions& options) {
  const FilterOptions& f = options.filter;
  Json json{{"filter", options.kind == FilterKind::kalman ? "kalman" : "low-pass"},
            {"time_constant_s", options.time_constant_s},
            {"camera_known", f.camera_known},
            {"acceleration", f.acceleration},
            {"marker_turning", f.marker_turning},
            {"camera_turning", f.camera_turning},
            {"speed", f.speed},
            {"marker_turn_rate", f.marker_turn_rate},
            {"camera_turn_rate", f.camera_turn_rate},
            {"gate", f.gate},
            {"confirm", f.confirm},
            {"replace", f.replace},
            {"tracking_s", f.tracking_s},
            {"coast_s", f.coast_s},
            {"history_s", f.history_s}};
  if (f.swell)
    json["swell"] = {{"period_s", f.swell->period_s},
                     {"damping", f.swell->damping},
                     {"shift_sd_m", f.swell->shift_sd_m},
                     {"turn_sd_rad", f.swell->turn_sd_rad}};
  return json;
}

TrackingOptions tracking_from_json(const Json& json) {
  TrackingOptions options;
  FilterOptions& f = options.filter;
  if (json.at("filter").get<std::string>() == "low-pass") options.kind = FilterKind::low_pass;
  json.at("time_constant_s").get_to(options.time_constant_s);
  json.at("camera_known").get_to(f.camera_known);
  json.at("acceleration").get_to(f.acceleration);
  json.at("marker_turning").get_to(f.marker_turning);
  json.at("camera_turning").get_to(f.camera_turning);
  json.at("speed").get_to(f.speed);
  json.at("marker_turn_rate").get_to(f.marker_turn_rate);
  json.at("camera_turn_rate").get_to(f.camera_turn_rate);
  json.at("gate").get_to(f.gate);
  json.at("confirm").get_to(f.confirm);
  json.at("replace").get_to(f.replace);
  json.at("tracking_s").get_to(f.tracking_s);
  json.at("coast_s").get_to(f.coast_s);
  json.at("history_s").get_to(f.history_s);
  if (const auto swell = json.find("swell"); swell != json.end()) {
    f.swell.emplace();
    swell->at("period_s").get_to(f.swell->period_s);
    swell->at("damping").get_to(f.swell->damping);
    swell->at("shift_sd_m").get_to(f.swell->shift_sd_m);
    swell->at("turn_sd_rad").get_to(f.swell->turn_sd_rad);
  }
  return options;
}

Tracking::Tracking(const TrackingOptions& options) {
  if (options.kind == FilterKind::low_pass)
    low_pass_.emplace(options.time_constant_s);
  else
    tracker_.emplace(options.filter);
}

void Tracking::take(std::vector<Pose>& poses, double time_s, const CameraPose& camera) {
  // The filter weighs two solutions by what it knows itself.
  if (tracker_) tracker_->add(poses, time_s, camera);
  continuity_.decide(poses, time_s);
  if (low_pass_) poses = low_pass_->filter(poses, time_s);
}

std::optional<std::vector<Track>> Tracking::tracks(double time_s, const CameraPose& camera) const {
  if (!tracker_) return std::nullopt;
  return tracker_->at(time_s, camera);
}

}  // namespace harco::cli
