#include "code_search.hpp"

#include <fmt/format.h>

#include "interrupt.hpp"
#include "progress.hpp"

namespace harco::cli {
namespace {

/// Calls `search` with a callback that draws a bar and hears Ctrl-C.
template <typename Search>
auto with_progress(const Search& search) {
  const InterruptGuard guard;
  ProgressBar progress("codes");
  return search([&](const DictionaryProgress& now) {
    progress.show(now.share, fmt::format("tau: parents {}, children {}", now.parent_distance,
                                         now.child_distance));
    return !guard.interrupted();
  });
}

}  // namespace

Dictionary search_codes(const DictionaryOptions& options) {
  return with_progress(
      [&](const DictionaryCallback& callback) { return generate_dictionary(options, callback); });
}

CodedMarkers search_codes(const MarkerSet& without_codes, const CodeSearch& search) {
  return with_progress([&](const DictionaryCallback& callback) {
    return generate_codes(without_codes, search, callback);
  });
}

}  // namespace harco::cli
