// `extract --region`: polygons of a GeoJSON file, from the command line to the voxels.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "tests/run_program.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::region_command_test {
namespace {

using geometry::Vec3;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;

const geometry::Geodetic kOrigin{50.5, 14.25, {300}};
constexpr double kHeight_m = 0.5;

/// An upright rectangle, metres east and north of the origin.
struct Rectangle {
  double west, south, east, north;
  bool holds(double x, double y) const { return x >= west && x <= east && y >= south && y <= north; }
};

json ring(const Rectangle& r) {
  const geometry::LocalFrame frame(kOrigin);
  json out = json::array();
  for (const auto& [x, y] : {std::pair(r.west, r.south), std::pair(r.east, r.south), std::pair(r.east, r.north),
                             std::pair(r.west, r.north), std::pair(r.west, r.south)}) {
    const geometry::Geodetic corner = frame.geodetic_from_local(Vec3(x, y, 0));
    out.push_back(json::array({corner.longitude_deg, corner.latitude_deg}));
  }
  return out;
}

/// A level square of 200 m in pieces of 10 m, tiled and put on earth.
class RegionFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    std::ofstream obj(folder_ / "ground.obj");
    for (int j = 0; j <= 20; ++j)
      for (int i = 0; i <= 20; ++i) obj << "v " << 10 * i - 100 << " " << 10 * j - 100 << " " << kHeight_m << "\n";
    for (int j = 0; j < 20; ++j)
      for (int i = 1; i <= 20; ++i) {
        const int a = 21 * j + i;
        obj << "f " << a << " " << a + 1 << " " << a + 22 << " " << a + 21 << "\n";
      }
    obj.close();
    const ProgramResult tiled = run_tileflight({"tile", (folder_ / "ground.obj").string(), "--out", place(),
                                                "--georeference", "50.5,14.25,300", "--tile-triangles", "100"});
    ASSERT_EQ(tiled.exit_code, 0) << tiled.err;
  }

  std::string place() const { return (folder_ / "place").string(); }

  std::string write(const std::string& name, const json& geojson) const {
    std::ofstream(folder_ / name) << geojson.dump();
    return (folder_ / name).string();
  }

  ProgramResult extract(const std::vector<std::string>& files) const {
    std::vector<std::string> call{"extract",  place(),          "--out", (folder_ / "truth").string(),
                                  "--origin", "50.5,14.25,300", "--json"};
    for (const std::string& file : files) call.insert(call.end(), {"--region", file});
    return run_tileflight(call);
  }

  void expect_refused(const std::string& file, const ::testing::Matcher<std::string>& matcher) const {
    const ProgramResult result = extract({file});
    EXPECT_EQ(result.exit_code, 1) << file;
    EXPECT_THAT(result.err, matcher);
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "truth"));
  }

  tests::TemporaryFolder folder_;
};

/// The centres of the occupied cells, east and north.
std::set<std::pair<double, double>> cells_of(const std::filesystem::path& ply) {
  std::set<std::pair<double, double>> out;
  for (const Vec3& at : geometry::read_cloud(ply).positions) out.emplace(at.x(), at.y());
  return out;
}

/// All cells of 1 m of the square whose centres are wanted, and no others. Edges that are straight in degrees are not
/// quite so in metres: centres within 5 mm of one may go either way.
template <class Holds>
void expect_cells_are_those_of(const std::set<std::pair<double, double>>& cells, const Holds& wanted) {
  ASSERT_FALSE(cells.empty());
  constexpr double kEdge_m = 0.005;
  const auto is_near_edge = [&](double x, double y) {
    return wanted(x - kEdge_m, y) != wanted(x + kEdge_m, y) || wanted(x, y - kEdge_m) != wanted(x, y + kEdge_m);
  };
  const auto is_there = [&](double x, double y) {
    const auto near = cells.lower_bound({x - 1e-3, y - 1e-3});
    for (auto it = near; it != cells.end() && it->first < x + 1e-3; ++it)
      if (std::abs(it->second - y) < 1e-3) return true;
    return false;
  };
  const double first_x = cells.begin()->first, first_y = cells.begin()->second;
  std::size_t there = 0;
  for (double x = first_x - std::floor(first_x + 99); x < 100; x += 1) {
    for (double y = first_y - std::floor(first_y + 99); y < 100; y += 1) {
      there += is_there(x, y) ? 1 : 0;
      if (is_near_edge(x, y)) continue;
      EXPECT_EQ(is_there(x, y), wanted(x, y)) << x << " " << y;
    }
  }
  EXPECT_EQ(there, cells.size());
}

TEST_F(RegionFiles, CellsAreThoseOfThePolygonsAndTheirHoles) {
  const Rectangle field{-31.3, -12.2, 44.4, 25.7}, hole{-10.4, 0.4, 9.6, 12.8}, yard{60.1, -80.2, 72.7, -70.9};
  const std::string first =
      write("field.geojson", {{"type", "Polygon"}, {"coordinates", json::array({ring(field), ring(hole)})}});
  const json feature = {{"type", "Feature"},
                        {"properties", json::object()},
                        {"geometry", {{"type", "Polygon"}, {"coordinates", json::array({ring(yard)})}}}};
  const std::string second =
      write("yard.geojson", {{"type", "FeatureCollection"}, {"features", json::array({feature})}});
  const ProgramResult result = extract({first, second});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json out = json::parse(result.out);
  EXPECT_TRUE(out["complete"].get<bool>());
  const auto cells = cells_of(folder_ / "truth/voxels.ply");
  EXPECT_EQ(cells.size(), out["voxels_occupied"].get<std::size_t>());
  expect_cells_are_those_of(
      cells, [&](double x, double y) { return (field.holds(x, y) && !hole.holds(x, y)) || yard.holds(x, y); });
}

TEST_F(RegionFiles, UnusableFilesAreOneLine) {
  expect_refused((folder_ / "none.geojson").string(), HasSubstr("none.geojson"));
  expect_refused(write("empty.geojson", {{"type", "FeatureCollection"}, {"features", json::array()}}),
                 AllOf(HasSubstr("empty.geojson"), HasSubstr("no Polygon")));
  expect_refused(write("point.geojson", {{"type", "Point"}, {"coordinates", {14.25, 50.5}}}), HasSubstr("no Polygon"));
  expect_refused(
      write("far.geojson", {{"type", "Polygon"}, {"coordinates", json::array({ring({5000, 5000, 5100, 5100})})}}),
      HasSubstr("no tile"));
}

}  // namespace
}  // namespace tileflight::region_command_test
