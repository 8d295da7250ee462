#include "tileflight/tiles/tileset/content_sample.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

namespace tileflight::tileset {

using geometry::Vec3;

ContentMeasures operator+(const ContentMeasures& a, const ContentMeasures& b) {
  return {a.file_bytes + b.file_bytes, a.triangles + b.triangles, a.vertices + b.vertices,
          a.points + b.points,         a.texels + b.texels,       a.attribute_bytes + b.attribute_bytes,
          a.area_m2 + b.area_m2};
}

ContentMeasures operator*(double factor, const ContentMeasures& a) {
  return {factor * a.file_bytes, factor * a.triangles,       factor * a.vertices, factor * a.points,
          factor * a.texels,     factor * a.attribute_bytes, factor * a.area_m2};
}

ContentMeasures measure_content(const std::vector<imaging::TexturedMesh>& meshes,
                                const std::vector<geometry::PointCloud>& clouds,
                                const std::optional<geometry::Box3>& within) {
  ContentMeasures out;
  std::set<const void*> textures;
  for (const imaging::TexturedMesh& mesh : meshes) {
    double inside = 0.0;
    for (const geometry::Triangle& t : mesh.mesh.triangles) {
      const Vec3 &a = mesh.mesh.vertices[t[0]], &b = mesh.mesh.vertices[t[1]], &c = mesh.mesh.vertices[t[2]];
      if (within && !within->contains(Vec3((a + b + c) / 3.0))) continue;
      ++inside;
      out.area_m2 += 0.5 * (b - a).cross(c - a).norm();
    }
    const double share = mesh.mesh.triangles.empty() ? 0.0 : inside / static_cast<double>(mesh.mesh.triangles.size());
    out.triangles += inside;
    out.vertices += share * static_cast<double>(mesh.mesh.vertices.size());
    out.attribute_bytes +=
        share * static_cast<double>(mesh.uv.size() * sizeof(mesh.uv[0]) + mesh.colors.size() * sizeof(mesh.colors[0]) +
                                    mesh.feature_ids.size() * sizeof(mesh.feature_ids[0]));
    if (mesh.texture && textures.insert(mesh.texture.get()).second)
      out.texels += static_cast<double>(mesh.texture->pixels.size());
  }
  for (const geometry::PointCloud& cloud : clouds) out.points += static_cast<double>(cloud.size());
  return out;
}

std::vector<std::size_t> spread_sample(std::size_t count, std::size_t wanted) {
  std::vector<std::size_t> sample;
  if (wanted >= count) {
    sample.resize(count);
    std::iota(sample.begin(), sample.end(), std::size_t{0});
    return sample;
  }
  constexpr double kGoldenRatio = 0.6180339887498949;
  std::set<std::size_t> taken;
  for (std::size_t i = 0; sample.size() < wanted; ++i) {
    const double turns = 0.5 + static_cast<double>(i) * kGoldenRatio;
    const double fraction = turns - std::floor(turns);
    const auto index = std::min(count - 1, static_cast<std::size_t>(fraction * static_cast<double>(count)));
    if (taken.insert(index).second) sample.push_back(index);
  }
  return sample;
}

SampleMean sample_mean(const std::vector<double>& values, double population) {
  SampleMean out;
  const auto count = static_cast<double>(values.size());
  if (values.empty()) return out;
  out.mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
  if (count >= population) return out;
  if (values.size() == 1) {
    out.standard_error = std::numeric_limits<double>::infinity();
    return out;
  }
  double squares = 0.0;
  for (const double value : values) squares += (value - out.mean) * (value - out.mean);
  // Cochran, "Sampling Techniques" (1977), equation 2.20: simple random sampling without replacement.
  out.standard_error = std::sqrt(squares / (count - 1.0) / count * (1.0 - count / population));
  return out;
}

}  // namespace tileflight::tileset
