#include "tileflight/experiments/study/study_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>

namespace tileflight::study::scatter_test {
namespace {

using ::testing::ElementsAre;

/// Labels below the horizontal axis, from left to right; the last one is the axis's name.
std::vector<std::string> labels_across(const drawing::Drawing& drawing) {
  const std::string svg = drawing.content.str();
  const std::regex label(R"re(<text[^>]*text-anchor="middle"[^>]*>([^<]*)</text>)re");
  std::vector<std::string> labels;
  for (std::sregex_iterator it(svg.begin(), svg.end(), label), end; it != end; ++it) {
    if ((*it)[0].str().find("rotate") == std::string::npos) labels.push_back((*it)[1]);
  }
  return labels;
}

Scatter scatter_from(double low, double high) {
  return {.title = "error",
          .x_label = "x",
          .y_label = "y",
          .x_is_logarithmic = true,
          .y_is_logarithmic = false,
          .series = {"a"},
          .points = {{low, 1.0, 0, "low"}, {high, 2.0, 0, "high"}}};
}

TEST(Scatter, ALogarithmicAxisHasTicksAtOneTwoAndFive) {
  EXPECT_THAT(labels_across(to_drawing(scatter_from(0.9, 60.0))), ElementsAre("1", "2", "5", "10", "20", "50", "x"));
}

TEST(Scatter, ALogarithmicAxisOverLessThanADecadeHasTicks) {
  EXPECT_THAT(labels_across(to_drawing(scatter_from(96.0, 109.0))),
              ElementsAre("96", "98", "100", "102", "104", "106", "108", "x"));
}

TEST(Scatter, ASinglePointIsDrawn) {
  EXPECT_THAT(labels_across(to_drawing(scatter_from(97.0, 97.0))).back(), "x");
  EXPECT_GT(labels_across(to_drawing(scatter_from(97.0, 97.0))).size(), 1U);
}

}  // namespace
}  // namespace tileflight::study::scatter_test
