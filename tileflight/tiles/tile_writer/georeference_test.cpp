#include "tileflight/tiles/tile_writer/georeference.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <GeographicLib/UTMUPS.hpp>
#include <fstream>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::tile_writer::georeference_test {
namespace {

using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

void write(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file) << text;
}

std::vector<imaging::TexturedMesh> mesh_at(const std::vector<Vec3>& places) {
  imaging::TexturedMesh mesh;
  mesh.mesh.vertices = places;
  return {mesh};
}

TEST(Georeference, OpenDroneMapsFileIsFound) {
  const tests::TemporaryFolder folder;
  const std::filesystem::path mesh = folder / "odm_texturing/model.obj";
  std::filesystem::create_directories(mesh.parent_path());
  EXPECT_FALSE(find_georeference(mesh));
  write(folder / "odm_georeferencing/coords.txt", "WGS84 UTM 17S\n776000 9974000\n1.5 2.5 3.5\n");
  auto place = find_georeference(mesh);
  ASSERT_TRUE(place);
  EXPECT_EQ(place->crs, "EPSG:32717");
  EXPECT_EQ(place->offset, Vec3(776000, 9974000, 0));
  write(folder / "odm_texturing/odm_georeferencing_model_geo.txt", "WGS84 UTM 33N\r\n500000.5 5600000.25\r\n");
  place = find_georeference(mesh);
  EXPECT_EQ(place->crs, "EPSG:32633");
  EXPECT_EQ(place->offset, Vec3(500000.5, 5600000.25, 0));
  write(folder / "odm_texturing/odm_georeferencing_model_geo.txt", "WGS84 UTM 61N\n1 2\n");
  EXPECT_THAT([&] { find_georeference(mesh); },
              ThrowsMessage<InputError>(HasSubstr("unknown format: expected a line like 'WGS84 UTM 17N'")));
}

TEST(Georeference, MetadataXmlIsFound) {
  const tests::TemporaryFolder folder;
  write(folder / "metadata.xml",
        "<?xml version=\"1.0\"?>\n<ModelMetadata version=\"1\">\n<SRS>EPSG:32650</SRS>\n"
        "<SRSOrigin>440000,4420000.5,10</SRSOrigin>\n</ModelMetadata>\n");
  const auto place = find_georeference(folder / "Data/model.obj");
  ASSERT_TRUE(place);
  EXPECT_EQ(place->crs, "EPSG:32650");
  EXPECT_EQ(place->offset, Vec3(440000, 4420000.5, 10));
  write(folder / "metadata.xml", "<ModelMetadata/>");
  EXPECT_THAT([&] { find_georeference(folder / "model.obj"); },
              ThrowsMessage<InputError>(HasSubstr("has no SRS with an SRSOrigin of three numbers")));
}

/// Oracle: another library's inverse of the projection gives each vertex's position.
TEST(Georeference, EachVertexLiesWhereGeographicLibPutsIt) {
  for (const bool north : {true, false}) {
    const double northing = north ? 5630000.0 : 9974000.0;
    const Georeference place{north ? "EPSG:32633" : "EPSG:32717", {776000, northing, 0}, "test"};
    std::vector<Vec3> places;
    for (int i = 0; i < 5; ++i) places.emplace_back(350.0 * i - 700, 400.0 * (i % 3) - 300, 2800 + 10.0 * i);
    auto meshes = mesh_at(places);
    const geometry::LocalFrame frame = reproject_to_local(place, meshes);
    EXPECT_NEAR(frame.origin().height.m, 2820, 1e-6);
    for (std::size_t i = 0; i < places.size(); ++i) {
      double latitude = 0, longitude = 0;
      GeographicLib::UTMUPS::Reverse(north ? 33 : 17, north, 776000 + places[i].x(), northing + places[i].y(), latitude,
                                     longitude);
      const Vec3 truth = frame.local_from_geodetic({latitude, longitude, {places[i].z()}});
      EXPECT_LT((meshes[0].mesh.vertices[i] - truth).norm(), 1e-4) << i;
    }
  }
}

TEST(Georeference, HeightsAboveSeaLevelAreRaisedByTheGeoid) {
  auto meshes = mesh_at({{0, 0, 2800}, {10, 0, 2800}, {0, 10, 2800}});
  const geometry::Geodetic at = reproject_to_local({"EPSG:32717+5773", {776000, 9974000, 0}, "test"}, meshes).origin();
  const double truth = geometry::ellipsoidal_from_orthometric(at.latitude_deg, at.longitude_deg, {2800}).m;
  EXPECT_NEAR(at.height.m, truth, 0.05);
  EXPECT_GT(std::abs(truth - 2800), 5);
}

TEST(Georeference, AnEastNorthUpFrameIsTakenAsItIs) {
  auto meshes = mesh_at({{1, 2, 3}});
  const geometry::LocalFrame frame = reproject_to_local({"ENU:50.5,14.25", {100, 0, 0}, "test"}, meshes);
  EXPECT_EQ(meshes[0].mesh.vertices[0], Vec3(101, 2, 3));
  EXPECT_EQ(frame.origin().latitude_deg, 50.5);
  EXPECT_EQ(frame.origin().longitude_deg, 14.25);
}

TEST(Georeference, WhatIsNoPlaceIsRefused) {
  auto meshes = mesh_at({{1, 2, 3}});
  EXPECT_THAT(
      [&] {
        reproject_to_local({"EPSG:1", {}, "test"}, meshes);
      },
      ThrowsMessage<InputError>(HasSubstr("'EPSG:1' is not a coordinate reference system known to PROJ")));
  EXPECT_THAT(
      [&] {
        reproject_to_local({"my map", {}, "test"}, meshes);
      },
      ThrowsMessage<InputError>(HasSubstr("'my map' is not a coordinate reference system known to PROJ")));
  EXPECT_THAT(
      [&] {
        reproject_to_local({"ENU:here", {}, "test"}, meshes);
      },
      ThrowsMessage<InputError>(HasSubstr("'ENU:here' is not of the form ENU:LAT,LON")));
  EXPECT_THAT(
      [&] {
        reproject_to_local({"EPSG:32717", {1e12, 1e12, 0}, "test"}, meshes);
      },
      ThrowsMessage<InputError>(HasSubstr("lie outside EPSG:32717")));
}

}  // namespace
}  // namespace tileflight::tile_writer::georeference_test
