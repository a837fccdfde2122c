// The objects of a PDF file and the table that finds them.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace harco {

class PdfFile {
 public:
  /// A number for an object that others refer to before it is known.
  int reserve();
  void set(int object, std::string body);

  /// Adds an object; returns its number.
  int add(std::string body);
  /// The same for a stream; `entries` are further entries of its dictionary.
  int add_stream(const std::string& content, const std::string& entries = "");

  /// The whole file. `root` is the catalog, `info` the information dictionary.
  std::string finish(int root, int info) const;

 private:
  std::vector<std::string> bodies_;
};

/// "7 0 R": how objects refer to one another.
std::string reference(int object);

/// A text as a PDF string in Windows-1252.
std::string pdf_string(const std::string& utf8);

}  // namespace harco
