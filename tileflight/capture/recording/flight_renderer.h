#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "tileflight/capture/events/event_camera.h"
#include "tileflight/capture/recording/flight_tiles.h"
#include "tileflight/capture/recording/frame_store.h"
#include "tileflight/capture/recording/part_loader.h"
#include "tileflight/capture/recording/planned_flight.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::recording {

/// Result of rendering a flight, all its parts together.
struct RenderSummary {
  double seconds = 0.0;         ///< rendering time
  tileset::LoadedTiles tiles;   ///< without their content; triangles: the largest number in a scene
  std::int64_t parts = 0;       ///< scenes that were built
  std::int64_t tiles_read = 0;  ///< repeated readings included
  std::uint64_t events = 0;     ///< number of events of all event cameras; known once they are finished
  bool lacks_textures = false;  ///< FlightTiles::lacks_textures()
};

/// Consumes a finished frame of one of the flight's cameras; as render::FrameSink.
using CameraFrameSink = std::function<void(std::size_t camera, const render::FlightFrame& frame)>;

/// Renders a flight's images from scenes that follow each other, each with the tiles of as many images as fit into
/// memory; the cameras of a rig share a scene. Mission, settings, assignment and progress must outlive it.
class FlightRenderer {
 public:
  /// Selects the tiles, and with them the frames of `share` that remain to be rendered. Throws InputError.
  FlightRenderer(const PlannedFlight& mission, const RenderSettings& settings, FrameAssignment& share,
                 const Progress& progress);

  /// Renders the assigned images and passes them to `sink`, which must have written a frame's files when it returns.
  /// `folder`: the dataset's, for the data of other sensors. Throws MemoryLimitExceeded, before any image is rendered
  /// where possible, if the tiles of one image do not fit into memory.
  RenderSummary run(const std::filesystem::path& folder, const CameraFrameSink& sink);

  /// Records event cameras from the flight's first frame to its last; `recorders`: by camera, null where none is
  /// recorded. Called after run(), whose tiles it uses as far as they are in memory.
  void record_events(const std::vector<std::unique_ptr<events::EventRecorder>>& recorders);

  /// Completes the summary by what this process and earlier ones read. Throws InputError if no tile has a surface.
  void complete(RenderSummary& summary);

 private:
  /// The scene of consecutive images.
  struct Part {
    scene::Scene scene;
    std::shared_ptr<const render::Appearance> appearance;  ///< shared by the cameras of a rig; null for a single one
    std::size_t begin = 0, end = 0;                        ///< numbers of the images, end not included
  };

  enum class Purpose { kMetering, kImages };
  template <class Work>
  void for_each_part(std::vector<std::size_t> images, Purpose purpose, const Work& work);
  Part make_part(FlightPart tiles, Purpose purpose) const;
  std::vector<std::size_t> images_to_load() const;
  bool has_auto_exposure() const;
  void meter();
  void add_light(const Part& part, std::vector<std::vector<double>>& light) const;
  const ImageOrder& images() const { return tiles_.images(); }
  render::FlightRenderOptions options_for(const Part& part, std::size_t camera) const;
  void render_part(const Part& part, const CameraFrameSink& sink, RenderSummary& summary);
  Progress progress_of(const Part& part, std::size_t camera) const;
  void record_sensors(const Part& part, const std::filesystem::path& folder) const;
  void record_camera_events(const Part& part, std::size_t camera, events::EventRecorder& recorder) const;
  void keep_records();

  const PlannedFlight& mission_;
  const RenderSettings& settings_;
  FrameAssignment& share_;
  const Progress& progress_;
  std::uintmax_t max_memory_bytes_;
  FlightTiles tiles_;
  std::optional<PartLoader> loader_;
  /// State of each camera's automatic exposure after the last part.
  std::vector<std::optional<render::AutoExposureState>> exposure_after_;
  /// Gains of the automatic exposure by camera, for its frames up to this process's last; empty: not metered ahead.
  std::vector<std::vector<double>> gains_;
};

}  // namespace tileflight::recording
