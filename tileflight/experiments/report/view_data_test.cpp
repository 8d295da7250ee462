#include "tileflight/experiments/report/view_data.h"

#include <gmock/gmock.h>
#include <zlib.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <span>

#include "tests/temporary_folder.h"
#include "tests/web/synthetic_run.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/experiments/report/figures.h"
#include "tileflight/experiments/report/page_script.h"

namespace tileflight::report::view_data_test {
namespace {

using geometry::Vec3;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

/// Unpacks the output of view_data like the page does.
class Unpacked {
 public:
  explicit Unpacked(const std::string& packed) : bytes_(64U << 20, '\0') {
    uLongf size = bytes_.size();
    EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(bytes_.data()), &size, reinterpret_cast<const Bytef*>(packed.data()),
                         packed.size()),
              Z_OK);
    bytes_.resize(size);
    std::uint32_t length = 0;
    std::memcpy(&length, bytes_.data(), sizeof(length));
    header = json::parse(bytes_.substr(4, length));
    first_ = (4 + length + 3) / 4 * 4;
  }

  template <class Number>
  std::vector<Number> numbers(const json& block) const {
    std::vector<Number> out(block["bytes"].get<std::size_t>() / sizeof(Number));
    std::memcpy(out.data(), bytes_.data() + first_ + block["at"].get<std::size_t>(), out.size() * sizeof(Number));
    return out;
  }

  std::vector<Vec3> positions(const json& block) const {
    const auto steps = numbers<std::uint16_t>(block);
    std::vector<Vec3> out(steps.size() / 3);
    for (std::size_t i = 0; i < steps.size(); ++i) {
      const std::size_t axis = i % 3;
      out[i / 3][static_cast<int>(axis)] =
          block["low_m"][axis].get<double>() + steps[i] * block["step_m"][axis].get<double>();
    }
    return out;
  }

  json header;

 private:
  std::string bytes_;
  std::size_t first_ = 0;
};

class ViewDataTest : public testing::Test {
 protected:
  void SetUp() override { tests::SyntheticRun(run_, {.map_points = 3000}).write(); }

  static ViewBudget small() {
    ViewBudget budget;
    budget.place = {.max_triangles = 2000, .texture_px = 128};
    budget.frame_width_px = 64;
    return budget;
  }
  Unpacked unpacked(const ViewBudget& budget = small()) { return Unpacked(view_data(read_run_folder(run_), budget)); }

  tests::TemporaryFolder folder_;
  std::filesystem::path run_ = folder_ / "run";
};

TEST_F(ViewDataTest, MapPointsAndTheirErrorsAreThoseOfTheRun) {
  const RunFolder run = read_run_folder(run_);
  const Unpacked view = unpacked();
  const json& map = view.header["flights"][0]["map"];
  const std::vector<Vec3> positions = view.positions(map["positions"]);
  const auto surface_mm = view.numbers<std::uint16_t>(map["surface_mm"]);
  const geometry::PointCloud& errors = *run.flights[0].errors;
  ASSERT_EQ(positions.size(), errors.size());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    EXPECT_LT((positions[i] - errors.positions[i]).norm(), 0.01);
    EXPECT_NEAR(surface_mm[i], 1000.0 * static_cast<double>(errors.scalars.at("surface_distance")[i]), 0.51);
  }
}

TEST_F(ViewDataTest, ThePlaceIsSimplifiedAndKeepsItsColours) {
  const Unpacked view = unpacked();
  const json& place = view.header["place"];
  EXPECT_LE(place["triangles"].get<int>(), 2200);
  EXPECT_EQ(place["source_triangles"].get<int>(), 85 * 68 * 2);
  double worst_m = 0;
  for (const Vec3& p : view.positions(place["positions"]))
    worst_m = std::max(worst_m, std::abs(p.z() - tests::SyntheticRun::height_m(std::round(p.x()), std::round(p.y()))));
  EXPECT_LT(worst_m, 0.05) << "vertices are some of the source's";
  const auto jpeg = view.numbers<std::byte>(place["texture"]);
  const imaging::RgbImage texture = imaging::decode_rgb(jpeg, "texture");
  EXPECT_LE(std::max(texture.width, texture.height), 128);
  double red = 0, blue = 0;
  for (const imaging::Rgb8& pixel : texture.pixels) {
    red += pixel[0];
    blue += pixel[2];
  }
  EXPECT_NEAR(blue / red, 0.5, 0.1) << "as the place is painted";
}

TEST_F(ViewDataTest, CellsAreThoseOfTheTruthAndCoarserWhereTheyAreTooMany) {
  const RunFolder run = read_run_folder(run_);
  const Unpacked all = unpacked();
  const auto cells = all.numbers<std::uint16_t>(all.header["cells"]["cells"]);
  EXPECT_EQ(cells.size() / 3, run.voxel_centers->size());
  EXPECT_EQ(all.header["cells"]["size_m"], 1.0);
  ViewBudget few = small();
  few.max_cells = 3000;
  const Unpacked fewer = unpacked(few);
  EXPECT_LE(fewer.numbers<std::uint16_t>(fewer.header["cells"]["cells"]).size() / 3, 3000U);
  EXPECT_GT(fewer.header["cells"]["size_m"], 1.0);
}

TEST_F(ViewDataTest, PathsArePosesInTimeAndPicturesFollowThem) {
  const RunFolder run = read_run_folder(run_);
  const Unpacked view = unpacked();
  const json& flight = view.header["flights"][1];
  const auto numbers = view.numbers<float>(flight["truth"]);
  ASSERT_EQ(numbers.size(), 8 * run.flights[1].truth->size());
  const geometry::StampedPose& pose = run.flights[1].truth->poses[40];
  EXPECT_NEAR(static_cast<double>(numbers[8 * 40]), pose.time_s - flight["start_s"].get<double>(), 1e-5);
  EXPECT_NEAR(static_cast<double>(numbers[8 * 40 + 3]), pose.T_local_camera.translation.z(), 1e-4);
  EXPECT_NEAR(std::abs(static_cast<double>(numbers[8 * 40 + 7])), std::abs(pose.T_local_camera.rotation.w()), 1e-6);
  ASSERT_EQ(flight["frames"].size(), run.flights[1].frames.size());
  const auto jpeg = view.numbers<std::byte>(flight["frames"][3]);
  EXPECT_EQ(imaging::decode_rgb(jpeg, "frame").width, 64);
  EXPECT_NEAR(flight["half_width"].get<double>(), std::tan(40 * M_PI / 180), 1e-9) << "155 degrees are drawn as 80";
}

TEST_F(ViewDataTest, BudgetsHold) {
  ViewBudget budget = small();
  budget.max_map_points = 500;
  budget.max_poses = 20;
  budget.max_frames = 4;
  budget.max_frame_bytes = 8000;
  budget.max_texture_bytes = 3000;
  const Unpacked view = unpacked(budget);
  EXPECT_LE(view.header["place"]["texture"]["bytes"].get<int>(), 3000);
  ASSERT_FALSE(view.header["flights"].empty());
  for (const json& flight : view.header["flights"]) {
    EXPECT_EQ(flight["map"]["shown"], 500);
    EXPECT_EQ(flight["map"]["points"], 3000);
    EXPECT_EQ(flight["truth"]["bytes"], 20 * 8 * 4);
    EXPECT_EQ(flight["frames"].size(), 4U);
  }
}

TEST_F(ViewDataTest, ARigsCamerasShareTheBudgetAndAreOnOneClock) {
  tests::SyntheticRun(folder_ / "rig", {.map_points = 300, .rig = true}).write();
  const RunFolder run = read_run_folder(folder_ / "rig");
  const FlightRun& rig = run.flights[0];
  EXPECT_EQ(rig.camera, "left");
  ASSERT_EQ(rig.other_cameras.size(), 2U);
  EXPECT_EQ(rig.other_cameras[0].name, "right");
  EXPECT_EQ(rig.other_cameras[0].frames.size(), rig.frames.size());
  EXPECT_EQ(rig.other_cameras[1].frames.size(), 11U);
  for (std::size_t i = 0; i < rig.frames.size(); ++i)
    EXPECT_NEAR(rig.other_cameras[0].frames[i].time_s, rig.frames[i].time_s, 1e-9) << "its shift is known";
  EXPECT_TRUE(run.flights[1].other_cameras.empty());
  ViewBudget budget = small();
  budget.max_frames = 12;
  const Unpacked view(view_data(run, budget));
  const json& flight = view.header["flights"][0];
  EXPECT_EQ(flight["camera"], "left");
  EXPECT_EQ(flight["frames"].size(), 4U);
  EXPECT_EQ(view.header["flights"][1]["frames"].size(), 12U);
  for (std::size_t c = 0; c < 2; ++c) {
    const json& frames = flight["other_cameras"][c]["frames"];
    ASSERT_EQ(frames.size(), 4U);
    EXPECT_EQ(frames[0]["time_s"].get<double>() + flight["start_s"].get<double>(),
              rig.other_cameras[c].frames[0].time_s);
    EXPECT_EQ(imaging::decode_rgb(view.numbers<std::byte>(frames[3]), "frame").width, 64);
  }
  const std::string html = frames_figure(run).content.str();
  EXPECT_THAT(html, HasSubstr("<summary>Simulated flight, camera right</summary>"));
  EXPECT_THAT(html, HasSubstr("<summary>Simulated flight, camera down</summary>"));
  EXPECT_THAT(html, HasSubstr("alt=\"Simulated flight, camera down, image at "));
  EXPECT_THAT(frames_figure(read_run_folder(run_)).content.str(), Not(HasSubstr("<summary>")));
}

TEST_F(ViewDataTest, PointsFarBesideThePlaceDoNotCoarsenTheOthers) {
  RunFolder run = read_run_folder(run_);
  run.flights[0].errors->positions[7] = Vec3(1e7, 0, 0);
  const Unpacked view(view_data(run, small()));
  EXPECT_EQ(view.header["flights"][0]["map"]["shown"], 2999);
  EXPECT_LT(view.header["flights"][0]["map"]["positions"]["step_m"][0], 0.01);
}

TEST_F(ViewDataTest, TheFirstLookHoldsPlaceMapsAndPathsButNoOutliers) {
  RunFolder run = read_run_folder(run_);
  const auto box = [](const json& header, const char* low, const char* high) {
    const auto corner = [&](const char* key) {
      return Vec3(header[key][0].get<double>(), header[key][1].get<double>(), header[key][2].get<double>());
    };
    return geometry::Box3(corner(low), corner(high));
  };
  // A tenth of a map lies beside the place, and a hundredth of it beyond that; the path ends high above.
  std::vector<Vec3>& points = run.flights[0].errors->positions;
  for (std::size_t i = 0; i < points.size(); i += 10) points[i] = Vec3(110, 0, 0);
  for (std::size_t i = 1; i < points.size(); i += 100) points[i] = Vec3(0, 150, 0);
  run.flights[1].truth->poses.back().T_local_camera.translation = Vec3(0, 0, 90);
  run.flights[1].estimate->poses.back().T_local_camera.translation = Vec3(0, 0, 1e5);  // lost
  const json header = Unpacked(view_data(run, small())).header;
  const geometry::Box3 place = box(header, "low_m", "high_m"), shown = box(header, "shown_low_m", "shown_high_m");
  EXPECT_TRUE(shown.contains(place));
  EXPECT_NEAR(shown.max().x(), 110, 1e-9);
  EXPECT_LT(shown.max().y(), 100);
  EXPECT_NEAR(shown.max().z(), 90, 1e-9);
}

TEST_F(ViewDataTest, ReproducedFlightsHaveOneClock) {
  RunFolder run = read_run_folder(run_);
  for (geometry::StampedPose& pose : run.flights[1].truth->poses) pose.time_s += 5;
  for (geometry::StampedPose& pose : run.flights[1].estimate->poses) pose.time_s += 5;
  for (FrameFile& frame : run.flights[1].frames) frame.time_s += 5;
  EXPECT_EQ(Unpacked(view_data(run, small())).header["flights"][1]["start_s"], 5.0);
  run.results["reproduction"] = json::object();
  EXPECT_EQ(Unpacked(view_data(run, small())).header["flights"][1]["start_s"], 0.0);
}

TEST_F(ViewDataTest, ARunWithNothingToShowHasNoView) {
  EXPECT_EQ(view_data(RunFolder{}), "");
  EXPECT_TRUE(view_section(RunFolder{}).empty());
}

/// The script is empty if the program was built without npm; the page then runs no script.
TEST(PageScript, CannotEndItsElementAndIsTheOnlyOneThatThePolicyLetsRun) {
  const std::string script(page_script()), policy = content_policy();
  EXPECT_THAT(script, Not(HasSubstr("</script")));
  EXPECT_THAT(script, Not(HasSubstr("]]>")));
  EXPECT_THAT(policy, HasSubstr("default-src 'none'"));
  EXPECT_EQ(view_script().empty(), script.empty());
  if (script.empty()) {
    EXPECT_THAT(policy, Not(HasSubstr("script-src")));
  } else {
    EXPECT_THAT(script, HasSubstr("Permission is hereby granted")) << "the licence of what is bundled";
    EXPECT_THAT(policy, testing::ContainsRegex("script-src 'sha256-[A-Za-z0-9+/]{43}='"));
  }
}

}  // namespace
}  // namespace tileflight::report::view_data_test
