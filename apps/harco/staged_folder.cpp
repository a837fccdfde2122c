#include "staged_folder.hpp"

#include <string>
#include <system_error>
#include <utility>

#include "harco/error.hpp"

namespace harco::cli {

namespace fs = std::filesystem;

StagedFolder::StagedFolder(fs::path folder) : folder_(std::move(folder)) {
  std::error_code failed;
  if (folder_.empty()) throw Error("the output folder has no name");
  if (fs::exists(folder_, failed) && !fs::is_directory(folder_, failed))
    throw Error(folder_.string() + ": is a file, not a folder");
  stage_ = folder_ / ".harco-part";
  fs::remove_all(stage_, failed);  // left by a run that was killed
  for (fs::path missing = fs::absolute(stage_); !fs::exists(missing, failed) && !failed;
       missing = missing.parent_path())
    made_.insert(made_.begin(), missing);
  for (const fs::path& missing : made_)
    if (!fs::create_directory(missing, failed) && failed) {
      discard();
      throw Error(folder_.string() + ": can't be written to (" + failed.message() + ")");
    }
}

StagedFolder::~StagedFolder() { discard(); }

void StagedFolder::discard() {
  std::error_code ignored;
  fs::remove_all(stage_, ignored);
  // Folders that hold something stay.
  for (auto made = made_.rbegin(); made != made_.rend(); ++made) fs::remove(*made, ignored);
}

fs::path StagedFolder::file(const std::string& name) {
  names_.push_back(name);
  return stage_ / name;
}

void StagedFolder::remove(const std::string& name) { removed_.push_back(name); }

void StagedFolder::commit() {
  std::error_code ignored;
  for (const std::string& name : names_)
    if (fs::is_directory(folder_ / name, ignored))
      throw Error((folder_ / name).string() + ": is a folder, so the file can't be written");
  for (const std::string& name : names_) {
    std::error_code failed;
    fs::rename(stage_ / name, folder_ / name, failed);
    if (failed)
      throw Error((folder_ / name).string() + ": can't be written (" + failed.message() + ")");
  }
  for (const std::string& name : removed_) fs::remove(folder_ / name, ignored);
}

}  // namespace harco::cli
