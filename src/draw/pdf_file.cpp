#include "draw/pdf_file.hpp"

#include <utility>

#include "draw/text.hpp"

namespace harco {
namespace {

std::string padded(std::size_t offset) {
  const std::string digits = std::to_string(offset);
  return std::string(10 - digits.size(), '0') + digits;
}

}  // namespace

int PdfFile::reserve() {
  bodies_.emplace_back();
  return static_cast<int>(bodies_.size());
}

void PdfFile::set(int object, std::string body) {
  bodies_[static_cast<std::size_t>(object - 1)] = std::move(body);
}

int PdfFile::add(std::string body) {
  const int object = reserve();
  set(object, std::move(body));
  return object;
}

int PdfFile::add_stream(const std::string& content, const std::string& entries) {
  return add("<< /Length " + std::to_string(content.size()) + entries + " >>\nstream\n" + content +
             "\nendstream");
}

std::string PdfFile::finish(int root, int info) const {
  // Four bytes above 127 tell file transfers that this is no text.
  std::string out = "%PDF-1.4\n%\xE2\xE3\xCF\xD3\n";
  std::string table = "0000000000 65535 f \n";
  int object = 0;
  for (const std::string& body : bodies_) {
    table += padded(out.size()) + " 00000 n \n";
    out += std::to_string(++object) + " 0 obj\n" + body + "\nendobj\n";
  }
  const std::size_t table_at = out.size();
  const std::string size = std::to_string(bodies_.size() + 1);
  out += "xref\n0 " + size + "\n" + table;
  out += "trailer\n<< /Size " + size + " /Root " + reference(root) + " /Info " + reference(info) +
         " >>\nstartxref\n" + std::to_string(table_at) + "\n%%EOF\n";
  return out;
}

std::string reference(int object) { return std::to_string(object) + " 0 R"; }

std::string pdf_string(const std::string& utf8) {
  std::string out = "(";
  for (const char c : to_windows_1252(utf8)) {
    if (c == '(' || c == ')' || c == '\\') out += '\\';
    out += c;
  }
  return out + ")";
}

}  // namespace harco
