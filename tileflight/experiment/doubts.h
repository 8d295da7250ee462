#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tileflight/experiment/map_inputs.h"
#include "tileflight/geometry/doubt.h"

namespace tileflight::experiment {

/// Those of a JSON file that has a key `doubts`; none where there is no file or no key. Throws InputError.
Doubts doubts_in(const std::filesystem::path& json_file);

/// Of a map as it came: what its odometry.json says (its own doubts; lost, frames without a pose), and how much there
/// is of a path where an outside program left no word.
Doubts doubts_of_odometry(const MapInputs& map);

/// Of the ground truth: tiles that are missing or coarse (extract.json).
Doubts doubts_of_truth(const nlohmann::json& extract_json);

/// Of the pictures: what `render` or `ingest` warned of (dataset.yaml).
Doubts doubts_of_dataset(const std::filesystem::path& dataset_folder);

/// Adds those that are not there yet (by what and where).
void append(Doubts& doubts, const Doubts& more);

/// The same with each `where` under a flight's name, e.g. "real/odometry".
Doubts of_flight(Doubts doubts, const std::string& flight);

}  // namespace tileflight::experiment
