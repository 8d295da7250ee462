#include "tileflight/report/plate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tileflight::report::plate {
namespace {

using imaging::Canvas;
using testing::ElementsAre;

TEST(Plate, ScalesGoBothWays) {
  const Scale up{10, 20, 300, 100};
  EXPECT_DOUBLE_EQ(up.at(10), 300);
  EXPECT_DOUBLE_EQ(up.at(15), 200);
  EXPECT_DOUBLE_EQ(up.at(20), 100);
}

TEST(Plate, TicksAreRoundNumbersWithATrueMinus) {
  std::vector<std::string> texts;
  for (const Tick& tick : ticks_of({-10, 10, 0, 100}, 4)) texts.push_back(tick.text);
  EXPECT_THAT(texts, ElementsAre("\u221210", "\u22125", "0", "5", "10"));
}

TEST(Plate, WordsThatDoNotFitAreCutOrWrapped) {
  const Canvas canvas(10, 10, kPaper);
  const std::string long_text = "Réserve naturelle: données ouvertes de la commune";
  EXPECT_EQ(fitted(canvas, long_text, words(), 1000), long_text);
  const std::string cut = fitted(canvas, long_text, words(), 60);
  EXPECT_THAT(cut, testing::EndsWith("\u2026"));
  EXPECT_THAT(long_text, testing::StartsWith(cut.substr(0, cut.size() - 3)));
  EXPECT_LE(canvas.text_width(cut, words()), 60);
  for (double width = 10; width < 200; width += 3)
    EXPECT_LE(canvas.text_width(fitted(canvas, "éééééééééé", words(), width), words()), std::max(width, 15.0));
  std::string all;
  for (const std::string& line : wrapped(canvas, long_text, words(), 150)) {
    EXPECT_LE(canvas.text_width(line, words()), 150);
    all += (all.empty() ? "" : " ") + line;
  }
  EXPECT_EQ(all, long_text);
}

}  // namespace
}  // namespace tileflight::report::plate
