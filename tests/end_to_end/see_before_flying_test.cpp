// What is looked at before anything is flown: the place from above, ground heights, a flight's preview; and what render
// and extract say of a camera in a wall and of voxels that are too coarse.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/run_program.h"
#include "tests/tiny_place.h"
#include "tileflight/capture/recording/flight_faults.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"

namespace tileflight::see_before_flying_test {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

const geometry::Geodetic kOrigin{50.5, 14.25, {300}};

/// Triangles for an OBJ file.
class ObjShapes {
 public:
  void quad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    for (const Vec3& v : {a, b, c, d}) text_ << "v " << v.x() << " " << v.y() << " " << v.z() << "\n";
    text_ << "f " << count_ + 1 << " " << count_ + 2 << " " << count_ + 3 << " " << count_ + 4 << "\n";
    count_ += 4;
  }
  /// Level ground in pieces of 10 m.
  void ground(int half) {
    for (int x = -half; x < half; x += 10)
      for (int y = -half; y < half; y += 10)
        quad(Vec3(x, y, 0), Vec3(x + 10, y, 0), Vec3(x + 10, y + 10, 0), Vec3(x, y + 10, 0));
  }
  /// Its fronts outwards.
  void box(const Vec3& l, const Vec3& h) {
    quad({l.x(), l.y(), h.z()}, {h.x(), l.y(), h.z()}, h, {l.x(), h.y(), h.z()});
    quad(l, {l.x(), h.y(), l.z()}, {h.x(), h.y(), l.z()}, {h.x(), l.y(), l.z()});
    quad(l, {h.x(), l.y(), l.z()}, {h.x(), l.y(), h.z()}, {l.x(), l.y(), h.z()});
    quad({h.x(), h.y(), l.z()}, {l.x(), h.y(), l.z()}, {l.x(), h.y(), h.z()}, h);
    quad({l.x(), h.y(), l.z()}, l, {l.x(), l.y(), h.z()}, {l.x(), h.y(), h.z()});
    quad({h.x(), l.y(), l.z()}, {h.x(), h.y(), l.z()}, h, {h.x(), l.y(), h.z()});
  }
  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
  int count_ = 0;
};

/// Level ground of 200 m with a bridge (its deck from 6 to 7 m) and a house, on earth.
class BridgeAndHouse : public ::testing::Test {
 protected:
  void SetUp() override {
    ObjShapes shapes;
    shapes.ground(100);
    shapes.box({-60, -4, 6}, {60, 4, 7});
    shapes.box({30, 30, 0}, {50, 50, 12});
    TinyPlace::write_file(folder_ / "place.obj", shapes.text());
    const ProgramResult tiled =
        run_tileflight({"tile", (folder_ / "place.obj").string(), "--out", place(), "--georeference", "50.5,14.25,300",
                        "--tile-triangles", "100", "--copyright", "Nobody, CC0"});
    ASSERT_EQ(tiled.exit_code, 0) << tiled.err;
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
  }

  std::string place() const { return (folder_ / "place").string(); }

  json inspect(std::vector<std::string> more) const {
    more.insert(more.begin(), {"inspect", place(), "--json"});
    const ProgramResult result = run_tileflight(more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return json::parse(result.out, nullptr, false);
  }

  /// Runs preview or render over the same waypoints and returns its JSON.
  json flown(const std::string& command, const std::string& flight, std::vector<std::string> more = {}) const {
    TinyPlace::write_file(folder_ / "flight.yaml", "camera: camera.yaml\nfps: 4\nspeed_m_s: 4\n" + flight);
    std::vector<std::string> call{command,    place(),
                                  "--flight", (folder_ / "flight.yaml").string(),
                                  "--out",    (folder_ / command).string(),
                                  "--origin", "50.5,14.25,300",
                                  "--force",  "--json"};
    call.insert(call.end(), more.begin(), more.end());
    const ProgramResult result = run_tileflight(call);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return json::parse(result.out, nullptr, false);
  }

  tests::TemporaryFolder folder_;
};

constexpr const char* kThroughTheHouse = R"(waypoints:
  - {position: [40, 10, 6], yaw_deg: 0, pitch_deg: -10}
  - {position: [40, 70, 6], yaw_deg: 0, pitch_deg: -10}
)";
constexpr const char* kOverAll = R"(waypoints:
  - {position: [-30, -40, 30], yaw_deg: 0, pitch_deg: -60}
  - {position: [-30, 40, 30], yaw_deg: 0, pitch_deg: -60}
)";

TEST_F(BridgeAndHouse, HeightsAtPointsAreThoseOfTheMesh) {
  const geometry::LocalFrame frame(kOrigin);
  const auto at = [&](double east, double north) {
    const geometry::Geodetic place = frame.geodetic_from_local({east, north, 0});
    char text[64];
    std::snprintf(text, sizeof text, "%.10f,%.10f", place.latitude_deg, place.longitude_deg);
    return std::string(text);
  };
  const json points =
      inspect({"--at", at(-80, 71), "--at", at(10.3, 1.2), "--at", at(41, 44), "--at", at(150, 0)})["points"];
  ASSERT_EQ(points.size(), 4U);
  // The plane of the frame leaves the ellipsoid by a millimetre over 100 m.
  EXPECT_NEAR(points[0]["highest"]["height"].get<double>(), 300, 2e-3);
  EXPECT_EQ(points[0]["surfaces"].size(), 1U);
  EXPECT_NEAR(points[1]["highest"]["height"].get<double>(), 307, 2e-3);
  EXPECT_NEAR(points[1]["lowest"]["height"].get<double>(), 300, 2e-3);
  EXPECT_EQ(points[1]["surfaces"].size(), 3U) << "deck above, deck below, ground";
  EXPECT_NEAR(points[2]["highest"]["height"].get<double>(), 312, 2e-3);
  EXPECT_NEAR(points[2]["highest"]["height_above_sea_level"].get<double>(),
              geometry::orthometric_from_ellipsoidal({50.5, 14.25, {312}}).m, 0.01);
  EXPECT_TRUE(points[3]["highest"].is_null());
}

TEST_F(BridgeAndHouse, TheLocalFrameIsTheOneThatIsAskedFor) {
  const json points = inspect({"--at-local", "10,0", "--at-local", "-70,0", "--origin", "50.5,14.25,290"})["points"];
  EXPECT_NEAR(points[0]["highest"]["local_z"].get<double>(), 17, 1e-3);
  EXPECT_NEAR(points[0]["highest"]["height"].get<double>(), 307, 1e-3);
  EXPECT_NEAR(points[1]["highest"]["local_z"].get<double>(), 10, 1e-3);
}

TEST_F(BridgeAndHouse, TheMapShowsThePlaceAndProposesARegion) {
  const std::string picture = (folder_ / "map.png").string();
  const json found = inspect({"--map", picture, "--pixels", "400"});
  EXPECT_EQ(found["tiles_with_content"].is_number(), true) << "beside what the tileset holds";
  EXPECT_NEAR(found["map"]["surface"]["max"][0].get<double>() - found["map"]["surface"]["min"][0].get<double>(), 200,
              1.5);
  EXPECT_TRUE(found["georeferenced"].get<bool>());
  const json& frame = found["frame"];
  const double low = frame["origin_height"].get<double>() + found["map"]["surface"]["min"][2].get<double>();
  EXPECT_NEAR(low, 300, 0.05);
  EXPECT_EQ(found["proposal"]["voxel_size"], 1.0);
  EXPECT_THAT(found["attribution"], Contains("Nobody, CC0"));
  const imaging::RgbImage image = imaging::read_rgb(picture);
  EXPECT_GT(image.width, 800);

  // The proposal is what extract takes.
  std::istringstream words(found["proposal"]["options"].get<std::string>());
  std::vector<std::string> call{"extract", place(), "--json", "--out", (folder_ / "truth").string()};
  for (std::string word; words >> word;) call.push_back(word);
  const ProgramResult extracted = run_tileflight(call);
  ASSERT_EQ(extracted.exit_code, 0) << extracted.err;
  EXPECT_TRUE(json::parse(extracted.out)["warnings"].empty()) << extracted.out;
  EXPECT_GT(json::parse(extracted.out)["voxels_occupied"].get<int>(), 30000);
}

TEST_F(BridgeAndHouse, SameMapForAnyNumberOfThreads) {
  const std::string one = (folder_ / "one.png").string(), four = (folder_ / "four.png").string();
  inspect({"--map", one, "--pixels", "300", "--threads", "1"});
  inspect({"--map", four, "--pixels", "300", "--threads", "4"});
  EXPECT_EQ(file_text(one), file_text(four));
}

TEST_F(BridgeAndHouse, CoarseVoxelsAreSaid) {
  const auto warnings = [&](const std::string& voxel) {
    const ProgramResult result =
        run_tileflight({"extract", place(), "--center", "50.50035,14.25055,306", "--size", "24,24,20", "--voxel", voxel,
                        "--out", (folder_ / "truth").string(), "--force", "--json"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return json::parse(result.out)["warnings"].dump();
  };
  EXPECT_THAT(warnings("1"), AllOf(HasSubstr("voxels of 1 m are coarse"), HasSubstr("use --voxel 0.1")));
  EXPECT_THAT(warnings("0.1"), Not(HasSubstr("coarse")));
}

TEST_F(BridgeAndHouse, APreviewHasItsFilesAndNothingAgainstAGoodFlight) {
  const json found = flown("preview", kOverAll);
  for (const char* file :
       {"map.png", "profile.png", "profile.csv", "first.jpg", "middle.jpg", "last.jpg", "preview.json"})
    EXPECT_TRUE(fs::file_size(folder_ / "preview" / file) > 100) << file;
  EXPECT_EQ(json::parse(file_text(folder_ / "preview/preview.json")), found);
  ASSERT_EQ(found["warnings"].size(), 1U) << found["warnings"];
  EXPECT_THAT(found["warnings"][0].get<std::string>(), HasSubstr("the place has no textures"));
  EXPECT_EQ(found["frames"], tests::line_count(file_text(folder_ / "preview/profile.csv")) - 1);
  EXPECT_NEAR(found["path_length"].get<double>(), 80, 1);
  EXPECT_NEAR(found["height_above_ground"]["max"].get<double>(), 30, 0.01);
  EXPECT_NEAR(found["height_above_ground"]["min"].get<double>(), 23, 0.01) << "over the bridge";
  EXPECT_NEAR(found["nearest_surface"]["distance"].get<double>(), 23, 0.01);
  EXPECT_EQ(found["cost"]["pixels"].get<double>(), 320.0 * 240 * found["frames"].get<int>());
  EXPECT_GT(found["cost"]["tiles"].get<int>(), 1);
  EXPECT_GT(found["cost"]["bytes"].get<int>(), 1000);
  EXPECT_GT(found["cost"]["seconds"]["total"].get<double>(), 0);
  EXPECT_EQ(found["pictures"][2]["frame"], found["frames"].get<int>() - 1);
}

TEST_F(BridgeAndHouse, PreviewsPicturesAreThoseOfTheRender) {
  flown("preview", kOverAll);
  flown("render", kOverAll, {"--png"});
  const imaging::RgbImage preview = imaging::read_rgb(folder_ / "preview/first.jpg");
  const imaging::RgbImage render = imaging::read_rgb(folder_ / "render/images/000000.png");
  ASSERT_EQ(preview.width, render.width) << "small pictures are as they are";
  double sum = 0;
  for (std::size_t i = 0; i < render.pixels.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) sum += std::abs(preview.pixels[i][c] - render.pixels[i][c]);
  EXPECT_LT(sum / (3.0 * static_cast<double>(render.pixels.size())), 2.5) << "but for JPEG";
}

TEST_F(BridgeAndHouse, AFlightThroughAHouseIsSaidByPreviewAndRenderAndInTheDataset) {
  const json preview = flown("preview", kThroughTheHouse);
  const json render = flown("render", kThroughTheHouse);
  for (const char* key : {"camera_inside_surface", "path_through_surface"}) {
    EXPECT_TRUE(preview["faults"].contains(key)) << preview["faults"];
  }
  EXPECT_THAT(preview["warnings"].dump(),
              AllOf(HasSubstr("inside or under a surface"), HasSubstr("goes through a surface")));
  EXPECT_THAT(render["warnings"].dump(),
              AllOf(HasSubstr("inside or under a surface"), HasSubstr("goes through a surface")));

  const auto about = dataset::read_dataset(folder_ / "render").metadata;
  const auto faults = recording::faults_from_metadata(about);
  const auto frames = [&](const std::string& key) {
    for (const render::FlightFault& fault : faults)
      if (fault.key == key) return fault.frames;
    return std::vector<std::size_t>();
  };
  EXPECT_EQ(json(frames("camera_inside_surface")), preview["faults"]["camera_inside_surface"]);
  EXPECT_EQ(json(frames("path_through_surface")), preview["faults"]["path_through_surface"]);
  // Between 30 and 50 m north the camera is in the house.
  const auto truth = geometry::read_tum(folder_ / "render/groundtruth.txt");
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double north = truth.poses[i].T_local_camera.translation.y();
    const auto inside = frames("camera_inside_surface");
    EXPECT_EQ(std::ranges::count(inside, i) > 0, north > 30 && north < 50) << north;
  }
  EXPECT_EQ(frames("path_through_surface").size(), 2U) << "in by one wall and out by the other";
}

TEST_F(BridgeAndHouse, AFlightWithoutFaultsSaysNoneInItsDataset) {
  flown("render", kOverAll);
  EXPECT_TRUE(recording::faults_from_metadata(dataset::read_dataset(folder_ / "render").metadata).empty());
  EXPECT_THAT(file_text(folder_ / "render/dataset.yaml"), Not(HasSubstr("warnings")));
}

TEST_F(BridgeAndHouse, AFlightFarAwayIsSaidToBe) {
  const json found = flown("preview", R"(waypoints:
  - {position: [4000, -40, 30], yaw_deg: 0, pitch_deg: -60}
  - {position: [4000, 40, 30], yaw_deg: 0, pitch_deg: -60}
)");
  EXPECT_THAT(found["warnings"][0].get<std::string>(),
              AllOf(HasSubstr("stays at least 3900 m away from the place"), HasSubstr("--origin")));
  EXPECT_THAT(found["warnings"].dump(), HasSubstr("no surface is in view"));
  EXPECT_TRUE(found["height_above_ground"].is_null());
}

TEST_F(BridgeAndHouse, AMissingTileIsSaidAndThePreviewGoesOn) {
  std::vector<fs::path> glbs;
  for (const auto& entry : fs::recursive_directory_iterator(place())) {
    if (entry.path().extension() == ".glb") glbs.push_back(entry.path());
  }
  ASSERT_GT(glbs.size(), 2U);
  for (const fs::path& glb : glbs) TinyPlace::write_file(glb, "no tile");
  const json found = flown("preview", kOverAll);
  EXPECT_THAT(found["warnings"].dump(), AllOf(HasSubstr("missing or broken"), HasSubstr("--allow-incomplete")));
}

TEST_F(BridgeAndHouse, OptionsThatAreOfNoUseTogetherAreRefused) {
  const auto refused = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"inspect", place(), "--quiet"});
    const ProgramResult result = run_tileflight(more);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    return result.err;
  };
  EXPECT_THAT(refused({"--error", "3"}), HasSubstr("--error: needs a map: add --map"));
  EXPECT_THAT(refused({"--origin", "1,2,3"}), HasSubstr("--origin"));
  EXPECT_THAT(refused({"--at", "95,3"}), HasSubstr("--at 95,3: is not a valid position"));
  EXPECT_THAT(refused({"--map", (folder_ / "place.obj").string()}), HasSubstr(".png or .jpg"));
  EXPECT_THAT(refused({"--map", (folder_ / "none/at/all/map.png").string()}), HasSubstr("map.png"));
}

/// A place that is not on earth, and holds nothing.
TEST(EmptyPlace, HasNoMap) {
  const tests::TemporaryFolder folder;
  TinyPlace::write(folder / "place");
  json tileset = TinyPlace::tileset();
  tileset["root"].erase("content");
  tileset["root"].erase("children");
  TinyPlace::write_file(folder / "place/tileset.json", tileset.dump());
  const ProgramResult result =
      run_tileflight({"inspect", (folder / "place").string(), "--map", (folder / "map.png").string()});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("there is nothing to show"));
  EXPECT_FALSE(fs::exists(folder / "map.png"));
}

/// A tileset of a whole globe has no map until a region is named.
TEST(EmptyPlace, AGlobeHasNoMap) {
  const tests::TemporaryFolder folder;
  TinyPlace::write(folder / "place");
  json tileset = TinyPlace::tileset();
  tileset["root"]["boundingVolume"] = {{"region", {-3.14, -1.57, 3.14, 1.57, -100, 9000}}};
  TinyPlace::write_file(folder / "place/tileset.json", tileset.dump());
  const ProgramResult result =
      run_tileflight({"inspect", (folder / "place").string(), "--map", (folder / "map.png").string()});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("give --center and --size"));
}

}  // namespace
}  // namespace tileflight::see_before_flying_test
