#include "explain.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <system_error>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "harco/error.hpp"
#include "overlay.hpp"
#include "write_file.hpp"

namespace harco::cli {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array kFates{Rejection::none,    Rejection::inconsistent, Rejection::duplicate,
                            Rejection::quality, Rejection::code,         Rejection::shape,
                            Rejection::edges,   Rejection::contrast,     Rejection::ring};

const char* fate(Rejection rejection) {
  return rejection == Rejection::none ? "accepted" : to_string(rejection);
}

/// Small frames are shown enlarged, so that lines don't hide what they are about.
int enlargement(const ColourImage& picture) {
  constexpr int kGoodWidth = 1600;
  return std::clamp(kGoodWidth / std::max(picture.width, 1), 1, 4);
}

class Painter {
 public:
  Painter(const fs::path& folder, const ColourImage& picture)
      : folder_(folder),
        factor_(enlargement(picture)),
        canvas_(media().enlarged(picture, factor_)) {}

  void paint(const std::string& name, const Overlay& overlay) const {
    ColourImage painted = canvas_;
    media().draw(enlarged(overlay, factor_), painted);
    write(name, painted);
  }

  void write(const std::string& name, const ColourImage& picture) const {
    const std::vector<std::uint8_t> bytes = media().encode(picture, ".png");
    write_file(folder_ / name, {bytes.begin(), bytes.end()});
  }

 private:
  fs::path folder_;
  int factor_;
  ColourImage canvas_;
};

Overlay overlay_of_contours(const std::vector<std::vector<Eigen::Vector2d>>& contours) {
  constexpr std::array<Colour, 6> kColours{{{255, 90, 90},
                                            {90, 230, 90},
                                            {110, 150, 255},
                                            {255, 200, 60},
                                            {230, 110, 255},
                                            {80, 220, 220}}};
  Overlay overlay;
  for (std::size_t i = 0; i < contours.size(); ++i)
    overlay.strokes.push_back({contours[i], kColours[i % kColours.size()], true, 1});
  return overlay;
}

/// The accepted ones last, so that they lie on top; a legend with counts in the corner.
Overlay overlay_of_candidates(const std::vector<Candidate>& candidates) {
  std::map<Rejection, int> counts;
  Overlay overlay;
  for (auto rejection = kFates.rbegin(); rejection != kFates.rend(); ++rejection)
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const Candidate& candidate = candidates[i];
      if (candidate.rejection != *rejection) continue;
      ++counts[*rejection];
      overlay.strokes.push_back({{candidate.corners.begin(), candidate.corners.end()},
                                 colour_of(*rejection),
                                 true,
                                 *rejection == Rejection::none ? 2 : 1});
      overlay.labels.push_back(
          {candidate.corners[1], std::to_string(i), colour_of(*rejection), 6.0});
    }
  double line = 12.0;
  for (const Rejection rejection : kFates) {
    overlay.labels.push_back({{4.0, line},
                              fmt::format("{} {}", counts[rejection], fate(rejection)),
                              colour_of(rejection),
                              10.0});
    line += 12.0;
  }
  return overlay;
}

Eigen::Vector2d middle(const Candidate& candidate) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& corner : candidate.corners) sum += corner;
  return sum / 4.0;
}

double side_px(const Candidate& candidate) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 4; ++i)
    sum += (candidate.corners[(i + 1) % 4] - candidate.corners[i]).norm();
  return sum / 4.0;
}

const PlacedMarker* marker_of(const Candidate& candidate, const std::vector<PlacedMarker>& placed) {
  const bool known = candidate.placed >= 0 && candidate.placed < static_cast<int>(placed.size());
  return known ? &placed[static_cast<std::size_t>(candidate.placed)] : nullptr;
}

std::string list_for_people(const std::vector<Candidate>& candidates,
                            const std::vector<PlacedMarker>& placed) {
  std::string text = fmt::format("{:>5} {:>8} {:>8} {:>7}  {:<6} {:<13} {:<14} {}\n", "quad", "x",
                                 "y", "side", "kind", "fate", "taken for", "measured");
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const Candidate& candidate = candidates[i];
    const PlacedMarker* marker = marker_of(candidate, placed);
    text += fmt::format("{:>5} {:>8.1f} {:>8.1f} {:>7.1f}  {:<6} {:<13} {:<14} {}\n", i,
                        middle(candidate).x(), middle(candidate).y(), side_px(candidate),
                        candidate.hole ? "hole" : "dark", fate(candidate.rejection),
                        marker ? fmt::format("layer {} id {}", marker->layer, marker->id) : "-",
                        candidate.note);
  }
  return text;
}

std::string list_for_programs(const FrameResult& result, const std::vector<Candidate>& candidates,
                              const std::vector<PlacedMarker>& placed) {
  Json list = Json::array();
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const Candidate& candidate = candidates[i];
    Json corners = Json::array();
    for (const Eigen::Vector2d& c : candidate.corners) corners.push_back({c.x(), c.y()});
    Json entry{{"quad", i},
               {"corners", corners},
               {"hole", candidate.hole},
               {"fate", fate(candidate.rejection)},
               {"marker", nullptr},
               {"note", candidate.note}};
    if (const PlacedMarker* marker = marker_of(candidate, placed))
      entry["marker"] = {{"layer", marker->layer}, {"id", marker->id}};
    list.push_back(entry);
  }
  const Json all{{"frame", result.frame}, {"source", result.source}, {"candidates", list}};
  return all.dump(1, ' ', false, Json::error_handler_t::replace) + '\n';
}

}  // namespace

void explain(const fs::path& folder, const Frame& frame, const FrameResult& result,
             const DetectionTrace& trace, const std::vector<PlacedMarker>& placed,
             const Overlay& detections) {
  const fs::path own = folder / fmt::format("{:06}-{}", frame.number, frame.name);
  std::error_code failed;
  fs::create_directories(own, failed);
  if (failed) throw Error(own.string() + ": can't be made (" + failed.message() + ")");

  const Painter painter(own, frame.picture.colour);
  for (std::size_t i = 0; i < trace.binary.size(); ++i)
    painter.write(fmt::format("1-binary-{}.png", i + 1), to_colour(trace.binary[i]));
  painter.paint("2-contours.png", overlay_of_contours(trace.contours));
  painter.paint("3-candidates.png", overlay_of_candidates(trace.candidates));
  painter.paint("4-detections.png", detections);
  write_file(own / "candidates.txt", list_for_people(trace.candidates, placed));
  write_file(own / "candidates.json", list_for_programs(result, trace.candidates, placed));
}

}  // namespace harco::cli
