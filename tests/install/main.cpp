// Reads a marker description and says what it holds.
#include <iostream>

#include <harco/harco.hpp>

int main() {
  const auto markers = harco::parse_markers(R"({"format": "harco-markers", "version": 1,
    "cells": 3, "line": {"inside": 0, "outside": 0.0714},
    "parents": [{"id": 4, "side_m": 0.5, "code": "110100000", "children": []}]})");
  for (const harco::PlacedMarker& marker : harco::place(markers))
    std::cout << "marker " << marker.id << ", side " << marker.side_m << " m\n";
  return markers.parents.size() == 1 ? 0 : 1;
}
