#include "frame_source.hpp"

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
#include "stream.hpp"

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
    frame.timed = true;
    frame.received_s = monotonic_s();
    if (live()) frame.captured_s = frame.timestamp_s;
    frame.moving = true;
    frame.frames_per_second = reader_->frames_per_second();
    return true;
  }

  std::optional<std::size_t> count() const override {
    if (!reader_ || reader_->frame_count() <= 0) return std::nullopt;
    return std::max(static_cast<std::size_t>(reader_->frame_count()), frames_);
  }

  bool live() const override { return !device_.empty(); }
  bool runs_on() const override { return live(); }
  bool may_return() const override { return live(); }

 private:
  std::string word_;
  std::string device_;  ///< of a camera; else empty
  std::unique_ptr<VideoReader> reader_;
  std::size_t frames_ = 0;
};

/// A GStreamer pipeline, or a network stream, which is one.
class StreamSource : public FrameSource {
 public:
  StreamSource(std::string word, const StopSignal& stop) : word_(std::move(word)), stop_(stop) {}

  bool next(Frame& frame, bool colour) override {
    if (!stream_) stream_ = open_stream(word_, colour, stop_);
    if (!stream_->read(frame.picture)) {
      if (frames_ == 0 && !stop_.raised()) throw Error(word_ + ": has no frames");
      return false;
    }
    ++frames_;
    frame.source = word_;
    frame.name = "stream";
    frame.received_s = monotonic_s();
    frame.timestamp_s = stream_->time_s();
    frame.timed = true;
    if (stream_->live()) frame.captured_s = frame.timestamp_s;
    frame.moving = true;
    return true;
  }

  std::optional<std::size_t> count() const override { return std::nullopt; }
  bool live() const override { return true; }
  bool runs_on() const override { return stream_ && stream_->live(); }
  bool may_return() const override { return !stream_ || stream_->live(); }

 private:
  std::string word_;
  const StopSignal& stop_;
  std::unique_ptr<Stream> stream_;
  std::size_t frames_ = 0;
};

class PgmSource : public FrameSource {
 public:
  PgmSource(std::string word, std::string path, const StopSignal& stop)
      : word_(std::move(word)), path_(std::move(path)), stop_(stop) {}

  bool next(Frame& frame, bool colour) override {
    if (!stream_) stream_.emplace(path_, stop_);
    std::swap(image_.image, frame.picture.grey);  // its memory is used again
    if (!stream_->read(image_)) {
      if (frames_ == 0 && !stop_.raised()) throw Error(word_ + ": has no frames");
      return false;
    }
    std::swap(image_.image, frame.picture.grey);
    frame.received_s = monotonic_s();
    frame.source = word_;
    frame.name = fmt::format("{}-{:06}", path_ == "-" ? "frame" : fs::path(path_).stem().string(),
                             frames_++);
    frame.timed = image_.timestamp_s.has_value();
    frame.timestamp_s = image_.timestamp_s.value_or(frame.timestamp_s);
    if (colour) frame.picture.colour = to_colour(frame.picture.grey);
    return true;
  }

  std::optional<std::size_t> count() const override { return std::nullopt; }
  bool live() const override { return true; }

  /// A named pipe waits for its next writer.
  bool may_return() const override {
    std::error_code ignored;
    return path_ != "-" && fs::is_fifo(path_, ignored);
  }

 private:
  std::string word_, path_;
  const StopSignal& stop_;
  std::optional<PgmStream> stream_;
  PgmFrame image_;
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

bool has_prefix(const std::string& word, const std::string& prefix) {
  return word.rfind(prefix, 0) == 0;
}

std::string without_prefix(const std::string& word, const std::string& prefix) {
  return has_prefix(word, prefix) ? word.substr(prefix.size()) : std::string();
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
    frame.received_s = monotonic_s();
  } catch (const Error& error) {
    frame.error = error.what();
  } catch (const std::bad_alloc&) {
    frame.error = frame.file.string() + ": is too large for this machine's memory";
  }
  frame.file.clear();
}

std::unique_ptr<FrameSource> open_source(const std::string& word, const StopSignal& stop) {
  if (const std::string path = without_prefix(word, "pgm:"); !path.empty()) {
    std::error_code ignored;
    if (path != "-" && !fs::exists(path, ignored)) throw Error(path + ": there is no such file");
    if (fs::is_directory(path, ignored)) throw Error(path + ": is a folder, not a PGM stream");
    return std::make_unique<PgmSource>(word, path, stop);
  }
  if (const std::string device = without_prefix(word, "camera:"); !device.empty())
    return std::make_unique<VideoSource>(word, device);
  for (const char* scheme : {"rtsp://", "rtsps://", "rtp://", "gst:"})
    if (has_prefix(word, scheme)) return std::make_unique<StreamSource>(word, stop);

  std::error_code failed;
  const fs::file_status status = fs::status(word, failed);
  if (!fs::exists(status)) throw Error(word + ": there is no such file or folder");
  if (has_prefix(word, "/dev/video")) return std::make_unique<VideoSource>(word, word);
  if (fs::is_directory(status))
    return std::make_unique<PictureSource>(pictures_in(word), /*single=*/false);
  if (contains(kFolderEndings, ending(word)) || contains(kMoreEndings, ending(word)))
    return std::make_unique<PictureSource>(std::vector<fs::path>{word}, /*single=*/true);
  return std::make_unique<VideoSource>(word, "");
}

}  // namespace harco::cli
