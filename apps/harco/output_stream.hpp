// Where lines go as they come: standard output, or a file that appears when it is whole.
#pragma once

#include <cstdio>
#include <filesystem>
#include <string>

namespace harco::cli {

class OutputStream {
 public:
  /// "-" is standard output. A file is written beside its name and gets it by `commit`, or with
  /// the first line if `at_once` is set, for who reads along. What is no plain file (a named pipe)
  /// is written to directly. Throws Error if it can't be written.
  explicit OutputStream(const std::string& file, bool at_once = false);

  /// What has not been committed disappears.
  ~OutputStream();
  OutputStream(const OutputStream&) = delete;
  OutputStream& operator=(const OutputStream&) = delete;

  /// Passes the text on at once. Throws Error.
  void write(const std::string& text);

  /// Nothing more comes. Throws Error.
  void commit();

 private:
  [[noreturn]] void fail() const;
  void rename();

  std::string name_;              ///< as messages call it
  std::filesystem::path file_;    ///< as it will be called
  std::filesystem::path beside_;  ///< as it is called until then; empty if that is the same
  bool at_once_;
  std::FILE* stream_ = nullptr;
};

}  // namespace harco::cli
