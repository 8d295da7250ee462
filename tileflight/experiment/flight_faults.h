#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "tileflight/sensors/fly.h"

namespace tileflight::experiment {

/// Frames for a file: "3-7,12,20-21". Reading leaves out what is no such text.
std::string frame_runs(const std::vector<std::size_t>& frames);
std::vector<std::size_t> frames_of_runs(const std::string& runs);

/// What dataset.yaml says of a rendered flight's faults: `warnings.KEY: "3-7,12"` for each of sensors::flight_faults,
/// the frames at which the camera is inside or near a surface, sees none, or its path goes through one. No `warnings`
/// where there is none.
std::map<std::string, std::string> described_faults(const std::vector<sensors::FlightFault>& faults);

/// The same back from a dataset's `about` (dataset.h), with the key's words for people; what `render` did not write is
/// left out.
std::vector<sensors::FlightFault> recorded_faults(const std::map<std::string, std::string>& about);

}  // namespace tileflight::experiment
