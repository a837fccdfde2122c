// harco reproduce: the experiments of the paper's section 4, and the report on them.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "harco/error.hpp"
#include "harco/version.hpp"
#include "harco_build_commit.hpp"
#include "interrupt.hpp"
#include "lab/experiments/experiment.hpp"
#include "lab/report/html.hpp"
#include "lab_module.hpp"
#include "machine.hpp"
#include "progress.hpp"
#include "result_file.hpp"
#include "verbs.hpp"
#include "write_file.hpp"

namespace harco::cli {
namespace {

namespace fs = std::filesystem;
using lab::Experiment;
using lab::Extent;

constexpr int kInterrupted = 130;

/// This one of so many that share the work.
struct Shard {
  int index = 1;  ///< 1 … count
  int count = 1;
};

struct ReproduceOptions {
  std::vector<std::string> names;
  fs::path out = "reproduction";
  bool quick = false;
  bool tiny = false;
  int jobs = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  std::string shard;
  std::vector<fs::path> merge;

  Extent extent() const { return tiny ? Extent::tiny : quick ? Extent::quick : Extent::full; }
};

Shard parse_shard(const std::string& text) {
  Shard shard;
  if (text.empty()) return shard;
  int read = 0;
  if (std::sscanf(text.c_str(), "%d/%d%n", &shard.index, &shard.count, &read) != 2 ||
      static_cast<std::size_t>(read) != text.size() || shard.index < 1 || shard.index > shard.count)
    throw std::invalid_argument("--shard: '" + text + "' is no I/N with 1 <= I <= N, such as 3/8");
  return shard;
}

std::vector<const Experiment*> chosen(const std::vector<std::string>& names) {
  std::vector<const Experiment*> all;
  lab_function<void(std::vector<const Experiment*>&)>("harco_lab_experiments")(all);
  if (names.empty()) return all;
  std::string known;
  for (const Experiment* one : all) known += (known.empty() ? "" : ", ") + one->name();
  for (const std::string& name : names)
    if (std::none_of(all.begin(), all.end(), [&](auto* one) { return one->name() == name; }))
      throw std::invalid_argument(fmt::format("no experiment {}; there are {}", name, known));
  std::erase_if(all, [&](const Experiment* one) {
    return std::find(names.begin(), names.end(), one->name()) == names.end();
  });
  return all;
}

/// One experiment, as it is done here, and what of it is done.
struct Part {
  const Experiment* experiment;
  Extent extent;
  lab::Json settings;
  int items;
  std::map<int, ItemResult> done;

  Part(const Experiment* one, Extent how_much)
      : experiment(one),
        extent(how_much),
        settings(one->settings(how_much)),
        items(one->items(how_much)) {}

  ItemResult labelled(int item) const {
    return {.version = HARCO_VERSION,
            .experiment = experiment->name(),
            .extent = lab::to_string(extent),
            .settings = settings,
            .item = item,
            .machine = describe_machine(),
            .commit = HARCO_BUILD_COMMIT,
            .result = {}};
  }

  bool takes(const ItemResult& result) const {
    return result.version == HARCO_VERSION && result.experiment == experiment->name() &&
           result.extent == lab::to_string(extent) && result.settings == settings &&
           result.item >= 0 && result.item < items;
  }
};

/// Takes over what fits; the number of results of these experiments that don't.
int take_over(std::vector<Part>& parts, const std::vector<ItemResult>& results) {
  int others = 0;
  for (const ItemResult& result : results)
    for (Part& part : parts) {
      if (part.experiment->name() != result.experiment) continue;
      if (part.takes(result))
        part.done.emplace(result.item, result);
      else
        ++others;
    }
  return others;
}

/// Something that is still to be done.
struct Task {
  Part* part;
  int item;
};

std::vector<Task> open_tasks(std::vector<Part>& parts, const Shard& shard) {
  std::vector<Task> tasks;
  int number = 0;
  for (Part& part : parts)
    for (int item = 0; item < part.items; ++item, ++number)
      if (number % shard.count == shard.index - 1 && part.done.count(item) == 0)
        tasks.push_back({&part, item});
  return tasks;
}

std::string minutes(double seconds) {
  return seconds < 90.0 ? fmt::format("{:.0f} s", seconds)
                        : fmt::format("{:.0f} min", seconds / 60);
}

/// Does all tasks on `jobs` threads; after Ctrl-C those that are begun. False if it came.
bool work(const std::vector<Task>& tasks, int jobs, ResultFile& file) {
  const InterruptGuard interrupt;
  ProgressBar bar("reproduce");
  const auto begin = std::chrono::steady_clock::now();
  std::atomic<std::size_t> next{0};
  std::mutex finishing;
  std::size_t finished = 0;
  std::exception_ptr failure;

  const auto finish = [&](const Task& task, lab::Json result) {
    ItemResult line = task.part->labelled(task.item);
    line.result = std::move(result);
    const std::lock_guard lock(finishing);
    file.append(line);
    task.part->done.emplace(task.item, std::move(line));
    ++finished;
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begin;
    const auto left = static_cast<double>(tasks.size() - finished);
    bar.show(static_cast<double>(finished) / static_cast<double>(tasks.size()),
             fmt::format("{}, about {} left", task.part->experiment->name(),
                         minutes(passed.count() * left / static_cast<double>(finished))));
  };
  const auto run = [&] {
    try {
      for (std::size_t i = next++; i < tasks.size() && !interrupt.interrupted(); i = next++)
        finish(tasks[i], tasks[i].part->experiment->run(tasks[i].part->extent, tasks[i].item));
    } catch (...) {
      const std::lock_guard lock(finishing);
      if (!failure) failure = std::current_exception();
      next = tasks.size();
    }
  };
  bar.show(0.0);
  std::vector<std::thread> threads;
  for (int i = 0; i < jobs; ++i) threads.emplace_back(run);
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
  return finished == tasks.size();
}

// --- The report ---------------------------------------------------------------------------------

lab::Report report_on(const std::vector<Part>& parts, const std::string& command) {
  lab::Report report;
  report.title = "HArCo: section 4 of the paper, reproduced";
  report.introduction =
      "Every figure below comes from pictures: drawn exact to the area that ink covers in a pixel, "
      "blurred, exposed with noise, and handed to the detectors as a camera would. The baseline is "
      "the paper's, ArUco as OpenCV has it, looking at its own markers from the same places.";
  std::set<std::string> machines, commits;
  for (const Part& part : parts) {
    if (part.done.empty()) continue;
    std::vector<lab::Json> results;
    for (const auto& [item, line] : part.done) {
      results.push_back(line.result);
      machines.insert(line.machine);
      commits.insert(line.commit.empty() ? "unknown" : line.commit);
    }
    std::string note = fmt::format("{} of {} items", part.done.size(), part.items);
    if (part.extent != Extent::full) note += ", in small (--quick)";
    report.sections.push_back({part.experiment->name(), part.experiment->title(), note,
                               part.experiment->summarise(part.extent, results)});
  }
  report.facts = {{"HArCo", HARCO_VERSION}, {"compiler", __VERSION__}, {"command", command}};
  for (const std::string& commit : commits) report.facts.emplace_back("built from commit", commit);
  for (const std::string& machine : machines) report.facts.emplace_back("machine", machine);
  return report;
}

void print_findings(const lab::Report& report) {
  for (const lab::ReportSection& section : report.sections) {
    fmt::print("{} {} ({})\n", section.name, section.title, section.note);
    for (const lab::Finding& finding : section.chapter.findings) {
      fmt::print("  {}: {}", finding.what, finding.ours);
      if (!finding.paper.empty()) fmt::print("; paper {}", finding.paper);
      if (!finding.baseline.empty()) fmt::print("; baseline {}", finding.baseline);
      if (finding.reached)
        fmt::print("; goal {}: {}", finding.goal, *finding.reached ? "reached" : "MISSED");
      fmt::print("\n");
    }
  }
}

void write_report(const std::vector<Part>& parts, const ReproduceOptions& options) {
  std::string command = "harco reproduce";
  for (const std::string& name : options.names) command += " " + name;
  if (options.quick) command += " --quick";
  const lab::Report report = report_on(parts, command);
  if (report.sections.empty()) throw Error("there is no result to report on");
  std::string html, overview;
  lab_function<void(const lab::Report&, std::string&, std::string&)>("harco_lab_report")(
      report, html, overview);
  const fs::path file = options.out / "report.html";
  write_file(file, html);
  if (!overview.empty()) write_file(options.out / "overview.svg", overview);
  print_findings(report);
  fmt::print("The report: {}\n", file.string());
}

// --- The verb -----------------------------------------------------------------------------------

void make_folder(const fs::path& folder) {
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed || !fs::is_directory(folder))
    throw Error(folder.string() + ": can't be made (" + failed.message() + ")");
}

void warn_of_others(int others) {
  if (others > 0)
    fmt::print(stderr, "harco: {} result{} of another version or other settings left aside\n",
               others, others == 1 ? " is" : "s are");
}

/// Puts the results of all paths together, sorted, into one file, and reports on them.
void merge(std::vector<Part>& parts, const ReproduceOptions& options) {
  int others = 0;
  for (const fs::path& path : options.merge) others += take_over(parts, read_results(path));
  warn_of_others(others);
  std::string lines;
  for (const Part& part : parts)
    for (const auto& [item, result] : part.done) lines += format_result(result) + "\n";
  make_folder(options.out);
  write_file(options.out / "results.jsonl", lines);
  write_report(parts, options);
}

void run(std::vector<Part>& parts, const ReproduceOptions& options) {
  const Shard shard = parse_shard(options.shard);
  make_folder(options.out);
  warn_of_others(take_over(parts, read_results(options.out)));
  const std::vector<Task> tasks = open_tasks(parts, shard);
  const std::string name = shard.count == 1
                               ? "results.jsonl"
                               : fmt::format("results-{}-of-{}.jsonl", shard.index, shard.count);
  ResultFile file(options.out / name);
  if (!work(tasks, options.jobs, file)) {
    fmt::print(stderr, "harco: interrupted; the same command goes on from here\n");
    throw ExitStatus{kInterrupted};
  }
  if (shard.count == 1) return write_report(parts, options);
  fmt::print("{}: all results of this shard; harco reproduce --merge puts shards together\n",
             (options.out / name).string());
}

void reproduce(const ReproduceOptions& options) {
  std::vector<Part> parts;
  for (const Experiment* one : chosen(options.names)) parts.emplace_back(one, options.extent());
  if (options.merge.empty())
    run(parts, options);
  else
    merge(parts, options);
}

}  // namespace

void add_reproduce(CLI::App& app) {
  CLI::App& verb = *app.add_subcommand(
      "reproduce", "Do the paper's experiments (section 4) in simulation and report on them");
  const auto options = std::make_shared<ReproduceOptions>();
  verb.add_option("experiments", options->names, "Sections of the paper, 4.1 … 4.6; all if none");
  verb.add_option("--out", options->out,
                  "Folder of results and report; what it holds already isn't done again")
      ->capture_default_str();
  verb.add_flag("--quick", options->quick, "Less of everything: two minutes instead of thirty");
  verb.add_flag("--tiny", options->tiny, "Some frames of everything, to test the command")
      ->group("");
  verb.add_option("--jobs", options->jobs, "Threads; a processor each by default")
      ->check(CLI::Range(1, 1024));
  CLI::Option* shard =
      verb.add_option("--shard", options->shard,
                      "I/N: only this one of N equal parts of the work, for job arrays; no report");
  verb.add_option("--merge", options->merge,
                  "Do nothing anew: one report on the results in these folders and files")
      ->excludes(shard);
  verb.callback([options] { reproduce(*options); });
}

}  // namespace harco::cli
