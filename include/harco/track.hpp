// What the paper does with time (section 3.4 c and d). A frame without a past needs none of this.
#pragma once

#include <deque>
#include <vector>

#include "harco/detect.hpp"
#include "harco/pose.hpp"

namespace harco {

/// The rule of a, b, c: a code with up to `a` wrong bits is believed if its marker was seen in more
/// than `b` of the last `c` frames.
struct MemoryOptions {
  int a = 3;
  int b = 3;
  int c = 10;
};

/// Remembers which markers were seen in the last frames and confirms tentative detections. Give the
/// detector tentative_bit_errors = a.
class Memory {
 public:
  explicit Memory(const MemoryOptions& options = {});

  /// The detections of the next frame without those that the past doesn't confirm.
  std::vector<Detection> confirm(const std::vector<Detection>& detections);

 private:
  MemoryOptions options_;
  std::deque<std::vector<int>> seen_;  ///< placed indices, one entry a frame, newest last
};

/// Tells the two solutions of a small marker's pose (Pose::alternative) by the frames before: a
/// marker doesn't jump from one tilt to its mirror image. What one frame leaves open, several
/// decide.
class Continuity {
 public:
  /// `rate_rad_s`: how fast camera and marker turn against each other, one standard deviation.
  explicit Continuity(double rate_rad_s = 1.0);

  /// Weighs the alternatives in the poses of one frame, taken at `time_s`, by what the past makes
  /// of both: the likelier becomes the pose, and what is decided by now has no alternative any
  /// more. A parent not seen for longer than a second starts anew, and so does all when time runs
  /// backwards.
  void decide(std::vector<Pose>& poses, double time_s);

 private:
  /// What is believed of one parent: its pose or the alternative.
  struct Belief {
    double time_s;
    Pose pose;
  };
  double expected(const Belief& belief, const Eigen::Isometry3d& pose, double time_s) const;

  double rate_rad_s_;
  std::vector<Belief> beliefs_;
};

/// First-order low-pass on poses, parent by parent: the filter that ends Algorithm 2.
class LowPass {
 public:
  /// `time_constant_s` 0 lets every pose through as it is.
  explicit LowPass(double time_constant_s = 0.1);

  /// Filters the poses of one frame, taken at `time_s`. A parent not seen for longer than ten time
  /// constants starts anew. Filtered poses carry no covariance: their errors are not independent.
  std::vector<Pose> filter(const std::vector<Pose>& poses, double time_s);

 private:
  struct State {
    int parent;
    double time_s;
    Eigen::Isometry3d camera_T_marker;
  };
  double time_constant_s_;
  std::vector<State> states_;
};

}  // namespace harco
