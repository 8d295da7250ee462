#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/geometry/mesh.h"

namespace tileflight::alignment {

/// Which parts of a place an alignment took, and which it left for scoring; local frame.
struct RegionList {
  std::vector<geometry::Box3> aligned_on;
  std::vector<geometry::Box3> held_out;
  bool found = false;  ///< by find_regions(); else named by hand
};

/// `regions` of transform.json ({found, aligned_on: [{center, size}], held_out: [...]}), and back. Throws InputError
/// (`where`) for what is not such a list.
nlohmann::json to_json(const RegionList& regions);
RegionList regions_from_json(const nlohmann::json& json, const std::string& where);

}  // namespace tileflight::alignment
