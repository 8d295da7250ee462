#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "tileflight/capture/recording/flight_renderer.h"
#include "tileflight/capture/recording/frame_store.h"
#include "tileflight/capture/recording/planned_flight.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/data/dataset/dataset.h"

namespace tileflight::recording {

/// Where a camera's files are in its flight's dataset; the first camera's are where a single one's are.
std::filesystem::path camera_folder(const PlannedFlight& mission, std::size_t camera);

/// Writes what is known of one camera's images.
void write_camera_metadata(dataset::DatasetWriter& writer, const PlannedFlight& mission, std::size_t number,
                           const RenderSettings& settings, const RenderSummary& summary,
                           const std::vector<FrameRecord>& frames);

/// Writes what is known of the flight besides its images.
void write_flight_metadata(dataset::DatasetWriter& writer, const PlannedFlight& mission, const RenderSettings& settings,
                           const RenderSummary& summary);

}  // namespace tileflight::recording
