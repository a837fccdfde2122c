// Files of the command, whole or not at all.
#pragma once

#include <filesystem>
#include <string>

namespace harco::cli {

/// Writes beside the file and renames, so that nobody ever sees half of it. Throws Error, naming
/// the file.
void write_file(const std::filesystem::path& file, const std::string& content);

}  // namespace harco::cli
