#include "write_file.hpp"

#include <fstream>
#include <system_error>

#include "harco/error.hpp"

namespace harco::cli {

void write_file(const std::filesystem::path& file, const std::string& content) {
  std::error_code failed;
  std::filesystem::path target = file;  // links are written through
  if (std::filesystem::is_symlink(file, failed) && std::filesystem::exists(file, failed))
    target = std::filesystem::canonical(file, failed);
  std::filesystem::path beside = target;
  beside += ".part";
  std::ofstream out(beside, std::ios::binary | std::ios::trunc);
  out << content;
  out.close();
  if (!out) {
    std::filesystem::remove(beside, failed);
    throw Error(file.string() + ": can't be written");
  }
  std::filesystem::rename(beside, target, failed);
  if (failed) {
    std::error_code ignored;
    std::filesystem::remove(beside, ignored);
    throw Error(file.string() + ": can't be written (" + failed.message() + ")");
  }
}

}  // namespace harco::cli
