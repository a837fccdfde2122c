#include "lab/scene_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>

#include <yaml-cpp/yaml.h>

#include "harco/error.hpp"

namespace harco::lab {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

constexpr double kDegree = 0.017453292519943295;

/// The fields of one mapping. Every field has to be asked for: what is left over is misspelt.
class Fields {
 public:
  Fields(const YAML::Node& node, std::string file, std::string path)
      : node_(node), file_(std::move(file)), path_(std::move(path)) {
    if (!node_.IsMap()) fail(path_.empty() ? "must be a mapping" : path_ + " must be a mapping");
  }

  bool has(const std::string& name) const { return static_cast<bool>(node_[name]); }

  template <typename T>
  void read(const std::string& name, T& value) {
    known_.insert(name);
    if (!has(name)) return;
    try {
      value = node_[name].as<T>();
    } catch (const YAML::Exception&) {
      fail(full(name) + " has a value of the wrong kind");
    }
    if constexpr (std::is_floating_point_v<T>)
      if (!std::isfinite(value)) fail(full(name) + " must be finite");
  }

  template <std::size_t N>
  void read(const std::string& name, std::array<double, N>& values) {
    std::vector<double> list;
    read(name, list);
    if (!has(name)) return;
    if (list.size() != N ||
        !std::all_of(list.begin(), list.end(), [](double v) { return std::isfinite(v); }))
      fail(full(name) + " must be " + std::to_string(N) + " numbers");
    std::copy(list.begin(), list.end(), values.begin());
  }

  void read(const std::string& name, Vector3d& vector) {
    std::array<double, 3> values{vector.x(), vector.y(), vector.z()};
    read(name, values);
    vector = Vector3d(values[0], values[1], values[2]);
  }

  /// A mapping inside this one.
  std::optional<Fields> part(const std::string& name) {
    known_.insert(name);
    if (!has(name)) return std::nullopt;
    return Fields(node_[name], file_, full(name));
  }

  /// A list of mappings.
  std::vector<Fields> parts(const std::string& name) {
    known_.insert(name);
    std::vector<Fields> all;
    if (!has(name)) return all;
    if (!node_[name].IsSequence()) fail(full(name) + " must be a list");
    for (std::size_t i = 0; i < node_[name].size(); ++i)
      all.emplace_back(node_[name][i], file_, full(name) + "[" + std::to_string(i) + "]");
    return all;
  }

  void check_all_known() const {
    for (const auto& field : node_) {
      const auto name = field.first.as<std::string>();
      if (known_.count(name) == 0) fail("unknown field " + full(name));
    }
  }

  [[noreturn]] void fail(const std::string& what) const { throw Error(file_ + ": " + what); }
  std::string full(const std::string& name) const {
    return path_.empty() ? name : path_ + "." + name;
  }

 private:
  YAML::Node node_;
  std::string file_;
  std::string path_;
  std::set<std::string> known_;
};

/// Files in a description are relative to it.
fs::path beside(const fs::path& file, const std::string& name) {
  return fs::path(name).is_absolute() ? fs::path(name) : file.parent_path() / name;
}

Camera read_camera(Fields& root, const fs::path& file) {
  if (root.has("camera_file")) {
    std::string name;
    root.read("camera_file", name);
    return load_camera(beside(file, name));
  }
  std::array<double, 2> size{750.0, 480.0};
  double focal_px = 700.0;
  std::vector<double> distortion;
  if (auto fields = root.part("camera")) {
    fields->read("size", size);
    fields->read("focal_px", focal_px);
    fields->read("distortion", distortion);
    fields->check_all_known();
    if (distortion.size() > 8) fields->fail("camera.distortion has more than 8 numbers");
  }
  Camera camera = Camera::pinhole(static_cast<int>(size[0]), static_cast<int>(size[1]), focal_px);
  std::copy(distortion.begin(), distortion.end(), camera.coefficients.begin());
  return camera;
}

CameraEffects read_effects(Fields& root) {
  CameraEffects effects;
  auto fields = root.part("effects");
  if (!fields) return effects;
  fields->read("psf_sigma_px", effects.psf_sigma_px);
  fields->read("defocus_px", effects.defocus_px);
  fields->read("vignetting", effects.vignetting);
  fields->read("exposure_s", effects.exposure_s);
  fields->read("readout_s", effects.readout_s);
  fields->read("gain", effects.gain);
  fields->read("black_level", effects.black_level);
  fields->read("gamma", effects.gamma);
  fields->read("read_noise", effects.read_noise);
  fields->read("electrons_per_level", effects.electrons_per_level);
  fields->read("bits", effects.bits);
  std::string quality = "moderate";
  fields->read("quality", quality);
  if (quality != "moderate" && quality != "exact")
    fields->fail("effects.quality must be moderate or exact");
  effects.quality = quality == "exact" ? Quality::exact : Quality::moderate;
  fields->check_all_known();
  return effects;
}

std::shared_ptr<const Photo> read_photo(Fields& fields, const fs::path& file,
                                        const PictureLoader& load_picture) {
  std::string name;
  fields.read("photo", name);
  if (name.empty()) return std::make_shared<const Photo>(made_up_ground(512, 110.0, 35.0, 1));
  return std::make_shared<const Photo>(load_picture(beside(file, name)));
}

Surface read_surface(Fields& fields, const fs::path& file, const PictureLoader& load_picture) {
  Surface surface;
  surface.photo = read_photo(fields, file, load_picture);
  fields.read("metres_per_pixel", surface.metres_per_pixel);
  if (!(surface.metres_per_pixel > 0.0)) fields.fail("metres_per_pixel must be positive");
  if (fields.has("size_m")) {
    std::array<double, 2> size{};
    fields.read("size_m", size);
    surface.extent = Rect{-0.5 * size[0], -0.5 * size[1], 0.5 * size[0], 0.5 * size[1]};
  }
  return surface;
}

void read_surroundings(Fields& root, const fs::path& file, const PictureLoader& load_picture,
                       Stage& stage) {
  if (auto far = root.part("far")) {
    stage.far = read_photo(*far, file, load_picture);
    far->read("pixels_per_radian", stage.far_pixels_per_radian);
    far->check_all_known();
  }
  if (auto ground = root.part("ground")) {
    stage.surfaces.push_back(read_surface(*ground, file, load_picture));
    Vector3d offset = Vector3d::Zero();
    ground->read("offset_m", offset);
    ground->check_all_known();
    stage.surfaces.back().world_T_surface = still(Eigen::Isometry3d(Eigen::Translation3d(offset)));
  }
  if (auto light = root.part("light")) {
    light->read("slope_per_m", stage.light_slope_per_m);
    for (Fields& one : light->parts("shadows")) {
      Shadow shadow;
      one.read("towards", shadow.towards);
      if (shadow.towards.norm() < 1e-9) one.fail(one.full("towards") + " has no direction");
      shadow.towards.normalize();
      one.read("offset_m", shadow.offset_m);
      one.read("penumbra_m", shadow.penumbra_m);
      one.read("light", shadow.light);
      one.check_all_known();
      stage.shadows.push_back(shadow);
    }
    light->check_all_known();
  }
  root.read("grey", stage.grey);
}

/// The parents beside one another unless told where.
void read_sheets(Fields& root, const MarkerSet& markers, Stage& stage) {
  double left = 0.0;
  for (std::size_t i = 0; i < markers.parents.size(); ++i) {
    StagedSheet staged;
    staged.sheet = sheet_of(markers, static_cast<int>(i));
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation().x() = left;
    left += 1.5 * markers.parents[i].side_m;
    staged.world_T_marker = still(pose);
    stage.sheets.push_back(std::move(staged));
  }
  for (Fields& one : root.parts("sheets")) {
    int parent = 0;
    one.read("parent", parent);
    const auto at = std::find_if(markers.parents.begin(), markers.parents.end(),
                                 [&](const Parent& p) { return p.marker.id == parent; });
    if (at == markers.parents.end())
      one.fail(one.full("parent") + ": the set has no parent " + std::to_string(parent));
    StagedSheet& staged = stage.sheets[static_cast<std::size_t>(at - markers.parents.begin())];
    Vector3d position = staged.world_T_marker(0.0).translation();
    Vector3d turn = Vector3d::Zero();
    one.read("position_m", position);
    one.read("turn_deg", turn);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = position;
    pose.linear() = (Eigen::AngleAxisd(turn.z() * kDegree, Vector3d::UnitZ()) *
                     Eigen::AngleAxisd(turn.y() * kDegree, Vector3d::UnitY()) *
                     Eigen::AngleAxisd(turn.x() * kDegree, Vector3d::UnitX()))
                        .toRotationMatrix();
    staged.world_T_marker = still(pose);
    one.read("black", staged.black);
    one.read("white", staged.white);
    for (Fields& round : one.parts("blobs")) {
      Blob blob;
      std::array<double, 2> centre{};
      round.read("centre_m", centre);
      blob.centre = {centre[0], centre[1]};
      round.read("radius_m", blob.radius);
      round.read("grey", blob.grey);
      round.check_all_known();
      staged.blobs.push_back(blob);
    }
    one.check_all_known();
  }
}

// --- The camera's path
// -----------------------------------------------------------------------------

/// look_at_marker's numbers at a time: aim x, y, distance, tilt, tilt axis, roll.
struct Key {
  double time_s = 0.0;
  std::array<double, 6> view{};
};

/// Through all keys without corners (cubic Hermite, slopes from the neighbours), at rest outside.
std::array<double, 6> between(const std::vector<Key>& keys, double time_s) {
  if (time_s <= keys.front().time_s || keys.size() == 1) return keys.front().view;
  if (time_s >= keys.back().time_s) return keys.back().view;
  std::size_t i = 0;
  while (keys[i + 1].time_s < time_s) ++i;
  const double span = keys[i + 1].time_s - keys[i].time_s;
  const double t = (time_s - keys[i].time_s) / span;
  const auto slope = [&](std::size_t k, std::size_t n) {
    const std::size_t before = k == 0 ? 0 : k - 1;
    const std::size_t after = std::min(k + 1, keys.size() - 1);
    return (keys[after].view[n] - keys[before].view[n]) /
           (keys[after].time_s - keys[before].time_s);
  };
  std::array<double, 6> view{};
  for (std::size_t n = 0; n < view.size(); ++n) {
    const double rise = keys[i + 1].view[n] - keys[i].view[n];
    const double a = span * slope(i, n), b = span * slope(i + 1, n);
    view[n] = keys[i].view[n] + t * (a + t * (3.0 * rise - 2.0 * a - b + t * (a + b - 2.0 * rise)));
  }
  return view;
}

Motion read_path(Fields& root, const MarkerSet& markers) {
  const double side = markers.parents.front().side_m;
  std::vector<Key> keys;
  for (Fields& one : root.parts("path")) {
    Key key;
    if (!keys.empty()) key = keys.back();
    if (keys.empty()) key.view = {0.5 * side, 0.5 * side, 2.0 * side, 0.0, 0.0, 0.0};
    one.read("time_s", key.time_s);
    if (!keys.empty() && key.time_s <= keys.back().time_s)
      one.fail(one.full("time_s") + " must be after the one before it");
    std::array<double, 2> aim{key.view[0], key.view[1]};
    one.read("aim_m", aim);
    std::array<double, 3> angles{key.view[3] / kDegree, key.view[4] / kDegree,
                                 key.view[5] / kDegree};
    one.read("distance_m", key.view[2]);
    if (!(key.view[2] > 0.0)) one.fail(one.full("distance_m") + " must be positive");
    one.read("tilt_deg", angles[0]);
    one.read("tilt_axis_deg", angles[1]);
    one.read("roll_deg", angles[2]);
    one.check_all_known();
    key.view = {
        aim[0], aim[1], key.view[2], angles[0] * kDegree, angles[1] * kDegree, angles[2] * kDegree};
    keys.push_back(key);
  }
  if (keys.empty()) keys.push_back({0.0, {0.5 * side, 0.5 * side, 2.0 * side, 0.0, 0.0, 0.0}});
  return [keys](double time_s) -> Eigen::Isometry3d {
    const auto v = between(keys, time_s);
    return look_at_marker({v[0], v[1]}, v[2], v[3], v[4], v[5]).inverse();
  };
}

std::optional<SceneFlight> read_flight(Fields& root, SceneDescription& scene, const fs::path& file,
                                       const PictureLoader& load_picture) {
  auto fields = root.part("flight");
  if (!fields) return std::nullopt;
  SceneFlight flight;
  FlightSetup& setup = flight.setup;
  fields->read("start_height_m", setup.start_height_m);
  std::array<double, 2> start{};
  fields->read("start_m", start);
  setup.start_m = {start[0], start[1]};
  fields->read("wind_mps", setup.wind.mean_mps);
  fields->read("gust_mps", setup.wind.gust_mps);
  fields->read("limit_s", setup.limit_s);
  fields->read("latency_s", setup.latency_s);
  fields->read("speed_mps", flight.speed_mps);
  fields->read("hover_s", flight.hover_s);
  fields->read("give_up_s", flight.give_up_s);
  std::string landing = "linear";
  fields->read("landing", landing);
  if (landing != "linear" && landing != "planned")
    fields->fail("flight.landing must be linear or planned");
  flight.planned = landing == "planned";
  if (!(setup.start_height_m > 0.0 && flight.speed_mps > 0.0))
    fields->fail("flight: start_height_m and speed_mps must be positive");
  if (auto deck = fields->part("deck")) {
    std::string motion = "still";
    int state = 3;
    deck->read("motion", motion);
    deck->read("sea_state", state);
    if (motion == "platform")
      setup.deck = platform_motion(scene.seed);
    else if (motion == "ship" && state >= 0 && state <= 6)
      setup.deck = ship_motion(sea_state(state), scene.seed);
    else if (motion != "still")
      deck->fail("flight.deck.motion must be still, platform or ship, its sea_state 0 … 6");
    if (auto surface = deck->part("surface")) {
      flight.deck_surface = read_surface(*surface, file, load_picture);
      surface->check_all_known();
    }
    deck->check_all_known();
  }
  fields->check_all_known();
  setup.frame_rate = scene.frame_rate;
  setup.knows_height = flight.planned;
  if (flight.planned) {
    setup.pilot.height.p = 4.0;
    setup.pilot.height.d = 3.4;
  }
  return flight;
}

}  // namespace

SceneDescription load_scene(const fs::path& file, const PictureLoader& load_picture) {
  YAML::Node node;
  try {
    node = YAML::LoadFile(file.string());
  } catch (const YAML::BadFile&) {
    throw Error(file.string() + ": can't be opened");
  } catch (const YAML::Exception& error) {
    throw Error(file.string() + ": is neither YAML nor JSON (" + error.msg + ")");
  }
  Fields root(node, file.string(), "");
  SceneDescription scene;
  std::string markers;
  root.read("markers", markers);
  if (markers.empty()) root.fail("markers must name a markers.json");
  scene.markers = load_markers(beside(file, markers));
  scene.camera = read_camera(root, file);
  scene.effects = read_effects(root);
  root.read("seed", scene.seed);
  root.read("start_s", scene.start_s);
  root.read("frame_rate", scene.frame_rate);
  root.read("frames", scene.frames);
  if (!(scene.frame_rate > 0.0) || scene.frames < 1)
    root.fail("frames and frame_rate must be positive");
  read_surroundings(root, file, load_picture, scene.stage);
  read_sheets(root, scene.markers, scene.stage);
  scene.world_T_camera = read_path(root, scene.markers);
  scene.flight = read_flight(root, scene, file, load_picture);
  root.check_all_known();
  try {
    harco::validate(scene.camera);
    validate(scene.effects);
  } catch (const std::invalid_argument& error) {
    throw Error(file.string() + ": " + error.what());
  }
  return scene;
}

namespace {

void simulate_flight(const SceneDescription& scene, const FrameSink& sink) {
  const SceneFlight& flight = *scene.flight;
  VisionSetup vision;
  vision.camera = scene.camera;
  vision.effects = scene.effects;
  vision.markers = scene.markers;
  vision.stage = scene.stage;
  vision.stage.sheets.clear();
  vision.deck_surface = flight.deck_surface;
  FlightSetup setup = flight.setup;
  int number = 0;
  setup.on_frame = [&](const Sight& sight, double time_s) {
    const std::vector<Eigen::Isometry3d> truth{sight.truth};
    return sink({number++, time_s, sight.image, truth});
  };
  if (!flight.planned) {
    LinearApproach approach(setup.start_height_m, flight.hover_s, flight.speed_mps);
    fly(setup, vision, nullptr, approach, scene.seed);
    return;
  }
  DeckOptions deck;
  deck.refit_s = 1.0;
  deck.max_samples = 500;
  TouchdownOptions landing;
  landing.max_forecast_age_s = 3.0;
  landing.windows.level.draws = 1000;
  PlannedApproach approach(landing, deck, flight.give_up_s);
  fly(setup, vision, nullptr, approach, scene.seed);
}

}  // namespace

void simulate(const SceneDescription& scene, const FrameSink& sink) {
  if (scene.flight) return simulate_flight(scene, sink);
  const CameraSimulator camera(scene.camera, scene.effects);
  for (int i = 0; i < scene.frames; ++i) {
    const double time_s = scene.start_s + i / scene.frame_rate;
    const Shot shot = camera.shoot(scene.stage, scene.world_T_camera, time_s,
                                   scene.seed * 1000003U + static_cast<std::uint64_t>(i));
    if (!sink({i, time_s, shot.image, shot.camera_T_marker})) return;
  }
}

}  // namespace harco::lab
