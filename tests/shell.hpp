// Programs, files, and folders that vanish with the test. Sources: shell.cpp.
#pragma once

#include <filesystem>
#include <string>

namespace harco::test {

/// What a run of a program left behind.
struct CommandResult {
  int status = -1;     ///< exit status; 128 + signal if it was killed
  std::string output;  ///< standard output
  std::string errors;  ///< standard error
};

/// Runs one command line, without redirections, through the shell.
CommandResult run_shell(const std::string& line);

/// Whether the shell finds a program of this name.
bool has_program(const std::string& name);

/// A new empty folder that vanishes with this object.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

std::string read_file(const std::filesystem::path& file);
void write_file(const std::filesystem::path& file, const std::string& content);

}  // namespace harco::test
