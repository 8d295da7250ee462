#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "tileflight/capture/recording/flight_renderer.h"
#include "tileflight/capture/recording/frame_store.h"
#include "tileflight/capture/recording/planned_flight.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::recording {

/// Builds a flight's dataset: this process and earlier ones render frames, then the dataset is completed. With a video
/// rate, the images are encoded to a video and decoded again, as in a recording camera: the dataset contains the
/// decoded ones.
class DatasetRenderer {
 public:
  /// Selects the tiles. Settings, frame assignment and progress must outlive it. Throws InputError.
  DatasetRenderer(const PlannedFlight& mission, const RenderSettings& settings, const std::filesystem::path& out,
                  bool replace, FrameAssignment& share, const Progress& progress);
  ~DatasetRenderer();

  /// Loads tiles and renders the frames assigned to this process, in as many parts as memory requires. Throws
  /// InputError.
  void render();
  /// Completes the dataset and moves it to its final name, once all frames are rendered. Returns the record of each
  /// frame. Throws InputError.
  std::vector<FrameRecord> finish();
  /// Valid after render(), complete after finish().
  const RenderSummary& summary() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::recording
