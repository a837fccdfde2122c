// Text files, whole or not at all.
#pragma once

#include <filesystem>
#include <string>

namespace harco {

/// Throws Error, naming the file, if it can't be read.
std::string read_text_file(const std::filesystem::path& file);

/// Writes beside the file and renames, so that nobody ever sees half of it. Throws Error.
void write_text_file(const std::filesystem::path& file, const std::string& text);

}  // namespace harco
