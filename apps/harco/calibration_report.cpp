#include "calibration_report.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace harco::cli {
namespace {

const char* name_of(CalibrationModel model) {
  switch (model) {
    case CalibrationModel::pinhole:
      return "pinhole";
    case CalibrationModel::rational:
      return "rational";
    case CalibrationModel::fisheye:
      return "fisheye";
  }
  return "";
}

std::size_t point_count(const TargetView& view, const FittedView& fitted, bool kept) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < view.features.size(); ++i)
    if ((fitted.used && fitted.kept[i]) == kept) count += view.features[i].target_m.size();
  return count;
}

/// The value and its standard deviation, both to the latter's second digit.
std::string with_sigma(double value, double sigma) {
  const int digits = std::clamp(1 - static_cast<int>(std::floor(std::log10(sigma))), 0, 12);
  return fmt::format("{:.{}f} +- {:.{}f}", value, digits, sigma, digits);
}

}  // namespace

std::string report_text(const CalibrationReport& report) {
  const Calibration& calibration = report.calibration;
  const Evidence& evidence = report.evidence;
  std::string text;
  const auto line = [&](const std::string& content) { text += content + "\n"; };

  std::size_t kept = 0, dropped = 0;
  for (std::size_t i = 0; i < report.views.size(); ++i) {
    kept += point_count(report.views[i], calibration.views[i], true);
    dropped += point_count(report.views[i], calibration.views[i], false);
  }
  for (const CalibrationPicture& picture : report.pictures)
    if (!picture.left_out.empty())
      line(fmt::format("left out: {}: {}", picture.source, picture.left_out));
  line(fmt::format("pictures:   {} of {} used, {} points ({} left out)", evidence.views,
                   report.pictures.size(), kept, dropped));
  line(fmt::format("camera:     {}, {} x {} pixels", name_of(report.model), evidence.width,
                   evidence.height));
  const std::vector<std::string> names = parameter_names(report.model);
  const Eigen::VectorXd values = parameters_of(calibration.camera, report.model);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto index = static_cast<Eigen::Index>(i);
    line(fmt::format("  {:<9} {}", names[i],
                     with_sigma(values[index], std::sqrt(calibration.covariance(index, index)))));
  }
  line(fmt::format("fit:        {:.3f} px rms; pictures held out {:.3f} px", calibration.rms_px,
                   calibration.held_out_rms_px));
  line(fmt::format("directions: known to {:.2f} px in the middle of the image, {:.2f} px at worst",
                   evidence.direction.middle_px, evidence.direction.worst_px));
  line(
      fmt::format("tilt:       {} pictures by {:.0f} degrees or more, {:.0f} degrees between the "
                  "most different",
                  evidence.tilt.tilted, kTilted_deg, evidence.tilt.widest_deg));
  line(fmt::format("coverage:   {:.0f} % of the image", 100.0 * evidence.coverage.share()));
  if (report.verdict.reasons.empty()) {
    line("verdict:    good: enough pictures from enough sides, and they agree");
  } else {
    line(fmt::format("verdict:    {}:", to_string(report.verdict.grade)));
    for (const std::string& reason : report.verdict.reasons) line("  - " + reason);
  }
  return text;
}

std::string report_json(const CalibrationReport& report) {
  using nlohmann::ordered_json;
  const Calibration& calibration = report.calibration;
  const Evidence& evidence = report.evidence;
  ordered_json json;
  json["verdict"] = to_string(report.verdict.grade);
  json["reasons"] = report.verdict.reasons;
  json["model"] = name_of(report.model);
  json["size"] = {evidence.width, evidence.height};
  const std::vector<std::string> names = parameter_names(report.model);
  const Eigen::VectorXd values = parameters_of(calibration.camera, report.model);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto index = static_cast<Eigen::Index>(i);
    json["parameters"][names[i]] = {{"value", values[index]},
                                    {"sigma", std::sqrt(calibration.covariance(index, index))}};
  }
  for (Eigen::Index i = 0; i < calibration.covariance.rows(); ++i) {
    const Eigen::VectorXd row = calibration.covariance.row(i);
    json["covariance"].push_back(std::vector<double>(row.begin(), row.end()));
  }
  json["rms_px"] = calibration.rms_px;
  json["held_out_rms_px"] = calibration.held_out_rms_px;
  json["noise_px"] = calibration.noise_px;
  json["direction_sigma_px"] = {{"middle", evidence.direction.middle_px},
                                {"worst", evidence.direction.worst_px}};
  json["tilt"] = {{"widest_deg", evidence.tilt.widest_deg}, {"tilted", evidence.tilt.tilted}};
  json["coverage"] = {{"share", evidence.coverage.share()},
                      {"missing", evidence.coverage.missing()},
                      {"columns", evidence.coverage.columns},
                      {"rows", evidence.coverage.rows},
                      {"points", evidence.coverage.points}};
  json["pictures"] = ordered_json::array();
  for (std::size_t i = 0; i < report.pictures.size(); ++i) {
    const CalibrationPicture& picture = report.pictures[i];
    ordered_json entry{{"source", picture.source}};
    if (!picture.left_out.empty()) entry["left_out"] = picture.left_out;
    entry["views"] = ordered_json::array();
    for (std::size_t v = 0; v < report.views.size(); ++v) {
      if (report.views[v].picture != i) continue;
      const FittedView& fitted = calibration.views[v];
      entry["views"].push_back({{"used", fitted.used},
                                {"points", point_count(report.views[v], fitted, true)},
                                {"points_left_out", point_count(report.views[v], fitted, false)},
                                {"rms_px", fitted.rms_px}});
    }
    json["pictures"].push_back(std::move(entry));
  }
  return json.dump(1) + "\n";
}

}  // namespace harco::cli
