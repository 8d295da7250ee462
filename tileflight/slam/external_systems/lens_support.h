#pragma once

#include <string>
#include <vector>

#include "tileflight/core/imaging/camera.h"

namespace tileflight::external_systems {

/// Returns the words for lens models: "pinhole", "pinhole-radtan", "pinhole-rational", "pinhole-equi", "fov",
/// "double-sphere", "omni", "eucm", "equirectangular".
const std::vector<std::string>& lens_names();

/// Returns the word of a camera's lens model; "pinhole" if all distortion is zero.
std::string lens_name(const imaging::Camera& camera);

/// Returns the pinhole with the image size of `camera` and the same magnification at the optical axis: rectified images
/// keep all detail in the centre and lose what lies outside the pinhole's narrower view. Throws InputError if the lens
/// does not see its optical axis.
imaging::Camera rectified_pinhole(const imaging::Camera& camera);

/// Returns the share of the native image's pixels that the rectified view holds, 0 to 1.
double visible_share(const imaging::Camera& camera, const imaging::Camera& pinhole);

}  // namespace tileflight::external_systems
