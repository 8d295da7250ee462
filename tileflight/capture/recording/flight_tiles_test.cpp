// Selection and loading of a flight's tiles, against the selection of single groups and frames.
#include "tileflight/capture/recording/flight_tiles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/tiny_city.h"
#include "tests/tiny_place.h"
#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/recording/content_memory.h"
#include "tileflight/capture/recording/part_loader.h"
#include "tileflight/capture/render/appearance.h"
#include "tileflight/core/base/files.h"

namespace tileflight::recording::flight_tiles_test {
namespace {

namespace fs = std::filesystem;
using geometry::SE3;
using geometry::Vec3;
using testing::HasSubstr;

constexpr std::uintmax_t kPlenty = std::uintmax_t{1} << 30;

/// Eastwards over the city and back, 40 degrees down.
geometry::Trajectory poses() {
  const Eigen::Quaterniond R =
      geometry::so3_exp(Vec3(0, 0, -M_PI / 2)) * geometry::so3_exp(Vec3(-M_PI * 130 / 180, 0, 0));
  geometry::Trajectory frames;
  for (int i = 0; i <= 24; ++i) frames.poses.push_back({0.5 * i, SE3(R, Vec3(-500 + 40 * i, -200 + 5 * i, 150))});
  for (int i = 0; i <= 12; ++i) frames.poses.push_back({13 + 0.5 * i, SE3(R, Vec3(460 - 80 * i, -80 - 10 * i, 150))});
  return frames;
}

class FlightTilesTest : public testing::Test {
 protected:
  FlightTilesTest() {
    tests::TinyCity::write(folder_ / "place");
    mission_.calibration.camera = imaging::make_fisheye(320, 240, 120.0);
    mission_.frames = poses();
    const flight_path::Path path = flight_path::path_through_poses(mission_.frames);
    mission_.pose_at = [path](double time_s) { return path.pose(time_s); };
    mission_.sensor_recorder = std::make_shared<SensorRecorder>(sensors::SensorSuite{}, path, mission_.frames);
    settings_.source = (folder_ / "place/tileset.json").string();
    settings_.error_px = 1.0;
  }

  FlightTiles open() const { return {mission_, settings_, {}}; }
  /// All tiles have as many triangles.
  std::uintmax_t tile_bytes() const { return memory_of(open().read({0})[0].meshes).rendered_bytes; }
  /// Memory of so many tiles.
  std::uintmax_t limit(double count) const {
    return static_cast<std::uintmax_t>(static_cast<double>(tile_bytes()) * count);
  }
  std::vector<std::size_t> all_frames() const {
    std::vector<std::size_t> frames(mission_.frames.size());
    for (std::size_t i = 0; i < frames.size(); ++i) frames[i] = i;
    return frames;
  }
  /// The cut of the group, as seen by all its frames or refined for them and seen by one.
  tileset::TileCut cut_of(const std::vector<std::size_t>& group, std::optional<std::size_t> frame = {}) const {
    const auto source = fetch::open_source(settings_.source);
    tileset::TilesetTree tree(*source);
    const std::vector<tileset::ViewCone> all = flight_view_cones(mission_);
    std::vector<tileset::ViewCone> cones;
    tileset::ViewConeRange part;
    for (const std::size_t i : group) {
      if (i == frame) part = {cones.size(), cones.size() + 1};
      cones.push_back(all[i]);
    }
    return tileset::select_cut(tree, tileset::flight_criterion(cones, SE3(), 1.0, part));
  }
  static std::vector<std::string> names(const tileset::TileCut& cut) {
    std::vector<std::string> names;
    for (const tileset::CutContent& content : cut.contents) names.push_back(content.identity);
    return names;
  }

  tests::TemporaryFolder folder_;
  PlannedFlight mission_;
  RenderSettings settings_;
};

TEST_F(FlightTilesTest, EachGroupHasItsOwnCutAndAFrameAllThatItShows) {
  const FlightTiles tiles = open();
  ASSERT_GE(tiles.groups().count(), 4U);
  std::set<std::string> different_cuts;
  bool some_see_less = false;
  for (std::size_t group = 0; group < tiles.groups().count(); ++group) {
    std::vector<std::string> own;
    for (const std::size_t content : tiles.contents_of_group(group)) own.push_back(tiles.content(content).identity);
    const tileset::TileCut cut = cut_of(tiles.groups().frames[group]);
    EXPECT_EQ(own, names(cut));
    different_cuts.insert(cut.hash);
    for (const std::size_t frame : tiles.groups().frames[group]) {
      std::set<std::string> for_frame;
      for (const std::size_t place : tiles.places_for_frame(frame)) for_frame.insert(own[place]);
      for (const std::string& name : names(cut_of(tiles.groups().frames[group], frame)))
        EXPECT_TRUE(for_frame.contains(name)) << frame << " lacks " << name;
      some_see_less = some_see_less || for_frame.size() < own.size();
    }
  }
  EXPECT_EQ(different_cuts.size(), tiles.groups().count());
  EXPECT_TRUE(some_see_less);
}

TEST_F(FlightTilesTest, ASmallFlightHasTheCutOfAllItsFrames) {
  mission_.frames.poses.resize(8);
  const FlightTiles tiles = open();
  ASSERT_EQ(tiles.groups().count(), 1U);
  EXPECT_EQ(tiles.cut_hash(), cut_of(tiles.groups().frames[0]).hash);
}

TEST_F(FlightTilesTest, RecordsOfSeveralProcessesGiveTheSummaryOfOne) {
  FlightTiles whole = open(), first = open(), second = open();
  std::vector<std::size_t> some, others;
  for (std::size_t i = 0; i < whole.content_count(); ++i) (i % 3 == 0 ? some : others).push_back(i);
  whole.read_rest();
  first.read(some);
  second.read(others);
  first.add_records(second.take_new_records());
  EXPECT_TRUE(second.take_new_records().is_null());
  const tileset::LoadedTiles one = whole.summary(), two = first.summary();
  EXPECT_EQ(one.triangles, two.triangles);
  EXPECT_EQ(one.tiles_loaded, static_cast<std::int64_t>(whole.content_count()));
  EXPECT_EQ(one.tiles_loaded, two.tiles_loaded);
  EXPECT_EQ(one.attribution, two.attribution);
  EXPECT_EQ(one.cut_hash, two.cut_hash);
}

TEST_F(FlightTilesTest, PartsCoverTheFlightWithinMemory) {
  std::size_t whole_parts = 0, most_tiles = 0;
  const FlightTiles all = open();
  for (const std::size_t frame : all_frames()) most_tiles = std::max(most_tiles, all.places_for_frame(frame).size());
  for (const std::uintmax_t limit : {kPlenty, (most_tiles + 8) * tile_bytes(), (most_tiles + 1) * tile_bytes()}) {
    FlightTiles tiles = open();
    PartLoader loader(tiles, all_frames(), limit);
    std::size_t next = 0, parts = 0;
    while (next < loader.images().size()) {
      FlightPart part = loader.load(next);
      ASSERT_EQ(part.begin, next);
      ASSERT_GT(part.end, part.begin);
      const std::size_t group = tiles.groups().group_of_frame[part.begin];
      std::set<std::size_t> places;
      for (std::size_t frame = part.begin; frame < part.end; ++frame) {
        EXPECT_EQ(tiles.groups().group_of_frame[frame], group);
        for (const std::size_t place : tiles.places_for_frame(frame)) places.insert(place);
      }
      ASSERT_EQ(part.meshes.size(), places.size()) << "one mesh a tile";
      std::uintmax_t bytes = 0;
      auto mesh = part.meshes.begin();
      for (const std::size_t place : places) {
        const auto expected = tiles.read({tiles.contents_of_group(group)[place]});
        EXPECT_EQ(mesh->mesh.vertices, expected[0].meshes[0].mesh.vertices);
        bytes += render::rendered_bytes(*mesh++);
      }
      EXPECT_LE(bytes, limit);
      loader.prefetch(part.end);
      loader.take_back(std::move(part.meshes));
      next = part.end;
      ++parts;
    }
    if (limit == kPlenty) whole_parts = parts;
    EXPECT_EQ(parts > whole_parts, limit != kPlenty);
  }
}

TEST_F(FlightTilesTest, WhatIsInMemoryIsNotReadAgain) {
  FlightTiles tiles = open();
  PartLoader loader(tiles, all_frames(), kPlenty);
  std::size_t removed = 0;
  for (std::size_t next = 0; next < loader.images().size();) {
    FlightPart part = loader.load(next);
    for (std::size_t frame = part.begin; frame < part.end; ++frame) {
      const std::size_t group = tiles.groups().group_of_frame[frame];
      for (const std::size_t place : tiles.places_for_frame(frame)) {
        const std::string uri = tiles.content(tiles.contents_of_group(group)[place]).uri;
        removed += fs::remove(folder_ / "place" / fs::path(uri).filename()) ? 1 : 0;
      }
    }
    loader.take_back(std::move(part.meshes));
    next = part.end;
  }
  EXPECT_GT(removed, 30U);
}

TEST_F(FlightTilesTest, AFrameNeedsWhatItsRaysMeet) {
  FlightTiles tiles = open();
  const imaging::Camera& camera = mission_.calibration.camera;
  std::size_t hits = 0;
  for (const std::size_t frame : {std::size_t{3}, std::size_t{20}, std::size_t{30}}) {
    std::vector<imaging::TexturedMesh> meshes;  // one a tile: its number is the tile's place
    for (tileset::LoadedContent& content : tiles.read(tiles.contents_of_group(tiles.groups().group_of_frame[frame])))
      meshes.push_back(std::move(content.meshes.at(0)));
    const scene::Scene scene(std::move(meshes));
    const SE3& T_local_camera = mission_.frames.poses[frame].T_local_camera;
    const std::vector<std::size_t> places = tiles.places_for_frame(frame);
    EXPECT_LT(places.size(), tiles.content_count());
    for (int y = 0; y < camera.height(); y += 3) {
      for (int x = 0; x < camera.width(); x += 3) {
        const auto ray = camera.unproject({static_cast<double>(x), static_cast<double>(y)});
        if (!ray) continue;
        const auto hit = scene.intersect({T_local_camera.translation, T_local_camera.rotation * *ray});
        if (!hit) continue;
        ++hits;
        ASSERT_TRUE(std::ranges::binary_search(places, std::size_t{hit->mesh})) << frame << " " << x << " " << y;
      }
    }
  }
  EXPECT_GT(hits, 1000U);
}

TEST_F(FlightTilesTest, AFrameThatDoesNotFitIsRefused) {
  FlightTiles tiles = open();
  std::size_t most_tiles = 0;
  for (const std::size_t frame : all_frames()) most_tiles = std::max(most_tiles, tiles.places_for_frame(frame).size());
  const auto most = static_cast<double>(most_tiles);
  require_frames_fit(tiles, all_frames(), limit(most + 0.5), {});
  const std::string message =
      tests::refusal_of([&] { require_frames_fit(tiles, all_frames(), limit(most - 1.5), {}); });
  EXPECT_THAT(message, HasSubstr("the tiles of frame "));
  EXPECT_THAT(message, HasSubstr(" need about "));
  EXPECT_THAT(message, HasSubstr(" GB of memory: raise the limit (--memory "));
  EXPECT_THAT(message, HasSubstr("or request coarser tiles (--pixel-error "));
  PartLoader loader(tiles, all_frames(), limit(2));
  EXPECT_THAT(tests::refusal_of([&] { loader.load(0); }), HasSubstr("the tiles of frame 0 need "));
}

TEST_F(FlightTilesTest, LightNeedsTilesInAllDirections) {
  const std::size_t seen = open().places_for_frame(0).size();
  mission_.options.formation.light.emplace();
  FlightTiles tiles = open();
  EXPECT_GT(tiles.places_for_frame(0).size(), seen);
  EXPECT_THAT(tests::refusal_of([&] { require_frames_fit(tiles, all_frames(), limit(20), {}); }),
              HasSubstr("the tiles of frame "));
  require_frames_fit(tiles, all_frames(), limit(64), {});
}

/// Stated volumes are hints: what tiles hold beside them is found by the sample that is read first.
TEST_F(FlightTilesTest, TilesThatLieOutsideOfTheirVolumesAreShown) {
  const auto state_heights = [&](double middle_m) {
    nlohmann::json tileset = nlohmann::json::parse(base::read_text(folder_ / "place/tileset.json"));
    const std::function<void(nlohmann::json&)> move = [&](nlohmann::json& tile) {
      tile["boundingVolume"]["box"][2] = middle_m;
      if (tile.contains("children"))
        for (nlohmann::json& child : tile["children"]) move(child);
    };
    move(tileset["root"]);
    tests::TinyPlace::write_file(folder_ / "place/tileset.json", tileset.dump());
  };
  mission_.calibration.camera = imaging::make_pinhole(320, 240, 40.0);
  const FlightTiles right = open();
  std::set<std::string> wanted;
  for (const std::size_t frame : {std::size_t{0}, std::size_t{12}}) {
    const std::vector<std::size_t>& all = right.contents_of_group(right.groups().group_of_frame[frame]);
    for (const std::size_t place : right.places_for_frame(frame)) wanted.insert(right.content(all[place]).uri);
  }
  for (const double wrong_m : {400.0, -500.0}) {
    state_heights(wrong_m);
    const FlightTiles found = open();
    std::set<std::string> shown;
    for (const std::size_t frame : {std::size_t{0}, std::size_t{12}}) {
      const std::vector<std::size_t>& all = found.contents_of_group(found.groups().group_of_frame[frame]);
      for (const std::size_t place : found.places_for_frame(frame)) shown.insert(found.content(all[place]).uri);
    }
    for (const std::string& uri : wanted) {
      // Finer tiles may stand for it.
      const std::string name = uri.substr(0, uri.size() - 4);
      EXPECT_TRUE(std::ranges::any_of(shown, [&](const std::string& one) { return one.starts_with(name); })) << uri;
    }
  }
}

TEST(MemorySum, CountsATextureOfAFileOnce) {
  const ContentMemory content{10, 100, {{0, 3, 7}, {1, 5, 11}}};
  MemorySum sum;
  sum.add(content, 4, true);
  EXPECT_EQ(sum.bytes(), 100U + 7 + 11);
  sum.add(content, 4, false);
  EXPECT_EQ(sum.bytes(), 118U + 10);
  sum.add(content, 5, false);
  EXPECT_EQ(sum.bytes(), 128U + 10 + 3 + 5);
}

}  // namespace
}  // namespace tileflight::recording::flight_tiles_test
