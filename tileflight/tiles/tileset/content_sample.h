#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::tileset {

/// Sizes of a decoded content, or a mean of several.
struct ContentMeasures {
  double file_bytes = 0.0;
  double triangles = 0.0;
  double vertices = 0.0;
  double points = 0.0;
  double texels = 0.0;           ///< an image shared by meshes counts once
  double attribute_bytes = 0.0;  ///< texture coordinates, colours, feature numbers
  double area_m2 = 0.0;          ///< area of the surface
};

ContentMeasures operator+(const ContentMeasures& a, const ContentMeasures& b);
ContentMeasures operator*(double factor, const ContentMeasures& a);

/// Measures a content. With `within`, only triangles whose centroid lies in that box (in the frame of the meshes) count
/// for its area, triangles and vertices.
ContentMeasures measure_content(const std::vector<imaging::TexturedMesh>& meshes,
                                const std::vector<geometry::PointCloud>& clouds,
                                const std::optional<geometry::Box3>& within = {});

/// Returns distinct indices of at most `wanted` of `count` things. They are evenly spread, and so is every prefix:
/// multiples of the golden ratio modulo one (Weyl's sequence), which keep step with no period that the things may have.
std::vector<std::size_t> spread_sample(std::size_t count, std::size_t wanted);

/// Mean of a sample of a population, and its uncertainty.
struct SampleMean {
  double mean = 0.0;
  double standard_error = 0.0;  ///< without replacement: 0 if all were sampled; infinite for one of several
};
/// Returns the mean of values sampled from `population` things.
SampleMean sample_mean(const std::vector<double>& values, double population);

}  // namespace tileflight::tileset
