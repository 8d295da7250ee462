#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::scene {

/// The built-in models: x forward, y left, z up, metres. Shapes measure a metre along each axis and have their origin
/// in the middle; the origin of all others is on the ground, in the middle of what stands on it.
enum class Model { kBox, kSphere, kCylinder, kCone, kCar, kVan, kPerson };

/// "box", "sphere", "cylinder", "cone", "car", "van", "person"; nullopt: no model has this name.
std::optional<Model> model_named(const std::string& name);
const std::vector<std::string>& model_names();

/// The model as one mesh: procedural, so that it belongs to nobody else, and the same bytes everywhere. `colour`: of
/// the paint, or of the clothes, sRGB; by default one of several that `number` chooses.
imaging::TexturedMesh make_model(Model model, std::uint64_t number = 0,
                                 const std::optional<imaging::Rgb8>& colour = {});

}  // namespace tileflight::scene
