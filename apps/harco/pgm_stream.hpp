// Binary PGM images (P5, 8 bit), one after the other, from a file, a named pipe or standard input.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "harco/image.hpp"
#include "stop_signal.hpp"

namespace harco::cli {

struct PgmFrame {
  Image image;
  std::optional<double> timestamp_s;  ///< from a comment line `# timestamp_s 12.345678`
};

class PgmStream {
 public:
  /// "-" is standard input. A named pipe may still be without a writer. Waiting for bytes ends with
  /// `stop`. Throws Error if the file can't be opened.
  PgmStream(const std::string& path, const StopSignal& stop);
  ~PgmStream();
  PgmStream(const PgmStream&) = delete;
  PgmStream& operator=(const PgmStream&) = delete;

  /// The next image, as soon as its last byte has come, into the memory of the one before; false
  /// if the stream ends before it or was stopped. Throws Error if what comes is no P5 image, has
  /// more than 8 bits or ends in its middle.
  bool read(PgmFrame& frame);

 private:
  struct Stopped {};

  [[noreturn]] void fail(const std::string& what) const;
  bool read_image(PgmFrame& frame);
  void read_comment(PgmFrame& frame);
  int read_number(const char* name, int limit, PgmFrame& frame);

  std::size_t read_bytes(std::uint8_t* to, std::size_t most);
  int peek();  ///< the next byte; kEnd where there is none
  int get();

  static constexpr int kEnd = -1;

  std::string name_;
  const StopSignal& stop_;
  int fd_;
  std::array<std::uint8_t, 4096> buffer_{};
  std::size_t next_ = 0, filled_ = 0;  ///< part of the buffer that is still to be read
};

}  // namespace harco::cli
