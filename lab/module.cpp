// What the harco command uses of the lab; part of the module harco_lab.so.
#include "apps/harco/module.hpp"
#include "lab/experiments/experiment.hpp"
#include "lab/report/html.hpp"
#include "lab/scene_file.hpp"

HARCO_MODULE_EXPORT void harco_lab_experiments(std::vector<const harco::lab::Experiment*>& out) {
  out = harco::lab::experiments();
}

HARCO_MODULE_EXPORT void harco_lab_report(const harco::lab::Report& report, std::string& html,
                                          std::string& overview) {
  html = harco::lab::format_html(report);
  overview = harco::lab::format_overview(report);
}

HARCO_MODULE_EXPORT void harco_lab_load_scene(const std::filesystem::path& file,
                                              const harco::lab::PictureLoader& load_picture,
                                              harco::lab::SceneDescription& scene) {
  scene = harco::lab::load_scene(file, load_picture);
}

HARCO_MODULE_EXPORT void harco_lab_simulate(const harco::lab::SceneDescription& scene,
                                            const harco::lab::FrameSink& sink) {
  harco::lab::simulate(scene, sink);
}
