#include "tileflight/capture/recording/frame_groups.h"

#include <array>
#include <cstdint>
#include <map>
#include <numeric>
#include <optional>

#include "tileflight/core/geometry/mesh.h"

namespace tileflight::recording {
namespace {

using geometry::Vec3;

/// Indices of a cube of the local frame's grid.
using Cube = std::array<std::int64_t, 3>;

Cube cube_of(const Vec3& position) {
  const Vec3 index = (position / kGroupEdge_m).array().floor();
  return {static_cast<std::int64_t>(index.x()), static_cast<std::int64_t>(index.y()),
          static_cast<std::int64_t>(index.z())};
}

Vec3 center_of_cube(const Cube& cube) {
  return kGroupEdge_m *
         (Vec3(static_cast<double>(cube[0]), static_cast<double>(cube[1]), static_cast<double>(cube[2])) +
          Vec3::Constant(0.5));
}

bool is_within_margin(const Vec3& position, const Cube& cube) {
  return (position - center_of_cube(cube)).cwiseAbs().maxCoeff() <= kGroupEdge_m / 2 + kGroupMargin_m;
}

}  // namespace

FrameGroups group_frames(const std::vector<Vec3>& positions) {
  geometry::Box3 flown;
  for (const Vec3& position : positions) flown.extend(position);
  if (flown.sizes().maxCoeff() <= kSingleGroupSpan_m) return single_group(positions);
  FrameGroups groups;
  std::map<Cube, std::size_t> group_of_cube;
  std::optional<Cube> cube;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (!cube || !is_within_margin(positions[i], *cube)) cube = cube_of(positions[i]);
    const auto [group, is_new] = group_of_cube.emplace(*cube, groups.count());
    if (is_new) {
      groups.frames.emplace_back();
      groups.anchors.push_back(center_of_cube(*cube));
    }
    groups.group_of_frame.push_back(group->second);
    groups.frames[group->second].push_back(i);
  }
  return groups;
}

FrameGroups single_group(const std::vector<Vec3>& positions) {
  FrameGroups groups{std::vector<std::size_t>(positions.size(), 0),
                     {std::vector<std::size_t>(positions.size())},
                     {positions[positions.size() / 2]}};
  std::iota(groups.frames[0].begin(), groups.frames[0].end(), std::size_t{0});
  return groups;
}

}  // namespace tileflight::recording
