#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tileflight/evaluation/localization/sift_features.h"

namespace tileflight::localization {

struct MatchOptions {
  std::size_t neighbors = 2;    ///< matches per feature, at most
  std::size_t shortlist = 100;  ///< candidates with the most similar sign bits, compared exactly; 0: all
};

struct FeatureMatch {
  std::uint32_t source = 0, target = 0;
  float distance = 0.0F;  ///< Euclidean distance of the descriptors
  float ratio = 1.0F;     ///< distance over that of the nearest descriptor not among the matches; below 1, lower is
                          ///< more distinctive
};

/// Searchable descriptors. Each is stored with 128 sign bits (whether a component exceeds that component's median);
/// candidates are preselected by Hamming distance of the bits before descriptors are compared.
class DescriptorIndex {
 public:
  explicit DescriptorIndex(std::vector<SiftDescriptor> descriptors);

  /// The nearest descriptors of each source, nearest first, with their distance ratios. In the order of `sources`;
  /// independent of the number of threads.
  std::vector<FeatureMatch> match(const std::vector<SiftDescriptor>& sources, const MatchOptions& options = {}) const;

 private:
  using SignBits = std::array<std::uint64_t, 2>;
  SignBits compute_sign_bits(const SiftDescriptor& descriptor) const;

  std::vector<SiftDescriptor> descriptors_;
  SiftDescriptor medians_{};
  std::vector<SignBits> signs_;
};

}  // namespace tileflight::localization
