#pragma once

#include <memory>

#include "tileflight/evaluation/localization/ground_image.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::render {
class Appearance;
}

namespace tileflight::localization {

struct OrthophotoOptions {
  double pixel_m = 0.05;     ///< side of a pixel; larger if the textures are coarser or the box is too large
  double max_pixels = 25e6;  ///< of the whole image
};

/// Renders an orthographic image of a textured place from above, over a box: the first hit of a vertical ray from the
/// top of the box (canopies and roofs hide what is below). The pixel size is increased to the texture resolution
/// (median over the surface area) and to meet `max_pixels`. Independent of the number of threads.
GroundImage build_orthophoto(const scene::Scene& scene, std::shared_ptr<const render::Appearance> appearance,
                             const geometry::Box3& box, const OrthophotoOptions& options = {});

/// Returns the side of a texel on the surface, metres: median over the area of the textured triangles in the box;
/// nullopt if there are none.
std::optional<double> median_texel_size_m(const scene::Scene& scene, const geometry::Box3& box);

}  // namespace tileflight::localization
