#include "tileflight/tiles/tile_writer/content_spill.h"

#include <gtest/gtest.h>

#include "tests/temporary_folder.h"
#include "tileflight/tiles/tile_writer/test_hills.h"

namespace tileflight::tile_writer::content_spill_test {
namespace {

using namespace test_hills;

TEST(ContentSpill, ReturnsWhatWasWritten) {
  const tests::TemporaryFolder folder;
  const ContentSpill spill(folder / "contents");
  std::vector<TexturedMesh> content = make_place();
  content.erase(content.begin());  // the rest shares one texture
  content[1].base_color = {0.1F, 0.2F, 0.3F, 1.0F};
  content[0].wrap_u = imaging::Wrap::kMirroredRepeat;
  spill.write(3, 17, content);
  for (const bool textures : {true, false}) {
    const std::vector<TexturedMesh> read = spill.read(3, 17, textures);
    ASSERT_EQ(read.size(), content.size());
    for (std::size_t i = 0; i < read.size(); ++i) {
      EXPECT_EQ(read[i].mesh.vertices, content[i].mesh.vertices);
      EXPECT_EQ(read[i].mesh.triangles, content[i].mesh.triangles);
      EXPECT_EQ(read[i].uv, content[i].uv);
      EXPECT_EQ(read[i].colors, content[i].colors);
      EXPECT_EQ(read[i].base_color, content[i].base_color);
      EXPECT_EQ(read[i].wrap_u, content[i].wrap_u);
      EXPECT_EQ(read[i].texture != nullptr, textures && content[i].texture != nullptr);
      if (read[i].texture) {
        EXPECT_TRUE(read[i].texture->pixels == content[i].texture->pixels);
      }
    }
  }
  EXPECT_TRUE(spill.read(3, 18, true).empty());
  spill.remove(3, 17);
  EXPECT_TRUE(spill.read(3, 17, true).empty());
}

}  // namespace
}  // namespace tileflight::tile_writer::content_spill_test
