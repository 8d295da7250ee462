#include "tileflight/slam/loop_closure/keyframe_image.h"

#include <algorithm>
#include <cmath>

namespace tileflight::loop_closure {

KeyframeImage keep_image(const keyframes::Pyramid& pyramid) {
  constexpr int kMostPixels = 310000;
  KeyframeImage image;
  const int coarsest = static_cast<int>(pyramid.levels.size()) - 1;
  while (image.level < coarsest && pyramid.levels[image.level].width * pyramid.levels[image.level].height > kMostPixels)
    ++image.level;
  const keyframes::PyramidLevel& level = pyramid.levels[image.level];
  image.width = level.width;
  image.height = level.height;
  const auto end = level.grey.begin() + static_cast<std::ptrdiff_t>(level.width) * level.height;
  // Irradiance may exceed 255 where vignetting is undone.
  image.grey_per_step = std::max(1.0F, *std::max_element(level.grey.begin(), end) / 255.0F);
  image.steps.reserve(static_cast<std::size_t>(level.width) * level.height);
  for (auto grey = level.grey.begin(); grey != end; ++grey)
    image.steps.push_back(
        static_cast<std::uint8_t>(std::lround(std::clamp(*grey / image.grey_per_step, 0.0F, 255.0F))));
  return image;
}

keyframes::Pyramid restore_pyramid(const KeyframeImage& image, int levels) {
  imaging::FloatImage grey = keyframes::make_image_in({}, image.width, image.height);
  for (std::size_t i = 0; i < image.steps.size(); ++i)
    grey.pixels[i] = image.grey_per_step * static_cast<float>(image.steps[i]);
  return keyframes::build_pyramid(std::move(grey), levels);
}

keyframes::LensPyramid lens_from_level(const keyframes::LensPyramid& lens, int first) {
  return {{lens.lenses.begin() + first, lens.lenses.end()}, {lens.rays.begin() + first, lens.rays.end()}};
}

}  // namespace tileflight::loop_closure
