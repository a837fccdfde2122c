#include "machine.hpp"

#include <sys/utsname.h>

#include <fstream>
#include <thread>

#include <fmt/format.h>

namespace harco::cli {
namespace {

/// What follows the separator in the first line that begins with `key`.
std::string value_of(const char* file, const std::string& key, char separator) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (line.rfind(key, 0) != 0) continue;
    const std::string value = line.substr(line.find(separator) + 1);
    const std::size_t first = value.find_first_not_of(" \"");
    const std::size_t last = value.find_last_not_of(" \"");
    if (first != std::string::npos) return value.substr(first, last - first + 1);
  }
  return "unknown";
}

}  // namespace

std::string describe_machine() {
  utsname system{};
  uname(&system);
  return fmt::format("{}, {} threads, {}, {}", value_of("/proc/cpuinfo", "model name", ':'),
                     std::thread::hardware_concurrency(),
                     value_of("/etc/os-release", "PRETTY_NAME", '='), system.machine);
}

}  // namespace harco::cli
