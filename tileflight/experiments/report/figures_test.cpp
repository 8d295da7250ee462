#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/drawing/chart.h"
#include "tileflight/core/drawing/number_format.h"
#include "tileflight/core/drawing/page_image.h"
#include "tileflight/core/drawing/top_view.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/experiments/report/frame_pairs.h"

namespace tileflight::report::figures_test {
using drawing::Chart;
using drawing::downscale;
using drawing::fit_extent;
using drawing::format_count;
using drawing::format_fixed;
using drawing::format_shortest;
using drawing::format_signed;
using drawing::GroundExtent;
using drawing::kUnknown;
using drawing::limit_aspect_ratio;
using drawing::nice_ticks;
using drawing::number_at;
using drawing::PaletteImage;
using drawing::round_down_to_nice;
using drawing::svg_number;
using drawing::text_at;
using drawing::tick_text;
using drawing::TopView;
using drawing::value_color;

namespace {

using geometry::Vec2;
using geometry::Vec3;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(Numbers, AreWrittenForReaders) {
  EXPECT_EQ(format_fixed(0.55481, 4), "0.5548");
  EXPECT_EQ(format_fixed(std::nullopt, 4), kUnknown);
  EXPECT_EQ(format_fixed(std::nan(""), 2), kUnknown);
  EXPECT_EQ(format_count(84029.0), "84,029");
  EXPECT_EQ(format_count(999.0), "999");
  EXPECT_EQ(format_count(-1234567.0), "-1,234,567");
  EXPECT_EQ(format_shortest(29.97), "29.97");
  EXPECT_EQ(format_shortest(5.0), "5");
  EXPECT_EQ(drawing::format_percent(0.4305), "43.0\u00A0%");
  EXPECT_EQ(format_signed(0.019, 3), "+0.019");
  EXPECT_EQ(format_signed(-0.019, 3), "\u22120.019");
}

TEST(Numbers, AreFoundInJsonOrNot) {
  const nlohmann::json json = {{"map", {{"mean", 0.5}, {"name", "x"}, {"none", nullptr}}}, {"list", {1, 2}}};
  EXPECT_EQ(number_at(json, "/map/mean"), 0.5);
  EXPECT_EQ(number_at(json, "/list/1"), 2);
  EXPECT_EQ(number_at(json, "/list/7"), std::nullopt);
  EXPECT_EQ(number_at(json, "/map/name"), std::nullopt);
  EXPECT_EQ(number_at(json, "/map/none"), std::nullopt);
  EXPECT_EQ(number_at(json, "/absent/mean"), std::nullopt);
  EXPECT_EQ(text_at(json, "/map/name"), "x");
  EXPECT_EQ(text_at(json, "/map/mean"), std::nullopt);
}

TEST(Scale, TicksAreRoundAndInside) {
  EXPECT_THAT(nice_ticks(0, 1, 5), ElementsAre(0, testing::DoubleNear(0.2, 1e-12), testing::DoubleNear(0.4, 1e-12),
                                               testing::DoubleNear(0.6, 1e-12), testing::DoubleNear(0.8, 1e-12), 1));
  EXPECT_THAT(nice_ticks(-37, 42, 4), ElementsAre(-30, -20, -10, 0, 10, 20, 30, 40));
  EXPECT_THAT(nice_ticks(3, 3, 4), ElementsAre(3));
  EXPECT_EQ(tick_text(0.6000000001, 0.2), "0.6");
  EXPECT_EQ(tick_text(-0.0, 5), "0");
  EXPECT_EQ(round_down_to_nice(37), 20);
  EXPECT_EQ(round_down_to_nice(0.05), 0.05);
  EXPECT_EQ(svg_number(1.50), "1.5");
  EXPECT_EQ(svg_number(-0.001), "0");
}

TEST(Chart, CumulativeIsTheShareOfAllPoints) {
  const std::vector<Vec2> curve =
      drawing::cumulative_points({0.9, 0.1, 0.5, 3.0}, 5, 1.0, 10);  // one of five has no distance at all
  ASSERT_EQ(curve.size(), 11u);
  EXPECT_EQ(curve.front(), Vec2(0, 0));
  EXPECT_DOUBLE_EQ(curve[1].y(), 0.2);
  EXPECT_DOUBLE_EQ(curve[5].y(), 0.4);
  EXPECT_DOUBLE_EQ(curve.back().y(), 0.6);
}

TEST(Chart, OutlineFollowsTheBins) {
  EXPECT_THAT(drawing::histogram_outline({0, 1, 3}, {5, 7}),
              ElementsAre(Vec2(0, 5), Vec2(1, 5), Vec2(1, 7), Vec2(3, 7)));
}

TEST(Chart, NamesAreEscaped) {
  const Chart chart{
      "<t>", "", {"<x>", 0, 1}, {"y", 0, 1}, {{"<n>", "simulated", {{0, 0}, {1, 1}}, true}}, {{"<m>", "floor", 0.5}}};
  EXPECT_THAT(drawing::on_page(drawing::to_drawing(chart)).str(),
              testing::Not(testing::AnyOf(HasSubstr("<t>"), HasSubstr("<x>"), HasSubstr("<n>"), HasSubstr("<m>"))));
}

TEST(PalettePng, IsReadBackByTheDecoder) {
  PaletteImage image{imaging::GrayImage(3, 2), {{0, 0, 0, 0}, {10, 20, 30, 255}, {200, 100, 50, 128}}};
  image.indices(1, 0) = 1;
  image.indices(2, 1) = 2;
  const std::string png = drawing::encode_png(image);
  const imaging::RgbImage decoded = imaging::decode_rgb(std::as_bytes(std::span(png)), "layer");
  ASSERT_EQ(decoded.width, 3);
  ASSERT_EQ(decoded.height, 2);
  EXPECT_EQ(decoded(1, 0), (imaging::Rgb8{10, 20, 30}));
  EXPECT_EQ(decoded(2, 1), (imaging::Rgb8{200, 100, 50}));
  EXPECT_THAT(png, HasSubstr("tRNS"));
}

/// Position of a point in an image of `extent`, as a share of its width and height from the north-west corner.
std::uint8_t index_at(const PaletteImage& image, double across, double down) {
  return image.indices(static_cast<int>(across * (image.indices.width - 1)),
                       static_cast<int>(down * (image.indices.height - 1)));
}

TEST(TopView, NorthIsUpAndEastIsRight) {
  const GroundExtent extent{0, 200, 0, 100};
  const PaletteImage image = drawing::draw_points(extent, {{150, 75, 0}, {-5, 50, 0}}, {1, 2, 3, 255});
  EXPECT_EQ(image.indices.width, 2 * image.indices.height);
  EXPECT_EQ(index_at(image, 0.75, 0.25), 1);
  EXPECT_EQ(index_at(image, 0.25, 0.25), 0);
  EXPECT_EQ(std::count(image.indices.pixels.begin(), image.indices.pixels.end(), 1),
            64);  // one dot: what is outside is not drawn
}

TEST(TopView, VoxelsAreSquaresAndTheHighestIsOnTop) {
  geometry::PointCloud centers;
  for (int x = 0; x < 10; ++x) {
    for (int y = 0; y < 10; ++y) centers.positions.emplace_back(x + 0.5, y + 0.5, 0.5);
  }
  centers.positions.emplace_back(2.5, 7.5, 9.5);
  centers.positions.emplace_back(2.5, 7.5, 4.5);
  const PaletteImage image = drawing::draw_voxels({0, 10, 0, 10}, centers, 1.0);
  EXPECT_EQ(std::count(image.indices.pixels.begin(), image.indices.pixels.end(), 0), 0);  // cells leave no gaps
  EXPECT_GT(index_at(image, 0.25, 0.25), index_at(image, 0.75, 0.25));
  EXPECT_EQ(std::count(image.indices.pixels.begin(), image.indices.pixels.end(), index_at(image, 0.25, 0.25)),
            140 * 140);
}

TEST(TopView, ColoursTellTheValue) {
  const PaletteImage image =
      drawing::draw_values({0, 10, 0, 10}, {{2, 5, 0}, {8, 5, 0}, {8, 5, -3}, {5, 5, 0}}, {0.0F, 2.0F, 0.0F, NAN}, 1.0);
  EXPECT_EQ(image.palette[index_at(image, 0.2, 0.5)], value_color(0));
  EXPECT_EQ(image.palette[index_at(image, 0.8, 0.5)], value_color(1));
  EXPECT_EQ(index_at(image, 0.5, 0.5), 0);
}

TEST(TopView, ExtentHoldsThePointsAndLeavesOutliersAway) {
  std::vector<Vec3> points{{1e6, -1e6, 0}};
  for (int i = 0; i <= 100; ++i) points.emplace_back(i, 2 * i, 0);
  const GroundExtent all = fit_extent(points), trimmed = fit_extent(points, 0.0, 0.02);
  EXPECT_GT(all.east, 1e6);
  EXPECT_LT(trimmed.east, 110);
  EXPECT_GT(trimmed.south, -10);
}

TEST(TopView, RoomyExtentsAreNeverNarrow) {
  const GroundExtent tall = limit_aspect_ratio({0, 10, 0, 100}), wide = limit_aspect_ratio({0, 100, 5, 6}),
                     square = limit_aspect_ratio({0, 90, 0, 100});
  EXPECT_DOUBLE_EQ(tall.width_m(), 75);
  EXPECT_DOUBLE_EQ(tall.west + tall.east, 10);
  EXPECT_DOUBLE_EQ(wide.height_m(), 75);
  EXPECT_DOUBLE_EQ(square.width_m(), 90);
}

FlightRun flight_with(const std::vector<std::pair<double, Vec3>>& places) {
  FlightRun flight;
  flight.estimate.emplace();
  for (const auto& [time_s, position] : places) {
    flight.frames.push_back({"picture", time_s});
    flight.estimate->poses.push_back({time_s, geometry::SE3(Eigen::Quaterniond::Identity(), position)});
  }
  return flight;
}

TEST(FramePairs, AreTheMostAlikeAndNoPictureTwice) {
  const FlightRun first = flight_with({{0, {0, 0, 0}}, {1, {10, 0, 0}}, {2, {20, 0, 0}}, {3, {30, 0, 0}}});
  const FlightRun second = flight_with({{5, {31, 0, 0}}, {6, {9, 0, 2}}, {7, {100, 0, 0}}});
  const std::vector<FramePair> pairs = frame_pairs(first, second, 2);
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_EQ(pairs[0].first.time_s, 1);
  EXPECT_EQ(pairs[0].second.time_s, 6);
  EXPECT_NEAR(*pairs[0].distance_m, std::sqrt(5.0), 1e-12);
  EXPECT_EQ(pairs[1].first.time_s, 3);
  EXPECT_EQ(pairs[1].second.time_s, 5);
}

TEST(FramePairs, PicturesThatLookElsewhereAreNoPair) {
  const FlightRun first = flight_with({{0, {0, 0, 0}}, {1, {10, 0, 0}}, {2, {20, 0, 0}}});
  FlightRun second = flight_with({{0, {0, 0, 0}}, {1, {10, 0, 0}}, {2, {20, 0, 0}}});
  for (std::size_t i : {0u, 2u})
    second.estimate->poses[i].T_local_camera.rotation = Eigen::AngleAxisd(2.0, Vec3::UnitZ());
  const std::vector<FramePair> pairs = frame_pairs(first, second, 3);
  ASSERT_EQ(pairs.size(), 1u);
  EXPECT_EQ(pairs[0].second.time_s, 1);
}

TEST(FramePairs, WithoutPosesAreAtTheSameShareOfBothFlights) {
  FlightRun first, second;
  for (int i = 0; i < 30; ++i) first.frames.push_back({"a", static_cast<double>(i)});
  for (int i = 0; i < 9; ++i) second.frames.push_back({"b", static_cast<double>(i)});
  const std::vector<FramePair> pairs = frame_pairs(first, second, 3);
  ASSERT_EQ(pairs.size(), 3u);
  EXPECT_EQ(pairs[1].first.time_s, 15);
  EXPECT_EQ(pairs[1].second.time_s, 4);
  EXPECT_FALSE(pairs[1].distance_m.has_value());
}

TEST(FramePairs, ScaledDownKeepsTheMean) {
  imaging::RgbImage image(640, 360);
  for (int y = 0; y < 360; ++y) {
    for (int x = 0; x < 640; ++x)
      image(x, y) = {static_cast<std::uint8_t>((x * 7 + y) % 256), 100, static_cast<std::uint8_t>(x < 320 ? 0 : 255)};
  }
  const imaging::RgbImage small = downscale(image, 64);
  ASSERT_EQ(small.width, 64);
  ASSERT_EQ(small.height, 36);
  EXPECT_EQ(small(10, 10)[1], 100);
  EXPECT_EQ(small(31, 5)[2], 0);
  EXPECT_EQ(small(32, 5)[2], 255);
  EXPECT_EQ(downscale(image, 2000).width, 640);
}

}  // namespace
}  // namespace tileflight::report::figures_test
