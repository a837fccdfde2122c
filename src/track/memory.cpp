#include <algorithm>
#include <stdexcept>

#include "harco/track.hpp"

namespace harco {

Memory::Memory(const MemoryOptions& options) : options_(options) {
  if (options.a < 0 || options.b < 0 || options.c < 1)
    throw std::invalid_argument("memory: a and b must not be negative, c must be positive");
}

std::vector<Detection> Memory::confirm(const std::vector<Detection>& detections) {
  const auto frames_with = [&](int placed) {
    return std::count_if(seen_.begin(), seen_.end(), [&](const std::vector<int>& frame) {
      return std::find(frame.begin(), frame.end(), placed) != frame.end();
    });
  };
  std::vector<Detection> confirmed;
  std::vector<int> now;
  for (Detection detection : detections) {
    if (detection.tentative &&
        (detection.bit_errors > options_.a || frames_with(detection.placed) <= options_.b))
      continue;
    detection.tentative = false;
    now.push_back(detection.placed);
    confirmed.push_back(detection);
  }
  seen_.push_back(std::move(now));
  if (seen_.size() > static_cast<std::size_t>(options_.c)) seen_.pop_front();
  return confirmed;
}

}  // namespace harco
