#include "output_stream.hpp"

#include <cerrno>
#include <system_error>

#include "harco/error.hpp"

namespace harco::cli {
namespace fs = std::filesystem;

OutputStream::OutputStream(const std::string& file, bool at_once)
    : name_(file == "-" ? "standard output" : file), file_(file), at_once_(at_once) {
  if (file == "-") {
    stream_ = stdout;
    return;
  }
  std::error_code ignored;
  // Links are written through, and what stands in /dev or /proc is never replaced.
  if (fs::is_symlink(file_, ignored) && fs::exists(file_, ignored)) {
    const fs::path absolute = fs::absolute(file_, ignored);
    const bool device =
        absolute.string().rfind("/dev/", 0) == 0 || absolute.string().rfind("/proc/", 0) == 0;
    if (!device) file_ = fs::canonical(file_, ignored);
  }
  const bool plain = !fs::exists(file_, ignored) ||
                     (fs::is_regular_file(file_, ignored) && !fs::is_symlink(file_, ignored));
  fs::path target = file_;
  if (plain) {
    beside_ = file_;
    beside_ += ".part";
    target = beside_;
  }
  errno = 0;
  stream_ = std::fopen(target.c_str(), "wb");
  if (stream_ == nullptr) {
    beside_.clear();
    fail();
  }
}

OutputStream::~OutputStream() {
  if (stream_ != nullptr && stream_ != stdout) std::fclose(stream_);
  std::error_code ignored;
  if (!beside_.empty()) fs::remove(beside_, ignored);
}

void OutputStream::write(const std::string& text) {
  errno = 0;
  if (std::fwrite(text.data(), 1, text.size(), stream_) != text.size() || std::fflush(stream_) != 0)
    fail();
  if (at_once_) rename();
}

void OutputStream::commit() {
  if (stream_ != stdout) {
    errno = 0;
    const bool closed = std::fclose(stream_) == 0;
    stream_ = nullptr;
    if (!closed) fail();
  }
  rename();
}

void OutputStream::rename() {
  if (beside_.empty()) return;
  std::error_code failed;
  fs::rename(beside_, file_, failed);
  if (failed) throw Error(name_ + ": can't be written (" + failed.message() + ")");
  beside_.clear();
}

void OutputStream::fail() const {
  throw Error(name_ + ": can't be written (" + std::generic_category().message(errno) + ")");
}

}  // namespace harco::cli
