#include <algorithm>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "command.hpp"

namespace harco {
namespace {

using test::CommandResult;
using test::TemporaryFolder;
using Json = nlohmann::json;
using Key = std::pair<std::string, int>;  // experiment and item

CommandResult reproduce(const std::string& arguments, const std::filesystem::path& out) {
  return test::run_harco("reproduce --tiny " + arguments + " --out '" + out.string() + "'");
}

std::vector<std::string> lines_of(const std::filesystem::path& file) {
  std::vector<std::string> lines;
  std::istringstream in(test::read_file(file));
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// Without fields that are times.
Json without_times(const Json& json) {
  Json out = Json::object();
  for (const auto& [key, value] : json.items())
    if (key.size() < 3 || key.substr(key.size() - 3) != "_ms") out[key] = value;
  return out;
}

std::map<Key, Json> results_of(const std::filesystem::path& file) {
  std::map<Key, Json> results;
  for (const std::string& line : lines_of(file)) {
    const Json json = Json::parse(line);
    results[{json.at("experiment"), json.at("item")}] = without_times(json.at("result"));
  }
  return results;
}

/// Empty if every tag is closed in its order and every attribute is quoted, as XML asks; else what
/// is wrong.
std::string trouble_in(const std::string& html) {
  std::vector<std::string> open;
  std::size_t at = html.find("<html");
  while (at != std::string::npos) {
    const std::size_t end = html.find('>', at);
    if (end == std::string::npos) return "a tag without end";
    const std::string tag = html.substr(at + 1, end - at - 1);
    if (tag.find('<') != std::string::npos) return "a bare < in " + tag;
    if (std::count(tag.begin(), tag.end(), '"') % 2 != 0) return "odd quotes in " + tag;
    const std::string name = tag.substr(0, tag.find_first_of(" \n/", 1));
    if (tag.front() == '/') {
      if (open.empty() || "/" + open.back() != tag) return "</" + tag + " closes nothing";
      open.pop_back();
    } else if (tag.back() != '/') {
      open.push_back(name);
    }
    at = html.find('<', end);
  }
  return open.empty() ? "" : open.back() + " is not closed";
}

TEST(Reproduce, DoesAllExperimentsAndReportsOnThem) {
  const TemporaryFolder folder;
  const CommandResult result = reproduce("", folder / "out");
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_NE(result.output.find("The report: "), std::string::npos);
  const std::string html = test::read_file(folder / "out" / "report.html");
  EXPECT_EQ(trouble_in(html), "");
  for (const char* section : {"4.1", "4.2", "4.3", "4.5"})
    EXPECT_NE(html.find("<h2 id=\"s" + std::string(section) + "\">"), std::string::npos) << section;
  EXPECT_NE(html.find("<svg "), std::string::npos);
  EXPECT_NE(html.find("src=\"data:image/jpeg;base64,/9j/"), std::string::npos);
  // Nothing is fetched and nothing runs.
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(html.find("src=\"http"), std::string::npos);
  for (const char* nothing : {">nan", " nan", "\"nan", ">inf", " inf", "\"inf"})
    EXPECT_EQ(html.find(nothing), std::string::npos) << nothing;
}

TEST(Reproduce, ShardsMergeToWhatOneRunGives) {
  const TemporaryFolder folder;
  const std::string which = "4.1 4.3";
  ASSERT_EQ(reproduce(which, folder / "whole").status, 0);
  ASSERT_EQ(reproduce(which + " --shard 1/2", folder / "a").status, 0);
  ASSERT_EQ(reproduce(which + " --shard 2/2", folder / "b").status, 0);
  EXPECT_FALSE(std::filesystem::exists(folder / "a" / "report.html"));
  const std::string parts =
      " --merge '" + (folder / "a").string() + "' '" + (folder / "b").string() + "'";
  const CommandResult merged = reproduce(which + parts, folder / "merged");
  EXPECT_EQ(merged.status, 0) << merged.errors;
  const auto whole = results_of(folder / "whole" / "results.jsonl");
  EXPECT_EQ(whole.size(), 2U);
  EXPECT_EQ(results_of(folder / "a" / "results-1-of-2.jsonl").size(), 1U);
  EXPECT_EQ(results_of(folder / "merged" / "results.jsonl"), whole);
  EXPECT_TRUE(std::filesystem::exists(folder / "merged" / "report.html"));
}

TEST(Reproduce, GoesOnWhereItWasInterrupted) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder / "out" / "results.jsonl";
  ASSERT_EQ(reproduce("4.1 4.3 --jobs 1", folder / "out").status, 0);
  const std::vector<std::string> whole = lines_of(file);
  ASSERT_EQ(whole.size(), 2U);
  // The first line marked, so that doing it again would show; the second one torn.
  Json first = Json::parse(whole[0]);
  first["machine"] = "another";
  test::write_file(file, first.dump() + "\n" + whole[1].substr(0, whole[1].size() / 2));
  const CommandResult again = reproduce("4.1 4.3 --jobs 1", folder / "out");
  EXPECT_EQ(again.status, 0) << again.errors;
  const std::vector<std::string> lines = lines_of(file);
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0], first.dump());
  EXPECT_EQ(lines[1], whole[1]);
}

TEST(Reproduce, LeavesResultsOfOtherSettingsAside) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder / "out" / "results.jsonl";
  ASSERT_EQ(reproduce("4.1", folder / "out").status, 0);
  Json other = Json::parse(lines_of(file).front());
  other["settings"]["side_m"] = 7.0;
  test::write_file(file, other.dump() + "\n");
  const CommandResult again = reproduce("4.1", folder / "out");
  EXPECT_EQ(again.status, 0);
  EXPECT_NE(again.errors.find("1 result is"), std::string::npos) << again.errors;
  EXPECT_EQ(lines_of(file).size(), 2U);
}

TEST(Reproduce, RefusesWhatMakesNoSense) {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& arguments, const std::string& because) {
    const CommandResult result = reproduce(arguments, folder / "out");
    EXPECT_EQ(result.status, 2) << arguments;
    EXPECT_NE(result.errors.find(because), std::string::npos) << result.errors;
    EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
    EXPECT_FALSE(std::filesystem::exists(folder / "out" / "report.html")) << arguments;
  };
  refused("4.9", "no experiment 4.9; there are 4.1, ");
  refused("4.1 --shard 0/2", "--shard");
  refused("4.1 --shard 3/2", "--shard");
  refused("4.1 --shard 1/2x", "--shard");
  refused("4.1 --merge '" + (folder / "none").string() + "'", (folder / "none").string());
  test::write_file(folder / "bad.jsonl", "{}\n");
  refused("4.1 --merge '" + (folder / "bad.jsonl").string() + "'", "bad.jsonl: line 1");
  test::write_file(folder / "empty.jsonl", "");
  refused("4.1 --merge '" + (folder / "empty.jsonl").string() + "'", "no result");
}

}  // namespace
}  // namespace harco
