#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::alignment {

struct GlobalRegistrationOptions {
  /// Range of the scale (target units per source unit). Both zero: from 0.1 to 1.5 times the ratio of the clouds'
  /// sizes, since a flight sees part of a place. Equal: the scale is known.
  double min_scale = 0.0;
  double max_scale = 0.0;
  /// Unit direction against gravity, if known; the relative rotation is then limited to the vertical axis, within the
  /// tolerance.
  std::optional<geometry::Vec3> source_up = {};
  std::optional<geometry::Vec3> target_up = {};
  double up_tolerance_rad = 0.17;
  std::size_t keypoints = 3000;    ///< approximate number of target points described
  std::size_t max_candidates = 6;  ///< candidates that are refined
  std::uint64_t seed = 1;
};

/// One candidate placement of the source.
struct GlobalCandidate {
  geometry::Sim3 T_target_source;
  double overlap = 0.0;   ///< mean over the source's points of a weight by distance to the target (1: on it); the
                          ///< tolerance is a share of the transformed source's size, so shrinking is not rewarded
  std::size_t pairs = 0;  ///< pairs consistent with it
};

struct GlobalRegistration {
  std::vector<GlobalCandidate> candidates;  ///< best first, at clearly different places; empty: none found
};

/// Registers a cloud to another one without a start. Points with similar descriptors (compute_surface_descriptors()) at
/// every scale of the range are paired; groups of pairs that preserve mutual distances (and, with gravity, heights) are
/// found as cliques of the consistency graph (Leordeanu and Hebert, ICCV 2005; Yang, Shi and Carlone, T-RO 37(2), 2021,
/// section on maximal cliques); each group gives a similarity by robust Umeyama. Deterministic. Both clouds should be
/// spread evenly over surfaces; a few thousand points are enough. Throws InputError for empty or non-finite clouds and
/// for invalid scale ranges.
GlobalRegistration register_globally(const std::vector<geometry::Vec3>& source,
                                     const std::vector<geometry::Vec3>& target,
                                     const GlobalRegistrationOptions& options = {});

}  // namespace tileflight::alignment
