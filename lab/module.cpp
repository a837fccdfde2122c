// What the harco command uses of the lab; part of the module harco_lab.so.
#include "apps/harco/module.hpp"
#include "lab/experiments/experiment.hpp"
#include "lab/report/html.hpp"

HARCO_MODULE_EXPORT void harco_lab_experiments(std::vector<const harco::lab::Experiment*>& out) {
  out = harco::lab::experiments();
}

HARCO_MODULE_EXPORT void harco_lab_report(const harco::lab::Report& report, std::string& html,
                                          std::string& overview) {
  html = harco::lab::format_html(report);
  overview = harco::lab::format_overview(report);
}
