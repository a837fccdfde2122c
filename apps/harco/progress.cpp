#include "progress.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include <fmt/format.h>

namespace harco::cli {
namespace {

constexpr int kWidth = 30;
constexpr std::chrono::milliseconds kPatience{300};  ///< what is done sooner needs no bar
constexpr std::chrono::milliseconds kInterval{100};

}  // namespace

ProgressBar::ProgressBar(std::string label)
    : label_(std::move(label)),
      terminal_(isatty(STDERR_FILENO) != 0),
      next_(std::chrono::steady_clock::now() + kPatience) {}

ProgressBar::~ProgressBar() {
  if (shown_) fmt::print(stderr, "\r\033[K");
}

void ProgressBar::show(double share, const std::string& note) {
  const auto now = std::chrono::steady_clock::now();
  if (!terminal_ || now < next_) return;
  next_ = now + kInterval;
  shown_ = true;
  const double done = std::clamp(share, 0.0, 1.0);
  const int filled = static_cast<int>(std::lround(done * kWidth));
  fmt::print(stderr, "\r{} [{:#<{}}{:.<{}}] {:3.0f} %{}{}\033[K", label_, "", filled, "",
             kWidth - filled, 100.0 * done, note.empty() ? "" : "  ", note);
  std::fflush(stderr);
}

}  // namespace harco::cli
