// On what the command runs.
#pragma once

#include <string>

namespace harco::cli {

/// Such as "Intel(R) Xeon(R) CPU @ 2.20GHz, 2 threads, Debian GNU/Linux 12 (bookworm), x86_64";
/// nothing that names the machine itself.
std::string describe_machine();

}  // namespace harco::cli
