#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::alignment {

struct GlobalOptions {
  /// Scales that come into question (target units for each source unit). Both zero: from a tenth to one and a half of
  /// the ratio of the clouds' sizes, since a flight sees a part of a place. Equal: the scale is known.
  double least_scale = 0.0;
  double most_scale = 0.0;
  /// Against gravity, where it is known; the two clouds then only turn about it, but for the tolerance.
  std::optional<geometry::Vec3> source_up = {};
  std::optional<geometry::Vec3> target_up = {};
  double up_tolerance_rad = 0.17;
  std::size_t keypoints = 3000;  ///< about so many of the target are described
  std::size_t candidates = 6;    ///< places that are looked at closely
  std::uint64_t seed = 1;
};

/// One place where the source may belong.
struct GlobalCandidate {
  geometry::Sim3 T_target_source;
  double share = 0.0;     ///< of the source's points that come to lie on the target, each counted by how closely: the
                          ///< tolerance is a share of the source's own size there, so that shrinking gains nothing
  std::size_t pairs = 0;  ///< pairs of similar places that agree on it
};

struct GlobalRegistration {
  std::vector<GlobalCandidate> candidates;  ///< best first, at clearly different places; empty: nothing agreed
};

/// Where a cloud belongs on another one, without any start: places that look alike (surface_descriptors()) at every
/// scale of the range are paired; pairs that keep their mutual distances (and, with gravity, heights) form the largest
/// group that is found, as a clique of the graph of consistency (Leordeanu and Hebert, ICCV 2005; Yang, Shi and
/// Carlone, T-RO 37(2), 2021, section on maximal cliques); each group gives a similarity by robust Umeyama.
/// Deterministic. Both clouds should be spread over surfaces; some thousand points serve. Throws InputError for empty
/// or non-finite clouds and ranges that are none.
GlobalRegistration register_globally(const std::vector<geometry::Vec3>& source,
                                     const std::vector<geometry::Vec3>& target, const GlobalOptions& options = {});

}  // namespace tileflight::alignment
