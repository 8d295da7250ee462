#include "tileflight/capture/render/texture_sampler.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <memory>
#include <random>

namespace tileflight::render {
namespace {

using imaging::Wrap;

std::shared_ptr<const imaging::RgbImage> random_image(int width, int height, std::mt19937& random) {
  auto image = std::make_shared<imaging::RgbImage>(width, height);
  for (imaging::Rgb8& texel : image->pixels) {
    for (std::uint8_t& value : texel) value = static_cast<std::uint8_t>(random() & 0xFFU);
  }
  return image;
}

std::array<std::uint32_t, 3> bits_of(const Float4& rgb) {
  return {std::bit_cast<std::uint32_t>(float{rgb[0]}), std::bit_cast<std::uint32_t>(float{rgb[1]}),
          std::bit_cast<std::uint32_t>(float{rgb[2]})};
}

/// Coordinates inside of the texture, near its borders and far outside.
TextureRead random_read(std::mt19937& random) {
  std::uniform_real_distribution<float> anywhere(-1.3F, 2.3F), step(-0.2F, 0.2F);
  TextureRead read{anywhere(random), anywhere(random), step(random), step(random)};
  read.probes = 1 + static_cast<int>(random() % 8);
  return read;
}

/// Bilinear mean of squared texels, texel by texel.
std::array<double, 3> bilinear_by_texels(const Texture& texture, int level, float x, float y) {
  const MipLevel& mip = texture.pyramid->level(level);
  const int x0 = sampling::floor_to_int(x), y0 = sampling::floor_to_int(y);
  const double fx = static_cast<double>(x) - x0, fy = static_cast<double>(y) - y0;
  std::array<double, 3> mean{};
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      const imaging::Rgb8 texel = texture.pyramid->texel(level, sampling::wrap_index(x0 + i, mip.width, texture.wrap_s),
                                                         sampling::wrap_index(y0 + j, mip.height, texture.wrap_t));
      const double weight = (i == 0 ? 1.0 - fx : fx) * (j == 0 ? 1.0 - fy : fy);
      for (std::size_t c = 0; c < 3; ++c) mean[c] += weight * texel[c] * texel[c];
    }
  }
  return mean;
}

class TextureSampler : public testing::TestWithParam<std::array<int, 2>> {};

TEST_P(TextureSampler, TwoLevelsAtOnceAreThoseOneByOneToTheBit) {
  std::mt19937 random(7);
  const MipPyramid pyramid(random_image(GetParam()[0], GetParam()[1], random));
  for (int i = 0; i < 4000; ++i) {
    const auto wrap = [&] {
      return std::array{Wrap::kRepeat, Wrap::kClampToEdge, Wrap::kMirroredRepeat}[random() % 3];
    };
    const Texture texture{&pyramid, wrap(), wrap(), static_cast<float>(GetParam()[0]),
                          static_cast<float>(GetParam()[1])};
    const TextureRead read = random_read(random);
    const int level = static_cast<int>(random() % static_cast<unsigned>(pyramid.levels() - 1));
    Float4 fine, coarse;
    sampling::probes_at_levels(texture, level, read, fine, coarse);
    ASSERT_EQ(bits_of(fine), bits_of(sampling::probes_at_level(texture, level, read)));
    ASSERT_EQ(bits_of(coarse), bits_of(sampling::probes_at_level(texture, level + 1, read)));
  }
}

TEST_P(TextureSampler, ABilinearReadIsTheMeanOfFourTexels) {
  std::mt19937 random(8);
  const MipPyramid pyramid(random_image(GetParam()[0], GetParam()[1], random));
  const Texture texture{&pyramid};
  for (int i = 0; i < 2000; ++i) {
    const int level = static_cast<int>(random() % static_cast<unsigned>(pyramid.levels()));
    std::uniform_real_distribution<float> x(-2.0F, static_cast<float>(pyramid.level(level).width) + 1.0F),
        y(-2.0F, static_cast<float>(pyramid.level(level).height) + 1.0F);
    const float at_x = x(random), at_y = y(random);
    const Float4 read = sampling::bilinear_squares(texture, pyramid.level(level), at_x, at_y);
    const std::array<double, 3> mean = bilinear_by_texels(texture, level, at_x, at_y);
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(read[c], mean[static_cast<std::size_t>(c)], 0.03);
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, TextureSampler,
                         testing::Values(std::array{64, 64}, std::array{37, 5}, std::array{2, 1}, std::array{1, 9},
                                         std::array{3, 3}));

}  // namespace
}  // namespace tileflight::render
