#include "annotate.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <system_error>

#include <fmt/format.h>

#include "harco/error.hpp"
#include "write_file.hpp"

namespace harco::cli {
namespace fs = std::filesystem;
namespace {

constexpr std::array kVideoEndings{".mp4", ".m4v", ".mov", ".mkv", ".avi"};
constexpr std::array kPictureEndings{".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff"};
constexpr double kUsualRate = 30.0;  // frames a second, where the source doesn't say

std::string ending(const fs::path& file) {
  std::string text = file.extension().string();
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

bool one_of(const std::string& text, const auto& list) {
  return std::find(list.begin(), list.end(), text) != list.end();
}

}  // namespace

Annotations::Annotations(const fs::path& target, bool one_frame) : target_(target) {
  std::error_code failed;
  const bool folder = fs::is_directory(target, failed);
  if (!folder && one_of(ending(target), kVideoEndings)) {
    kind_ = Kind::video;
  } else if (!folder && one_of(ending(target), kPictureEndings)) {
    kind_ = Kind::picture;
    if (!one_frame)
      throw Error(target.string() + ": can't hold several frames; name a folder or a video");
  } else {
    kind_ = Kind::folder;
    fs::create_directories(target, failed);
    if (failed) throw Error(target.string() + ": can't be made (" + failed.message() + ")");
    return;
  }
  const fs::path parent = target.parent_path();
  if (!parent.empty() && !fs::is_directory(parent, failed))
    throw Error(target.string() + ": can't be written (there is no folder " + parent.string() +
                ")");
}

Annotations::~Annotations() {
  for (auto& [file, video] : videos_) {
    video.writer.reset();
    std::error_code ignored;
    if (!video.beside.empty()) fs::remove(video.beside, ignored);
  }
}

void Annotations::add(const Frame& frame, const ColourImage& picture) {
  if (kind_ == Kind::video) {
    add_to_video(target_, frame, picture);
  } else if (kind_ == Kind::folder && frame.moving) {
    const auto [file, is_new] = video_files_.try_emplace(frame.sequence);
    if (is_new) file->second = unused(frame.name, ".mp4");
    add_to_video(file->second, frame, picture);
  } else {
    const fs::path file = kind_ == Kind::picture ? target_ : unused(frame.name, ".png");
    const std::vector<std::uint8_t> bytes = media().encode(picture, ending(file));
    write_file(file, {bytes.begin(), bytes.end()});
  }
}

void Annotations::add_to_video(const fs::path& file, const Frame& frame,
                               const ColourImage& picture) {
  Video& video = videos_[file];
  if (!video.writer) {
    video.file = file;
    // The ending tells the format, so it has to stay at the end.
    video.beside = file;
    video.beside.replace_filename(file.stem().string() + ".part" + file.extension().string());
    const double rate = frame.frames_per_second > 0.0 ? frame.frames_per_second : kUsualRate;
    video.writer = media().create_video(video.beside.string(), picture.width, picture.height, rate);
  }
  video.writer->write(picture);
}

void Annotations::commit() {
  for (auto& [name, video] : videos_) {
    video.writer.reset();
    std::error_code failed;
    fs::rename(video.beside, video.file, failed);
    if (failed) throw Error(video.file.string() + ": can't be written (" + failed.message() + ")");
    video.beside.clear();
  }
}

fs::path Annotations::unused(const std::string& name, const std::string& ending) {
  std::string file = name + ending;
  for (int i = 2; !used_.insert(file).second; ++i) file = fmt::format("{}-{}{}", name, i, ending);
  return target_ / file;
}

}  // namespace harco::cli
