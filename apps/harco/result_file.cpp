#include "result_file.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "harco/error.hpp"

namespace harco::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr const char* kFormat = "harco-result";
constexpr int kVersion = 1;

ItemResult parse(const std::string& line) {
  const Json json = Json::parse(line);
  if (json.at("format") != kFormat || json.at("version") != kVersion)
    throw Error("is of another format or version");
  return {.version = json.at("harco"),
          .experiment = json.at("experiment"),
          .extent = json.at("extent"),
          .settings = json.at("settings"),
          .item = json.at("item"),
          .machine = json.at("machine"),
          .commit = json.value("commit", ""),
          .result = json.at("result")};
}

std::string content_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw Error(file.string() + ": can't be read");
  return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<ItemResult> read_file(const fs::path& file) {
  const std::string content = content_of(file);
  std::vector<ItemResult> results;
  int number = 1;
  for (std::size_t begin = 0, end = 0; (end = content.find('\n', begin)) != std::string::npos;
       begin = end + 1, ++number)
    try {
      results.push_back(parse(content.substr(begin, end - begin)));
    } catch (const std::exception& error) {
      throw Error(fmt::format("{}: line {} is no result of an experiment ({})", file.string(),
                              number, error.what()));
    }
  return results;
}

std::vector<fs::path> files_of(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    if (entry.path().filename().string().rfind("results", 0) == 0 &&
        entry.path().extension() == ".jsonl")
      files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

/// Cuts off what follows the last line's end.
void trim(const fs::path& file) {
  std::error_code failed;
  if (!fs::exists(file, failed)) return;
  const std::string content = content_of(file);
  const std::size_t whole = content.rfind('\n') + 1;  // 0 if there is none
  if (whole < content.size()) fs::resize_file(file, whole);
}

}  // namespace

std::string format_result(const ItemResult& result) {
  // Ordered: what a reader looks for first stands first.
  const nlohmann::ordered_json json{
      {"format", kFormat},           {"version", kVersion},
      {"harco", result.version},     {"experiment", result.experiment},
      {"extent", result.extent},     {"item", result.item},
      {"machine", result.machine},   {"commit", result.commit},
      {"settings", result.settings}, {"result", result.result}};
  return json.dump();
}

std::vector<ItemResult> read_results(const fs::path& path) {
  std::error_code failed;
  if (!fs::is_directory(path, failed)) return read_file(path);
  std::vector<ItemResult> results;
  for (const fs::path& file : files_of(path)) {
    std::vector<ItemResult> more = read_file(file);
    std::move(more.begin(), more.end(), std::back_inserter(results));
  }
  return results;
}

ResultFile::ResultFile(fs::path file) : path_(std::move(file)) {
  trim(path_);
  file_.reset(std::fopen(path_.c_str(), "ab"));
  if (!file_)
    throw Error(fmt::format("{}: can't be written to ({})", path_.string(), std::strerror(errno)));
}

void ResultFile::append(const ItemResult& result) {
  const std::string line = format_result(result) + "\n";
  const std::lock_guard lock(mutex_);
  if (std::fwrite(line.data(), 1, line.size(), file_.get()) != line.size() ||
      std::fflush(file_.get()) != 0)
    throw Error(fmt::format("{}: can't be written to ({})", path_.string(), std::strerror(errno)));
}

}  // namespace harco::cli
