// The verbs of the command, one file each. A verb adds its options to the command line and sets the
// callback that runs it; main.cpp turns exceptions into messages and exit statuses.
#pragma once

namespace CLI {
class App;
}

namespace harco::cli {

void add_plan(CLI::App& app);
void add_generate(CLI::App& app);
void add_import(CLI::App& app);
void add_detect(CLI::App& app);
void add_calibrate(CLI::App& app);
void add_mount(CLI::App& app);
void add_simulate(CLI::App& app);
void add_land(CLI::App& app);
void add_replay(CLI::App& app);
void add_reproduce(CLI::App& app);

/// Thrown by a verb that did its work but has to report failures that it has already named: the
/// command ends with this status.
struct ExitStatus {
  int status;
};

}  // namespace harco::cli
