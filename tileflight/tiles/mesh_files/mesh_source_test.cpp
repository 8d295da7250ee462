#include "tileflight/tiles/mesh_files/mesh_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <fstream>

#include "tests/refusal.h"
#include "tests/source_folder.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/deferred_texture.h"
#include "tileflight/core/imaging/glb_writer.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/core/imaging/ktx2.h"

namespace tileflight::mesh_files::mesh_source_test {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class MeshFile : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }

  /// 4 x 2 texels, each with a colour of its own.
  void write_picture(const std::string& name) const {
    imaging::RgbImage image(4, 2);
    for (int y = 0; y < 2; ++y)
      for (int x = 0; x < 4; ++x)
        image(x, y) = {static_cast<std::uint8_t>(60 * x), static_cast<std::uint8_t>(200 * y), 7};
    std::filesystem::create_directories((folder_ / name).parent_path());
    imaging::write_rgb(folder_ / name, image);
  }

  MeshSource read(const std::string& name, const std::string& text, const MeshSourceOptions& options = {}) const {
    return read_mesh_source(write(name, text), options);
  }

  template <class Matcher>
  void expect_refused(const std::string& name, const std::string& text, const Matcher& matcher) const {
    EXPECT_THAT(tests::refusal_of([&] { read(name, text); }), AllOf(matcher, HasSubstr(name))) << text;
  }

  tests::TemporaryFolder folder_;
};

/// Windows line ends, a continued line, negative and positive indices, a quadrangle, a triangle without texture
/// coordinates, two materials, names with blanks, a path of another machine.
constexpr const char* kObj =
    "# exported\r\nmtllib my place.mtl\r\no house\r\n"
    "v 0 0 0\r\nv 2 0 0\r\nv 2 1 \\\r\n0\r\nv 0 1 0\r\nv 0 0 3 1.0\r\n"
    "vt 0 0\r\nvt 1 0\r\nvt 1 1 0\r\nvt 0 1\r\nvn 0 0 1\r\n"
    "usemtl wall paint\r\nf -5/-4/1 -4/-3/1 -3/-2/1 -2/-1/1 # a quadrangle\r\n"
    "usemtl plain\r\nf 1 2 5\r\nf 1//1 2//1 4//1\r\n";
constexpr const char* kMtl =
    "newmtl wall paint\r\nKd 0.2 0.2 0.2\r\nmap_Kd -s 1 1 1 -clamp on C:\\\\textures\\\\the wall.png\r\n"
    "newmtl plain\r\nKd 0.5 0.25 1\r\nd 1\r\n";

TEST_F(MeshFile, ObjWithMaterialsIsRead) {
  write("my place.mtl", kMtl);
  write_picture("the wall.png");
  const MeshSource source = read("house of mine.obj", kObj);
  EXPECT_TRUE(source.warnings.empty());
  ASSERT_EQ(source.meshes.size(), 2U);
  const TexturedMesh& wall = source.meshes[0];
  EXPECT_EQ(wall.mesh.vertices.size(), 4U);
  EXPECT_NEAR(geometry::surface_area_m2(wall.mesh), 2.0, 1e-12);
  ASSERT_TRUE(wall.texture);
  EXPECT_EQ((*wall.texture)(3, 1), (imaging::Rgb8{180, 200, 7}));
  EXPECT_EQ(wall.base_color[0], 1.0F) << "a texture hides Kd";
  EXPECT_EQ(wall.wrap_u, imaging::Wrap::kClampToEdge);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(wall.uv[i].x(), wall.mesh.vertices[i].x() / 2);
    EXPECT_EQ(wall.uv[i].y(), 1 - wall.mesh.vertices[i].y()) << "v points down in glTF";
  }
  const TexturedMesh& plain = source.meshes[1];
  EXPECT_EQ(plain.mesh.triangles.size(), 2U);
  EXPECT_FALSE(plain.texture);
  EXPECT_NEAR(plain.base_color[0], 0.2140, 1e-4);  // sRGB 0.5
  EXPECT_EQ(plain.base_color[2], 1.0F);
}

TEST_F(MeshFile, LibrariesMayBeginWithAByteOrderMarkAndOpacityIsNamed) {
  write_picture("p.png");
  const std::string square =
      "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\n"
      "f 1/1 2/2 3/3 4/4\n";
  for (const auto& [library, named] :
       {std::pair("newmtl m\nmap_Kd p.png\n", false), std::pair("newmtl m\nmap_Kd p.png\nd 1\nTr 0\n", false),
        std::pair("newmtl m\nmap_Kd p.png\nd 0.3\n", true), std::pair("newmtl m\nmap_Kd p.png\nTr 0.7\n", true),
        std::pair("newmtl m\nmap_Kd p.png\nd -halo 0.5\n", true)}) {
    write("a.mtl", std::string("\xEF\xBB\xBF") + library);
    const MeshSource source = read("a.obj", "\xEF\xBB\xBFmtllib a.mtl\n" + square);
    ASSERT_EQ(source.meshes.size(), 1U);
    EXPECT_TRUE(source.meshes[0].texture) << library;
    EXPECT_EQ(source.warnings.size(), named ? 1U : 0U) << library;
  }
}

TEST_F(MeshFile, ObjWithoutTexturesNeedsNoLibrary) {
  const MeshSource source = read("a.obj", kObj, {.textures = false});
  EXPECT_EQ(source.meshes.size(), 2U);
  for (const TexturedMesh& mesh : source.meshes) EXPECT_FALSE(mesh.texture);
}

TEST_F(MeshFile, ObjKeepsMillimetresOfCoordinatesOnAMap) {
  const MeshSource source =
      read("a.obj", "v 532001.001 9974001.002 2800.003\nv 532002 9974001 2800\nv 532001 9974002 2800\nf 1 2 3\n");
  EXPECT_EQ(source.meshes[0].mesh.vertices[0], Vec3(532001.001, 9974001.002, 2800.003));
}

TEST_F(MeshFile, ObjColorsOfVerticesAreDisplayedIntensities) {
  const MeshSource source = read("a.obj", "v 0 0 0 1 0.5 0\nv 1 0 0 1 0.5 0\nv 0 1 0\nf 1 2 3\n");
  ASSERT_EQ(source.meshes[0].colors.size(), 3U);
  EXPECT_EQ(source.meshes[0].colors[0], (std::array<std::uint8_t, 4>{255, 55, 0, 255}));
  EXPECT_EQ(source.meshes[0].colors[2], (std::array<std::uint8_t, 4>{255, 255, 255, 255}));
  const MeshSource bytes = read("b.obj", "v 0 0 0 255 127.5 0\nv 1 0 0 255 127.5 0\nv 0 1 0 0 0 0\nf 1 2 3\n");
  EXPECT_EQ(bytes.meshes[0].colors[0], (std::array<std::uint8_t, 4>{255, 55, 0, 255}));
}

TEST_F(MeshFile, UpAndScaleAreAppliedAndFlatTrianglesLeftOut) {
  const std::string text = "v 0 0 0\nv 100 0 0\nv 0 200 0\nv 50 0 0\nf 1 2 3\nf 1 2 4\nf 1 1 2\nf 1 2\n";
  const MeshSource source = read("a.obj", text, {.up = tile_content::UpAxis::kY, .metres_per_unit = 0.01});
  ASSERT_EQ(source.meshes[0].mesh.triangles.size(), 1U);
  EXPECT_TRUE(source.meshes[0].mesh.vertices[2].isApprox(Vec3(0, 0, 2)));
  EXPECT_THAT(source.warnings,
              ::testing::UnorderedElementsAre(HasSubstr("2 triangles without area"), HasSubstr("1 faces with fewer")));
}

TEST_F(MeshFile, BrokenObjIsRefusedWithItsLine) {
  expect_refused("a.obj", "", HasSubstr("no triangle"));
  expect_refused("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", HasSubstr("no triangle"));
  expect_refused("a.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", HasSubstr("no triangle with an area"));
  expect_refused("a.obj", "v 0 0 0\nv nan 0 0\n", AllOf(HasSubstr("line 2"), HasSubstr("not finite")));
  expect_refused("a.obj", "v 0 0 1e999\n", HasSubstr("line 1"));
  expect_refused("a.obj", "v 0 0\n", HasSubstr("three coordinates"));
  expect_refused("a.obj", "v 0 0 x\n", HasSubstr("'x' is not a number"));
  const std::string corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  expect_refused("a.obj", corners + "f 1 2 4\n",
                 AllOf(HasSubstr("line 4"), HasSubstr("vertex 4"), HasSubstr("3 so far")));
  expect_refused("a.obj", corners + "f 1 2 -4\n", HasSubstr("vertex -4"));
  expect_refused("a.obj", corners + "f 0 1 2\n", HasSubstr("vertex 0"));
  expect_refused("a.obj", corners + "f 1 2 99999999999999999999\n", HasSubstr("not an index"));
  expect_refused("a.obj", corners + "f 1/1 2/1 3/1\n", HasSubstr("texture coordinate 1"));
  expect_refused("a.obj", "v 1e30 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n", HasSubstr("--scale"));
}

TEST_F(MeshFile, MissingLibrariesAndTexturesAreNamed) {
  expect_refused("a.obj", kObj, AllOf(HasSubstr("my place.mtl"), HasSubstr("--no-textures")));
  write("my place.mtl", kMtl);
  try {
    read("a.obj", kObj);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("the wall.png"), HasSubstr("wall paint"), HasSubstr("my place.mtl")));
  }
  write("the wall.png", "no picture");
  EXPECT_THAT([&] { read("a.obj", kObj); },
              ThrowsMessage<InputError>(HasSubstr("the wall.png: is not a JPEG, PNG, WebP, TIFF")));
  write("my place.mtl", "newmtl other\nKd 1 x 1\n");
  EXPECT_THAT([&] { read("a.obj", kObj); }, ThrowsMessage<InputError>(HasSubstr("Kd needs one or three numbers")));
}

TEST_F(MeshFile, TextureCoordinatesThatAreNotFiniteAreWarnedOf) {
  write("m.mtl", "newmtl m\nmap_Kd p.png\n");
  write_picture("p.png");
  const MeshSource source =
      read("a.obj", "mtllib m.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt nan 1\nvt 0 0\nvt 1 1\nf 1/1 2/2 3/3\n");
  EXPECT_THAT(source.warnings, ::testing::ElementsAre(HasSubstr("not finite")));
  EXPECT_EQ(source.meshes[0].uv[0], Eigen::Vector2f(0, 1));
}

constexpr const char* kPlyHeader =
    "ply\nformat ascii 1.0\ncomment TextureFile p.png\nelement vertex 4\nproperty float x\nproperty float y\n"
    "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n";
constexpr const char* kPlyVertices = "0 0 0 255 188 0\n2 0 0 255 188 0\n2 1 0 255 188 0\n0 1 0 0 0 0\n";

TEST_F(MeshFile, PlyWithColorsAndPolygonsIsRead) {
  const MeshSource source =
      read("a.ply", std::string(kPlyHeader) + "element face 1\nproperty list uchar int vertex_indices\nend_header\n" +
                        kPlyVertices + "4 0 1 2 3\n");
  ASSERT_EQ(source.meshes.size(), 1U);
  EXPECT_EQ(source.meshes[0].mesh.triangles.size(), 2U);
  EXPECT_NEAR(geometry::surface_area_m2(source.meshes[0].mesh), 2.0, 1e-12);
  EXPECT_EQ(source.meshes[0].colors[0], (std::array<std::uint8_t, 4>{255, 128, 0, 255}));
}

TEST_F(MeshFile, PlyInBinaryIsTheSame) {
  std::string text =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\nproperty double y\n"
      "property double z\nelement face 1\nproperty list uchar uint vertex_index\nend_header\n";
  static_assert(std::endian::native == std::endian::little);
  const std::array<double, 9> places{0, 0, 0, 1, 0, 0, 0, 1, 532001.25};
  const std::array<std::uint32_t, 3> corners{0, 1, 2};
  text.append(reinterpret_cast<const char*>(places.data()), sizeof(places)).push_back(3);
  text.append(reinterpret_cast<const char*>(corners.data()), sizeof(corners));
  EXPECT_EQ(read("a.ply", text).meshes[0].mesh.vertices[2], Vec3(0, 1, 532001.25));
}

TEST_F(MeshFile, PlyWithTextureCoordinatesOfCornersIsRead) {
  write_picture("p.png");
  const MeshSource source = read(
      "a.ply",
      std::string(kPlyHeader) +
          "element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n" +
          kPlyVertices + "3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0 0 1 1 0 1\n");
  ASSERT_EQ(source.meshes.size(), 1U);
  const TexturedMesh& mesh = source.meshes[0];
  ASSERT_TRUE(mesh.texture);
  EXPECT_EQ(mesh.mesh.vertices.size(), 4U) << "corners with the same coordinates are one vertex";
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_EQ(mesh.uv[i], Eigen::Vector2f(static_cast<float>(mesh.mesh.vertices[i].x() / 2),
                                          static_cast<float>(1 - mesh.mesh.vertices[i].y())));
}

TEST_F(MeshFile, PlyTriangleStripsTurnEveryOtherTriangleAndEndAtMinusOne) {
  const MeshSource source = read(
      "a.ply", std::string(kPlyHeader) + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n" +
                   kPlyVertices + "12 0 1 3 2 -1 1 2 0 -1 2 2 3\n");
  ASSERT_EQ(source.meshes.size(), 1U);
  const geometry::TriangleMesh& mesh = source.meshes[0].mesh;
  ASSERT_EQ(mesh.triangles.size(), 3U) << "2 2 3 has no area";
  for (const geometry::Triangle& t : mesh.triangles) {
    const geometry::Vec3 up =
        (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    EXPECT_GT(up.z(), 0);
  }
}

TEST_F(MeshFile, BrokenPlyIsRefused) {
  const std::string header =
      std::string(kPlyHeader) + "element face 1\nproperty list uchar int vertex_indices\nend_header\n" + kPlyVertices;
  expect_refused("a.ply",
                 std::string(kPlyHeader) + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n" +
                     kPlyVertices + "3 0 1 4\n",
                 HasSubstr("strip 0 refers to vertex 4 of 4"));
  expect_refused("a.ply", std::string(kPlyHeader) + "end_header\n" + kPlyVertices, HasSubstr("points without faces"));
  expect_refused("a.ply", header + "3 0 1 4\n", HasSubstr("vertex 4 of 4"));
  expect_refused("a.ply", header + "3 0 1 -1\n", HasSubstr("vertex -1"));
  expect_refused("a.ply", header, HasSubstr("face"));
  expect_refused("a.ply",
                 "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nelement face 1\nproperty list uchar int "
                 "vertex_indices\nend_header\n0\n0\n0\n3 0 1 2\n",
                 HasSubstr("x, y or z"));
}

TEST_F(MeshFile, TexturesOfAGlbMayStayInTheFile) {
  std::vector<TexturedMesh> meshes(3);
  for (int k = 0; k < 3; ++k) {
    const auto image = std::make_shared<imaging::RgbImage>(40 + k, 24);
    for (std::size_t i = 0; i < image->pixels.size(); ++i)
      image->pixels[i] = {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(50 * k), 7};
    TexturedMesh& mesh = meshes[static_cast<std::size_t>(k)];
    mesh.mesh.vertices = {{10.0 * k, 0, 0}, {10.0 * k + 4, 0, 0}, {10.0 * k, 4, 1}};
    mesh.mesh.triangles = {{0, 1, 2}};
    mesh.uv = {{0, 0}, {1, 0}, {0, 1}};
    mesh.texture = k == 2 ? meshes[1].texture : image;
  }
  const auto file = write("a.glb", imaging::write_glb(meshes, {}));
  const MeshSource whole = read_mesh_source(file, {}), deferred = read_mesh_source(file, {.defer_textures = true});
  ASSERT_EQ(deferred.meshes.size(), 3U);
  EXPECT_EQ(deferred.meshes[1].texture, deferred.meshes[2].texture);
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& texture = deferred.meshes[k].texture;
    EXPECT_TRUE(texture->pixels.empty());
    EXPECT_EQ(texture->width, whole.meshes[k].texture->width);
    EXPECT_EQ(texture->height, 24);
    EXPECT_EQ(imaging::with_pixels(texture)->pixels, whole.meshes[k].texture->pixels);
    EXPECT_EQ(deferred.meshes[k].uv, whole.meshes[k].uv);
  }
  std::filesystem::remove(file);
  EXPECT_THAT(tests::refusal_of([&] { imaging::with_pixels(deferred.meshes[0].texture); }),
              HasSubstr("a.glb: cannot be read any more"));
}

TEST_F(MeshFile, GlbIsReadWithItsNodesAndAxis) {
  TexturedMesh mesh;
  mesh.mesh.vertices = {{100, 200, 5}, {103, 200, 5}, {100, 204, 6}};
  mesh.mesh.triangles = {{0, 1, 2}};
  mesh.colors = {{10, 20, 30, 255}, {40, 50, 60, 255}, {70, 80, 90, 255}};
  write("a.glb", imaging::write_glb({mesh}, {.copyright = "me"}));
  const MeshSource source = read_mesh_source(folder_ / "a.glb", {});
  ASSERT_EQ(source.meshes.size(), 1U);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_TRUE(source.meshes[0].mesh.vertices[i].isApprox(mesh.mesh.vertices[i], 1e-9));
  EXPECT_EQ(source.meshes[0].colors, mesh.colors);
  EXPECT_EQ(source.copyrights, std::vector<std::string>{"me"});
  const MeshSource as_it_is =
      read_mesh_source(folder_ / "a.glb", {.up = tile_content::UpAxis::kZ, .metres_per_unit = 2});
  EXPECT_TRUE(as_it_is.meshes[0].mesh.vertices[2].isApprox(2 * Vec3(100, 6, -204), 1e-9));
  expect_refused("b.glb", "glTF but not really", HasSubstr("b.glb"));
  expect_refused("b.gltf", "<html>", HasSubstr("b.gltf"));
}

/// A triangle with texture coordinates; positions and coordinates are in one data URI.
constexpr const char* kKtx2Gltf = R"({"asset": {"version": "2.0"},
  "extensionsUsed": ["KHR_texture_basisu"], "extensionsRequired": ["KHR_texture_basisu"],
  "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
  "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
  "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
  "textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}],
  "images": [{"uri": "the%20wall.ktx2", "mimeType": "image/ktx2"}],
  "accessors": [
    {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
    {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"}],
  "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 24}],
  "buffers": [{"byteLength": 60, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/"}]})";

TEST_F(MeshFile, GltfWithATextureInKtx2IsRead) {
  std::filesystem::copy(tests::source_folder() / "tests/fuzz/seeds/texture/uastc.ktx2", folder_ / "the wall.ktx2");
  const MeshSource source = read("a.gltf", kKtx2Gltf);
  ASSERT_EQ(source.meshes.size(), 1U);
  ASSERT_NE(source.meshes[0].texture, nullptr);
  const std::vector<std::byte> bytes = base::read_bytes(folder_ / "the wall.ktx2");
  EXPECT_TRUE(source.meshes[0].texture->pixels == imaging::decode_ktx2(bytes, "the wall", 1 << 20).pixels);
}

TEST_F(MeshFile, OtherFilesAreRefused) {
  expect_refused("a.fbx", "Kaydara", AllOf(HasSubstr(".obj"), HasSubstr(".ply")));
  EXPECT_THAT([&] { read_mesh_source(folder_ / "not there.obj", {}); },
              ThrowsMessage<InputError>(HasSubstr("not there.obj: cannot be opened")));
}

}  // namespace
}  // namespace tileflight::mesh_files::mesh_source_test
