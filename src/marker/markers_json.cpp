// markers.json: the one description that generator, printer, detector and simulator share.
#include <cmath>
#include <fstream>
#include <functional>
#include <sstream>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "harco/error.hpp"
#include "harco/marker.hpp"
#include "marker/file.hpp"

namespace harco {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "harco-markers";
constexpr int kVersion = 1;
constexpr int kMaxDepth = 8;

/// What is wrong with a description; the file's name is put before it where it is known.
class Wrong : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

const Json& field(const Json& object, const char* key, const std::string& where) {
  if (!object.is_object()) throw Wrong(where + " is not an object");
  const auto found = object.find(key);
  if (found == object.end()) throw Wrong(where + ": '" + key + "' is missing");
  return *found;
}

double number(const Json& value, const std::string& what) {
  if (!value.is_number()) throw Wrong(what + " is not a number");
  return value.get<double>();
}

int whole(const Json& value, const std::string& what) {
  const double v = number(value, what);
  if (v != std::floor(v) || std::abs(v) > 1e9) throw Wrong(what + " is not a whole number");
  return static_cast<int>(v);
}

Marker read_marker(const Json& json, int set_cells, int layer) {
  if (layer > kMaxDepth) throw Wrong("more than " + std::to_string(kMaxDepth) + " layers");
  const char* kind = layer == 1 ? "a parent" : "a child";
  Marker marker;
  marker.id = whole(field(json, "id", kind), "'id'");
  const std::string who = (layer == 1 ? "parent " : "child ") + std::to_string(marker.id);
  if (layer > 1) marker.cell = whole(field(json, "cell", who), who + ": 'cell'");
  if (json.contains("parts")) {
    marker.parts = whole(json["parts"], who + ": 'parts'");
    marker.part = whole(field(json, "part", who), who + ": 'part'");
  }
  const int cells = json.contains("cells") ? whole(json["cells"], who + ": 'cells'") : set_cells;
  const Json& code = field(json, "code", who);
  if (!code.is_string()) throw Wrong(who + ": 'code' is not a string");
  try {
    marker.code = parse_code(code.get<std::string>());
  } catch (const std::invalid_argument& error) {
    throw Wrong(who + ": " + error.what());
  }
  if (marker.code.cells != cells)
    throw Wrong(who + ": its code has " + std::to_string(marker.code.size()) + " bits, not " +
                std::to_string(cells) + " x " + std::to_string(cells));
  if (json.contains("children")) {
    if (!json["children"].is_array()) throw Wrong(who + ": 'children' is not a list");
    for (const Json& child : json["children"])
      marker.children.push_back(read_marker(child, set_cells, layer + 1));
  }
  return marker;
}

MarkerSet read_set(const Json& json) {
  const Json& format = field(json, "format", "the file");
  if (format != kFormat) throw Wrong("'format' is not \"" + std::string(kFormat) + "\"");
  const Json& version = field(json, "version", "the file");
  if (version != kVersion)
    throw Wrong("version " + version.dump() + " is not supported (this program reads version " +
                std::to_string(kVersion) + ")");
  MarkerSet set;
  set.cells = whole(field(json, "cells", "the file"), "'cells'");
  const Json& line = field(json, "line", "the file");
  set.line.inside = number(field(line, "inside", "'line'"), "'line': 'inside'");
  set.line.outside = number(field(line, "outside", "'line'"), "'line': 'outside'");
  const Json& parents = field(json, "parents", "the file");
  if (!parents.is_array()) throw Wrong("'parents' is not a list");
  for (const Json& parent : parents) {
    Parent read;
    read.marker = read_marker(parent, set.cells, 1);
    const std::string who = "parent " + std::to_string(read.marker.id);
    read.side_m = number(field(parent, "side_m", who), who + ": 'side_m'");
    set.parents.push_back(std::move(read));
  }
  return set;
}

Json coordinate(double value) {
  if (value == std::floor(value) && std::abs(value) < 1e15) return static_cast<long long>(value);
  return value;
}

}  // namespace

MarkerSet parse_markers(const std::string& json, const std::string& name) {
  try {
    MarkerSet set = read_set(Json::parse(json));
    validate(set);
    return set;
  } catch (const Json::parse_error& error) {
    throw Error(name + ": not valid JSON (at byte " + std::to_string(error.byte) + ")");
  } catch (const Json::exception&) {
    throw Error(name + ": not a marker description");
  } catch (const Wrong& error) {
    throw Error(name + ": " + error.what());
  } catch (const std::invalid_argument& error) {
    throw Error(name + ": " + error.what());
  }
}

MarkerSet load_markers(const std::filesystem::path& file) {
  return parse_markers(read_text_file(file), file.string());
}

std::string format_markers(const MarkerSet& markers) {
  validate(markers);
  Json json;
  json["format"] = kFormat;
  json["version"] = kVersion;
  json["cells"] = markers.cells;
  json["line"]["inside"] = markers.line.inside;
  json["line"]["outside"] = markers.line.outside;
  json["layers"] = markers.layers();

  // place() lists each parent's tree breadth first; `next` walks along it.
  const std::vector<PlacedMarker> placed = place(markers);
  std::size_t first = 0;
  const auto write = [&](const Marker& marker, std::size_t index, const auto& self) -> Json {
    const PlacedMarker& at = placed[index];
    Json out;
    if (at.layer > 1) out["cell"] = marker.cell;
    if (marker.parts > 1) {
      out["parts"] = marker.parts;
      out["part"] = marker.part;
    }
    out["id"] = marker.id;
    if (marker.code.cells != markers.cells) out["cells"] = marker.code.cells;
    out["code"] = to_string(marker.code);
    out["position"] = {coordinate(at.grid_position.x()), coordinate(at.grid_position.y())};
    out["children"] = Json::array();
    std::size_t child_index = index;
    for (const Marker& child : marker.children) {
      do ++child_index;
      while (placed[child_index].container != static_cast<int>(index));
      out["children"].push_back(self(child, child_index, self));
    }
    return out;
  };
  json["parents"] = Json::array();
  for (const Parent& parent : markers.parents) {
    while (placed[first].layer != 1) ++first;
    Json out = write(parent.marker, first, write);
    out["side_m"] = parent.side_m;
    json["parents"].push_back(std::move(out));
    ++first;
  }
  return json.dump(1) + "\n";
}

void save_markers(const MarkerSet& markers, const std::filesystem::path& file) {
  write_text_file(file, format_markers(markers));
}

}  // namespace harco
