#include <array>
#include <cctype>
#include <stdexcept>
#include <string>

#include "harco/draw.hpp"

namespace harco {
namespace {

struct Named {
  const char* name;
  Paper paper;
};

// ISO 216, and the American sizes (multiples of an inch of 25.4 mm).
constexpr std::array<Named, 11> kPapers{{{"fit", {0.0, 0.0}},
                                         {"a0", {841.0, 1189.0}},
                                         {"a1", {594.0, 841.0}},
                                         {"a2", {420.0, 594.0}},
                                         {"a3", {297.0, 420.0}},
                                         {"a4", {210.0, 297.0}},
                                         {"a5", {148.0, 210.0}},
                                         {"a6", {105.0, 148.0}},
                                         {"letter", {215.9, 279.4}},
                                         {"legal", {215.9, 355.6}},
                                         {"tabloid", {279.4, 431.8}}}};

}  // namespace

std::vector<std::string> paper_names() {
  std::vector<std::string> names;
  names.reserve(kPapers.size());
  for (const Named& known : kPapers) names.emplace_back(known.name);
  return names;
}

Paper paper(const std::string& name) {
  std::string lower;
  for (const char c : name) lower += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const Named& known : kPapers)
    if (lower == known.name) return known.paper;
  throw std::invalid_argument("there is no paper '" + name + "'");
}

}  // namespace harco
