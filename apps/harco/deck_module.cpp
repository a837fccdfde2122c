#include "deck_watch.hpp"

namespace harco::cli {
namespace {

/// Between two thoughts, seconds.
constexpr double kPeriod = 0.2;

class Watch : public DeckWatch {
 public:
  explicit Watch(const LandingOrderOptions& options) : options_(options), order_(options) {}

  std::optional<DeckView> add(const DeckSample& sample, double height_m) override {
    model_.add(sample);
    if (sample.time_s < thought_s_ + kPeriod && sample.time_s >= thought_s_) return std::nullopt;
    thought_s_ = sample.time_s;
    model_.update();

    DeckView view;
    view.time_s = sample.time_s;
    view.motion = sample.motion;
    view.height_m = height_m;
    view.phase = model_.phase();
    const DeckForecast* const forecast =
        view.phase == DeckPhase::ready ? &*model_.forecast() : nullptr;
    if (forecast != nullptr)
      view.windows = level_windows(*forecast, options_.level, forecast->as_of_s,
                                   forecast->as_of_s + options_.look_ahead_s, options_.windows);
    view.advice = order_.update(sample.time_s, height_m, forecast);
    view.touchdown_s = order_.touchdown_s();
    return view;
  }

 private:
  LandingOrderOptions options_;
  LandingOrder order_;
  DeckModel model_;
  double thought_s_ = -1e9;
};

}  // namespace

HARCO_MODULE_EXPORT void harco_deck_watch(const LandingOrderOptions& options,
                                          std::unique_ptr<DeckWatch>& watch) {
  watch = std::make_unique<Watch>(options);
}

HARCO_MODULE_EXPORT void harco_deck_sample(const Pose& pose, const CameraState& camera,
                                           double time_s, const Eigen::Vector3d& touchdown_point,
                                           DeckSample& sample) {
  sample = deck_sample(pose, camera, time_s, touchdown_point);
}

}  // namespace harco::cli
