#pragma once

// Candidate keyframes for loop detection, by votes of equal parts of their features' descriptors.

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "tileflight/slam/keyframes/features.h"

namespace tileflight::loop_closure {

// Types of another room that appear in this one's interfaces.
using keyframes::Feature;
using keyframes::FeatureMatch;

/// Inverted index from descriptor parts (16 parts of 16 bits each) to keyframes. Each part of a query feature votes for
/// the keyframes that contain it.
class FeatureIndex {
 public:
  struct Votes {
    int keyframe = 0;
    int votes = 0;
  };
  void add(int keyframe, const std::vector<Feature>& features);
  /// Returns the keyframes with ids below `end` by descending votes, at most `most`; parts shared by very many
  /// keyframes are ignored.
  std::vector<Votes> candidates(const std::vector<Feature>& features, int end, int most) const;

 private:
  std::unordered_map<std::uint32_t, std::vector<int>> keyframes_by_word_;
};

}  // namespace tileflight::loop_closure
