#include "rivals.hpp"

#include "apps/harco/families.hpp"
#include "tests/other_detectors.hpp"

namespace harco::bench {

lab::Sheet apriltag_sheet(double side_m) {
  cli::Family family;
  cli::harco_load_family("apriltag:36h11", family);
  MarkerSet markers;
  markers.cells = family.codes.front().cells;
  markers.parents.push_back({side_m, Marker{0, -1, family.codes.front(), {}}});
  return lab::sheet_of(markers, 0, 2.0);
}

std::optional<Eigen::Isometry3d> apriltag_pose(const Image& image, const Camera& camera,
                                               double side_m) {
  for (const test::Reading& reading : test::read_by_apriltag(image, "36h11", 1.0F))
    if (reading.id == 0) return lab::pose_of_square(reading.corners, camera, side_m);
  return std::nullopt;
}

}  // namespace harco::bench
