#include <algorithm>

#include "harco/filter.hpp"

namespace harco {

Tracker::Tracker(const FilterOptions& options) : options_(options) { PoseFilter{options}; }

void Tracker::add(const std::vector<Pose>& poses, double time_s,
                  const CameraPose& reference_T_camera) {
  std::vector<int> done;
  for (const Pose& pose : poses) {
    const bool again = std::find(done.begin(), done.end(), pose.parent) != done.end();
    if (again || !pose.covariance) continue;
    done.push_back(pose.parent);
    const auto place =
        std::lower_bound(entries_.begin(), entries_.end(), pose.parent,
                         [](const Entry& entry, int parent) { return entry.parent < parent; });
    const bool known = place != entries_.end() && place->parent == pose.parent;
    PoseFilter& filter =
        (known ? place : entries_.insert(place, {pose.parent, PoseFilter(options_)}))->filter;

    // Of several poses the one that is expected; the first, best seen one if nothing is.
    const Pose* nearest = &pose;
    std::optional<double> least = filter.distance(pose, time_s, reference_T_camera);
    for (const Pose& other : poses) {
      if (!least || &other == &pose || other.parent != pose.parent || !other.covariance) continue;
      const std::optional<double> distance = filter.distance(other, time_s, reference_T_camera);
      if (distance < least) {
        nearest = &other;
        least = distance;
      }
    }
    filter.add(*nearest, time_s, reference_T_camera);
  }
}

std::vector<Track> Tracker::at(double time_s, const CameraPose& reference_T_camera) const {
  std::vector<Track> tracks;
  for (const Entry& entry : entries_)
    if (const auto state = entry.filter.at(time_s, reference_T_camera))
      tracks.push_back({entry.parent, *state});
  return tracks;
}

const PoseFilter* Tracker::filter(int parent) const {
  for (const Entry& entry : entries_)
    if (entry.parent == parent) return &entry.filter;
  return nullptr;
}

}  // namespace harco
