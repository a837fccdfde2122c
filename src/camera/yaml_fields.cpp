#include "yaml_fields.hpp"

#include <array>
#include <charconv>
#include <cmath>

namespace harco {

std::string quoted(const std::string& key) {
  std::string text = "'";
  text += key;
  text += "'";
  return text;
}

double number(const YAML::Node& node, const std::string& what) {
  double value = 0.0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) || !std::isfinite(value))
    throw Wrong(what + " is not a finite number");
  return value;
}

int whole(const YAML::Node& node, const std::string& what) {
  const double value = number(node, what);
  if (value != std::floor(value) || std::abs(value) > 1e9)
    throw Wrong(what + " is not a whole number");
  return static_cast<int>(value);
}

YAML::Node field(const YAML::Node& map, const std::string& key, const std::string& what) {
  const YAML::Node node = map[key];
  if (!node) throw Wrong(what + " is missing");
  return node;
}

std::string to_text(double value) {
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

}  // namespace harco
