#include <CLI/CLI.hpp>

#include "verbs.hpp"

namespace harco::cli {

void add_generate(CLI::App& app) { app.add_subcommand("generate"); }

}  // namespace harco::cli
