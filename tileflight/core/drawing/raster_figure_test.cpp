#include "tileflight/core/drawing/raster_figure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tileflight::drawing::plate::raster_figure_test {
namespace {

using testing::ElementsAre;

TEST(RasterFigure, ScalesGoBothWays) {
  const AxisScale up{10, 20, 300, 100};
  EXPECT_DOUBLE_EQ(up.to_px(10), 300);
  EXPECT_DOUBLE_EQ(up.to_px(15), 200);
  EXPECT_DOUBLE_EQ(up.to_px(20), 100);
}

TEST(RasterFigure, TicksAreRoundNumbersWithATrueMinus) {
  std::vector<std::string> texts;
  for (const Tick& tick : make_ticks({-10, 10, 0, 100}, 4)) texts.push_back(tick.text);
  EXPECT_THAT(texts, ElementsAre("\u221210", "\u22125", "0", "5", "10"));
}

TEST(RasterFigure, WordsThatDoNotFitAreCut) {
  const Canvas canvas(10, 10, kBackground);
  const std::string long_text = "Réserve naturelle: données ouvertes de la commune";
  EXPECT_EQ(truncate_to_width(canvas, long_text, body_lettering(), 1000), long_text);
  const std::string cut = truncate_to_width(canvas, long_text, body_lettering(), 60);
  EXPECT_THAT(cut, testing::EndsWith("\u2026"));
  EXPECT_THAT(long_text, testing::StartsWith(cut.substr(0, cut.size() - 3)));
  EXPECT_LE(canvas.text_width(cut, body_lettering()), 60);
  for (double width = 10; width < 200; width += 3)
    EXPECT_LE(canvas.text_width(truncate_to_width(canvas, "éééééééééé", body_lettering(), width), body_lettering()),
              std::max(width, 15.0));
}

}  // namespace
}  // namespace tileflight::drawing::plate::raster_figure_test
