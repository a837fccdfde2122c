#include "target_finder.hpp"

#include <algorithm>
#include <map>
#include <set>

#include "harco/detect.hpp"

namespace harco::cli {
namespace {

class BoardFinder : public TargetFinder {
 public:
  BoardFinder(const Board& board, double square_m) : board_(board), square_m_(square_m) {}

  std::vector<TargetView> find(const ImageView& image) override {
    TargetView view;
    for (const BoardCorner& corner : find_board(board_, image))
      view.features.push_back(
          {{square_m_ * corner.squares}, {corner.pixel}, Eigen::Matrix2d::Zero()});
    if (view.features.empty()) return {};
    return {view};
  }

 private:
  Board board_;
  double square_m_;
};

class MarkerFinder : public TargetFinder {
 public:
  MarkerFinder(const MarkerSet& markers, const std::optional<Camera>& camera)
      : detector_(markers, options_with(camera)) {}

  std::vector<TargetView> find(const ImageView& image) override {
    std::map<int, TargetView> views;  // by parent
    std::set<int> seen, twice;
    for (const Detection& detection : detector_.detect(image)) {
      const PlacedMarker& marker = detector_.placed()[static_cast<std::size_t>(detection.placed)];
      if (!seen.insert(detection.placed).second) twice.insert(marker.parent_index);
      const auto target = marker.corners_m();
      views[marker.parent_index].features.push_back(
          {{target.begin(), target.end()},
           {detection.corners.begin(), detection.corners.end()},
           detection.corner_covariance});
    }
    std::vector<TargetView> list;
    for (auto& [parent, view] : views)
      if (!twice.contains(parent)) list.push_back(std::move(view));  // else: which copy is which?
    return list;
  }

 private:
  /// Only what is whole and measured by itself says something about the lens.
  static DetectorOptions options_with(const std::optional<Camera>& camera) {
    DetectorOptions options;
    options.covered = false;
    options.infer = false;
    options.camera = camera;
    return options;
  }

  Detector detector_;
};

}  // namespace

std::unique_ptr<TargetFinder> target_finder(const CalibrationTarget& target,
                                            const std::optional<Camera>& camera) {
  if (target.board) return std::make_unique<BoardFinder>(*target.board, target.square_m);
  return std::make_unique<MarkerFinder>(target.markers, camera);
}

bool gains_by_camera(const CalibrationTarget& target) { return !target.board; }

}  // namespace harco::cli
