#include "marker/file.hpp"

#include <fstream>
#include <iterator>
#include <system_error>

#include "harco/error.hpp"

namespace harco {

std::string read_text_file(const std::filesystem::path& file) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored))
    throw Error(file.string() + ": is a folder, not a file");
  std::ifstream in(file, std::ios::binary);
  if (!in) throw Error(file.string() + ": can't be opened");
  std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  if (in.bad()) throw Error(file.string() + ": can't be read");
  return text;
}

void write_text_file(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::path beside = file;
  beside += ".part";
  std::error_code failed;
  {
    std::ofstream out(beside, std::ios::binary | std::ios::trunc);
    out << text;
    out.close();
    if (!out) {
      std::filesystem::remove(beside, failed);
      throw Error(file.string() + ": can't be written");
    }
  }
  std::filesystem::rename(beside, file, failed);
  if (failed) {
    std::error_code ignored;
    std::filesystem::remove(beside, ignored);
    throw Error(file.string() + ": can't be written (" + failed.message() + ")");
  }
}

}  // namespace harco
