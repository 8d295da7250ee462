#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "tileflight/experiment/fly.h"
#include "tileflight/experiment/frame_share.h"
#include "tileflight/experiment/mission.h"
#include "tileflight/sensors/fly.h"
#include "tileflight/tiles/load.h"

namespace tileflight::experiment {

/// What came of a flight, all its parts together.
struct Filmed {
  double seconds = 0.0;  ///< of rendering
  std::optional<sensors::ExposureState> exposure_after;
  tiles::LoadedTiles tiles;  ///< without what was in them; triangles: the most that were there at once
  std::int64_t parts = 0;
};

/// A flight's dataset in the making: frames by this process and others, then the whole. With a video rate, the pictures
/// go through a video file and back, as in a camera that records: those of the dataset are the decoded ones.
class DatasetFilm {
 public:
  /// Settings, share and progress must outlive it. Throws InputError.
  DatasetFilm(const Mission& mission, const RenderSettings& settings, const std::filesystem::path& out, bool replace,
              FrameShare& share, const Progress& progress);
  ~DatasetFilm();

  /// Loads tiles and renders this process's frames. Throws InputError.
  void shoot();
  /// The whole, put in its place, once every process has shot its frames; by the first one. What was noted of each
  /// frame. Throws InputError.
  std::vector<KeptFrame> finish();
  /// After shoot().
  const Filmed& filmed() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::experiment
