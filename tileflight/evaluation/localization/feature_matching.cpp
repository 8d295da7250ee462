#include "tileflight/evaluation/localization/feature_matching.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "tileflight/core/base/simd.h"

namespace tileflight::localization {

namespace {

TILEFLIGHT_WIDE_VECTORS int squared_distance(const std::uint8_t* a, const std::uint8_t* b) {
  int sum = 0;
  for (int k = 0; k < 128; ++k) {
    const int d = static_cast<int>(a[k]) - static_cast<int>(b[k]);
    sum += d * d;
  }
  return sum;
}

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
__attribute__((target_clones("popcnt", "default")))
#endif
void count_differences(const std::array<std::uint64_t, 2>& signs, const std::array<std::uint64_t, 2>* all, std::size_t n,
                       std::uint8_t* differences) {
  for (std::size_t k = 0; k < n; ++k)
    differences[k] =
        static_cast<std::uint8_t>(std::popcount(signs[0] ^ all[k][0]) + std::popcount(signs[1] ^ all[k][1]));
}

/// Smallest Hamming distance that at least `wanted` entries do not exceed.
int shortlist_cutoff(const std::vector<std::uint8_t>& differences, std::size_t wanted) {
  std::array<std::array<std::uint32_t, 256>, 4> counts{};
  for (std::size_t k = 0; k < differences.size(); ++k) ++counts[k % 4][differences[k]];
  std::size_t sum = 0;
  for (std::size_t d = 0; d < 256; ++d) {
    sum += counts[0][d] + counts[1][d] + counts[2][d] + counts[3][d];
    if (sum >= wanted) return static_cast<int>(d);
  }
  return 255;
}

}  // namespace

DescriptorIndex::DescriptorIndex(std::vector<SiftDescriptor> descriptors) : descriptors_(std::move(descriptors)) {
  for (std::size_t part = 0; part < medians_.size(); ++part) {
    std::array<std::size_t, 256> counts{};
    for (const SiftDescriptor& d : descriptors_) ++counts[d[part]];
    std::size_t sum = 0, value = 0;
    while (value < 255 && 2 * (sum += counts[value]) < descriptors_.size()) ++value;
    medians_[part] = static_cast<std::uint8_t>(value);
  }
  signs_.resize(descriptors_.size());
  tbb::parallel_for(std::size_t{0}, signs_.size(),
                    [&](std::size_t k) { signs_[k] = compute_sign_bits(descriptors_[k]); });
}

DescriptorIndex::SignBits DescriptorIndex::compute_sign_bits(const SiftDescriptor& descriptor) const {
  SignBits signs{};
  for (std::size_t k = 0; k < descriptor.size(); ++k)
    signs[k / 64] |= static_cast<std::uint64_t>(descriptor[k] > medians_[k] ? 1 : 0) << (k % 64);
  return signs;
}

std::vector<FeatureMatch> DescriptorIndex::match(const std::vector<SiftDescriptor>& sources,
                                                 const MatchOptions& options) const {
  const std::size_t wanted = std::min(options.neighbors, descriptors_.size());
  if (wanted == 0) return {};
  std::vector<FeatureMatch> matches(sources.size() * wanted);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, sources.size(), 16), [&](const auto& range) {
    std::vector<std::uint8_t> differences(descriptors_.size());
    std::vector<std::pair<int, std::uint32_t>> nearest;  // squared distance, index
    for (std::size_t i = range.begin(); i != range.end(); ++i) {
      int most = 255;
      if (options.shortlist > 0) {
        count_differences(compute_sign_bits(sources[i]), signs_.data(), signs_.size(), differences.data());
        most = shortlist_cutoff(differences, std::max(options.shortlist, wanted + 1));
      }
      nearest.clear();
      for (std::size_t k = 0; k < descriptors_.size(); ++k) {
        if (differences[k] <= most)
          nearest.emplace_back(squared_distance(sources[i].data(), descriptors_[k].data()),
                               static_cast<std::uint32_t>(k));
      }
      const std::size_t sorted = std::min(nearest.size(), wanted + 1);
      std::partial_sort(nearest.begin(), nearest.begin() + static_cast<std::ptrdiff_t>(sorted), nearest.end());
      const float next = sorted > wanted ? std::sqrt(static_cast<float>(nearest[wanted].first))
                                         : std::numeric_limits<float>::infinity();
      for (std::size_t k = 0; k < wanted; ++k) {
        const float distance = std::sqrt(static_cast<float>(nearest[k].first));
        matches[i * wanted + k] = {static_cast<std::uint32_t>(i), nearest[k].second, distance,
                                   next > 0.0F ? distance / next : 1.0F};
      }
    }
  });
  return matches;
}

}  // namespace tileflight::localization
