#pragma once

#include <cstdint>

#include "tileflight/capture/render/block_tracer.h"
#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/ray_table.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::render {

/// Outputs of the rays through the pixels' centres besides the view's statistics. Null: not wanted.
struct CentralRays {
  imaging::FloatImage* depth_m = nullptr;
  const SurfaceVisitor* visitor = nullptr;
  std::uint32_t first_placed_mesh = 0;  ///< of the scene
};

/// Writes the wanted outputs of a beam of central rays, and adds its hits to the statistics. `table`: the table from
/// which the beam was cast.
void note_central(const TracedBeam& beam, const RayTable& table, const CentralRays& wanted, ViewStatistics& view);

}  // namespace tileflight::render
