// Pictures and videos with what was found drawn over them.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>

#include "frames.hpp"
#include "media.hpp"

namespace harco::cli {

/// Writes annotated frames, one by one and in order: into one video if `target` is called like
/// one, into one picture if it is called like that, else into a folder: NAME.png for a picture,
/// NAME.mp4 for a video.
class Annotations {
 public:
  /// Throws Error if `target` can't be made, or is a picture for more (or maybe more) than one
  /// frame.
  Annotations(const std::filesystem::path& target, bool one_frame);

  /// Unfinished videos disappear.
  ~Annotations();

  void add(const Frame& frame, const ColourImage& picture);

  /// Videos appear under their names.
  void commit();

 private:
  /// A video that is written beside its name until it is whole.
  struct Video {
    std::filesystem::path file, beside;
    std::unique_ptr<VideoWriter> writer;
  };

  void add_to_video(const std::filesystem::path& file, const Frame& frame,
                    const ColourImage& picture);
  std::filesystem::path unused(const std::string& name, const std::string& ending);

  enum class Kind { folder, picture, video };
  std::filesystem::path target_;
  Kind kind_;
  std::set<std::string> used_;                                ///< names of files in the folder
  std::map<std::size_t, std::filesystem::path> video_files_;  ///< by sequence
  std::map<std::filesystem::path, Video> videos_;
};

}  // namespace harco::cli
