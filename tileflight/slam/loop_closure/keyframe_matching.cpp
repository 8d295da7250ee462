#include "tileflight/slam/loop_closure/keyframe_matching.h"

#include <algorithm>
#include <map>

namespace tileflight::loop_closure {
namespace {

constexpr int kWords = 16;

std::uint32_t descriptor_word(const keyframes::BinaryDescriptor& descriptor, int part) {
  return static_cast<std::uint32_t>(part) << 16 |
         static_cast<std::uint32_t>(descriptor[part / 4] >> (part % 4 * 16) & 0xFFFF);
}

}  // namespace

void FeatureIndex::add(int keyframe, const std::vector<Feature>& features) {
  for (const Feature& feature : features) {
    for (int part = 0; part < kWords; ++part) {
      std::vector<int>& keyframes = keyframes_by_word_[descriptor_word(feature.descriptor, part)];
      if (keyframes.empty() || keyframes.back() != keyframe) keyframes.push_back(keyframe);
    }
  }
}

std::vector<FeatureIndex::Votes> FeatureIndex::candidates(const std::vector<Feature>& features, int end,
                                                          int most) const {
  constexpr std::size_t kCommon = 60;  // parts that occur in more keyframes are not distinctive
  std::map<int, int> votes;
  for (const Feature& feature : features) {
    for (int part = 0; part < kWords; ++part) {
      const auto found = keyframes_by_word_.find(descriptor_word(feature.descriptor, part));
      if (found == keyframes_by_word_.end() || found->second.size() > kCommon) continue;
      for (const int keyframe : found->second) votes[keyframe] += keyframe < end ? 1 : 0;
    }
  }
  std::vector<Votes> out;
  for (const auto& [keyframe, count] : votes) {
    if (count > 0) out.push_back({keyframe, count});
  }
  std::stable_sort(out.begin(), out.end(), [](const Votes& x, const Votes& y) { return x.votes > y.votes; });
  if (static_cast<int>(out.size()) > most) out.resize(most);
  return out;
}

}  // namespace tileflight::loop_closure
