// Which detections of one parent are of the same sheet: a parent may be seen twice in a frame.
#pragma once

#include <vector>

#include "pose/joint.hpp"

namespace harco {

/// Detections that agree on one sheet, largest first, and their pose.
struct Group {
  std::vector<Observation> members;
  JointPose pose;
};

/// Splits the observations of one parent, whose square has the side `parent_side_m`, into sheets,
/// the best supported first. Every observation is tried as a seed, largest first: from its own
/// pose it predicts where the others have their corners, and those that are there, within
/// what the pose's covariance allows so far away, belong to it. A sheet holds a marker only once.
/// Observations that contradict a known sheet, lying on it without agreeing with it, are left out;
/// elsewhere they are another sheet, a single one only if it was read without a corrected bit and
/// has the shape of a square.
std::vector<Group> group_by_sheet(std::vector<Observation> observations,
                                  const std::vector<Detection>& detections, double parent_side_m);

}  // namespace harco
