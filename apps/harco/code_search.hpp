// The search for codes as someone at a terminal sees it.
#pragma once

#include "harco/dictionary.hpp"

namespace harco::cli {

/// generate_dictionary with a progress bar. Ctrl-C ends it with the best codes so far.
Dictionary search_codes(const DictionaryOptions& options);
CodedMarkers search_codes(const MarkerSet& without_codes, const CodeSearch& search);

}  // namespace harco::cli
