// The one exception for what comes from outside: files that can't be read or parsed.
// Misuse of a function (a negative length, a NaN) throws std::invalid_argument instead.
#pragma once

#include <stdexcept>
#include <string>

namespace harco {

/// A file that can't be read, parsed or written. what() is one line that names the file and what
/// is wrong with it.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace harco
