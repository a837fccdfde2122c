// Binary PGM images (P5, 8 bit), one after the other, from a file, a named pipe or standard input.
#pragma once

#include <cstdio>
#include <memory>
#include <optional>
#include <string>

#include "harco/image.hpp"

namespace harco::cli {

struct PgmFrame {
  Image image;
  std::optional<double> timestamp_s;  ///< from a comment line `# timestamp_s 12.345678`
};

class PgmStream {
 public:
  /// "-" is standard input. Throws Error if the file can't be opened.
  explicit PgmStream(const std::string& path);

  /// The next image, as soon as its last byte has come; false if the stream ends before it. Throws
  /// Error if what comes is no P5 image, has more than 8 bits or ends in its middle.
  bool read(PgmFrame& frame);

 private:
  struct Close {
    void operator()(std::FILE* file) const;
  };

  [[noreturn]] void fail(const std::string& what) const;
  void read_comment(PgmFrame& frame);
  int read_number(const char* name, int limit, PgmFrame& frame);

  std::string name_;
  std::unique_ptr<std::FILE, Close> file_;
};

}  // namespace harco::cli
