#include "tileflight/tiles/mesh_files/texel_store.h"

#include <gtest/gtest.h>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/noise.h"

namespace tileflight::mesh_files::texel_store_test {
namespace {

imaging::RgbImage noise(int width, int height, std::uint32_t seed) {
  base::HashRandom random(seed);
  imaging::RgbImage image(width, height);
  for (imaging::Rgb8& pixel : image.pixels)
    for (std::uint8_t& value : pixel) value = static_cast<std::uint8_t>(random.uniform(0, 256));
  return image;
}

TEST(TexelStore, ReturnsTheTexelsOfEachImage) {
  const tests::TemporaryFolder folder;
  TexelStore store(folder / "texels");
  const std::vector<imaging::RgbImage> images{noise(1, 1, 1), noise(130, 67, 2), noise(64, 128, 3)};
  std::vector<std::shared_ptr<const imaging::RgbImage>> stand_ins;
  for (const imaging::RgbImage& image : images) stand_ins.push_back(store.add(image));
  const TexelFetcher fetch = store.fetcher();
  for (int round = 0; round < 2; ++round)
    for (std::size_t i = 0; i < images.size(); ++i) {
      ASSERT_EQ(stand_ins[i]->width, images[i].width);
      EXPECT_TRUE(stand_ins[i]->pixels.empty());
      for (int y = 0; y < images[i].height; ++y)
        for (int x = 0; x < images[i].width; ++x) ASSERT_EQ(fetch(*stand_ins[i], x, y), images[i](x, y));
    }
  EXPECT_EQ(store.texels(), 1U + 130 * 67 + 64 * 128);
}

}  // namespace
}  // namespace tileflight::mesh_files::texel_store_test
