// What each pixel of an image looks at, for everything that may be a tenth of a pixel off.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "harco/camera.hpp"

namespace harco::lab {

/// A smooth map from pixels to places, known at every 16th pixel and interpolated between them.
class PixelMap {
 public:
  static constexpr int kStep = 16;
  using Function = std::function<std::optional<Eigen::Vector2d>(const Eigen::Vector2d& pixel)>;

  /// `place` must outlive this: it is asked again where parts of the image have no place.
  PixelMap(const Camera& camera, Function place);

  /// One row of pixels.
  struct Row {
    explicit Row(int width)
        : u(static_cast<std::size_t>(width)), v(u.size()), size(u.size()), seen(u.size()) {}
    std::vector<float> u, v;  ///< place
    std::vector<float> size;  ///< of the pixel there
    std::vector<char> seen;   ///< whether it has a place
  };
  void read(int y, Row& row) const;

 private:
  struct Node {
    Eigen::Vector2f place = Eigen::Vector2f::Zero();
    bool seen = false;
  };
  const Node& node(int column, int line) const {
    return nodes_[static_cast<std::size_t>(line) * static_cast<std::size_t>(columns_) +
                  static_cast<std::size_t>(column)];
  }

  Function place_;
  int columns_;
  std::vector<Node> nodes_;
};

}  // namespace harco::lab
