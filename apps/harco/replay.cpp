// harco replay: what a record's measurements become, once more.
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "output_stream.hpp"
#include "record.hpp"
#include "verbs.hpp"

namespace harco::cli {
namespace {

struct ReplayOptions {
  std::string record;
  std::string output = "-";
};

void run(const ReplayOptions& options) {
  OutputStream output(options.output);
  replay(options.record, [&](const std::string& line) { output.write(line); });
  output.commit();
}

constexpr const char* kExamples = R"(Examples:
  harco detect --markers deck/markers.json --camera camera.yaml --track --record flight.jsonl
               --output seen.jsonl rtp://0.0.0.0:5600
  harco replay flight.jsonl | cmp - seen.jsonl

The measured poses of the record go through tracking again, with the options recorded; the lines
written are those of the recorded command, to the last bit.)";

}  // namespace

void add_replay(CLI::App& app) {
  auto options = std::make_shared<ReplayOptions>();
  CLI::App* verb = app.add_subcommand("replay", "Play a record of detect or land again");
  verb->footer(kExamples);
  verb->add_option("RECORD", options->record, "What --record wrote; - is standard input")
      ->required()
      ->type_name("FILE");
  verb->add_option("--output", options->output, "Where the lines go; - is standard output")
      ->type_name("FILE")
      ->capture_default_str();
  verb->callback([options] { run(*options); });
}

}  // namespace harco::cli
