#pragma once

#include <memory>

#include "tileflight/localization/ground_image.h"
#include "tileflight/scene/scene.h"

namespace tileflight::sensors {
class Appearance;
}

namespace tileflight::localization {

struct OrthophotoOptions {
  double pixel_m = 0.05;      ///< side of a pixel; larger where the textures hold no more or the box is too large
  double most_pixels = 25e6;  ///< of the whole picture
};

/// A textured place from straight above, over a box: what a ray from the box's top meets first within it (canopies and
/// roofs hide what is under them). The pixel grows to what the textures resolve (median over the surface's area) and to
/// what `most_pixels` allows. Same bytes for any number of threads.
GroundImage orthophoto(const scene::Scene& scene, std::shared_ptr<const sensors::Appearance> appearance,
                       const geometry::Box3& box, const OrthophotoOptions& options = {});

/// Side of a texel on the surface, metres: the median over the area of the textured triangles in the box; nullopt where
/// there is none.
std::optional<double> texel_size_m(const scene::Scene& scene, const geometry::Box3& box);

}  // namespace tileflight::localization
