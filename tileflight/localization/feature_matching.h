#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tileflight/localization/local_features.h"

namespace tileflight::localization {

struct MatchOptions {
  std::size_t neighbors = 2;    ///< of each feature, at most
  std::size_t looked_at = 100;  ///< most similar ones by signs, that are compared exactly; 0: all
};

struct FeatureMatch {
  std::uint32_t source = 0, target = 0;
  float distance = 0.0F;  ///< of the descriptors (Euclidean, of 512 at most in each)
  float ratio = 1.0F;     ///< to the distance of the next one that is not among the matches: below 1, lower is clearer
};

/// Descriptors to be searched: beside each, a word of 128 signs (whether a part of it is above that part's median),
/// whose differences are counted before descriptors are compared.
class DescriptorIndex {
 public:
  explicit DescriptorIndex(std::vector<Descriptor> descriptors);

  /// The nearest descriptors of each, nearest first, with their distance ratios. In the order of `sources`; same bytes
  /// for any number of threads.
  std::vector<FeatureMatch> match(const std::vector<Descriptor>& sources, const MatchOptions& options = {}) const;

  std::size_t size() const { return descriptors_.size(); }

 private:
  using Signs = std::array<std::uint64_t, 2>;
  Signs signs_of(const Descriptor& descriptor) const;

  std::vector<Descriptor> descriptors_;
  Descriptor medians_{};
  std::vector<Signs> signs_;
};

}  // namespace tileflight::localization
