#include "frames.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <new>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "harco/error.hpp"
#include "pgm_stream.hpp"
#include "picture_file.hpp"

namespace harco::cli {
namespace fs = std::filesystem;
namespace {

/// What counts as a picture in a folder.
constexpr std::array kFolderEndings{".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".tif", ".tiff"};
/// What else is taken for a picture where a single file is named.
constexpr std::array kMoreEndings{".ppm", ".pbm", ".pnm", ".webp", ".jp2", ".jpe", ".exr", ".hdr"};

std::string ending(const fs::path& file) {
  std::string text = file.extension().string();
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

template <typename List>
bool contains(const List& list, const std::string& text) {
  return std::find(list.begin(), list.end(), text) != list.end();
}

/// Pictures in files: one, or those of a folder.
class PictureSource : public FrameSource {
 public:
  PictureSource(std::vector<fs::path> files, bool single)
      : files_(std::move(files)), single_(single) {}

  bool next(Frame& frame, bool /*colour*/) override {
    if (next_ == files_.size()) return false;
    frame.file = files_[next_++];
    frame.source = frame.file.string();
    frame.name = frame.file.stem().string();
    return true;
  }

  std::optional<std::size_t> count() const override { return files_.size(); }

  bool continues(const FrameSource& before) const override {
    const auto* pictures = dynamic_cast<const PictureSource*>(&before);
    return single_ && pictures != nullptr && pictures->single_;
  }

 private:
  std::vector<fs::path> files_;
  bool single_;
  std::size_t next_ = 0;
};

/// A video file or a camera, opened when its turn comes.
class VideoSource : public FrameSource {
 public:
  VideoSource(std::string word, std::string device)
      : word_(std::move(word)), device_(std::move(device)) {}

  bool next(Frame& frame, bool colour) override {
    if (!reader_) reader_ = live() ? media().open_camera(device_) : media().open_video(word_);
    if (!reader_->read(frame.picture, colour)) {
      if (frames_ == 0) throw Error(word_ + ": has no frames that can be read");
      return false;
    }
    ++frames_;
    frame.source = word_;
    frame.name = live() ? "camera" : fs::path(word_).stem().string();
    frame.timestamp_s = reader_->time_s();
    frame.moving = true;
    frame.frames_per_second = reader_->frames_per_second();
    return true;
  }

  std::optional<std::size_t> count() const override {
    if (!reader_ || reader_->frame_count() <= 0) return std::nullopt;
    return std::max(static_cast<std::size_t>(reader_->frame_count()), frames_);
  }

  bool live() const override { return !device_.empty(); }

 private:
  std::string word_;
  std::string device_;  ///< of a camera; else empty
  std::unique_ptr<VideoReader> reader_;
  std::size_t frames_ = 0;
};

class PgmSource : public FrameSource {
 public:
  PgmSource(std::string word, std::string path) : word_(std::move(word)), path_(std::move(path)) {}

  bool next(Frame& frame, bool colour) override {
    if (!stream_) stream_.emplace(path_);
    PgmFrame image;
    if (!stream_->read(image)) {
      if (frames_ == 0) throw Error(word_ + ": has no frames");
      return false;
    }
    frame.source = word_;
    frame.name = fmt::format("{}-{:06}", path_ == "-" ? "frame" : fs::path(path_).stem().string(),
                             frames_++);
    frame.timestamp_s = image.timestamp_s.value_or(frame.timestamp_s);
    frame.picture.grey = std::move(image.image);
    if (colour) frame.picture.colour = to_colour(frame.picture.grey);
    return true;
  }

  std::optional<std::size_t> count() const override { return std::nullopt; }
  bool live() const override { return true; }

 private:
  std::string word_, path_;
  std::optional<PgmStream> stream_;
  std::size_t frames_ = 0;
};

std::vector<fs::path> pictures_in(const std::string& folder) {
  std::error_code failed;
  std::vector<fs::path> files;
  for (fs::directory_iterator entry(folder, failed), end; !failed && entry != end;
       entry.increment(failed)) {
    std::error_code ignored;
    if (contains(kFolderEndings, ending(entry->path())) && !entry->is_directory(ignored))
      files.push_back(entry->path());
  }
  if (failed) throw Error(folder + ": can't be read (" + failed.message() + ")");
  if (files.empty()) throw Error(folder + ": is a folder without pictures");
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
    return natural_less(a.filename().string(), b.filename().string());
  });
  return files;
}

std::string without_prefix(const std::string& word, const std::string& prefix) {
  return word.rfind(prefix, 0) == 0 ? word.substr(prefix.size()) : std::string();
}

}  // namespace

bool natural_less(const std::string& a, const std::string& b) {
  const auto digit = [](char c) { return c >= '0' && c <= '9'; };
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (!digit(a[i]) || !digit(b[j])) {
      if (a[i] != b[j]) return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[j]);
      ++i, ++j;
      continue;
    }
    const auto number = [&](const std::string& text, std::size_t& at) {
      while (at < text.size() && text[at] == '0') ++at;
      const std::size_t start = at;
      while (at < text.size() && digit(text[at])) ++at;
      return text.substr(start, at - start);
    };
    const std::string x = number(a, i), y = number(b, j);
    if (x.size() != y.size()) return x.size() < y.size();
    if (x != y) return x < y;
  }
  if (i < a.size() || j < b.size()) return i == a.size();
  return a < b;  // they differ in leading zeros only
}

void load(Frame& frame, bool colour) {
  if (frame.file.empty()) return;
  try {
    PictureFile loaded = read_picture(frame.file, colour);
    frame.picture = std::move(loaded.picture);
    frame.timestamp_s = loaded.timestamp_s.value_or(frame.timestamp_s);
  } catch (const Error& error) {
    frame.error = error.what();
  } catch (const std::bad_alloc&) {
    frame.error = frame.file.string() + ": is too large for this machine's memory";
  }
  frame.file.clear();
}

std::unique_ptr<FrameSource> open_source(const std::string& word) {
  if (const std::string path = without_prefix(word, "pgm:"); !path.empty()) {
    std::error_code ignored;
    if (path != "-" && !fs::exists(path, ignored)) throw Error(path + ": there is no such file");
    if (fs::is_directory(path, ignored)) throw Error(path + ": is a folder, not a PGM stream");
    return std::make_unique<PgmSource>(word, path);
  }
  if (const std::string device = without_prefix(word, "camera:"); !device.empty())
    return std::make_unique<VideoSource>(word, device);

  std::error_code failed;
  const fs::file_status status = fs::status(word, failed);
  if (!fs::exists(status)) throw Error(word + ": there is no such file or folder");
  if (word.rfind("/dev/video", 0) == 0) return std::make_unique<VideoSource>(word, word);
  if (fs::is_directory(status))
    return std::make_unique<PictureSource>(pictures_in(word), /*single=*/false);
  if (contains(kFolderEndings, ending(word)) || contains(kMoreEndings, ending(word)))
    return std::make_unique<PictureSource>(std::vector<fs::path>{word}, /*single=*/true);
  return std::make_unique<VideoSource>(word, "");
}

Frames::Frames(const std::vector<std::string>& words, double frame_rate, bool colour)
    : words_(words), frame_rate_(frame_rate), colour_(colour) {
  for (const std::string& word : words) sources_.push_back(open_source(word));
}

std::optional<Frame> Frames::next() {
  for (; current_ < sources_.size(); go_to_next_source()) {
    Frame frame;
    frame.number = number_;
    frame.source = words_[current_];
    frame.sequence = sequence_;
    if (frame_rate_ > 0.0) frame.timestamp_s = static_cast<double>(position_) / frame_rate_;
    try {
      if (!sources_[current_]->next(frame, colour_)) continue;
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
