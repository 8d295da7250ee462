#include "tileflight/capture/ingest/takeoff_height.h"

#include <gmock/gmock.h>

#include <fstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/world/place/extract.h"
#include "tileflight/tiles/mesh_files/mesh_source.h"
#include "tileflight/tiles/tile_writer/mesh_tileset.h"

namespace tileflight::ingest::takeoff_height_test {
namespace {

using ::testing::HasSubstr;

const geometry::Geodetic kOrigin{47.0, 8.5, {400.0}};

/// A slope of 1 in 10 eastwards, at x = 0 5 m above the origin, with a roof of 1 m x 1 m 4 m above it at x = 10.
class TakeoffAnchor : public testing::Test {
 protected:
  void SetUp() override {
    std::ofstream(folder_ / "slope.obj") << "v -50 -50 0\nv 50 -50 10\nv 50 50 10\nv -50 50 0\nf 1 2 3 4\n"
                                         << "v 9.5 -0.5 10\nv 10.5 -0.5 10\nv 10.5 0.5 10\nv 9.5 0.5 10\nf 5 6 7 8\n";
    mesh_files::MeshSource source = mesh_files::read_mesh_source(folder_ / "slope.obj", {});
    tile_writer::MeshTilesetOptions options;
    options.T_ecef_local = geometry::LocalFrame(kOrigin).T_ecef_local();
    tile_writer::write_mesh_tileset(folder_ / "place", std::move(source.meshes), options);
    place::ExtractSettings settings;
    settings.source = (folder_ / "place").string();
    settings.load.origin = kOrigin;
    place::extract(settings, folder_ / "truth", false);
  }

  /// A log whose first position is `east_m`, `north_m` of the origin, `above_m` above take-off.
  flight_logs::Telemetry log_at(double east_m, double north_m, double above_m) const {
    const geometry::Geodetic at = geometry::LocalFrame(kOrigin).geodetic_from_local({east_m, north_m, 0});
    flight_logs::Telemetry log;
    log.fixes.resize(2);
    log.fixes[0].latitude_deg = log.fixes[1].latitude_deg = at.latitude_deg;
    log.fixes[0].longitude_deg = log.fixes[1].longitude_deg = at.longitude_deg;
    log.fixes[0].height_above_takeoff_m = above_m;
    log.fixes[1].height_above_takeoff_m = 30.0;
    log.fixes[1].time_s = 10;
    return log;
  }
  double height(const flight_logs::Telemetry& log) const {
    return estimate_takeoff_height(log, "log.srt", folder_ / "truth").m;
  }

  tests::TemporaryFolder folder_;
};

TEST_F(TakeoffAnchor, IsTheSurfacesHeightWhereTheLogIsOnTheGround) {
  EXPECT_NEAR(height(log_at(0, 0, 0)), 405.0, 0.02);
  EXPECT_NEAR(height(log_at(20, -10, 0)), 407.0, 0.02);
  EXPECT_NEAR(height(log_at(20, -10, 1.5)), 405.5, 0.02) << "the zero lies 1.5 m below";
  EXPECT_NEAR(height(log_at(10, 0, 0)), 406.0, 0.02) << "what stands over one vertical does not count";
}

TEST_F(TakeoffAnchor, WhatDoesNotSayTheHeightIsRefused) {
  EXPECT_THAT(tests::refusal_of([&] { height(log_at(0, 0, 12)); }), HasSubstr("within 2 m"));
  EXPECT_THAT(tests::refusal_of([&] { height(log_at(500, 0, 0)); }), HasSubstr("outside the ground truth"));
}

}  // namespace
}  // namespace tileflight::ingest::takeoff_height_test
