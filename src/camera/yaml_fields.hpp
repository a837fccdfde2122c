// Fields of the YAML files that describe a camera and its mount, with messages that name them.
#pragma once

#include <stdexcept>
#include <string>

#include <yaml-cpp/yaml.h>

#include "harco/error.hpp"

namespace harco {

/// What is wrong with a description; the file's name is put before it where it is known.
class Wrong : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// "'key'", as messages name a field.
std::string quoted(const std::string& key);

/// These throw Wrong; `what` names the field in its message.
double number(const YAML::Node& node, const std::string& what);
int whole(const YAML::Node& node, const std::string& what);
YAML::Node field(const YAML::Node& map, const std::string& key, const std::string& what);

/// The shortest text that reads back as the same number, whatever the locale.
std::string to_text(double value);

/// Runs `read` on the root of a document and returns what it does. What it throws, Wrong or
/// std::invalid_argument, and wrong YAML become an Error that begins with `name`.
template <typename Read>
auto parse_yaml(const std::string& yaml, const std::string& name, Read read) {
  // OpenCV's first line, %YAML:1.0, is not a directive of YAML's own grammar (that is "%YAML 1.0"):
  // make it a comment, so that line numbers stay as they are.
  std::string text = yaml;
  if (text.rfind("%YAML:", 0) == 0) text[0] = '#';
  try {
    return read(YAML::Load(text));
  } catch (const YAML::Exception& error) {
    const std::string line =
        error.mark.is_null() ? "" : " at line " + std::to_string(error.mark.line + 1);
    throw Error(name + ": not valid YAML" + line + " (" + error.msg + ")");
  } catch (const Wrong& error) {
    throw Error(name + ": " + error.what());
  } catch (const std::invalid_argument& error) {
    throw Error(name + ": " + error.what());
  }
}

}  // namespace harco
