#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/tiles/fetch/open_source.h"

namespace tileflight::publishing {

/// A place, simplified so that a viewer can take it in one message: at most about 60 000 triangles and one texture of
/// 2048 pixels, some megabytes.
struct PlaceGlb {
  std::string bytes;  ///< binary glTF, y up
  std::vector<std::string> attribution;
};

/// Simplifies meshes in the local frame; nullopt if there is no triangle.
std::optional<PlaceGlb> make_place_glb(const std::vector<imaging::TexturedMesh>& meshes,
                                       const std::vector<std::string>& attribution);

/// Reads and simplifies the place of a dataset, in the dataset's local frame. `place` is a truth folder written by
/// `extract`, or a SOURCE, of which the surroundings of the true path are read at a detail that suits their extent.
/// Throws InputError.
PlaceGlb read_place_glb(const std::string& place, const fetch::SourceOptions& source, const dataset::Dataset& dataset,
                        const Progress& progress = {});

}  // namespace tileflight::publishing
