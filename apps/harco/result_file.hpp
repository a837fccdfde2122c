// Results of experiments as lines of JSON, each of which tells all that it takes to know whether it
// may stand beside others: so files of several machines can be put together as they are.
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace harco::cli {

/// One finished item.
struct ItemResult {
  std::string version;     ///< of HArCo
  std::string experiment;  ///< its name
  std::string extent;      ///< tiny, quick, full
  nlohmann::json settings;
  int item = 0;
  std::string machine;  ///< that did it
  std::string commit;   ///< that was built; empty if unknown
  nlohmann::json result;
};

/// Its line, without the line's end.
std::string format_result(const ItemResult& result);

/// All lines of the file, or of all results*.jsonl of a folder in the order of their names. What an
/// interruption left of a last line is skipped. Throws Error, naming file and line, for anything
/// else that is no result.
std::vector<ItemResult> read_results(const std::filesystem::path& path);

/// A file that grows line by line; several threads may append. Throws Error.
class ResultFile {
 public:
  /// Goes on after the last whole line of a file that is there already.
  explicit ResultFile(std::filesystem::path file);

  /// The line is in the file when this returns.
  void append(const ItemResult& result);

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::filesystem::path path_;
  std::mutex mutex_;
  std::unique_ptr<std::FILE, Close> file_;
};

}  // namespace harco::cli
