#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/events/event_recorder.h"
#include "tileflight/capture/render/frame_parts.h"
#include "tileflight/capture/render/frame_renderer.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/world/scene/scene.h"
#include "tileflight/capture/recording/flight_tiles.h"
#include "tileflight/capture/recording/frame_assignment.h"
#include "tileflight/capture/recording/part_loader.h"
#include "tileflight/capture/recording/planned_flight.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/capture/recording/tile_shares.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/core/jobs/ranks.h"

namespace tileflight::recording {

/// Result of rendering a flight, all its parts together.
struct RenderSummary {
  double seconds = 0.0;                                                    ///< rendering time
  std::vector<std::optional<render::AutoExposureState>> exposure_after{};  ///< of each camera
  tileset::LoadedTiles tiles;         ///< without their content; triangles: the largest number in a scene
  std::int64_t parts = 0;           ///< scenes that were built
  std::int64_t frames_divided = 0;  ///< images that were rendered in regions or layers
  bool are_tiles_dealt = false;     ///< several processes shared the tiles, not the frames
  std::int64_t tiles_read = 0;      ///< by all processes together, repeated readings included
  std::uint64_t events = 0;         ///< of all event cameras; known once they are finished
};

/// Consumes a finished frame of one of the flight's cameras; as render::FrameSink.
using CameraFrameSink = std::function<void(std::size_t camera, const render::FlightFrame& frame)>;

/// Loads a flight's tiles and renders its images, in as many parts as the memory limit requires; the cameras of a rig
/// share a part's scene. Where an image's tiles and those around its camera do not fit into memory together, the path
/// is checked apart from the image; an image whose own tiles do not fit is divided. If each of its pixels is of one
/// ray, it is rendered in layers, each with some of its tiles, together with other such images, so that each tile is
/// read once for all of them; else in regions, each with the tiles that it shows. Several processes each render a range
/// of the images (meter(), set_light(), run()), or share the tiles: each traces every image against its part of them,
/// as layers (deal_out_tiles(), run_together()). The steps are called in order. Mission, settings and progress must
/// outlive it.
class PartRenderer {
 public:
  PartRenderer(const PlannedFlight& mission, const RenderSettings& settings, const Progress& progress);

  /// Selects the tiles, and with them the frames that remain.
  void select(FrameAssignment& share);
  /// Decides whether the processes share the tiles rather than the frames, and says so: as the settings want, else by
  /// what would be read. Called by all processes; the same result in each. Throws InputError (CollectiveError) if that
  /// is asked for and cannot be.
  bool deal_out_tiles(jobs::Ranks& ranks, FrameAssignment& share);
  /// Refuses frames of this process that do not fit into memory.
  void require_fit(const FrameAssignment& share);

  /// Light of the frames in this rank's range (of a part: also of all before it, which no other process meters), for
  /// set_light(); empty if the rank needs none of other ranks' frames.
  std::string meter(const FrameAssignment& share);
  /// `parts`: results of meter(), by rank.
  void set_light(const std::vector<std::string>& parts);

  /// Images of `share` are passed to `sink`, which must have written a frame's files when it returns. `folder`: the
  /// dataset's, for the data of other sensors.
  RenderSummary run(const std::filesystem::path& folder, FrameAssignment& share, const CameraFrameSink& sink);

  /// The same of processes that share the tiles. Called by all of them; throws on all if one fails.
  RenderSummary run_together(jobs::Ranks& ranks, FrameAssignment& share, const CameraFrameSink& sink);

  /// How often tiles were read by this process.
  std::int64_t read_count() const { return tiles_->read_count(); }

  /// Records event cameras from the flight's first frame to its last; `recorders`: by camera, null where none is
  /// recorded here. Called after run(), whose tiles it uses as far as they are in memory.
  void record_events(const std::vector<std::unique_ptr<events::EventRecorder>>& recorders,
                     const FrameAssignment& share);

  /// Completes the summary by what all processes read; on the first rank. Throws InputError if no tile has a surface.
  void complete(const FrameAssignment& share, RenderSummary& summary);

 private:
  struct LoadedPart {
    scene::Scene scene;
    std::shared_ptr<const render::Appearance> appearance;  ///< shared by the cameras of a rig; null for a single one
    std::size_t begin = 0, end = 0;                        ///< of the loader's views
    std::vector<std::uint32_t> mesh_ranks;                 ///< FlightPart::places
  };
  using PartWork = std::function<void(const LoadedPart& part)>;
  using LayeredFrames = std::map<std::size_t, render::LayeredFrame>;  ///< by image
  /// Images that processes trace together.
  struct Together {
    jobs::Ranks& ranks;
    FrameAssignment& share;
    std::vector<std::size_t> images;  ///< of one camera

    std::size_t own_rank() const { return static_cast<std::size_t>(ranks.rank()); }
    /// The process that completes an image: they take turns.
    std::size_t rank_of(std::size_t image) const;
  };

  bool has_auto_exposure() const;
  bool is_metered() const;  ///< whether gains of the automatic exposure are still to be found
  const ImageOrder& images() const { return tiles_->images(); }
  const PlannedCamera& camera_of(std::size_t image) const { return mission_.camera(images()[image].camera); }
  const geometry::Vec3& anchor_of(std::size_t image) const;  ///< of all scenes that show the image
  std::vector<FrameView> views_to_load(const FrameAssignment& share) const;
  PartLoader& loader_for(std::vector<FrameView> views);
  std::optional<LoadedPart> load(std::size_t begin, const FrameAssignment& share);
  std::optional<LoadedPart> load_whole(std::size_t begin, const FrameAssignment& share, RenderSummary& summary);
  void check_paths_apart(std::size_t begin, const FrameAssignment& share, RenderSummary& summary);
  std::size_t release(LoadedPart part);
  jobs::IndexRange frames_in(const LoadedPart& part, std::size_t camera) const;
  render::FlightRenderOptions options_of(std::size_t camera) const;
  render::FlightRenderOptions options_for(const LoadedPart& part, std::size_t camera,
                                          const FrameAssignment& share) const;
  /// For these images, in order, of one camera.
  render::FlightRenderOptions options_for(const LoadedPart& part, const std::vector<std::size_t>& of_camera,
                                          const std::vector<double>& exposure_gains,
                                          const FrameAssignment& share) const;
  std::vector<double> meter_part(const LoadedPart& part, const FrameAssignment& share) const;
  Progress progress_of(const LoadedPart& part, std::size_t camera) const;
  void record_sensors(const LoadedPart& part, const std::filesystem::path& folder) const;
  void render_part(const LoadedPart& part, const std::filesystem::path& folder, FrameAssignment& share,
                   const CameraFrameSink& sink, RenderSummary& summary);

  std::vector<std::size_t> too_large_images(std::size_t begin, std::size_t most) const;
  std::vector<std::size_t> frames_to_divide(std::size_t begin) const;
  std::vector<FrameView> divided_views(const std::vector<std::size_t>& frames, double bytes_for_tiles) const;
  std::vector<ContentRange> divide_into_layers(const std::vector<std::size_t>& frames, double bytes_for_tiles) const;
  std::vector<FrameView> layers_of(const std::vector<std::size_t>& frames, double bytes_for_tiles) const;
  std::vector<FrameView> checks_of(const std::vector<std::size_t>& frames, double bytes_for_tiles) const;
  bool is_check(const LoadedPart& part) const { return loader_->views()[part.begin].sight == Sight::kPath; }
  void for_each_check(const LoadedPart& part,
                      const std::function<void(std::size_t image, const render::PathCheck& check)>& take) const;
  void divide_further(std::size_t begin);
  void divide_region(std::size_t begin);
  void divide_layer(std::size_t begin);
  void for_each_view(std::vector<FrameView> views, double bytes_for_tiles, const FrameAssignment& share,
                     const PartWork& work);
  std::vector<std::vector<std::size_t>> by_camera(const std::vector<std::size_t>& images) const;
  std::vector<double> meter_divided(const std::vector<std::size_t>& images, const FrameAssignment& share);
  std::map<std::size_t, double> meter_layers(const std::vector<std::size_t>& images, const FrameAssignment& share);
  void render_divided(const std::vector<std::size_t>& images, FrameAssignment& share, const CameraFrameSink& sink,
                      RenderSummary& summary);
  template <class Frame>
  void compose(const std::vector<std::size_t>& images, std::vector<FrameView> views,
               const std::vector<double>& exposure_gains, FrameAssignment& share, const CameraFrameSink& sink,
               RenderSummary& summary);
  std::string why_tiles_are_not_dealt() const;
  TileUses uses_of(const FrameAssignment& share) const;
  SharingCosts sharing_costs(const std::vector<TileUses>& by_rank) const;
  std::size_t images_together(jobs::Ranks& ranks) const;
  std::vector<FrameView> views_together(const Together& together, double bytes_for_tiles) const;
  LayeredFrames compose_together(const Together& together, bool has_checks,
                                 const std::function<void(const LoadedPart&, LayeredFrames&)>& trace);
  std::map<std::size_t, double> meter_together(const Together& together);
  void render_together(const std::vector<std::size_t>& images, jobs::Ranks& ranks, FrameAssignment& share,
                       const CameraFrameSink& sink, RenderSummary& summary);
  void finish_together(const Together& together, const std::vector<double>& gains, LayeredFrames frames,
                       const CameraFrameSink& sink) const;
  bool has_layers(std::size_t image) const { return render::has_one_ray_per_pixel(camera_of(image).options); }
  /// A layer without what is placed in the images, which is a layer of its own.
  bool is_layer_of_tiles(const LoadedPart& part) const {
    const std::optional<ContentRange>& contents = loader_->views()[part.begin].contents;
    return contents && !contents->empty();
  }
  std::vector<double> gains_of(const std::vector<std::size_t>& images, const std::map<std::size_t, double>& light,
                               RenderSummary& summary) const;
  double bytes_for_tiles(std::size_t frames) const;
  std::uintmax_t bytes_of_traced_frame() const;

  void record_camera_events(const LoadedPart& part, std::size_t camera, const FrameAssignment& share,
                            events::EventRecorder& recorder) const;

  void keep_records(const FrameAssignment& share);

  const PlannedFlight& mission_;
  const RenderSettings& settings_;
  const Progress& progress_;
  std::uintmax_t max_memory_bytes_;
  std::optional<FlightTiles> tiles_;
  std::optional<PartLoader> loader_;
  std::vector<std::size_t> rank_of_content_;  ///< whose part of the tiles it is; empty: tiles are not dealt out
  /// Of the automatic exposure by camera, for all its frames up to this process's last; empty: not known yet, or none.
  std::vector<std::vector<double>> gains_;
  std::map<std::size_t, render::PathCheck> path_checks_;  ///< of images that are loaded apart from them
};

}  // namespace tileflight::recording
