#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "tileflight/capture/recording/planned_flight.h"
#include "tileflight/capture/render/render_flight.h"

namespace tileflight::recording {

/// Formats frame indices as "3-7,12,20-21" for a file, and parses such a text. Parsing ignores malformed parts.
std::string format_frame_ranges(const std::vector<std::size_t>& frames);
std::vector<std::size_t> parse_frame_ranges(const std::string& runs);

/// Finds the faults `camera_inside_actor` and `path_through_actor` of one camera's frames of a flight with actors.
std::vector<render::FlightFault> find_actor_faults(const PlannedFlight& mission, std::size_t camera = 0);

/// Makes the entries of dataset.yaml for a rendered flight's faults: `warnings.KEY: "3-7,12"` for each fault, with its
/// frames. There are no entries without faults.
std::map<std::string, std::string> faults_to_metadata(const std::vector<render::FlightFault>& faults);

/// Parses the faults from a dataset's metadata (dataset.h), with the readable text of each key; entries not written by
/// `render` are ignored.
std::vector<render::FlightFault> faults_from_metadata(const std::map<std::string, std::string>& about);

}  // namespace tileflight::recording
