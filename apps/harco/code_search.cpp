#include "code_search.hpp"

#include <fmt/format.h>

#include "interrupt.hpp"
#include "progress.hpp"

namespace harco::cli {

Dictionary search_codes(const DictionaryOptions& options) {
  const InterruptGuard guard;
  ProgressBar progress("codes");
  return generate_dictionary(options, [&](const DictionaryProgress& now) {
    progress.show(now.share, fmt::format("tau: parents {}, children {}", now.parent_distance,
                                         now.child_distance));
    return !guard.interrupted();
  });
}

}  // namespace harco::cli
