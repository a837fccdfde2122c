#include "pixel_map.hpp"

#include <algorithm>

namespace harco::lab {

PixelMap::PixelMap(const Camera& camera, Function place)
    : place_(std::move(place)), columns_((camera.width + kStep - 1) / kStep + 1) {
  const int lines = (camera.height + kStep - 1) / kStep + 1;
  nodes_.reserve(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(lines));
  for (int line = 0; line < lines; ++line)
    for (int column = 0; column < columns_; ++column) {
      Node node;
      if (const auto at = place_({1.0 * kStep * column, 1.0 * kStep * line}))
        node = {at->cast<float>(), true};
      nodes_.push_back(node);
    }
}

void PixelMap::read(int y, Row& row) const {
  const int line = y / kStep;
  const float down = static_cast<float>(y - line * kStep) / kStep;
  const auto width = static_cast<int>(row.u.size());
  for (int column = 0; column * kStep < width; ++column) {
    const Node& a = node(column, line);
    const Node& b = node(column + 1, line);
    const Node& c = node(column, line + 1);
    const Node& d = node(column + 1, line + 1);
    const bool known = a.seen && b.seen && c.seen && d.seen;
    const Eigen::Vector2f left = a.place + down * (c.place - a.place);
    const Eigen::Vector2f right = b.place + down * (d.place - b.place);
    const Eigen::Vector2f step = (right - left) / kStep;
    const float size = std::max(step.norm(), (c.place - a.place).norm() / kStep);
    for (int i = 0; i < kStep && column * kStep + i < width; ++i) {
      const int x = column * kStep + i;
      const auto at = static_cast<std::size_t>(x);
      Eigen::Vector2f here = left + static_cast<float>(i) * step;
      row.seen[at] = 1;
      if (!known) {
        const auto exact = place_({1.0 * x, 1.0 * y});
        row.seen[at] = exact ? 1 : 0;
        if (exact) here = exact->cast<float>();
      }
      row.u[at] = here.x();
      row.v[at] = here.y();
      row.size[at] = size;
    }
  }
}

}  // namespace harco::lab
