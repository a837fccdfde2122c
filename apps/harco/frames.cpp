#include "frames.hpp"

#include <algorithm>
#include <utility>

#include "harco/error.hpp"
#include "live_source.hpp"

namespace harco::cli {
namespace {

/// A source read by a thread of its own, from when its first frame is asked for.
class ThreadedSource : public FrameSource {
 public:
  ThreadedSource(std::string word, LiveOptions options, const StopSignal& stop)
      : word_(std::move(word)), options_(std::move(options)), stop_(stop) {}

  bool next(Frame& frame, bool /*colour*/) override {
    if (!source_) source_.emplace(word_, options_);
    if (source_->wait(frame, stop_)) return true;
    if (const std::string why = source_->error(); !why.empty()) throw Error(why);
    return false;
  }
  std::optional<std::size_t> count() const override { return std::nullopt; }
  bool live() const override { return true; }

 private:
  std::string word_;
  LiveOptions options_;
  const StopSignal& stop_;
  std::optional<LiveSource> source_;
};

/// What runs on while nobody looks has a thread of its own; so have pipes, if wanted.
std::unique_ptr<FrameSource> open(const std::string& word, const FramesOptions& options,
                                  const StopSignal& stop) {
  std::unique_ptr<FrameSource> source = open_source(word, stop);
  const bool pipe = word.rfind("pgm:", 0) == 0;
  if (!source->live() || (pipe && !options.live)) return source;
  LiveOptions live;
  live.colour = options.colour;
  live.drop = options.live;
  return std::make_unique<ThreadedSource>(word, live, stop);
}

}  // namespace

Frames::Frames(const std::vector<std::string>& words, const FramesOptions& options,
               const StopSignal& stop)
    : words_(words), options_(options), stop_(stop) {
  for (const std::string& word : words) sources_.push_back(open(word, options, stop));
}

std::optional<Frame> Frames::next() {
  for (; current_ < sources_.size() && !stop_.raised(); go_to_next_source()) {
    Frame frame;
    frame.number = number_;
    frame.source = words_[current_];
    frame.sequence = sequence_;
    frame.picture = unused_picture();
    if (options_.frame_rate > 0.0)
      frame.timestamp_s = static_cast<double>(position_) / options_.frame_rate;
    try {
      if (!sources_[current_]->next(frame, options_.colour)) continue;
      ++position_;
    } catch (const Error& error) {
      frame.error = error.what();
      go_to_next_source();
    }
    ++number_;
    return frame;
  }
  return std::nullopt;
}

Picture Frames::unused_picture() {
  const std::lock_guard lock(mutex_);
  if (unused_.empty()) return {};
  Picture picture = std::move(unused_.back());
  unused_.pop_back();
  return picture;
}

void Frames::recycle(Picture&& picture) {
  constexpr std::size_t kMost = 4;
  const std::lock_guard lock(mutex_);
  if (unused_.size() < kMost) unused_.push_back(std::move(picture));
}

void Frames::go_to_next_source() {
  ++current_;
  if (current_ < sources_.size() && sources_[current_]->continues(*sources_[current_ - 1])) return;
  ++sequence_;
  position_ = 0;
}

std::optional<std::size_t> Frames::count() const {
  std::size_t sum = 0;
  for (const auto& source : sources_) {
    const std::optional<std::size_t> count = source->count();
    if (!count) return std::nullopt;
    sum += *count;
  }
  return sum;
}

bool Frames::live() const {
  return std::any_of(sources_.begin(), sources_.end(),
                     [](const auto& source) { return source->live(); });
}

}  // namespace harco::cli
