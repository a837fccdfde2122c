// Several files that appear together or not at all.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace harco::cli {

/// A place beside a folder's content where new files are made, and from where they move into the
/// folder at once. Makes the folder if need be; what isn't committed disappears again.
class StagedFolder {
 public:
  /// Throws Error if `folder` is a file or can't be made or written to.
  explicit StagedFolder(std::filesystem::path folder);
  ~StagedFolder();
  StagedFolder(const StagedFolder&) = delete;
  StagedFolder& operator=(const StagedFolder&) = delete;

  /// Where to write a file that will have this name. Files are moved in the order of these calls.
  std::filesystem::path file(const std::string& name);

  /// A file of the folder that disappears when the new ones appear, if it is there.
  void remove(const std::string& name);

  /// Moves all files to their place. Throws Error.
  void commit();

 private:
  void discard();

  std::filesystem::path folder_;
  std::filesystem::path stage_;
  std::vector<std::filesystem::path> made_;  ///< folders that weren't there, outermost first
  std::vector<std::string> names_;
  std::vector<std::string> removed_;
};

}  // namespace harco::cli
