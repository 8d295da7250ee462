#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/geometry/mesh.h"

namespace tileflight::alignment {

/// Regions that an alignment used, and regions held out for scoring; local frame.
struct RegionList {
  std::vector<geometry::Box3> aligned_on;
  std::vector<geometry::Box3> held_out;
  bool found = false;  ///< by find_regions(); else given by the user
};

/// `regions` of transform.json ({found, aligned_on: [{center, size}], held_out: [...]}), and back. Throws InputError
/// (`where`) if the JSON has another form.
nlohmann::json to_json(const RegionList& regions);
RegionList regions_from_json(const nlohmann::json& json, const std::string& where);

}  // namespace tileflight::alignment
