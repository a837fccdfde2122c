// Scenes and flights described in a file, for `harco simulate`: docs/simulation.md has the format.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "harco/marker.hpp"
#include "lab/camera_simulator.hpp"
#include "lab/flight/flight.hpp"

namespace harco::lab {

/// A landing, from the hover to the deck.
struct SceneFlight {
  FlightSetup setup;
  std::optional<Surface> deck_surface;
  bool planned = false;      ///< by TouchdownPlanner; else linearly
  double speed_mps = 0.4;    ///< of the linear descent
  double hover_s = 2.0;      ///< before it
  double give_up_s = 120.0;  ///< of the planned one
};

/// What a file describes.
struct SceneDescription {
  MarkerSet markers;
  Camera camera;
  CameraEffects effects;
  Stage stage;            ///< its sheets are the set's parents, in their order
  Motion world_T_camera;  ///< of a scene; a flight has its own
  double start_s = 0.0;   ///< of the first frame
  double frame_rate = 30.0;
  int frames = 1;  ///< of a scene; a flight takes as many as it lasts
  std::uint64_t seed = 1;
  std::optional<SceneFlight> flight;
};

/// Reads a picture in grey; throws Error.
using PictureLoader = std::function<Image(const std::filesystem::path&)>;

/// Reads a description (YAML or JSON); files in it are relative to it. Throws Error, naming the
/// file and the field.
SceneDescription load_scene(const std::filesystem::path& file, const PictureLoader& load_picture);

/// One picture and what it shows.
struct SimulatedFrame {
  int number = 0;
  double time_s = 0.0;  ///< the middle of the exposure of the middle row
  const Image& image;
  const std::vector<Eigen::Isometry3d>& camera_T_marker;  ///< of the set's parents, in their order
};

/// Takes frames as they come; false ends the simulation.
using FrameSink = std::function<bool(const SimulatedFrame&)>;

void simulate(const SceneDescription& scene, const FrameSink& sink);

}  // namespace harco::lab
