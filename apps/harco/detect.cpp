#include <CLI/CLI.hpp>

#include "verbs.hpp"

namespace harco::cli {

void add_detect(CLI::App& app) { app.add_subcommand("detect"); }

}  // namespace harco::cli
