#pragma once

#include <cstdint>

#include "tileflight/core/imaging/image.h"
#include "tileflight/capture/render/block_tracer.h"
#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/ray_table.h"

namespace tileflight::render {

/// What is wanted of the rays through the pixels' centres, besides the view's statistics. Null: not wanted.
struct CentralRays {
  imaging::FloatImage* depth_m = nullptr;
  const SurfaceVisitor* visitor = nullptr;
  std::uint32_t first_placed_mesh = 0;  ///< of the scene
};

/// Hands on what a beam of central rays has hit. `table`: that the beam was cast from.
void note_central(const TracedBeam& beam, const RayTable& table, const CentralRays& wanted, ViewStatistics& view);

}  // namespace tileflight::render
